"""Search for a limb that got lost: random poses of that limb alone, the best refined, taken if the whole cost falls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel
from hmc.body.prior import POSTURE
from hmc.body.reach import limb_joint, limb_lengths, reach
from hmc.pose.objectives.objective import Misfit, Objective
from hmc.pose.steps.refine import RefineSettings, refine_best
from hmc.search.truncated import truncated_normal

#: What has to be covered is thinned out to so many points for poses drawn at random.
COARSE_POINTS = 200

__all__ = ["SearchSettings", "lost_limbs", "search_limbs"]


@dataclass(frozen=True)
class SearchSettings:
    """When a limb counts as lost and how it is looked for.

    Parameters
    ----------
    far_m : float
        A body or hull point farther than this from its counterpart is a misfit, metres.
    outside_share : float
        A limb is lost when more than this share of its surface is that far outside the tolerant hull ...
    uncovered_share : float
        ... and may be when more than this share of what has to be covered is that far from the body ...
    at_once : int
        ... then others that reach it are looked for too, picked at random, to make up this number.
    random_share : float
        Share of the frames without a lost limb in which one picked at random is looked for.
    draws : int
        Random poses a limb.
    reach_share : float
        Share of them that reach for hull points which the body does not cover, where there are any.
    gain : float
        The new pose is taken when the cost falls by at least this share.
    draw_ratio : float
        Poses drawn that all cost more than the present one times this, at few points, are not refined at all.
    refine_ratio : float
        A new pose that costs more than the present one times this after the first steps of its refinement is not refined further ...
    back_m : float
        ... nor is one whose limb has come so near to where it is now: it would end there again.
    """

    far_m: float = 0.05
    outside_share: float = 0.25
    uncovered_share: float = 0.02
    at_once: int = 2
    random_share: float = 0.5
    draws: int = 200
    reach_share: float = 0.5
    gain: float = 0.03
    draw_ratio: float = 1.5
    refine_ratio: float = 1.3
    back_m: float = 0.05


def lost_limbs(rng: np.random.Generator, body: BodyModel, state: np.ndarray, misfit: Misfit, settings: SearchSettings) -> list[str]:
    """Limbs that the hulls contradict, and some that reach what is not covered where that is much; else now and then one picked at random.

    Of those that the body's points are of: a body may lack some (`hmc.pose.steps.hidden`).

    The random one is for limbs that rest in a wrong place which is nearly as good, a folded arm before the chest say.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : BodyModel
    state : ndarray, shape (37,)
        The pose.
    misfit : Misfit
        Of the pose.
    settings : SearchSettings

    Returns
    -------
    list of str
        Keys of `hmc.body.limbs.LIMBS`.
    """
    there = [limb for limb, one in LIMBS.items() if np.isin(misfit.part, one.parts).any()]
    far = misfit.outside > settings.far_m
    lost = [limb for limb in there if far[np.isin(misfit.part, LIMBS[limb].parts)].mean() > settings.outside_share]
    if (misfit.distance > settings.far_m).mean() > settings.uncovered_share:
        # A foot that is nowhere is no arm's: the more of it a limb reaches, the likelier it is the limb's.
        goals = np.array([len(_goals(body, state, limb, misfit, settings)) for limb in there])
        others = [k for k, limb in enumerate(there) if limb not in lost and goals[k]]
        n = min(len(others), max(0, settings.at_once - len(lost)))
        picked = rng.choice(others, n, replace=False, p=goals[others] / goals[others].sum()).tolist() if n else []
        return lost + [there[k] for k in sorted(picked)]
    at_random = [str(rng.choice(there))] if there and rng.random() < settings.random_share else []
    return lost or at_random


def search_limbs(
    rng: np.random.Generator,
    objective: Objective,
    found: tuple[np.ndarray, float],
    limbs: Sequence[str],
    refine_settings: RefineSettings,
    settings: SearchSettings,
    misfit: Misfit | None = None,
) -> tuple[np.ndarray, float, int]:
    """A pose with limbs looked for, one after the other.

    Parameters
    ----------
    rng : numpy.random.Generator
    objective : Objective
    found : (ndarray of shape (37,), float)
        The pose, and its cost as the refinement gives it, square metres.
    limbs : sequence of str
        As from `lost_limbs`.
    refine_settings : RefineSettings
    settings : SearchSettings
    misfit : Misfit, optional
        Of the pose, where it is known.

    Returns
    -------
    state : ndarray, shape (37,)
    cost : float
    evaluations : int
    """
    state, cost = found
    coarse = objective.coarser(rng, COARSE_POINTS)
    evaluations = 0
    for limb in limbs:
        trials = np.repeat(state[None], settings.draws + 1, axis=0)
        misfit = objective.linearise(state).misfit if misfit is None else misfit
        trials[1:, LIMBS[limb].dofs] = _draw(rng, settings, objective.body, state, limb, misfit)
        costs = coarse.cost(trials)  # the first is the present pose
        evaluations += len(trials)
        if costs[1:].min() > settings.draw_ratio * costs[0]:
            continue
        starts = [trials[1 + pick] for pick in np.argsort(costs[1:])[:2]]
        has_failed = _has_failed(objective.body, (state, cost), limb, settings)
        trial, info = refine_best(objective, starts, refine_settings, stop_early=has_failed)
        evaluations += info.evaluations
        if info.cost_after < (1 - settings.gain) * cost:
            state, cost, misfit = trial, info.cost_after, info.misfit
    return state, cost, evaluations


def _has_failed(
    body: BodyModel, found: tuple[np.ndarray, float], limb: str, settings: SearchSettings
) -> Callable[[np.ndarray, float], bool]:
    """Whether a new pose of a limb is not worth more steps: it costs too much, or is back at the pose as it is."""
    state, cost = found

    def has_failed(trial: np.ndarray, trial_cost: float) -> bool:
        before, now = landmarks(body, np.stack([state, trial]))[:, LIMBS[limb].landmarks]
        return trial_cost > settings.refine_ratio * cost or bool(np.linalg.norm(now - before, axis=1).max() < settings.back_m)

    return has_failed


def _draw(
    rng: np.random.Generator, settings: SearchSettings, body: BodyModel, state: np.ndarray, limb: str, misfit: Misfit | None
) -> np.ndarray:
    """Random poses of a limb: some reach for hull points that no part covers, some are common ones, and some may be any."""
    dofs = LIMBS[limb].dofs
    low, high = body.limits.low[dofs], body.limits.high[dofs]
    goals = np.zeros((0, 3)) if misfit is None else _goals(body, state, limb, misfit, settings)
    n_reach = round(settings.reach_share * settings.draws) if len(goals) else 0
    n_common = (settings.draws - n_reach) // 2
    n_any = settings.draws - n_reach - n_common
    drawn = [
        truncated_normal(rng, np.tile(POSTURE[0][dofs], (n_common, 1)), POSTURE[1][dofs], low, high),
        rng.uniform(low, high, (n_any, len(dofs))),
    ]
    if n_reach:
        drawn.append(reach(body, state, limb, goals[rng.integers(len(goals), size=n_reach)], rng.uniform(-np.pi, np.pi, n_reach)))
    return np.concatenate(drawn)


def _goals(body: BodyModel, state: np.ndarray, limb: str, misfit: Misfit, settings: SearchSettings) -> np.ndarray:
    """What the body does not cover and a limb can reach, shape (n, 3), world, metres."""
    centre, _ = limb_joint(body, state, limb)
    near = np.linalg.norm(misfit.places - centre, axis=1) < sum(limb_lengths(body, limb)) + settings.far_m
    return misfit.places[near & (misfit.distance > settings.far_m)]
