"""Track birth: detections that were seen in enough frames become persons, from the first frame in which each was seen.

Canton (2009), Figure 4.1 and section 4.2.3. Shown by all tests of the trackers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmc.tracking.association import head_centre, locating_voxels
from hmc.tracking.likeness import horizontal_distance
from hmc.tracking.settings import FollowingSettings, LifecycleSettings
from hmc.tracking.state import Candidate, Track, TrackRow
from hmc.tracking.update import FrameUpdate

__all__ = ["confirm", "confirm_candidates", "locate_births", "propose_candidates"]


def locate_births(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with a row for each detection, and for each upright person who has no track."""
    observation = update.observation
    sets = (*update.detections, *update.newcomers)
    owners = np.full(len(observation.points), -1)
    for j, voxels in enumerate(sets):
        owners[voxels] = j
    best = locating_voxels(observation, owners, len(sets), settings)
    located = [observation.points[best & (owners == j)] for j in range(len(sets))]
    rows = tuple(TrackRow(update.frame, -1, points.mean(axis=0), head_centre(points)) for points in located)
    n = len(update.detections)
    return replace(update, births=rows[:n], upright_births=rows[n:])


def propose_candidates(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update whose candidates are carried on with what was seen in this frame, nearest pairs first, and new ones begun.

    Nothing nearer to a track than `least_distance_m` is a candidate, except upright people beside whom the track has a column of its
    own. Candidates missed more often than seen are gone.
    """
    least = settings.lifecycle.least_distance_m
    births = [row for row in update.births if all(horizontal_distance(row.position, track.position) >= least for track in update.tracks)]
    births += update.upright_births
    pairs = sorted(
        (distance, c, s)
        for c, candidate in enumerate(update.candidates)
        for s, row in enumerate(births)
        if (distance := horizontal_distance(row.position, _expected(candidate, row.frame))) <= 2 * least
    )
    match: dict[int, int] = {}
    for _, c, s in pairs:
        if c not in match and s not in match.values():
            match[c] = s
    kept = [
        replace(candidate, rows=(*candidate.rows, births[match[c]])) if c in match else replace(candidate, missed=candidate.missed + 1)
        for c, candidate in enumerate(update.candidates)
    ]
    fresh = [Candidate((row,)) for s, row in enumerate(births) if s not in match.values()]
    return replace(update, candidates=(*(one for one in kept if one.missed <= len(one.rows)), *fresh))


def confirm_candidates(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the persons who begin in this frame: those seen longest first, and no more than there are."""
    state, limits = update.state, settings.lifecycle
    ready = [one for one in update.candidates if len(one.rows) >= _frames_needed(one, update.tracks, state.fps, limits)]
    ready = sorted(ready, key=lambda one: -len(one.rows))
    if state.most is not None:
        ready = ready[: max(0, state.most - len(update.tracks))]
    born, rows = confirm(ready, state.next_person, state.fps)
    begun = {id(one) for one in ready}
    return replace(
        update,
        candidates=tuple(one for one in update.candidates if id(one) not in begun),
        born=born,
        born_rows=rows,
        next_person=state.next_person + len(born),
    )


def confirm(candidates: Sequence[Candidate], next_person: int, fps: float) -> tuple[tuple[Track, ...], tuple[TrackRow, ...]]:
    """The persons that candidates become, numbered from `next_person`, and their positions from the first frame in which each was seen."""
    tracks: list[Track] = []
    rows: list[TrackRow] = []
    for person, candidate in enumerate(candidates, next_person):
        first, last = candidate.rows[0], candidate.rows[-1]
        tracks.append(Track(person, last.position, last.head, candidate.velocity * fps, 0.0, first.frame, last.frame))
        rows += [replace(row, person=person) for row in candidate.rows]
    return tuple(tracks), tuple(rows)


def _frames_needed(candidate: Candidate, tracks: tuple[Track, ...], fps: float, limits: LifecycleSettings) -> float:
    """Frames in which a candidate must be seen: more beside a track, where arms, and silhouettes that meet, may be taken for a person."""
    beside = any(horizontal_distance(candidate.rows[-1].position, track.position) < limits.beside_m for track in tracks)
    return max(limits.confirm_frames, round(limits.confirm_s * fps), limits.confirm_beside_s * fps if beside else 0)


def _expected(candidate: Candidate, frame: int) -> np.ndarray:
    last = candidate.rows[-1]
    return last.position + candidate.velocity * (frame - last.frame)
