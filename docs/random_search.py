"""A pose method of one's own in one file: random search about the last pose, then the house's refinement.

    hmc pose data/synthetic/tiny --plugin docs/random_search.py --method random-search --out out/random
    python -m hmc.experiments run all-methods --quick --plugin docs/random_search.py

It has the start, the recovery and the telling of the legs that the other methods have.
"""

from dataclasses import replace

import numpy as np

import hmc
from hmc.pose.steps.polish import fine_objective, polished
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.proposal import Proposal

HOUSE = PRESETS["default"]
DRAWS, SPREADS = 60, (0.1, 0.05, 0.025)


def propose(rng, tracked, view):
    """Draw poses about the best so far, closer every time; metres and radians alike."""
    objective, limits = fine_objective(rng, tracked.subject, view, HOUSE.polish), tracked.subject.body.limits
    best = tracked.state
    for spread in SPREADS:
        drawn = best + spread * rng.standard_normal((DRAWS, len(best)))
        states = np.concatenate([best[None], np.clip(drawn, limits.low, limits.high)])
        costs = objective.cost(states)
        best = states[costs.argmin()]
    return Proposal(best, best, float(costs.min()), len(SPREADS) * (DRAWS + 1))


settings = {"draws": DRAWS, "spreads": list(SPREADS), "house": HOUSE}
method = replace(hmc.pose_method("apf"), name="random-search", source="docs", step=polished(propose, HOUSE.polish), settings=settings)
hmc.register_method(method, "random search about the last pose")
