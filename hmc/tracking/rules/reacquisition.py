"""Track loss and reacquisition: a track without support takes the nearest free person-like set, if the person can have come so far.

Shown by `test_a_gap_is_filled_on_a_straight_line`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.likeness import horizontal_distance, looks_like_person
from hmc.tracking.newcomers import unowned_blobs
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.update import FrameUpdate

__all__ = ["reacquire_tracks"]


def reacquire_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update in which lost tracks own what their persons are seen as elsewhere."""
    observation, tracks = update.observation, update.state.tracks
    held = np.bincount(update.owners[update.owners >= 0], minlength=len(tracks)) * observation.voxel_size_m**3
    lost = np.flatnonzero(held < settings.lifecycle.keep_volume_m3)
    if lost.size == 0:
        return update
    owners, reacquired = update.owners.copy(), np.zeros(len(tracks), bool)
    labels, blobs = unowned_blobs(observation, owners, settings.lifecycle)
    free = list(np.flatnonzero(looks_like_person(blobs, settings.lifecycle)))
    for k in lost:
        way = settings.most_speed_m_s * (update.frame - tracks[k].last_frame) / update.state.fps
        reach = min(settings.lifecycle.least_distance_m + way, settings.most_reach_m)
        gaps = [horizontal_distance(blobs.centroid[b], tracks[k].position) for b in free]
        if gaps and min(gaps) <= reach:
            owners[labels == free.pop(int(np.argmin(gaps)))] = k
            reacquired[k] = True
    return replace(update, owners=owners, reacquired=reacquired)
