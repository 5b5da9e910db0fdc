"""A person's pose that got lost as a whole: noticed, and found anew.

A filter that follows from frame to frame stays lost where it once is: two seconds went missing while the person walked on, or the body
faces backwards. Two signs tell, and neither alone changes anything:

- The cost has stayed far above what is usual for this person. A fresh start from the frame's hulls is then refined beside the pose as
  it is, and taken if it is far better.
- Every so often the body turned about is refined beside the pose as it is. A hull hardly tells the two apart in one frame; the logarithm
  of the ratio of their costs is summed up (CUSUM; Page, 1954), until it is beyond doubt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace

import numpy as np

from hmc.body.exchange import swapped_pose
from hmc.pose.objectives.residuals import residual_values
from hmc.pose.starts.spectral import spectral_poses
from hmc.pose.starts.templates import first_poses
from hmc.pose.starts.window import StartSettings, walk_factor
from hmc.pose.steps.annealed import PoseFilter, PoseInfo, PoseState, pose_init
from hmc.pose.steps.limb_search import LIMBS, search_limbs
from hmc.pose.steps.refine import refine
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.rays import points_to_explain

__all__ = ["LossSettings", "LossState", "loss_init", "loss_step", "recalled", "remembered"]

#: Of the entry in a pose's memory.
_NAME = "loss"


@dataclass(frozen=True)
class LossSettings:
    """When a pose counts as lost.

    Parameters
    ----------
    ratio : float
        A cost is bad above so many times the usual one.
    patience_s : float
        Bad for so long, and a fresh start is tried, seconds; after one in vain, twice as long, and so on.
    gain : float
        A fresh start is taken where its cost is below this share of the pose's as it is.
    memory_s : float
        Time over which the usual cost is a mean, seconds.
    turn_every_s, suspicion_s : float
        How often the body turned about is tried, and how often once it was better, seconds.
    turn_drift, turn_limit : float
        What is taken from each logarithm of a ratio of costs, and the sum at which the body is turned about.
    """

    ratio: float = 3.0
    patience_s: float = 0.3
    gain: float = 0.6
    memory_s: float = 3.0
    turn_every_s: float = 1.0
    suspicion_s: float = 0.2
    turn_drift: float = 0.1
    turn_limit: float = 0.8


@dataclass(frozen=True)
class LossState:
    """What is known of a pose's reliability between two frames.

    Parameters
    ----------
    usual : float
        Mean of the logarithm of good frames' costs; NaN before the first.
    bad_s : float
        For how long the cost has been bad, seconds.
    wait_s : float
        For how long it has to be before a fresh start is tried.
    since_turn_s : float
        Since the body turned about was last tried, seconds.
    turned : float
        Evidence for the body turned about.
    """

    usual: float = np.nan
    bad_s: float = 0.0
    wait_s: float = 0.0
    since_turn_s: float = 0.0
    turned: float = 0.0


def loss_init(costs: np.ndarray, settings: LossSettings) -> LossState:
    """The state after a person's first frames.

    Parameters
    ----------
    costs : ndarray, shape (n,)
        Square metres; NaN where there is none.
    settings : LossSettings
    """
    costs = costs[np.isfinite(costs) & (costs > 0)]
    return LossState(float(np.log(np.median(costs))) if len(costs) else np.nan, wait_s=settings.patience_s)


def remembered(state: LossState) -> dict[str, np.ndarray]:
    """The state as an entry of a pose's memory (`hmc.pose.steps.annealed.PoseState`)."""
    return {_NAME: np.array(astuple(state))}


def recalled(memory: Mapping[str, np.ndarray]) -> LossState:
    """The state from a pose's memory; a fresh one where there is none."""
    return LossState(*memory[_NAME].tolist()) if _NAME in memory else LossState()


