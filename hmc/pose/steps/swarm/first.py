"""The first pose of somebody: from the curves of a reading that is upright, from upright rest poses in the voxels, whichever costs least.

People begin a recording upright, bent or sitting, never on their heads: a reading that says so was misread, and so is a pose. In both kinds
of trial every limb is then looked for anywhere, and the legs are tried exchanged, as what was exchanged once stays so for long.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.body.spin_skeleton import SkeletonModel
from hmc.pose.objectives.curves import Observed, curves_near, observe_curves
from hmc.pose.spectral.reading import BodyReading
from hmc.pose.steps.swarm.fit import PARTS, FitSettings, Fitted, Prior, bounds_around, fine_tune, fit_around, fit_cost, rest_state
from hmc.pose.steps.swarm.heading import spin_towards
from hmc.pose.steps.swarm.lost_limbs import free_limbs

__all__ = ["exchange_legs", "is_upright", "pose_near", "rest_poses"]

#: How far from a rest pose's place the torso is looked for, metres.
REACH_M = 0.3


def is_upright(state: np.ndarray) -> bool:
    """Whether the neck of a state (23,) is above its pelvis."""
    return bool(state[5] > state[2])


def exchange_legs(
    rng: np.random.Generator, model: SkeletonModel, observed: Observed, found: Fitted, settings: FitSettings, prior: Prior | None = None
) -> Fitted:
    """The same with the legs exchanged and everything tuned, where that costs less.

    Exchanged as they are, legs of a stride cost more than before, since the hips are turned the wrong way: `free_limbs` tries only that.

    Parameters
    ----------
    rng, model, observed, settings, prior
        As for `hmc.pose.steps.swarm.fit.fine_tune`.
    found : Fitted
    """
    left, right = [list(free) for free in PARTS[-2:]]
    state = found.state.copy()
    state[left], state[right] = found.state[right], found.state[left]
    trial = fine_tune(rng, model, observed, state, settings, prior)
    before, after = fit_cost(model, np.stack([found.state, trial.state]), observed, prior)
    return replace(trial if after < before else found, evaluations=found.evaluations + trial.evaluations)


def pose_near(
    rng: np.random.Generator,
    model: SkeletonModel,
    reading: BodyReading,
    state: np.ndarray,
    nodes: int,
    farthest_m: float,
    settings: FitSettings,
    prior: Prior,
) -> Fitted:
    """A rough pose made better: every limb is tried anywhere, the legs exchanged, and everything tuned.

    Parameters
    ----------
    rng, model, settings
        As for `hmc.pose.steps.swarm.fit.fine_tune`.
    reading : BodyReading
    state : ndarray, shape (23,)
    nodes : int
        Nodes of a curve that count.
    farthest_m : float
        As for `hmc.pose.objectives.curves.curves_near`.
    prior : Prior
        What is likely where the voxels are too fat to say.

    Returns
    -------
    Fitted
        Its cost is that beside the curves that are near it, so that poses of one frame can be compared.
    """

    def observed(near: np.ndarray) -> Observed:
        return observe_curves(model, curves_near(model, near, reading, farthest_m), nodes, volume=reading.volume)

    freed, more = free_limbs(rng, model, observed(state), state, prior)
    seen = observed(freed)
    found = fine_tune(rng, model, seen, freed, settings, prior)
    found = exchange_legs(rng, model, seen, replace(found, evaluations=found.evaluations + more), settings, prior)
    return replace(found, cost_m=float(fit_cost(model, found.state[None], observed(found.state))[0]))


def rest_poses(
    rng: np.random.Generator,
    model: SkeletonModel,
    reading: BodyReading,
    heading: np.ndarray | None,
    particles: int,
    iterations: int,
    settings: FitSettings,
    last: np.ndarray | None = None,
) -> list[Fitted]:
    """Poses from the voxels alone: bodies at rest below the top of the hull, each way round, every parameter sought by a swarm.

    Parameters
    ----------
    rng, model, settings
        As for `hmc.pose.steps.swarm.fit.fit_around`.
    reading : BodyReading
        With voxels.
    heading : ndarray, shape (2,), or None
        As from `hmc.pose.steps.swarm.heading.heading_of`.
    particles, iterations : int
    last : ndarray, shape (23,), optional
        A known pose: the body at rest is where its torso is, and turned as it is.
    """
    if reading.volume is None:
        return []
    shell = reading.volume.shell
    centre = np.median(shell, axis=0)
    centre[2] = np.quantile(shell[:, 2], 0.99) - model.head - model.torso / 2
    rest = rest_state(model, centre, np.array([0.0, 0.0, 1.0]))
    turns = [0.0, np.pi / 2, np.pi, 3 * np.pi / 2]
    if last is not None:
        rest, turns = rest_state(model, last[:3], last[3:6] - last[:3], last[6]), [0.0]
    elif heading is not None:
        rest[6], turns = spin_towards(rest, heading), [0.0, np.pi]
    observed = observe_curves(model, {}, volume=reading.volume)
    fits = []
    for turn in turns:
        start = rest.copy()
        start[6] += turn
        low, high = bounds_around(model, start, REACH_M, np.pi / 2)
        fits.append(fit_around(rng, model, observed, start[None], low, high, settings, particles, iterations))
    return fits
