"""One frame of a person by a scalable body model: SHBM-APF, DDM-APF, or both (Canton 2009, chapter 7 and section 9.2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.body.joints import N_DOF, dof_index
from hmc.body.limbs import CHAIN_OF_DOF
from hmc.body.model import PARTS
from hmc.body.prior import POSTURE
from hmc.body.scalable_models import Inclusive
from hmc.pose.objectives.four_scores import ScoreMaps, ScoreTable
from hmc.pose.objectives.restrict import ScoreData, SymmetricData, nearest_part, part_mask, restrict_filter, restrict_target
from hmc.pose.steps.annealed import (
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
from hmc.pose.steps.hidden.limbs import LimbMemory, LimbSettings, limb_spread_deg, look_again
from hmc.pose.steps.hidden.scouts import limb_dofs, scout
from hmc.pose.steps.hidden.shown import covered, in_doubt, place_flesh
from hmc.pose.steps.preset import PosePreset
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.rays import points_to_explain
from hmc.search.filters import ParticleState, annealed_step
from hmc.search.structural import structural_step
from hmc.search.weights import normalise

__all__ = ["PoseStep", "scalable_step", "step_of", "suited"]

#: All that the search for lost limbs may look for.
_LIMB_PARTS = [part for part in PARTS if part not in ("torso", "head")]
#: Elbows and knees; bent by more than this in the mean, degrees, is a pose of bent limbs.
HINGES = dof_index("r_elbow_z", "l_elbow_z", "r_knee_y", "l_knee_y")
BENT_DEG = 45.0
#: A step of one person's filter.
PoseStep = Callable[[np.random.Generator, PoseFilter, PoseState, HullTarget | None], tuple[PoseState, PoseInfo]]


@dataclass(frozen=True)
class _There:
    """What of the body is there: parts, shape (n_parts,), and angles, shape (27,)."""

    parts: np.ndarray
    dofs: np.ndarray


@dataclass(frozen=True)
class _Found:
    """What a search came to: estimate and best state, each of shape (27,), particles, and those of the lower models."""

    estimate: np.ndarray
    best: np.ndarray
    best_log_likelihood: float
    particles: ParticleState
    evaluations: int
    lower: tuple[ParticleState, ...] = ()
    levels: np.ndarray | None = None


def step_of(preset: PosePreset) -> PoseStep:
    """The step that a preset asks for."""
    return scalable_step if preset.models or preset.limbs is not None else pose_step


def scalable_step(rng: np.random.Generator, filt: PoseFilter, state: PoseState, target: HullTarget | None) -> tuple[PoseState, PoseInfo]:
    """One frame: the limbs that are there, by structural annealing or by plain one, refined where the preset has it; then the scouts.

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
    preset, limbs = filt.preset, filt.preset.limbs
    memory = None if limbs is None else LimbMemory.of(state.memory, limbs)
    there = _there(limbs, memory)
    if target is None or len(target.surface) < LEAST_SURFACE:
        pose, info = unseen(state)
        return pose, replace(info, missing=~there.dofs)
    maps = score_maps(target, filt.room) if limbs is not None or preset.likelihood != "symmetric" else None
    data = _observed(rng, filt, state, target, maps, there)
    found = _structural(rng, filt, state, data, there) if preset.models else _annealed(rng, filt, state, data, there)
    searched: list[str] = []
    if preset.refine is None:
        estimate, more = found.estimate, 0
        cost = -found.best_log_likelihood if preset.likelihood == "symmetric" else np.nan
    else:
        part, seen = restrict_filter(filt, there.parts), _asked(filt, state, target, there)
        if not there.parts[part_mask(_LIMB_PARTS)].any():
            part = replace(part, preset=replace(preset, search=None))
        estimate, cost, searched, more = polish(rng, part, [found.best, state.state], state.state, seen)
    estimate = tracked = np.where(there.dofs, estimate, state.state)
    kept = {} if preset.refine is not None else _kept(found.lower)
    particles = found.particles
    if limbs is not None and memory is not None and filt.table is not None and maps is not None:
        memory, estimate, looked = _look(rng, filt.table, maps, target, tracked, particles, memory, limbs)
        particles = replace(particles, particles=np.where(estimate != tracked, estimate, particles.particles))
        there, more = _there(limbs, memory), more + looked
        kept |= memory.kept()
    # A limb that was put elsewhere has not moved there.
    pose = PoseState(estimate, np.where(there.dofs & (estimate == tracked), estimate - state.state, 0.0), particles, kept)
    missing = None if there.dofs.all() else ~there.dofs
    return pose, PoseInfo(cost, tuple(searched), found.evaluations + more, None, "fitted", missing, found.levels)


def _there(limbs: LimbSettings | None, memory: LimbMemory | None) -> _There:
    if limbs is None or memory is None:
        return _There(np.ones(len(PARTS), bool), np.ones(N_DOF, bool))
    model = limbs.tree.model(memory.active)
    return _There(part_mask(model.parts), np.isin(np.arange(N_DOF), model.dofs))


def _asked(filt: PoseFilter, state: PoseState, target: HullTarget, there: _There) -> HullTarget:
    """The hulls without what only a missing part would explain."""
    if there.parts.all():
        return target
    target = restrict_target(target, there.parts)
    surface = target.surface[there.parts[nearest_part(filt.body, state.state, target.surface)]]
    target = replace(target, surface=surface if len(surface) else target.surface)
    if target.rays is not None and len(target.rays):
        rays = target.rays[there.parts[nearest_part(filt.body, state.state, target.rays)]]
        target = replace(target, rays=rays if len(rays) else None)
    return target


