"""Local least-squares refinement of a pose: damped Gauss-Newton steps (`hmc.search.gauss_newton`) on an objective's residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.pose.objectives.objective import Linearisation, Misfit, Objective
from hmc.search.gauss_newton import GaussNewtonSettings, GaussNewtonState, LeastSquares, gauss_newton_init, gauss_newton_run

__all__ = ["RefineInfo", "RefineSettings", "refine", "refine_all", "refine_best"]

_Trial: TypeAlias = GaussNewtonState[Linearisation]


@dataclass(frozen=True)
class RefineSettings:
    """How a pose is refined.

    Parameters
    ----------
    iterations : int
        Most accepted steps.
    tolerance : float
        Stop when the cost falls by less than this share in a step, or no step is left that would lower it by more.
    stay_weight : float
        Weight (square metres for a step of one prior deviation) that holds angles no data speaks of, such as the twist of a
        straight arm, where the start has them.
    """

    iterations: int = 12
    tolerance: float = 2e-3
    stay_weight: float = 4e-6


@dataclass(frozen=True)
class RefineInfo:
    """What a refinement came to.

    Parameters
    ----------
    cost_before, cost_after : float
        Square metres, the hold included.
    cost : float
        The objective alone, afterwards, square metres.
    evaluations : int
        Of the objective.
    misfit : Misfit or None
        Where body and data contradict each other afterwards, if the objective can tell.
    """

    cost_before: float
    cost_after: float
    cost: float
    evaluations: int
    misfit: Misfit | None


def refine(
    objective: Objective,
    state: np.ndarray,
    settings: RefineSettings,
    free: np.ndarray | None = None,
    anchor: np.ndarray | None = None,
    deviation: np.ndarray | None = None,
) -> tuple[np.ndarray, RefineInfo]:
    """The pose at the nearest minimum of an objective.

    Parameters
    ----------
    objective : Objective
    state : ndarray, shape (37,)
        Start.
    settings : RefineSettings
    free : ndarray of bool, shape (37,), optional
        Degrees of freedom that may move; all by default.
    anchor : ndarray, shape (37,), optional
        Pose on which the hold pulls; the start by default.
    deviation : ndarray, shape (37,), optional
        Deviations of the hold, metres and radians; .1 m and .5 rad by default.

    Returns
    -------
    state : ndarray, shape (37,)
        Within the body's joint limits.
    info : RefineInfo
    """
    problem, steps = _problem(objective, settings, free, deviation), _steps(settings)
    return _outcome(gauss_newton_run(problem, gauss_newton_init(problem, state, steps, anchor), steps))


def refine_best(
    objective: Objective,
    starts: Sequence[np.ndarray],
    settings: RefineSettings,
    anchor: np.ndarray | None = None,
    trial_steps: int = 3,
    stop_early: Callable[[np.ndarray, float], bool] | None = None,
) -> tuple[np.ndarray, RefineInfo]:
    """Of several starts the one that is best after some steps, refined to the end.

    Parameters
    ----------
    objective, settings
        As for `refine`.
    starts : sequence of ndarray, shape (37,)
    anchor : ndarray, shape (37,), optional
        As for `refine`; each start's own by default.
    trial_steps : int
        Accepted steps after which the best goes on alone.
    stop_early : callable, optional
        Told the best state after its first steps and its cost (square metres, the hold included): whether to leave it there.

    Returns
    -------
    state : ndarray, shape (37,)
    info : RefineInfo
        Of the best, with the evaluations of all.
    """
    problem, steps = _problem(objective, settings), _steps(settings)
    trials: list[_Trial] = []
    for start in starts:
        begun = gauss_newton_init(problem, start, steps, anchor, trials[-1].found.near if trials else None)
        trials.append(gauss_newton_run(problem, begun, steps, trial_steps))
    best = min(trials, key=lambda trial: trial.cost)
    before = sum(trial.evaluations for trial in trials) - best.evaluations
    if stop_early is None or not stop_early(best.x, best.cost):
        best = gauss_newton_run(problem, best, steps)
    state, info = _outcome(best)
    return state, replace(info, evaluations=info.evaluations + before)


def refine_all(
    objective: Objective,
    starts: Sequence[np.ndarray],
    settings: RefineSettings,
    anchor: np.ndarray | None = None,
    trial_steps: int = 3,
    same_m: float = 0.03,
    ended_before: Sequence[np.ndarray] = (),
) -> list[tuple[np.ndarray, RefineInfo]]:
    """Several starts, each refined to the end unless its first steps bring it to where an earlier one ended: it would end there too.

    Parameters
    ----------
    objective, settings
        As for `refine`.
    starts : sequence of ndarray, shape (37,)
    anchor, trial_steps
        As for `refine_best`.
    same_m : float
        Poses are at the same place when no landmark is farther apart, metres.
    ended_before : sequence of ndarray, shape (37,), optional
        Where other starts of the same objective ended.

    Returns
    -------
    list of tuple
        As from `refine`, start by start.
    """
    problem, steps = _problem(objective, settings), _steps(settings)
    ended: list[_Trial] = []
    places = [landmarks(objective.body, state) for state in ended_before]
    for start in starts:
        begun = gauss_newton_init(problem, start, steps, anchor, ended[-1].found.near if ended else None)
        trial = gauss_newton_run(problem, begun, steps, trial_steps)
        here = landmarks(objective.body, trial.x)
        if all(np.linalg.norm(here - there, axis=1).max() > same_m for there in places):
            trial = gauss_newton_run(problem, trial, steps)
            here = landmarks(objective.body, trial.x)
        ended.append(trial)
        places.append(here)
    return [_outcome(trial) for trial in ended]


def _problem(
    objective: Objective, settings: RefineSettings, free: np.ndarray | None = None, deviation: np.ndarray | None = None
) -> LeastSquares[Linearisation]:
    """All angles free, and held by .1 m and .5 rad, where nothing else is said."""
    deviation = np.r_[np.full(3, 0.1), np.full(N_DOF - 3, 0.5)] if deviation is None else deviation
    limits = objective.body.limits
    return LeastSquares(objective.linearise, limits.low, limits.high, settings.stay_weight / deviation**2, free)


def _steps(settings: RefineSettings) -> GaussNewtonSettings:
    return GaussNewtonSettings(settings.iterations, tolerance=settings.tolerance)


def _outcome(trial: _Trial) -> tuple[np.ndarray, RefineInfo]:
    found = trial.found
    cost = float(found.residuals @ found.residuals)
    return trial.x, RefineInfo(trial.first_cost, trial.cost, cost, trial.evaluations, found.misfit)
