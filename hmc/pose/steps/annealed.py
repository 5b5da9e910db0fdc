"""The annealed particle filter on one person's body: what it proposes in a frame. Canton (2009), sections 3.2 and 6.5."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.body.flesh import flesh_points, surface_coordinates
from hmc.body.model import BodyModel
from hmc.pose.method import Capture, Subject, Tracked, particles_of, with_particles
from hmc.pose.objectives.four_scores import make_score_table
from hmc.pose.objectives.symmetric import body_points, thinned
from hmc.pose.steps.presets import PosePreset, drift_of
from hmc.pose.steps.proposal import Proposal, Propose
from hmc.pose.steps.restrict import ScoreData, SymmetricData, nearest_part, score_maps
from hmc.pose.views.person_view import PersonView
from hmc.pose.views.rays import points_to_cover
from hmc.search.filters import ParticleState, annealed_step, particle_init

__all__ = ["annealed", "annealed_subject", "first_spread", "frame_data", "starting_particles"]


def annealed_subject(body: BodyModel, capture: Capture, preset: PosePreset) -> Subject:
    """What an annealed filter makes of a body: points of its surface and, where the four scores are used, a table of its flesh.

    Parameters
    ----------
    body : BodyModel
    capture : Capture
    preset : PosePreset
    """
    samples = body_points(body, surface_coordinates(body, preset.surface_samples))
    needs_flesh = preset.likelihood != "symmetric" or preset.limbs is not None
    table = make_score_table(body, flesh_points(body, preset.density * capture.voxel_size_m)) if needs_flesh else None
    return Subject(body, capture, samples, table)


def annealed(preset: PosePreset) -> Propose:
    """Annealed layers over the whole body by a preset's likelihood, schedule and drift.

    Parameters
    ----------
    preset : PosePreset

    Returns
    -------
    callable
        `Propose`; it leaves its particles in the memory.
    """

    def propose(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> Proposal:
        subject = tracked.subject
        data = frame_data(rng, tracked, view, preset)
        if isinstance(data, SymmetricData):
            # Particles only have to find the way to the minimum; the refinement, with all points, goes to its bottom.
            subject = replace(subject, points=thinned(subject.points, preset.coarse_samples))
        likelihood, limits = data.likelihood(subject, np.ones_like(subject.parts)), subject.body.limits
        sd = first_spread(tracked, preset)
        starts = starting_particles(tracked, preset)
        particles, info = annealed_step(rng, starts, likelihood, sd, limits.low, limits.high, preset.annealed)
        cost = -info.best_log_likelihood if preset.likelihood == "symmetric" else np.nan
        return Proposal(info.estimate, info.best, cost, info.evaluations, with_particles(particles), annealed=info)

    return propose


def first_spread(tracked: Tracked, preset: PosePreset) -> np.ndarray:
    """Deviations of the first layer, shape (37,): P0, and 0 for angles of limbs that are not there."""
    subject = tracked.subject
    return np.where(subject.free, preset.drift_scale * drift_of(subject.capture), 0.0)


def frame_data(
    rng: np.random.Generator, tracked: Tracked, view: PersonView, preset: PosePreset, by_part: bool = False
) -> SymmetricData | ScoreData:
    """A frame as a preset's likelihood reads it.

    Parameters
    ----------
    rng : numpy.random.Generator
    tracked : Tracked
    view : PersonView
        With hulls.
    preset : PosePreset
    by_part : bool
        Whether single parts are asked about.
    """
    target, subject = view.target, tracked.subject
    if target is None:
        raise ValueError("the frame has no hulls of this person")
    if preset.likelihood != "symmetric":
        return ScoreData(score_maps(target, subject.capture.room, preset.hull), preset.likelihood == "global")
    points = points_to_cover(rng, target, preset.hull_points, preset.symmetric.ray_share)
    part = nearest_part(subject.body, tracked.state, points) if by_part else None
    keypoints = None if view.keypoints is None else (view.keypoints, preset.keypoints)
    return SymmetricData(target, points, preset.symmetric, part, keypoints)


def starting_particles(tracked: Tracked, preset: PosePreset) -> ParticleState:
    """Where a frame's particles start, by the preset's `motion`: the last frame's, or, if its estimate was refined, that, which is better.

    Source: Canton (2009), section 3.1.2.2.
    """
    last, limits = particles_of(tracked) if preset.refine is None else particle_init(tracked.state[None]), tracked.subject.body.limits
    if preset.motion == "none":
        return last
    moved = np.clip(last.particles + tracked.velocity, limits.low, limits.high)
    if preset.motion == "smooth":
        return replace(last, particles=moved)
    return ParticleState(np.concatenate([last.particles, moved]), np.tile(last.log_weights, 2))
