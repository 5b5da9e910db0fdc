"""Track death: without support for too long, in another's place, unlike a person, or with a filter that hardly finds anything.

Canton (2009), section 4.2.3. Shown by `tests/tracking/test_tracking_deletion.py`; two tracks in one place by
`test_the_younger_of_two_tracks_in_one_place_ends`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.tracking.likeness import horizontal_distance, is_established
from hmc.tracking.settings import FollowingSettings, LifecycleSettings
from hmc.tracking.state import Track
from hmc.tracking.update import FrameUpdate

__all__ = ["FORGIVEN", "TrackVerdict", "at_edge", "delete_tracks", "judge_track"]

#: A verdict for a person makes up for so many against.
FORGIVEN = 2


@dataclass(frozen=True)
class TrackVerdict:
    """What a frame says of a track; None: nothing.

    Attributes
    ----------
    like_person : bool or None
        Whether its voxels looked like a person.
    like_object : bool
        Whether they looked like a chair or the like.
    efficiency : float or None
        Share of its filter's particles that survive, in [0, 1].
    """

    like_person: bool | None = None
    like_object: bool = False
    efficiency: float | None = None


def delete_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the tracks that stay, by person, those that begin among them."""
    verdicts = [*(_verdict(update, k) for k in range(len(update.tracks))), *(TrackVerdict() for _ in update.born)]
    limits, fps = settings.lifecycle, update.state.fps
    kept: list[Track] = []
    for track, verdict in zip((*update.tracks, *update.born), verdicts, strict=True):
        if update.frame - track.last_frame > limits.patience_s * fps:
            continue
        judged = judge_track(track, verdict, kept, fps, limits)
        if judged is not None:
            kept.append(judged)
    alive = {track.person for track in kept}
    return replace(update, tracks=tuple(kept), ended=tuple(track for track in update.tracks if track.person not in alive))


def judge_track(track: Track, verdict: TrackVerdict, older: list[Track], fps: float, limits: LifecycleSettings) -> Track | None:
    """The track with its counts of bad frames, or None where one of them is over its limit.

    Parameters
    ----------
    track : Track
    verdict : TrackVerdict
    older : list of Track
        Those that stay.
    fps : float
    limits : LifecycleSettings
    """
    near = any(horizontal_distance(track.position, other.position) < limits.same_place_m for other in older)
    unlike, liked, inefficient = track.unlike, track.liked, track.inefficient
    if verdict.like_person is not None:
        unlike, liked = max(unlike - FORGIVEN, 0) if verdict.like_person else unlike + 1, liked + verdict.like_person
    if is_established(track, fps, limits):
        unlike = min(unlike, int(limits.unlike_s * fps))
    if verdict.efficiency is not None:
        inefficient = inefficient + 1 if verdict.efficiency < limits.least_efficiency else 0
    rests = verdict.like_object and horizontal_distance(track.position, track.rest) <= limits.still_m
    still, rest = (track.still + 1, track.rest) if rests else (0, track.position)
    counts = (track.crowded + 1 if near else 0, unlike, inefficient, still)
    most = (limits.same_place_s, limits.unlike_s, limits.efficiency_s, limits.still_s)
    if any(count > limit * fps for count, limit in zip(counts, most, strict=True)):
        return None
    return replace(track, crowded=counts[0], unlike=unlike, liked=liked, inefficient=inefficient, still=still, rest=rest)


def at_edge(position: np.ndarray, room: np.ndarray, settings: LifecycleSettings) -> bool:
    """Whether a place, shape (3,), is at the edge of the room, whose corners have shape (2, 3), or outside."""
    return not np.all((position > room[0] + settings.edge_m)[:2] & (position < room[1] - settings.edge_m)[:2])


def _verdict(update: FrameUpdate, k: int) -> TrackVerdict:
    """Of track k: where nothing is seen there is nothing to judge, nor where the voxels are the object's that the person left."""
    measurement, working = update.measurement, update.estimate.efficiency
    seen = bool(measurement.supported[k])
    left = update.tracks[k].person in update.handed_over
    return TrackVerdict(
        bool(measurement.like_person[k]) if seen and not left else None,
        seen and bool(measurement.like_object[k]),
        float(working[k]) if len(working) else None,
    )
