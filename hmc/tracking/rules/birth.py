"""Track birth: detections that were seen in enough frames become persons, from the first frame in which each was seen.

Canton (2009), Figure 4.1 and section 4.2.3. Shown by all tests of the trackers.
"""

from __future__ import annotations

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
    """The update with the persons who begin in this frame."""
    fps, limits = update.state.fps, settings.lifecycle
    beside = {id(one): _is_beside(one, update.tracks, limits) for one in update.candidates}
    sure = tuple(one for one in update.candidates if not beside[id(one)] or len(one.rows) >= limits.confirm_beside_s * fps)
    room = len(sure) if update.state.most is None else max(0, update.state.most - len(update.tracks))
    sure = tuple(sorted(sure, key=lambda one: -len(one.rows)))[:room]
    candidates, born, rows = confirm(sure, update.state.next_person, fps, limits)
    candidates += tuple(one for one in update.candidates if not any(one is other for other in sure))
    return replace(update, candidates=candidates, born=born, born_rows=tuple(rows), next_person=update.state.next_person + len(born))


def confirm(
    candidates: tuple[Candidate, ...], next_person: int, fps: float, settings: LifecycleSettings
) -> tuple[tuple[Candidate, ...], tuple[Track, ...], list[TrackRow]]:
    """Persons made of the candidates that were seen in enough frames.

    Returns
    -------
    candidates : tuple of Candidate
        The others.
    tracks : tuple of Track
        New ones, numbered from `next_person`.
    rows : list of TrackRow
        Their positions from the first frame in which each was seen.
    """
    needed = max(settings.confirm_frames, round(settings.confirm_s * fps))
    left: list[Candidate] = []
    tracks: list[Track] = []
    rows: list[TrackRow] = []
    for candidate in candidates:
        if len(candidate.rows) < needed:
            left.append(candidate)
            continue
        person = next_person + len(tracks)
        first, last = candidate.rows[0], candidate.rows[-1]
        tracks.append(Track(person, last.position, last.head, candidate.velocity * fps, 0.0, first.frame, last.frame))
        rows += [replace(row, person=person) for row in candidate.rows]
    return tuple(left), tuple(tracks), rows


def _is_beside(candidate: Candidate, tracks: tuple[Track, ...], limits: LifecycleSettings) -> bool:
    """Whether a candidate is so near to a track that arms, and silhouettes that meet, may be taken for a person."""
    return any(horizontal_distance(candidate.rows[-1].position, track.position) < limits.beside_m for track in tracks)


def _expected(candidate: Candidate, frame: int) -> np.ndarray:
    last = candidate.rows[-1]
    return last.position + candidate.velocity * (frame - last.frame)
