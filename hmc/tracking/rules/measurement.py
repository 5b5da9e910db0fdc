"""What the owned voxels say of each track, and which tracks they keep alive.

Canton (2009), section 4.3.1. Shown by all tests of the trackers; that a remnant does not keep a track
alive by the recipe `meeting_unseen` (false positives 5 to 6).
"""

from __future__ import annotations

from dataclasses import replace
from time import thread_time

import numpy as np

from hmc.tracking.association import locating_voxels
from hmc.tracking.blobs import Blobs, blob_features
from hmc.tracking.likeness import looks_like_object, looks_like_person
from hmc.tracking.settings import FollowingSettings, LifecycleSettings
from hmc.tracking.state import TrackerState
from hmc.tracking.update import FrameUpdate, Measurement

__all__ = ["measure_tracks"]


def measure_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the measurement."""
    observation, owners, n = update.observation, update.owners, len(update.state.tracks)
    locating = locating_voxels(observation, owners, n, settings)

    def features(voxels: np.ndarray) -> Blobs:
        return blob_features(observation.points, np.where(voxels, owners, -1), n, observation.voxel_size_m)

    owned, located = features(owners >= 0), features(locating)
    filter_s = update.filter_s if update.filter else thread_time() - update.begun_s
    certain = features(observation.certain)
    upright = update.matched >= 0
    look = looks_like_person(owned, settings.lifecycle) | upright
    same = ~look & _same_body(owned, certain, update.shared, update.state, settings.lifecycle)
    like = look | same
    supported = upright | _supports(owned, certain, like, update.state, settings.lifecycle)
    things = looks_like_object(owned, settings.lifecycle)
    measurement = Measurement(locating, owned, located, certain, supported, like, things, same)
    return replace(update, measurement=measurement, filter_s=filter_s)


def _same_body(owned: Blobs, certain: Blobs, shared: np.ndarray, state: TrackerState, settings: LifecycleSettings) -> np.ndarray:
    """Which tracks own as much of the strict hull as when they looked like a person, shape (k,) bool.

    Who goes down on the floor keeps the volume, whatever the shape; who gets up from a chair leaves less there.
    """
    before = np.array([track.body_m3 for track in state.tracks])
    known = np.array([track.liked >= settings.known_s * state.fps for track in state.tracks], bool) & (before > 0)
    least, most = settings.same_body
    within = (certain.volume_m3 >= least * before) & (certain.volume_m3 <= most * before) & (owned.volume_m3 <= settings.most_volume_m3)
    return known & ~shared & within


def _supports(owned: Blobs, certain: Blobs, like: np.ndarray, state: TrackerState, settings: LifecycleSettings) -> np.ndarray:
    """Which tracks the voxels that they own keep alive, shape (k,) bool.

    Enough of the strict hull does, or a set that looks like a person as a whole (whom one camera cannot see), but not a remnant of what
    the track was: remnants stay behind where a person leaves the room.
    """
    usual = np.array([track.volume_m3 for track in state.tracks])
    return ((certain.volume_m3 >= settings.keep_volume_m3) | like) & (owned.volume_m3 >= settings.keep_share * usual)
