"""The annealed particle filter on one person's body: a step takes a state and a frame's hulls and returns a state.

Source: Canton (2009), sections 3.2 and 6.5; the symmetric cost, the local refinement and the limb search are ours
(`hmc.pose.objectives.symmetric`, `refine`, `limb_search`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.body.flesh import flesh_points, surface_coordinates
from hmc.body.model import BodyModel
from hmc.pose.objectives.four_scores import (
    ScoreMaps,
    ScoreTable,
    ScoreVariances,
    log_likelihood_factorised,
    log_likelihood_global,
    make_score_table,
    observe,
    scores,
)
from hmc.pose.objectives.symmetric import BodyPoints, body_points, symmetric_cost, thinned
from hmc.pose.steps.limb_search import lost_limbs, search_limbs
from hmc.pose.steps.preset import PosePreset, drift
from hmc.pose.steps.refine import refine_all
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.rays import points_to_explain
from hmc.search.filters import AnnealedInfo, ParticleState, annealed_step, particle_init
from hmc.voxels.grid import VoxelGrid

#: Fewer surface voxels than this are noise, not a person.
LEAST_SURFACE = 20

__all__ = [
    "PoseFilter",
    "PoseInfo",
    "PoseState",
    "make_filter",
    "polish",
    "pose_init",
    "pose_step",
    "score_maps",
    "starting_particles",
    "unseen",
]  # fmt: skip


@dataclass(frozen=True)
class PoseFilter:
    """What stays the same from frame to frame: the person's body and the settings.

    Parameters
    ----------
    body : BodyModel
    samples : BodyPoints
        At which the symmetric cost is taken.
    preset : PosePreset
    drift : ndarray, shape (27,)
        P0, metres and radians.
    table : ScoreTable or None
        The body's flesh, where the four scores are used, be it by scouts for missing limbs alone.
    room : ndarray, shape (2, 3), or None
        Where a body may be, metres; for the score Out.
    """

    body: BodyModel
    samples: BodyPoints
    preset: PosePreset
    drift: np.ndarray
    table: ScoreTable | None = None
    room: np.ndarray | None = None


@dataclass(frozen=True)
class PoseState:
    """One person's pose and the particles around it.

    Parameters
    ----------
    state : ndarray, shape (27,)
        The estimate.
    velocity : ndarray, shape (27,)
        Change of the estimate in the last frame; zero at the start.
    particles : ParticleState
    memory : mapping of str to ndarray
        What else a method keeps from frame to frame (`hmc.pose.steps.scalable`).
    """

    state: np.ndarray
    velocity: np.ndarray
    particles: ParticleState
    memory: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class PoseInfo:
    """What happened in one step.

    Parameters
    ----------
    cost : float
        Of the estimate, square metres; NaN without a fit, and where the four scores are used: there is a likelihood then
        (`AnnealedInfo.best_log_likelihood`) and no cost.
    searched : tuple of str
        Limbs that were looked for.
    evaluations : int
        Of the cost or likelihood, in all.
    annealed : AnnealedInfo or None
        None in a frame without hull.
    status : str
        ``"fitted"``, or why not.
    missing : ndarray of bool, shape (27,), or None
        Angles of limbs that the data does not show; None: of none.
    levels : ndarray, shape (n_models, 27), or None
        The estimates of a hierarchy's models, NaN where a model lacks the angle.
    """

    cost: float
    searched: tuple[str, ...]
    evaluations: int
    annealed: AnnealedInfo | None
    status: str
    missing: np.ndarray | None = None
    levels: np.ndarray | None = None


def make_filter(body: BodyModel, preset: PosePreset, fps: float, voxel_size_m: float = 0.03, room: np.ndarray | None = None) -> PoseFilter:
    """Prepare the filter for one person.

    Parameters
    ----------
    body : BodyModel
    preset : PosePreset
    fps : float
        Frames a second of the recording.
    voxel_size_m : float
        Of the hulls: the spacing of the flesh where the four scores are used.
    room : ndarray, shape (2, 3), optional
        Limits of the room, metres.
    """
    samples = body_points(body, surface_coordinates(body, preset.surface_samples))
    needs_flesh = preset.likelihood != "symmetric" or preset.limbs is not None
    table = make_score_table(body, flesh_points(body, preset.density * voxel_size_m)) if needs_flesh else None
    return PoseFilter(body, samples, preset, preset.drift_scale * drift(fps), table, room)


def pose_init(
    state: np.ndarray,
    velocity: np.ndarray | None = None,
    particles: ParticleState | None = None,
    memory: Mapping[str, np.ndarray] | None = None,
) -> PoseState:
    """A filter's state on one pose.

    Parameters
    ----------
    state : ndarray, shape (27,)
    velocity : ndarray, shape (27,), optional
        Zero where left out.
    particles : ParticleState, optional
        All on `state` where left out.
    memory : mapping, optional
        As in `PoseState`.
    """
    state = np.asarray(state, float)
    velocity = np.zeros_like(state) if velocity is None else np.asarray(velocity, float)
    return PoseState(state, velocity, particles or particle_init(state[None]), memory or {})


def pose_step(rng: np.random.Generator, filt: PoseFilter, state: PoseState, target: HullTarget | None) -> tuple[PoseState, PoseInfo]:
    """One frame: annealed layers, then, where the preset has them, refinement and search for lost limbs.

    Parameters
    ----------
    rng : numpy.random.Generator
    filt : PoseFilter
    state : PoseState
    target : HullTarget or None
        None where the person has no hull in this frame: the pose stays.

    Returns
    -------
    state : PoseState
    info : PoseInfo
    """
    if target is None or len(target.surface) < LEAST_SURFACE:
        return unseen(state)
    preset = filt.preset
    low, high = filt.body.limits.low, filt.body.limits.high
    symmetric = preset.likelihood == "symmetric"
    likelihood = _by_symmetric_cost(rng, filt, target) if symmetric or filt.table is None else _by_scores(filt, filt.table, target)
    if preset.refine is None:
        particles, annealed = annealed_step(rng, starting_particles(filt, state), likelihood, filt.drift, low, high, preset.annealed)
        estimate = annealed.estimate
        cost = -annealed.best_log_likelihood if symmetric else np.nan
        info = PoseInfo(cost, (), annealed.evaluations, annealed, "fitted")
        return PoseState(estimate, estimate - state.state, particles), info
    particles, annealed = annealed_step(rng, starting_particles(filt, state), likelihood, filt.drift, low, high, preset.annealed)
    estimate, cost, searched, more = polish(rng, filt, [annealed.best, state.state], state.state, target)
    info = PoseInfo(cost, tuple(searched), annealed.evaluations + more, annealed, "fitted")
    return PoseState(estimate, estimate - state.state, particles), info


def unseen(state: PoseState) -> tuple[PoseState, PoseInfo]:
    """A frame without a hull of the person: the pose stays."""
    return replace(state, velocity=np.zeros_like(state.velocity)), PoseInfo(np.nan, (), 0, None, "no hull of this person in this frame")


def starting_particles(filt: PoseFilter, state: PoseState) -> ParticleState:
    """Where a frame's particles start, by the preset's `motion`: the last frame's, or, if its estimate was refined, that, which is better.

    Source: Canton (2009), section 3.1.2.2.
    """
    last = state.particles if filt.preset.refine is None else particle_init(state.state[None])
    if filt.preset.motion == "none":
        return last
    moved = np.clip(last.particles + state.velocity, filt.body.limits.low, filt.body.limits.high)
    if filt.preset.motion == "smooth":
        return replace(last, particles=moved)
    return ParticleState(np.concatenate([last.particles, moved]), np.tile(last.log_weights, 2))


def polish(
    rng: np.random.Generator, filt: PoseFilter, starts: Sequence[np.ndarray], anchor: np.ndarray, target: HullTarget
) -> tuple[np.ndarray, float, list[str], int]:
    """Refine several starts, take the best, look for limbs that the hulls contradict.

    Parameters
    ----------
    rng : numpy.random.Generator
    filt : PoseFilter
        Of a preset with `refine`.
    starts : sequence of ndarray, shape (27,)
    anchor : ndarray, shape (27,)
        Pose on which what no data speaks of is held.
    target : HullTarget

    Returns
    -------
    state : ndarray, shape (27,)
    cost : float
        Square metres.
    searched : list of str
    evaluations : int
    """
    preset, body, samples = filt.preset, filt.body, filt.samples
    if preset.refine is None:
        raise ValueError(f"preset '{preset.name}' has no `refine`")
    points = points_to_explain(rng, target, preset.fine_hull_points, preset.symmetric.ray_share)
    # Each to the end: a start that has moved a limb across costs more than one that has lost it until late in the refinement.
    trials = refine_all(body, samples, starts, target, points, preset.symmetric, preset.refine, anchor=anchor)
    evaluations = sum(info.evaluations for _, info in trials)
    estimate, info = min(trials, key=lambda trial: trial[1].cost_after)
    cost = info.cost
    searched: list[str] = []
    if preset.search is not None:
        searched = lost_limbs(rng, samples, info.outside, info.unexplained, preset.search)
        estimate, cost, more = search_limbs(
            rng, body, samples, estimate, cost, searched, target, points, preset.symmetric, preset.refine, preset.search
        )
        evaluations += more
    return estimate, cost, searched, evaluations


def _by_symmetric_cost(rng, filt, target):
    # Particles only have to find the way to the minimum; the refinement, with all points, goes to its bottom.
    samples = thinned(filt.samples, filt.preset.coarse_samples)
    points = points_to_explain(rng, target, filt.preset.hull_points, filt.preset.symmetric.ray_share)

    def log_likelihood(states: np.ndarray) -> np.ndarray:
        return -symmetric_cost(filt.body, samples, states, target, points, filt.preset.symmetric)

    return log_likelihood


def _by_scores(filt, table, target):
    """The four scores against the tolerant hull."""
    maps = score_maps(target, filt.room)
    variances = ScoreVariances()

    def log_likelihood(states: np.ndarray) -> np.ndarray:
        values = scores(table, states, maps)
        if filt.preset.likelihood == "global":
            return log_likelihood_global(values, table.counts, variances.whole_body())
        return log_likelihood_factorised(values, variances.by_part())

    return log_likelihood


def score_maps(target: HullTarget, room: np.ndarray | None) -> ScoreMaps:
    """The tolerant hull as the four scores read it; `room` is that of `PoseFilter`."""
    grid = VoxelGrid(target.origin - 0.5 * target.voxel_size_m, target.voxel_size_m, target.distance.shape)
    return observe(target.tolerant, grid, room)
