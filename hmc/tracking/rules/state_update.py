"""The update of each track by its measurement: position, velocity and volume, and which rows are told.

Among others a person is at their own column's body: `test_two_who_walk_arm_in_arm_are_at_their_columns_where_the_filter_is_behind`, and at
no body of two: `test_two_who_come_together_in_one_column_are_not_both_at_its_middle`. The
gain in a shared component is shown by the recipe `meeting_unseen`, where the naive tracker exchanges 3 identities without it and 1 with it;
withheld rows by `test_where_a_thing_was_taken_for_a_person_nothing_begins_while_it_stands_there`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.tracking.association import head_centre
from hmc.tracking.columns import TRUNK_M, bodies_at
from hmc.tracking.likeness import is_established
from hmc.tracking.rules.death import FORGIVEN
from hmc.tracking.rules.upright import MATCH_M
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import PersonMemory, Track, TrackRow, coasted
from hmc.tracking.update import FrameUpdate

__all__ = ["update_tracks"]


@dataclass(frozen=True)
class _Correction:
    """What one track is corrected by: a measured position, how much of it is believed, and whether the filter knows the person."""

    measured: np.ndarray
    gain: float
    known: bool


def update_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the tracks after their measurements, and their rows."""
    tracks, rows = [], []
    corrections = _corrections(update, settings)
    for k, track in enumerate(update.state.tracks):
        if update.measurement.supported[k]:
            track, told = _measured(update, k, corrections[k], settings)
            tracks.append(track)
            rows += told
        else:
            tracks.append(replace(coasted(track, update.state.fps), position=update.predicted[k]))
    memories = tuple(
        memory if correction.known else PersonMemory(memory.person, histogram=memory.histogram)
        for memory, correction in zip(update.memories, corrections, strict=True)
    )
    return replace(update, tracks=tuple(tracks), rows=tuple(rows), memories=memories)


def _corrections(update: FrameUpdate, settings: FollowingSettings) -> list[_Correction]:
    """The body at the column of who shares voxels, where it is near; else the filter's, where it knows them; else the centroid.

    Of one whose column is elsewhere the filter knows nothing.
    """
    columns = _of_tracks(update, update.columns.centres)
    known = update.estimate.seen & ~(np.hypot(*(update.estimate.positions[:, :2] - columns).T) > MATCH_M)
    measured = np.where(known[:, None], update.estimate.positions, update.measurement.located.centroid)
    gain = np.where(update.shared, np.where(known, settings.filter_gain, settings.shared_gain), 1.0)
    bodies = _of_tracks(update, _bodies(update))
    sure = update.shared & (np.hypot(*(bodies - update.predicted)[:, :2].T) <= TRUNK_M)
    measured, gain = np.where(sure[:, None], bodies, measured), np.where(sure, 1.0, gain)
    return [_Correction(*one) for one in zip(measured, gain, known.tolist(), strict=True)]


def _bodies(update: FrameUpdate) -> np.ndarray:
    """The body at each column, shape (m, 3). Of two who embrace there may be one column: voxels nearer to who has none are not its."""
    without = update.predicted[update.matched < 0, :2]
    return bodies_at(update.observation, np.concatenate([update.columns.centres, without]))[: len(update.columns)]


def _of_tracks(update: FrameUpdate, places: np.ndarray) -> np.ndarray:
    """The place of each track's column; nan for who has none."""
    return np.append(places, np.full((1, places.shape[1]), np.nan), axis=0)[update.matched]


def _measured(update: FrameUpdate, k: int, correction: _Correction, settings: FollowingSettings) -> tuple[Track, list[TrackRow]]:
    """Track k after its measurement, and the rows that are told of it."""
    track, predicted, fps = update.state.tracks[k], update.predicted[k], update.state.fps
    head = head_centre(update.observation.points[update.measurement.locating & (update.owners == k)])
    moved = predicted + correction.gain * (correction.measured - predicted)
    row = TrackRow(update.frame, track.person, correction.measured if correction.gain == 1 or not correction.known else moved, head)
    held = (*track.withheld, row)
    told = (update.measurement.like_person[k] and track.unlike <= FORGIVEN) or (
        is_established(track, fps, settings.lifecycle) and len(held) >= settings.lifecycle.unlike_s * fps
    )
    velocity, volume = _motion(update, k, moved, correction.gain, settings)
    body = _body(update, k, settings)
    track = replace(track, position=moved, head=head, velocity=velocity, volume_m3=volume, body_m3=body, last_frame=update.frame)
    if not told:
        return replace(track, withheld=held), []
    return replace(track, withheld=()), [replace(one, person=track.person) for one in held]


def _motion(update: FrameUpdate, k: int, position: np.ndarray, gain: float, settings: FollowingSettings) -> tuple[np.ndarray, float]:
    """Smoothed velocity and volume; what is measured with little gain changes them little."""
    track, fps = update.state.tracks[k], update.state.fps
    blend = gain * _smoothing(fps, settings)
    velocity = track.velocity + blend * ((position - track.position) * fps - track.velocity)
    volume = float(update.measurement.owned.volume_m3[k])
    if track.volume_m3 > 0:
        volume = track.volume_m3 if update.shared[k] else track.volume_m3 + blend * (min(volume, 2 * track.volume_m3) - track.volume_m3)
    return velocity, volume


def _body(update: FrameUpdate, k: int, settings: FollowingSettings) -> float:
    """Smoothed volume of the strict hull while it looks like a person who stands apart."""
    before, measurement = update.state.tracks[k].body_m3, update.measurement
    if update.shared[k] or measurement.same_body[k] or not measurement.like_person[k]:
        return before
    volume = float(measurement.certain.volume_m3[k])
    return before + _smoothing(update.state.fps, settings) * (volume - before) if before > 0 else volume


def _smoothing(fps: float, settings: FollowingSettings) -> float:
    """Share of what is new in a frame that smoothed values take."""
    return float(1 - np.exp(-1 / (fps * settings.velocity_time_s)))
