"""The naive tracker: each person is at the centroid of the voxels in the region of influence around where they should be.

Source: Canton (2009), section 4.3.1, Eq. 4.4-4.7, which the preset `canton2009` follows (`hmc.tracking.rules.printed`). By default three
points differ. The region is placed at the position predicted from the smoothed velocity instead of the last one. Voxels in the regions of
several persons go to the nearest, where Eq. 4.7 takes them from all. And once the region has told which component a person is, the whole
component within reach counts, not the part inside the ellipsoid only, so that stretched arms are in the centroid.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.tracking.blobs import Observation
from hmc.tracking.following import advance
from hmc.tracking.method import TrackerMethod
from hmc.tracking.settings import ALIKE, CANTON_2009, FollowingSettings
from hmc.tracking.state import TrackerInfo, TrackerState

__all__ = ["METHOD", "NaiveSettings", "step"]


@dataclass(frozen=True)
class NaiveSettings:
    """The naive tracker has no parameters beyond those that every tracker has."""

    following: FollowingSettings = field(default_factory=FollowingSettings)


def step(
    rng: np.random.Generator, state: TrackerState, frame: int, observation: Observation | None, settings: NaiveSettings
) -> tuple[TrackerState, TrackerInfo]:
    """The state after a frame, and what was found in it; no random numbers are drawn."""
    return advance(state, frame, observation, settings.following)


METHOD = TrackerMethod(
    name="naive",
    source="Canton (2009), section 4.3.1",
    summary="the centroid of the voxels near each person",
    step=step,
    presets={"default": NaiveSettings(), "canton2009": NaiveSettings(CANTON_2009), "alike": NaiveSettings(ALIKE)},
)
