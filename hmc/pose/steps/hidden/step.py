"""Limbs that the data does not show are left out of any step, and looked for. Canton (2009), sections 7.4 and 9.2."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hmc.body.joints import N_DOF
from hmc.pose.method import PoseStep, StepInfo, Tracked, particles_of, unseen, with_particles
from hmc.pose.objectives.four_scores import ScoreTable
from hmc.pose.steps.hidden.limbs import LimbMemory, LimbSettings, limb_spread_deg, look_again
from hmc.pose.steps.hidden.scouts import limb_dofs, scout
from hmc.pose.steps.hidden.shown import FleshInHulls, covered, flesh_in_hulls, in_doubt, place_flesh
from hmc.pose.steps.proposal import shows_enough
from hmc.pose.steps.restrict import nearest_part, part_mask, restrict_target, restricted
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.person_view import PersonView
from hmc.search.weights import normalise

__all__ = ["with_hidden_limbs"]


@dataclass(frozen=True)
class _There:
    """What of the body is there: parts, shape (n_parts,), and angles, shape (37,)."""

    parts: np.ndarray
    dofs: np.ndarray


def with_hidden_limbs(step: PoseStep, settings: LimbSettings, hull: Literal["strict", "tolerant"] = "tolerant") -> PoseStep:
    """A step for the limbs that are there; then the tracked limbs are tested, and scouts look for the missing ones.

    Parameters
    ----------
    step : callable
        `PoseStep`, of subjects whose flesh is known.
    settings : LimbSettings
    hull : {"strict", "tolerant"}
        In which a limb's occupancy is counted.
    """

    def look(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[Tracked, StepInfo]:
        memory, target = LimbMemory.of(tracked.memory, settings), view.target
        there = _there(settings, memory)
        if target is None or not shows_enough(target):
            after, info = unseen(tracked)
            return after, replace(info, missing=~there.dofs)
        part = replace(tracked, subject=restricted(tracked.subject, there.parts, there.dofs))
        after, info = step(rng, part, replace(view, target=_asked(tracked, target, there)))
        estimate = np.where(there.dofs, after.state, tracked.state)
        after = replace(after, subject=tracked.subject)
        seen = flesh_in_hulls(_flesh(after), target, after.subject.capture.room, hull)
        memory, found, looked = _look(rng, after, seen, estimate, memory, settings)
        particles = particles_of(after)
        particles = replace(particles, particles=np.where(found != estimate, found, particles.particles))
        # A limb that was put elsewhere has not moved there.
        there = _there(settings, memory)
        velocity = np.where(there.dofs & (found == estimate), found - tracked.state, 0.0)
        after = Tracked(tracked.subject, found, velocity, {**after.memory, **with_particles(particles), **memory.kept()})
        missing = None if there.dofs.all() else ~there.dofs
        return after, replace(info, evaluations=info.evaluations + looked, missing=missing)

    return look


def _there(settings: LimbSettings, memory: LimbMemory) -> _There:
    model = settings.tree.model(memory.active)
    return _There(part_mask(model.parts), np.isin(np.arange(N_DOF), model.dofs))


def _asked(tracked: Tracked, target: HullTarget, there: _There) -> HullTarget:
    """The hulls without what only a missing part would cover."""
    if there.parts.all():
        return target
    body, state = tracked.subject.body, tracked.state
    target = restrict_target(target, there.parts)
    surface = target.surface[there.parts[nearest_part(body, state, target.surface)]]
    target = replace(target, surface=surface if len(surface) else target.surface)
    if target.rays is not None and len(target.rays):
        rays = target.rays[there.parts[nearest_part(body, state, target.rays)]]
        target = replace(target, rays=rays if len(rays) else None)
    return target


def _flesh(tracked: Tracked) -> ScoreTable:
    table = tracked.subject.flesh
    if table is None:
        raise ValueError("the subject has no table of its flesh, by which limbs are looked for")
    return table


def _look(
    rng: np.random.Generator, tracked: Tracked, looked: FleshInHulls, estimate: np.ndarray, memory: LimbMemory, limbs: LimbSettings
) -> tuple[LimbMemory, np.ndarray, int]:
    """Are the tracked limbs still shown, and the missing ones again? Memory, estimate with the limbs that were found, evaluations."""
    tree, particles = limbs.tree, particles_of(tracked)
    weights = normalise(particles.log_weights)
    evidence = np.zeros(len(tree.limbs), bool)
    found, freed, evaluations = {}, {}, 0
    flesh = place_flesh(looked, estimate, [part for limb in tree.limbs for part in limb.parts])
    for k, limb in enumerate(tree.limbs):
        if memory.active[k]:
            evaluations += 1
            spread = limb_spread_deg(particles.particles[:, limb.placing], weights).min()
            if spread > limbs.lost_spread_deg:
                evidence[k] = in_doubt(flesh, k, memory.active, limbs)
        elif tree.parent[k] < 0 or memory.active[tree.parent[k]]:
            report = scout(rng, looked, estimate, k, memory.active, limbs)
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
