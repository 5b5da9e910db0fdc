"""Local least-squares refinement of a pose: Gauss-Newton steps with damping on an objective's residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.pose.objectives.objective import Linearised, Objective, Unexplained

__all__ = ["RefineInfo", "RefineSettings", "refine", "refine_all", "refine_best"]


@dataclass(frozen=True)
class RefineSettings:
    """How a pose is refined.

    Parameters
    ----------
    iterations : int
        Most accepted steps.
    tolerance : float
        Stop when the cost falls by less than this share in a step, or none is left that promises more.
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
    unexplained : Unexplained or None
        Where body and data contradict each other afterwards, if the objective can tell.
    """

    cost_before: float
    cost_after: float
    cost: float
    evaluations: int
    unexplained: Unexplained | None


@dataclass(frozen=True)
class _Problem:
    """What stays the same while a pose descends; `free` and the weights of the hold have shape (27,)."""

    objective: Objective
    settings: RefineSettings
    free: np.ndarray
    hold: np.ndarray


@dataclass(frozen=True)
class _Descent:
    """How far a pose has come: its distances and costs, the damping of the next step, and what is to be told in the end."""

    state: np.ndarray
    anchor: np.ndarray
    found: Linearised
    cost: float
    first: float
    evaluations: int = 1
    accepted: int = 0
    damping: float = 1e-2
    is_done: bool = False


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
    state : ndarray, shape (27,)
        Start.
    settings : RefineSettings
    free : ndarray of bool, shape (27,), optional
        Degrees of freedom that may move; all by default.
    anchor : ndarray, shape (27,), optional
        Pose on which the hold pulls; the start by default.
    deviation : ndarray, shape (27,), optional
        Deviations of the hold, metres and radians; .1 m and .5 rad by default.

    Returns
    -------
    state : ndarray, shape (27,)
        Within the body's joint limits.
    info : RefineInfo
    """
    problem = _problem(objective, settings, free, deviation)
    return _outcome(_descend(problem, _begin(problem, state, anchor), settings.iterations))


def refine_best(
    objective: Objective,
    starts: Sequence[np.ndarray],
    settings: RefineSettings,
    anchor: np.ndarray | None = None,
    trial_steps: int = 3,
    is_hopeless: Callable[[np.ndarray, float], bool] | None = None,
) -> tuple[np.ndarray, RefineInfo]:
    """Of several starts the one that is best after some steps, refined to the end.

    Parameters
    ----------
    objective, settings
        As for `refine`.
    starts : sequence of ndarray, shape (27,)
    anchor : ndarray, shape (27,), optional
        As for `refine`; each start's own by default.
    trial_steps : int
        Accepted steps after which the best goes on alone.
    is_hopeless : callable, optional
        Told the best state after its first steps and its cost (square metres, the hold included): whether to leave it there.

    Returns
    -------
    state : ndarray, shape (27,)
    info : RefineInfo
        Of the best, with the evaluations of all.
    """
    problem = _problem(objective, settings)
    trials: list[_Descent] = []
    for start in starts:
        begun = _begin(problem, start, anchor, trials[-1].found.near if trials else None)
        trials.append(_descend(problem, begun, trial_steps))
    best = min(trials, key=lambda trial: trial.cost)
    before = sum(trial.evaluations for trial in trials) - best.evaluations
    if is_hopeless is None or not is_hopeless(best.state, best.cost):
        best = _descend(problem, best, settings.iterations)
    state, info = _outcome(best)
    return state, replace(info, evaluations=info.evaluations + before)


