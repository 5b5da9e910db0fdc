"""The annealed particle filter on one person's body: a step takes a state and a frame's hulls and returns a state.

Source: Canton (2009), sections 3.2 and 6.5; the symmetric cost, the local refinement and the limb search are ours
(`hmc.pose.annealed.symmetric`, `refine`, `limb_search`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.montecarlo.filters import AnnealedInfo, ParticleState, annealed_step, particle_init
from hmc.pose.annealed.hull_target import HullTarget, sample_points
from hmc.pose.annealed.limb_search import lost_limbs, search_limbs
from hmc.pose.annealed.presets import PosePreset, drift
from hmc.pose.annealed.refine import refine
from hmc.pose.annealed.symmetric import symmetric_cost
from hmc.pose.body.flesh import SurfaceSamples, surface_coordinates, surface_samples
from hmc.pose.body.model import BodyModel

__all__ = ["PoseFilter", "PoseInfo", "PoseState", "make_filter", "pose_init", "pose_step"]


@dataclass(frozen=True)
class PoseFilter:
    """What stays the same from frame to frame: the person's body and the settings.

    Parameters
    ----------
    body : BodyModel
    samples : SurfaceSamples
        Of the body's surface.
    preset : PosePreset
    drift : ndarray, shape (27,)
        P0, metres and radians.
    """

    body: BodyModel
    samples: SurfaceSamples
    preset: PosePreset
    drift: np.ndarray


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
    """

    state: np.ndarray
    velocity: np.ndarray
    particles: ParticleState


@dataclass(frozen=True)
class PoseInfo:
    """What happened in one step.

    Parameters
    ----------
    cost : float
        Of the estimate, square metres; NaN where the four scores were used.
    searched : tuple of str
        Limbs that were looked for.
    evaluations : int
        Of the cost or likelihood, in all.
    annealed : AnnealedInfo or None
        None in a frame without hull.
    status : str
        ``"fitted"``, or why not.
    """

    cost: float
    searched: tuple[str, ...]
    evaluations: int
    annealed: AnnealedInfo | None
    status: str


def make_filter(body: BodyModel, preset: PosePreset, fps: float) -> PoseFilter:
    """Prepare the filter for one person.

    Parameters
    ----------
    body : BodyModel
    preset : PosePreset
    fps : float
        Frames a second of the recording.
    """
    samples = surface_samples(body, surface_coordinates(body, preset.surface_samples))
    return PoseFilter(body, samples, preset, preset.drift_scale * drift(fps))


def pose_init(state: np.ndarray) -> PoseState:
    """A filter's first state, all particles on one pose, shape (27,)."""
    state = np.asarray(state, float)
    return PoseState(state, np.zeros_like(state), particle_init(state[None]))


def pose_step(rng: np.random.Generator, filt: PoseFilter, state: PoseState, target: HullTarget | None) -> tuple[PoseState, PoseInfo]:
    """One frame by the symmetric cost: annealed layers, refinement, search for lost limbs.

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
    if target is None or len(target.surface) < 20:
        return replace(state, velocity=np.zeros_like(state.velocity)), PoseInfo(np.nan, (), 0, None, "no hull of this person in this frame")
    preset, body, samples = filt.preset, filt.body, filt.samples
    low, high = body.limits.low, body.limits.high
    coarse = sample_points(rng, target.surface, preset.hull_points)
    fine = sample_points(rng, target.surface, preset.fine_hull_points)

    def log_likelihood(states: np.ndarray) -> np.ndarray:
        return -symmetric_cost(body, samples, states, target, coarse, preset.symmetric)

    # The no-motion and the smooth-motion assumption (Canton 3.1.2.2), half of the first layer's particles each.
    predicted = np.clip(state.state + state.velocity, low, high)
    starts = np.stack([state.state, predicted])
    particles, annealed = annealed_step(rng, particle_init(starts), log_likelihood, filt.drift, low, high, preset.annealed)
    if preset.refine is None:
        estimate, evaluations = annealed.estimate, annealed.evaluations
        return PoseState(estimate, estimate - state.state, particles), PoseInfo(
            -annealed.best_log_likelihood, (), evaluations, annealed, "fitted"
        )
    # From the particles and from the last pose: where the body hardly moved the second is the better start.
    trials = [
        refine(body, samples, start, target, fine, preset.symmetric, preset.refine, anchor=state.state)
        for start in (annealed.best, state.state)
    ]
    evaluations = annealed.evaluations + sum(info.evaluations for _, info in trials)
    estimate, best = min(trials, key=lambda trial: trial[1].cost_after)
    cost, searched = best.cost_after, []
    if preset.search is not None:
        searched = lost_limbs(body, samples, estimate, target, fine, preset.search)
        if searched:
            estimate, cost, more = search_limbs(
                rng, body, samples, estimate, cost, searched, target, fine, preset.symmetric, preset.refine, preset.search
            )
            evaluations += more
    velocity = estimate - state.state
    return PoseState(estimate, velocity, particles), PoseInfo(cost, tuple(searched), evaluations, annealed, "fitted")
