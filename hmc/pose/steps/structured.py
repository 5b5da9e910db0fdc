"""Structural annealing on one person's body: a filter a model of rising detail. Canton (2009), section 7.3."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.body.joints import dof_index
from hmc.body.limbs import CHAIN_OF_DOF
from hmc.body.prior import POSTURE
from hmc.body.scalable_models import Inclusive
from hmc.pose.method import Tracked, particles_of, with_particles
from hmc.pose.steps.annealed import first_spread, frame_data, starting_particles
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.proposal import Proposal, Propose
from hmc.pose.steps.restrict import ScoreData, SymmetricData, part_mask
from hmc.pose.views.person_view import PersonView
from hmc.search.filters import LogLikelihood, ParticleState
from hmc.search.structural import Variables, structural_step

__all__ = ["structured", "suited"]

#: Elbows and knees; bent by more than this in the mean, degrees, is a pose of bent limbs.
HINGES = dof_index("r_elbow_z", "l_elbow_z", "r_knee_y", "l_knee_y")
BENT_DEG = 45.0


def structured(preset: PosePreset) -> Propose:
    """Structural annealing by the hierarchy of a preset that suits the last pose.

    Parameters
    ----------
    preset : PosePreset
        With `models`.

    Returns
    -------
    callable
        `Propose`; it leaves the particles of all models in the memory.
    """

    def propose(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> Proposal:
        subject = tracked.subject
        data = frame_data(rng, tracked, view, preset, by_part=True)
        hierarchy = suited(preset.models, tracked.state, subject.free)
        n = len(hierarchy.models)
        likelihoods = [_likelihood(tracked, data, hierarchy, level, preset) for level in range(n)]
        if preset.refine is None:
            starts = [*_threads(tracked, n - 1), particles_of(tracked)]
        else:
            starts = [starting_particles(tracked, preset)] * n
        group = np.where(subject.free, hierarchy.group, n)
        limits = subject.body.limits
        variables = Variables(group, first_spread(tracked, preset), limits.low, limits.high, CHAIN_OF_DOF)
        threads, info = structural_step(rng, starts, likelihoods, variables, preset.structural)
        memory = with_particles(threads[-1])
        if preset.refine is None:
            for level, thread in enumerate(threads[:-1]):
                memory |= with_particles(thread, f"_{level}")
        cost = -info.best_log_likelihood if preset.likelihood == "symmetric" else np.nan
        return Proposal(threads[-1].mean, info.best, cost, info.evaluations, memory, structural=info, levels=info.estimates)

    return propose


def suited(hierarchies: Sequence[Inclusive], state: np.ndarray, there: np.ndarray) -> Inclusive:
    """The first of two hierarchies where limbs are mostly straight, the second where they are bent (Canton, section 7.3.2.1).

    Parameters
    ----------
    hierarchies : sequence of Inclusive
        One, or two.
    state : ndarray, shape (37,)
        The last pose.
    there : ndarray of bool, shape (37,)
        Angles of limbs that are there: others say nothing.
    """
    hinges = HINGES[there[HINGES]]
    bent = len(hinges) > 0 and np.degrees(np.abs(state[hinges])).mean() > BENT_DEG
    return hierarchies[-1 if bent else 0]


def _likelihood(tracked: Tracked, data: ScoreData | SymmetricData, hierarchy: Inclusive, level: int, preset: PosePreset) -> LogLikelihood:
    """The log-likelihood of one model."""
    keep = part_mask(hierarchy.models[level].parts)
    every = 1 if level == len(hierarchy.models) - 1 else hierarchy.thinning
    log_likelihood = data.likelihood(tracked.subject, keep, every, by_limb=preset.structural.by_limb)
    if hierarchy.held == "last":
        return log_likelihood
    lacking = hierarchy.group > level
    return lambda states: log_likelihood(np.where(lacking, POSTURE[0], states))


def _threads(tracked: Tracked, n: int) -> list[ParticleState]:
    """The particles of the lower models; where there are none, all start from the last model's."""
    return [particles_of(tracked, f"_{level}" if f"particles_{level}" in tracked.memory else "") for level in range(n)]