def refine_all(
    objective: Objective,
    starts: Sequence[np.ndarray],
    settings: RefineSettings,
    anchor: np.ndarray | None = None,
    trial_steps: int = 3,
    same_m: float = 0.03,
) -> list[tuple[np.ndarray, RefineInfo]]:
    """Several starts, each refined to the end unless its first steps bring it to where an earlier one ended: it would end there too.

    Parameters
    ----------
    objective, settings
        As for `refine`.
    starts : sequence of ndarray, shape (27,)
    anchor, trial_steps
        As for `refine_best`.
    same_m : float
        Poses are at the same place when no landmark is farther apart, metres.

    Returns
    -------
    list of tuple
        As from `refine`, start by start.
    """
    problem = _problem(objective, settings)
    ended: list[_Descent] = []
    places: list[np.ndarray] = []
    for start in starts:
        trial = _descend(problem, _begin(problem, start, anchor, ended[-1].found.near if ended else None), trial_steps)
        here = landmarks(objective.body, trial.state)
        if all(np.linalg.norm(here - there, axis=1).max() > same_m for there in places):
            trial = _descend(problem, trial, settings.iterations)
            here = landmarks(objective.body, trial.state)
        ended.append(trial)
        places.append(here)
    return [_outcome(trial) for trial in ended]


def _problem(objective: Objective, settings: RefineSettings, free=None, deviation=None) -> _Problem:
    """All angles free, and held by .1 m and .5 rad, where nothing else is said."""
    free = np.ones(N_DOF, bool) if free is None else free
    deviation = np.r_[np.full(3, 0.1), np.full(N_DOF - 3, 0.5)] if deviation is None else deviation
    return _Problem(objective, settings, free, settings.stay_weight / deviation**2)


def _outcome(descent: _Descent) -> tuple[np.ndarray, RefineInfo]:
    found = descent.found
    cost = float(found.residuals @ found.residuals)
    return descent.state, RefineInfo(descent.first, descent.cost, cost, descent.evaluations, found.unexplained)


def _begin(problem: _Problem, state: np.ndarray, anchor: np.ndarray | None, near: Any = None) -> _Descent:
    state = np.clip(state, problem.objective.body.limits.low, problem.objective.body.limits.high)
    anchor = state if anchor is None else anchor
    found, cost = _evaluate(problem, state, anchor, near)
    return _Descent(state, anchor, found, cost, cost)


def _evaluate(problem: _Problem, state: np.ndarray, anchor: np.ndarray, near: Any = None) -> tuple[Linearised, float]:
    found = problem.objective.linearise(state, near)
    return found, float(found.residuals @ found.residuals + problem.hold @ (state - anchor) ** 2)


def _descend(problem: _Problem, descent: _Descent, accepted: int) -> _Descent:
    """Go on until so many steps were accepted, or nothing is to be gained."""
    low, high, hold = problem.objective.body.limits.low, problem.objective.body.limits.high, problem.hold
    improved = True
    while descent.accepted < accepted and not descent.is_done:
        state, found = descent.state, descent.found
        if improved:
            pulled, jacobian = found.pulls()
            gradient = jacobian.T @ found.residuals[pulled] + hold * (state - descent.anchor)
            normal = jacobian.T @ jacobian + np.diag(hold)
            # An angle at its limit that wants further out takes no part in this step.
            stuck = ((state <= low) & (gradient > 0)) | ((state >= high) & (gradient < 0)) | ~problem.free
            active = np.flatnonzero(~stuck)
            normal = normal[np.ix_(active, active)]
        matrix = normal + descent.damping * np.diag(np.diag(normal) + 1e-9)
        step = np.zeros(N_DOF)
        step[active] = -np.linalg.solve(matrix, gradient[active])
        promised = -step[active] @ (2 * gradient[active] + normal @ step[active])
        if promised < problem.settings.tolerance * descent.cost:
            return replace(descent, is_done=True)
        trial = np.clip(state + np.clip(step, -0.5, 0.5), low, high)
        trial_found, trial_cost = _evaluate(problem, trial, descent.anchor, found.near)
        improved = trial_cost < descent.cost
        descent = replace(descent, evaluations=descent.evaluations + 1)
        if improved:
            gain = (descent.cost - trial_cost) / max(descent.cost, 1e-12)
            descent = replace(
                descent,
                state=trial,
                found=trial_found,
                cost=trial_cost,
                damping=max(descent.damping * 0.3, 1e-4),
                accepted=descent.accepted + 1,
                is_done=gain < problem.settings.tolerance,
            )
        else:
            descent = replace(descent, damping=max(descent.damping * 10, 1e-2))
    return descent
