"""Search for a limb that got lost: random poses of that limb alone, the best refined, taken if the whole cost falls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hmc.body.cone_maps import cone_maps
from hmc.body.cones import places_and_directions
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.limbs import LIMBS as LIMB_TABLE
from hmc.body.model import BodyModel
from hmc.body.nearest_cone import candidates, nearest_cones
from hmc.body.prior import POSTURE
from hmc.body.reach import limb_joint, limb_lengths, reach
from hmc.pose.objectives.symmetric import BodyPoints, SymmetricSettings, symmetric_cost
from hmc.pose.steps.refine import RefineSettings, refine_best
from hmc.pose.views.hull_target import HullTarget, sample_points
from hmc.search.truncated import truncated_normal

__all__ = ["LIMBS", "SearchSettings", "lost_limbs", "search_limbs"]

#: Angles of each limb.
LIMBS: dict[str, np.ndarray] = {name: limb.dofs for name, limb in LIMB_TABLE.items()}
_PARTS = {name: limb.parts for name, limb in LIMB_TABLE.items()}
_LANDMARKS = {name: limb.landmarks for name, limb in LIMB_TABLE.items()}


@dataclass(frozen=True)
class SearchSettings:
    """When a limb counts as lost and how it is looked for.

    Parameters
    ----------
    far_m : float
        A body or hull point farther than this from its counterpart is unexplained, metres.
    outside_share : float
        A limb is lost when more than this share of its surface is that far outside the tolerant hull ...
    unexplained_share : float
        ... and may be when more than this share of what has to be explained is that far from the body ...
    at_once : int
        ... then others are looked for too, picked at random, to make up this number.
    random_share : float
        Share of the frames without a lost limb in which one picked at random is looked for.
    draws : int
        Random poses a limb.
    reach_share : float
        Share of them that reach for hull points which the body does not explain, where there are any.
    gain : float
        The new pose is taken when the cost falls by at least this share.
    promise : float
        Poses drawn that all cost more than the present one times this, at few points, are not refined at all.
    hope : float
        A new pose that costs more than the present one times this after the first steps of its refinement is not refined further ...
    back_m : float
        ... nor is one whose limb has come so near to where it is now: it would end there again.
    """

    far_m: float = 0.05
    outside_share: float = 0.25
    unexplained_share: float = 0.02
    at_once: int = 2
    random_share: float = 0.5
    draws: int = 200
    reach_share: float = 0.5
    gain: float = 0.03
    promise: float = 1.5
    hope: float = 1.3
    back_m: float = 0.05


def lost_limbs(
    rng: np.random.Generator, samples: BodyPoints, outside: np.ndarray, unexplained: np.ndarray, settings: SearchSettings
) -> list[str]:
    """Limbs that the hulls contradict, and some where much of the hull is unexplained; else now and then one picked at random.

    Of those that the samples have: a body may lack some (`hmc.pose.scalable`).

    The random one is for limbs that rest in a wrong place which is nearly as good, a folded arm before the chest say.

    Parameters
    ----------
    rng : numpy.random.Generator
    samples : BodyPoints
    outside, unexplained : ndarray
        Distances of the samples from the tolerant hull, and of what has to be explained from the body, metres
        (`hmc.pose.steps.refine.RefineInfo`).
    settings : SearchSettings

    Returns
    -------
    list of str
        Keys of `LIMBS`.
    """
    there = [limb for limb, parts in _PARTS.items() if np.isin(samples.surface.part, parts).any()]
    far = outside > settings.far_m
    lost = [limb for limb in there if far[np.isin(samples.surface.part, _PARTS[limb])].mean() > settings.outside_share]
    if (unexplained > settings.far_m).mean() > settings.unexplained_share:
        others = [limb for limb in there if limb not in lost]
        picked = rng.permutation(len(others))[: max(0, settings.at_once - len(lost))]
        return lost + [others[k] for k in sorted(picked)]
    at_random = [str(rng.choice(there))] if rng.random() < settings.random_share else []
    return lost or at_random


def search_limbs(
    rng: np.random.Generator,
    body: BodyModel,
    samples: BodyPoints,
    state: np.ndarray,
    cost: float,
    limbs: list[str],
    target: HullTarget,
    hull_points: np.ndarray,
    cost_settings: SymmetricSettings,
    refine_settings: RefineSettings,
    settings: SearchSettings,
) -> tuple[np.ndarray, float, int]:
    """Look for limbs one after the other.

    Parameters
    ----------
    rng : numpy.random.Generator
    body, samples, target, hull_points, cost_settings
        As for `hmc.pose.objectives.symmetric.symmetric_cost`.
    state : ndarray, shape (27,)
    cost : float
        Its cost as the refinement gives it, square metres.
    limbs : list of str
        As from `lost_limbs`.
    refine_settings : RefineSettings
    settings : SearchSettings

    Returns
    -------
    state : ndarray, shape (27,)
    cost : float
    evaluations : int
    """
    coarse = sample_points(rng, hull_points, 200)
    evaluations = 0
    for limb in limbs:
        dofs = LIMBS[limb]
        trials = np.repeat(state[None], settings.draws + 1, axis=0)
        trials[1:, dofs] = _draw(rng, settings, body, state, limb, hull_points)
        costs = symmetric_cost(body, samples, trials, target, coarse, cost_settings)  # the first is the present pose
        evaluations += len(trials)
        if costs[1:].min() > settings.promise * costs[0]:
            continue
        trial, info = refine_best(
            body,
            samples,
            [trials[1 + pick] for pick in np.argsort(costs[1:])[:2]],
            target,
            hull_points,
            cost_settings,
            refine_settings,
            is_hopeless=_has_failed(body, state, cost, limb, settings),
        )
        evaluations += info.evaluations
        if info.cost_after < (1 - settings.gain) * cost:
            state, cost = trial, info.cost_after
    return state, cost, evaluations


def _has_failed(
    body: BodyModel, state: np.ndarray, cost: float, limb: str, settings: SearchSettings
) -> Callable[[np.ndarray, float], bool]:
    """Whether a new pose of a limb is not worth more steps: it costs too much, or is back at `state`, whose cost is `cost`."""

    def has_failed(trial: np.ndarray, trial_cost: float) -> bool:
        before, now = landmarks(body, np.stack([state, trial]))[:, _LANDMARKS[limb]]
        return trial_cost > settings.hope * cost or bool(np.linalg.norm(now - before, axis=1).max() < settings.back_m)

    return has_failed


def _unexplained(body: BodyModel, state: np.ndarray, hull_points: np.ndarray, settings: SearchSettings) -> np.ndarray:
    """Distance of hull points and rays to the body, metres; infinite where it is far."""
    rotations, positions = segment_transforms(body, state[None])
    maps = cone_maps(body.cones, np.concatenate([rotations[0], positions[0][..., None]], axis=-1)[..., None])
    return nearest_cones(body.cones, maps, candidates(body.cones, maps, hull_points, 1.1 * settings.far_m)).distance


def _draw(rng: np.random.Generator, settings: SearchSettings, body: BodyModel, state: np.ndarray, limb: str, hull_points: np.ndarray):
    """Random poses of a limb: some reach for hull points that no part explains, some are common ones, and some may be any."""
    dofs = LIMBS[limb]
    low, high = body.limits.low[dofs], body.limits.high[dofs]
    centre, _ = limb_joint(body, state, limb)
    places, _ = places_and_directions(hull_points)
    near = np.linalg.norm(places - centre, axis=1) < sum(limb_lengths(body, limb)) + settings.far_m
    goals = places[near & (_unexplained(body, state, hull_points, settings) > settings.far_m)]
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
