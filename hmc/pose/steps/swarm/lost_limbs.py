"""Limbs that were lost, or exchanged: a swarm that looks near the last pose does not find them."""

from __future__ import annotations

import numpy as np

from hmc.body.spin_skeleton import SkeletonModel, part_chains, segment_ends
from hmc.pose.objectives.curves import Observed, pair_errors, skeleton_error
from hmc.pose.steps.swarm.fit import PARTS, Prior, fit_cost
from hmc.search.swarm import PsoSettings, pso_run

__all__ = ["free_limbs"]

#: Places of each limb, anywhere within its limits, that are tried in every frame.
LIMB_TRIALS = 15
#: A limb that is farther than this from its curve is led to it, metres.
LOST_LIMB_M = 0.1


def free_limbs(
    rng: np.random.Generator, model: SkeletonModel, observed: Observed, state: np.ndarray, prior: Prior | None = None
) -> tuple[np.ndarray, int]:
    """Try every limb anywhere within its limits, whatever it did before, and the legs exchanged: what is lost is not found nearby.

    Parameters
    ----------
    rng, model, observed, state, prior
        As for `fine_tune`.

    Returns
    -------
    state : ndarray, shape (23,)
        The given one or a better one.
    evaluations : int
    """
    limbs = PARTS[2:]
    exchanged = state.copy()
    left, right = [list(free) for free in PARTS[-2:]]
    exchanged[left], exchanged[right] = state[right], state[left]
    tried, evaluations = [state[None], exchanged[None]], 0
    errors = pair_errors(part_chains(*segment_ends(model, state[None])), observed)
    assigned = observed.choices[int(skeleton_error(model, state[None], observed)[1][0])]
    for k, free in enumerate(limbs):
        angles = np.array(free) - 7
        states = np.repeat(state[None], LIMB_TRIALS, axis=0)
        states[:, free] = rng.uniform(model.low[angles], model.high[angles], (LIMB_TRIALS, len(free)))
        own = [pair for pair in assigned if observed.pairs[pair, 1] == k + 2]
        if own and errors[0, own[0]] > LOST_LIMB_M:
            # The limb's own curve leads it home.
            def off_curve(values: np.ndarray, free=free, pair=own[0]) -> np.ndarray:
                moved = np.repeat(state[None], len(values), axis=0)
                moved[:, free] = values
                return pair_errors(part_chains(*segment_ends(model, moved)), observed)[:, pair]

            found = pso_run(rng, off_curve, model.low[angles], model.high[angles], PsoSettings(LIMB_TRIALS, 10), states[:, free])
            states[0, free] = found.leader
            evaluations += found.evaluations
        tried.append(states)
    states = np.concatenate(tried)
    costs = fit_cost(model, states, observed, prior)
    evaluations += len(costs)
    best = state.copy()
    for k, free in enumerate(limbs):
        first = 2 + k * LIMB_TRIALS
        one = first + int(costs[first : first + LIMB_TRIALS].argmin())
        if costs[one] < costs[0]:
            best[list(free)] = states[one, list(free)]
    # Each limb for itself may be better so, and all of them together not.
    together = fit_cost(model, best[None], observed, prior)[0]
    return (best if together <= costs.min() else states[costs.argmin()]), evaluations + 1
