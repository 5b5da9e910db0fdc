"""A control: no search from frame to frame. The last pose with half its change is refined; all else is as the other methods have it.

hmc pose RECORDING --plugin docs/no_search.py --method no-search --out DIR
"""

from dataclasses import replace

import hmc
from hmc.pose.steps.polish import polished
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.proposal import Proposal

HOUSE = PRESETS["default"]


def propose(rng, tracked, view):
    """Where the person would be who goes on half as fast."""
    expected = tracked.state + 0.5 * tracked.velocity
    return Proposal(expected, expected)


method = replace(hmc.pose_method("apf"), name="no-search", source="docs", step=polished(propose, HOUSE.polish), settings=HOUSE)
hmc.register_method(method, "the last pose, refined")
