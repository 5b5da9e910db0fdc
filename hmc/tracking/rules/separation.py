"""Two people in one set of voxels are separated: in a track that began with both, and among those whom no track owns.

Beyond Canton (2009), whose tracker makes one track of them until they part. Shown by
`test_who_came_in_behind_another_is_let_go_when_seen` and `test_two_who_hold_each_other_from_the_first_frame_are_two`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.newcomers import one_or_two
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.update import FrameUpdate

__all__ = ["separate_detections", "separate_tracks"]


def separate_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update in which no track holds a second person beside its own; one whose component has another owner may hold its head."""
    observation, owners, parted = update.observation, update.owners.copy(), {}
    certain = owners[observation.certain & (owners >= 0)]
    sure = np.bincount(certain, minlength=len(update.predicted)) * observation.voxel_size_m**3
    for k in np.flatnonzero((sure > settings.lifecycle.least_joined_m3) & ~update.shared):
        parts = one_or_two(observation, np.flatnonzero(owners == k), settings.lifecycle)
        if len(parts) > 1:
            away = [np.hypot(*(observation.points[rows].mean(axis=0) - update.predicted[k])[:2]) for rows in parts]
            parted[int(k)] = parts[int(np.argmax(away))]
            owners[parted[int(k)]] = -1
    return replace(update, owners=owners, parted=parted)


def separate_detections(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with one person in each detection. After ghosts are out: of two who hold each other, one may hide the other in most
    views.
    """
    parts = [part for rows in update.detections for part in one_or_two(update.observation, rows, settings.lifecycle)]
    return replace(update, detections=tuple(parts))
