"""Detections in the tolerant hull alone beside people whom all cameras see: all cameras see the person who pushes
furniture, and the tolerant hull makes what looks like a person of the furniture.

Shown by `test_what_one_camera_does_not_see_is_no_newcomer_beside_somebody_whom_all_see` and the recipe `meeting_unseen`, where
false positives go from 4 to 21 without it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.settings import FollowingSettings
from hmc.tracking.update import FrameUpdate

__all__ = ["reject_unsolid"]

#: So near, seen from above, is a person who pushes a chair; metres.
BESIDE_M = 1.5


def reject_unsolid(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update without detections that lack strict hull beside people who have it."""
    observation, tracks = update.observation, update.state.tracks
    owners = np.where(observation.certain, update.claimed, -1)
    least = settings.lifecycle.least_volume_m3 / observation.voxel_size_m**3
    counts = np.bincount(owners[owners >= 0], minlength=len(tracks))
    solid = np.array([track.position for track, count in zip(tracks, counts, strict=True) if count >= least]).reshape(-1, 3)

    def alone(rows: np.ndarray) -> bool:
        return not np.any(np.hypot(*(solid - observation.points[rows].mean(axis=0))[:, :2].T) <= BESIDE_M)

    kept = (rows for rows in update.detections if observation.certain[rows].sum() >= least or alone(rows))
    return replace(update, detections=tuple(kept))
