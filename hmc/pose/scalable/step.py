"""One frame of a person by a scalable body model: SHBM-APF, DDM-APF, or both (Canton 2009, chapter 7 and section 9.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hmc.montecarlo.filters import ParticleState
from hmc.pose.annealed.apf import (
    LEAST_SURFACE,
    PoseFilter,
    PoseInfo,
    PoseState,
    polish,
    pose_step,
    score_maps,
    starting_particles,
    unseen,
)
from hmc.pose.annealed.hull_target import HullTarget
from hmc.pose.annealed.presets import PosePreset
from hmc.pose.annealed.rays import points_to_explain
from hmc.pose.annealed.symmetric import POSTURE
from hmc.pose.scalable.restrict import ScoreData, SymmetricData, nearest_part, part_mask
from hmc.pose.scalable.structure import StructuralInfo, structural_step

__all__ = ["PoseStep", "scalable_step", "step_of"]

#: A step of one person's filter.
PoseStep = Callable[[np.random.Generator, PoseFilter, PoseState, HullTarget | None], tuple[PoseState, PoseInfo]]


def step_of(preset: PosePreset) -> PoseStep:
    """The step that a preset asks for."""
    return scalable_step if preset.models or preset.limbs is not None else pose_step


def scalable_step(rng: np.random.Generator, filt: PoseFilter, state: PoseState, target: HullTarget | None) -> tuple[PoseState, PoseInfo]:
    """One frame: structural annealing, then refinement where the preset has it.

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
    found = _structural(rng, filt, state, _observed(rng, filt, state, target))
    searched: list[str] = []
    if preset.refine is None:
        estimate, cost, more = found.threads[-1].mean, np.nan, 0
        if preset.likelihood == "symmetric":
            cost = -found.info.best_log_likelihood
    else:
        estimate, cost, searched, more = polish(rng, filt, [found.info.best, state.state], state.state, target)
    pose = PoseState(estimate, estimate - state.state, found.threads[-1], _kept(found.threads[:-1]) if preset.refine is None else {})
    return pose, PoseInfo(cost, tuple(searched), found.evaluations + more, None, "fitted", levels=found.info.estimates)


def _observed(rng: np.random.Generator, filt: PoseFilter, state: PoseState, target: HullTarget) -> ScoreData | SymmetricData:
    """The frame as the preset's likelihood reads it."""
    if filt.preset.likelihood != "symmetric":
        return ScoreData(score_maps(target, filt.room))
    points = points_to_explain(rng, target, filt.preset.hull_points, filt.preset.symmetric.ray_share)
    return SymmetricData(target, points, nearest_part(filt.body, state.state, points))


@dataclass(frozen=True)
class _Found:
    threads: tuple[ParticleState, ...]
    info: StructuralInfo
    evaluations: int


def _structural(rng, filt, state, data) -> _Found:
    """The hierarchies' filters, which share the particles; the one that explains the whole body best."""
    hierarchies = filt.preset.models
    settings = replace(filt.preset.structural, gamma=filt.preset.structural.gamma / len(hierarchies))
    low, high = filt.body.limits.low, filt.body.limits.high
    trials = []
    for hierarchy in hierarchies:
        likelihoods = [_likelihood(filt, data, hierarchy, level) for level in range(len(hierarchy.models))]
        if filt.preset.refine is None:
            starts = [*_threads(state, len(hierarchy.models) - 1), state.particles]
        else:
            starts = [starting_particles(filt, state)] * len(hierarchy.models)
        trials.append(structural_step(rng, starts, likelihoods, hierarchy.group, filt.drift, low, high, settings))
    threads, info = max(trials, key=lambda trial: trial[1].best_log_likelihood)
    return _Found(threads, info, sum(info.evaluations for _, info in trials))


def _likelihood(filt, data, hierarchy, level):
    keep = part_mask(hierarchy.models[level].parts)
    lacking = hierarchy.group > level

    def log_likelihood(states: np.ndarray) -> np.ndarray:
        if hierarchy.held == "rest":
            states = np.where(lacking, POSTURE[0], states)
        return data.log_likelihood(filt, states, keep)

    return log_likelihood


def _kept(threads) -> dict[str, np.ndarray]:
    """Particles of the lower models as arrays by name."""
    memory: dict[str, np.ndarray] = {}
    for level, thread in enumerate(threads):
        memory |= {f"particles_{level}": thread.particles, f"log_weights_{level}": thread.log_weights}
    return memory


def _threads(state: PoseState, n: int) -> list[ParticleState]:
    """The same particles again; where there are none, all start from the last model's."""
    return [
        ParticleState(state.memory[f"particles_{level}"], state.memory[f"log_weights_{level}"])
        if f"particles_{level}" in state.memory
        else state.particles
        for level in range(n)
    ]