def loss_step(
    rng: np.random.Generator,
    filt: PoseFilter,
    fps: float,
    pose: PoseState,
    info: PoseInfo,
    target: HullTarget | None,
    velocity: np.ndarray,
    state: LossState,
    settings: LossSettings,
    start: StartSettings,
) -> tuple[PoseState, PoseInfo, LossState]:
    """Judge one frame's pose, and replace it if it is lost.

    Parameters
    ----------
    rng : numpy.random.Generator
        Its own, so that a pose that is never lost is the same with and without.
    filt : PoseFilter
        Of a preset with `refine`.
    fps : float
    pose, info
        As from `hmc.pose.steps.annealed.pose_step`.
    target : HullTarget or None
        Of the same frame.
    velocity : ndarray, shape (3,)
        Of the person's track, metres a second.
    state : LossState
    settings : LossSettings
    start : StartSettings
        What walking backwards costs.

    Returns
    -------
    pose : PoseState
    info : PoseInfo
    state : LossState
    """
    if target is None or info.status != "fitted" or not info.cost > 0:
        return pose, info, state
    dt, level = 1 / fps, float(np.log(info.cost))
    if state.wait_s == 0:
        state = replace(state, wait_s=settings.patience_s)
    if np.isnan(state.usual):
        state = replace(state, usual=level)
    state = replace(state, since_turn_s=state.since_turn_s + dt)
    if level > state.usual + np.log(settings.ratio):
        state = replace(state, bad_s=state.bad_s + dt)
        if state.bad_s < state.wait_s - dt / 2:
            return pose, info, state
        found = _fresh_start(rng, filt, pose.state, target, settings)
        if found is None:
            return pose, info, replace(state, bad_s=0.0, wait_s=2 * state.wait_s)
        return (
            replace(pose_init(found[0]), memory=pose.memory),
            replace(info, cost=found[1]),
            replace(state, bad_s=0.0, wait_s=settings.patience_s, turned=0.0),
        )
    usual = state.usual + (level - state.usual) * min(1.0, dt / settings.memory_s)
    state = replace(state, usual=usual, bad_s=0.0, wait_s=settings.patience_s)
    if state.since_turn_s < (settings.suspicion_s if state.turned else settings.turn_every_s) - dt / 2:
        return pose, info, state
    (as_it_is, cost), (turned, turned_cost) = _both_ways(rng, filt, pose.state, target)
    factors = walk_factor(np.array([as_it_is[3], turned[3]]), velocity, start)
    evidence = np.log(cost * factors[0]) - np.log(turned_cost * factors[1]) - settings.turn_drift
    state = replace(state, since_turn_s=0.0, turned=max(0.0, state.turned + float(evidence)))
    if state.turned < settings.turn_limit:
        return pose, info, state
    return replace(pose_init(turned), memory=pose.memory), replace(info, cost=turned_cost), replace(state, turned=0.0)


def _fresh_start(rng, filt, now, target, settings) -> tuple[np.ndarray, float] | None:
    """The best pose that a start from this frame's hulls finds, and its cost, if that is far below the present one's."""
    preset = filt.preset
    floor_z = 0.0 if target.floor_z is None else target.floor_z
    find = spectral_poses if preset.start == "spectral" else first_poses
    states, _ = find(rng, filt.body, filt.samples, target, preset.symmetric, floor_z)
    points = points_to_explain(rng, target, preset.fine_hull_points, preset.symmetric.ray_share)
    trials = [refine(filt.body, filt.samples, one, target, points, preset.symmetric, preset.refine) for one in states]
    best, cost = min(((one, info.cost_after) for one, info in trials), key=lambda pair: pair[1])
    values = residual_values(filt.body, filt.samples, now, target, points, preset.symmetric)
    return (best, cost) if cost < settings.gain * float(values @ values) else None


def _both_ways(rng, filt, now, target) -> list[tuple[np.ndarray, float]]:
    """The pose and the one turned about, both refined to the same points, with their costs.

    Arms and legs of a body that has been followed the wrong way round have gone astray too: those of the turned one are looked for.
    """
    preset = filt.preset
    points = points_to_explain(rng, target, preset.fine_hull_points, preset.symmetric.ray_share)
    both = []
    for start, search in ((now, None), (swapped_pose(filt.body, now, "all"), preset.search)):
        state, _ = refine(filt.body, filt.samples, start, target, points, preset.symmetric, preset.refine)
        values = residual_values(filt.body, filt.samples, state, target, points, preset.symmetric)
        cost = float(values @ values)
        if search is not None:
            state, cost, _ = search_limbs(
                rng, filt.body, filt.samples, state, cost, list(LIMBS), target, points, preset.symmetric, preset.refine, search
            )
        both.append((state, cost))
    return both
