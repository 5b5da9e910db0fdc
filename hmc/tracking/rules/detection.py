"""Detection of people whom no track owns: person-like sets of voxels.

Canton (2009), section 4.2.3. Shown by all tests of the trackers; that fragments which stand close are judged together by
`test_noise_ghosts_and_furniture_are_nobody`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.newcomers import newcomers
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.update import FrameUpdate

#: What is no further than this from an upright person, seen from above, is no other who is not: arms and steps reach so far. Metres.
ARMS_M = 0.6

__all__ = ["detect_people", "owned_voxels"]


def detect_people(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the detections."""
    owners = np.where(owned_voxels(update), 0, -1)
    return replace(update, detections=tuple(newcomers(update.observation, owners, settings.lifecycle)))


def owned_voxels(update: FrameUpdate) -> np.ndarray:
    """Voxels that are of no detection, shape (n,) bool: those of the tracks, of what their persons push, of upright newcomers."""
    held = update.claimed >= 0
    places = np.delete(update.columns.centres, update.matched[update.matched >= 0], axis=0)
    for place in places:
        held |= np.hypot(*(update.observation.points[:, :2] - place).T) <= ARMS_M
    return held