def _observed(rng, filt, state, target, maps, there) -> ScoreData | SymmetricData:
    """The frame as the preset's likelihood reads it."""
    if filt.preset.likelihood != "symmetric":
        return ScoreData(maps)
    points = points_to_explain(rng, target, filt.preset.hull_points, filt.preset.symmetric.ray_share)
    return SymmetricData(target, points, nearest_part(filt.body, state.state, points))


def _annealed(rng, filt, state, data, there) -> _Found:
    """The plain annealed filter of what is there."""
    low, high = filt.body.limits.low, filt.body.limits.high
    starts = state.particles if filt.preset.refine is None else starting_particles(filt, state)
    particles, info = annealed_step(
        rng,
        starts,
        data.likelihood(filt, there.parts),
        np.where(there.dofs, filt.drift, 0.0),
        low,
        high,
        filt.preset.annealed,
    )
    return _Found(info.estimate, info.best, info.best_log_likelihood, particles, info.evaluations)


def _structural(rng, filt, state, data, there) -> _Found:
    """The filters of the hierarchy that suits the last pose."""
    hierarchy = suited(filt.preset.models, state.state, there.dofs)
    n = len(hierarchy.models)
    likelihoods = [_likelihood(filt, data, hierarchy, level, there) for level in range(n)]
    if filt.preset.refine is None:
        starts = [*_threads(state, n - 1), state.particles]
    else:
        starts = [starting_particles(filt, state)] * n
    group = np.where(there.dofs, hierarchy.group, n)
    low, high = filt.body.limits.low, filt.body.limits.high
    threads, info = structural_step(rng, starts, likelihoods, group, filt.drift, low, high, filt.preset.structural, CHAIN_OF_DOF)
    return _Found(threads[-1].mean, info.best, info.best_log_likelihood, threads[-1], info.evaluations, threads[:-1], info.estimates)


def suited(hierarchies: Sequence[Inclusive], state: np.ndarray, there: np.ndarray) -> Inclusive:
    """The first of two hierarchies where limbs are mostly straight, the second where they are bent (Canton, section 7.3.2.1).

    Parameters
    ----------
    hierarchies : sequence of Inclusive
        One, or two.
    state : ndarray, shape (27,)
        The last pose.
    there : ndarray of bool, shape (27,)
        Angles of limbs that are there: others say nothing.
    """
    hinges = HINGES[there[HINGES]]
    bent = len(hinges) > 0 and np.degrees(np.abs(state[hinges])).mean() > BENT_DEG
    return hierarchies[-1 if bent else 0]


def _likelihood(filt, data, hierarchy, level, there):
    keep = part_mask(hierarchy.models[level].parts) & there.parts
    every = 1 if level == len(hierarchy.models) - 1 else hierarchy.thinning
    log_likelihood = data.likelihood(filt, keep, every, by_limb=filt.preset.structural.by_limb)
    if hierarchy.held == "last":
        return log_likelihood
    lacking = hierarchy.group > level
    return lambda states: log_likelihood(np.where(lacking, POSTURE[0], states))


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


def _look(
    rng: np.random.Generator,
    table: ScoreTable,
    maps: ScoreMaps,
    target: HullTarget,
    estimate: np.ndarray,
    particles: ParticleState,
    memory: LimbMemory,
    limbs: LimbSettings,
) -> tuple[LimbMemory, np.ndarray, int]:
    """Are the tracked limbs still shown, and the missing ones again? Memory, estimate with the limbs that were found, evaluations."""
    tree = limbs.tree
    weights = normalise(particles.log_weights)
    evidence = np.zeros(len(tree.limbs), bool)
    found, freed, evaluations = {}, {}, 0
    flesh = place_flesh(table, estimate, maps, target, [part for limb in tree.limbs for part in limb.parts])
    for k, limb in enumerate(tree.limbs):
        if memory.active[k]:
            evaluations += 1
            spread = limb_spread_deg(particles.particles[:, limb.dofs], weights).min()
            if spread > limbs.lost_spread_deg:
                evidence[k] = in_doubt(flesh, k, memory.active, limbs)
        elif tree.parent[k] < 0 or memory.active[tree.parent[k]]:
            report = scout(rng, table, maps, target, estimate, k, memory.active, limbs)
            evaluations += report.evaluations
            found[k], evidence[k] = report.state, report.shown
            # Without its lower part an upper one that went into the trunk would stay there: nothing asks for it elsewhere.
            if (
                report.spread_deg < limbs.found_spread_deg
                and report.held_occupancy > limbs.found_occupancy
                and covered(flesh, tree.parent[k], memory.active, limbs)
            ):
                freed[tree.parent[k]] = report.state
    after = look_again(memory, evidence, limbs)
    for k, state in freed.items():
        estimate = np.where(np.isin(np.arange(N_DOF), tree.limbs[k].dofs), state, estimate)
    for k in np.flatnonzero(after.active & ~memory.active).tolist():
        estimate = np.where(np.isin(np.arange(N_DOF), limb_dofs(limbs, k)), found[k], estimate)
    return after, estimate, evaluations
