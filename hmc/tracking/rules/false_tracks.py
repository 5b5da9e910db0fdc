"""False tracks: where a static object was tracked as a person, no track begins as long as it stands there.

Beyond Canton (2009), whose tracker deletes such a track (section 4.2.3) and may begin it again in the next frame. Shown by
`test_where_a_thing_was_taken_for_a_person_nothing_begins_while_it_stands_there`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.likeness import horizontal_distance
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import TrackRow
from hmc.tracking.update import FrameUpdate

__all__ = ["reject_false_tracks", "remember_false_tracks"]

#: A person who stands where an object was tracked has the head so much higher, metres.
STANDS_HIGHER_M = 0.2


def reject_false_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update without births where an object was tracked; a person who stands there is higher."""

    def is_object(row: TrackRow, one: TrackRow) -> bool:
        near = horizontal_distance(row.position, one.position) <= settings.lifecycle.least_distance_m
        return bool(near and row.head[2] <= one.head[2] + STANDS_HIGHER_M)

    births = (row for row in update.births if not any(is_object(row, one) for one in update.state.false_tracks))
    return replace(update, births=tuple(births))


def remember_false_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the last rows of tracks that ended because they did not look like a person, while something is there."""
    free = update.observation.points[update.owners < 0]
    near, limit = settings.lifecycle.least_distance_m, settings.lifecycle.unlike_s * update.state.fps - 1
    there = (one for one in update.false_tracks if np.any(np.hypot(*(free - one.position)[:, :2].T) < near))
    ended = (track.withheld[-1] for track in update.ended if track.unlike >= limit and track.withheld)
    return replace(update, false_tracks=(*there, *ended))
