"""Handover: where a person gets up from an object that the track stays with, the number goes with the person.

Only established tracks are given on, and a person who comes in at the edge of the room is not taken for one. Shown by
`test_who_gets_up_from_a_chair_that_stays_keeps_the_number_and_the_chair_is_nobody` and
`test_a_newcomer_does_not_take_the_number_of_somebody_who_sits_low`.
"""

from __future__ import annotations

from dataclasses import replace

from hmc.tracking.likeness import horizontal_distance, is_established
from hmc.tracking.rules.death import at_edge
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import PersonMemory, Track, TrackRow
from hmc.tracking.update import FrameUpdate

__all__ = ["hand_over_tracks"]

#: A person who gets up from an object is first seen apart from it within this distance, metres.
APART_M = 1.5
#: And until the track begins comes no nearer to it than by this, metres: a person who walks up to it does.
NEARER_M = 0.15
#: The centroid of what is left when a person gets up is no higher than this, metres.
LOW_M = 0.5


def hand_over_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update in which older tracks go on with the persons born beside the objects that they stayed with."""
    rows, born = update.born_rows, []
    heirs: dict[int, Track] = {}
    for new in update.born:
        old = _predecessor(update, new, settings, tuple(heirs))
        if old is None:
            born.append(new)
        else:
            heirs[old.person] = replace(new, person=old.person, first_frame=old.first_frame, liked=old.liked)
            rows = _given_on(rows, new, old)
    objects = tuple(TrackRow(update.frame, one.person, one.position, one.head) for one in update.tracks if one.person in heirs)
    return replace(
        update,
        tracks=tuple(heirs.get(track.person, track) for track in update.tracks),
        memories=tuple(PersonMemory(one.person, histogram=one.histogram) if one.person in heirs else one for one in update.memories),
        born=tuple(born),
        born_rows=rows,
        handed_over=tuple(heirs),
        false_tracks=update.false_tracks + objects,
    )


def _predecessor(update: FrameUpdate, new: Track, settings: FollowingSettings, taken: tuple[int, ...]) -> Track | None:
    """The nearest established track that does not look like a person, or is low, from which the new one came away."""
    first = next(row.position for row in update.born_rows if row.person == new.person)
    if at_edge(first, update.observation.room, settings.lifecycle):
        return None
    left = [
        track
        for track in update.tracks
        if (track.unlike > 0 or track.position[2] <= LOW_M)
        and is_established(track, update.state.fps, settings.lifecycle)
        and track.person not in taken
        and horizontal_distance(new.position, track.position) >= horizontal_distance(first, track.position) - NEARER_M
    ]
    old = min(left, key=lambda track: horizontal_distance(first, track.position), default=None)
    return old if old is not None and horizontal_distance(first, old.position) <= APART_M else None


def _given_on(rows: tuple[TrackRow, ...], new: Track, old: Track) -> tuple[TrackRow, ...]:
    """The rows of those born, in which the new track's are the old one's where that one's were withheld, and what was withheld before."""
    frames = {row.frame for row in old.withheld}
    before = (row for row in old.withheld if row.frame < new.first_frame)
    moved = (replace(row, person=old.person) for row in rows if row.person == new.person and row.frame in frames)
    return (*(row for row in rows if row.person != new.person), *before, *moved)
