"""From the rows of a tracker to the table of tracks, and what belongs to each person in a frame of that table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from hmc.io.results import TrackTable
from hmc.tracking.association import assign_voxels
from hmc.tracking.blobs import Observation
from hmc.tracking.following import finish, init, original_number
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import TrackRow
from hmc.tracking.trackers import Tracker, make_tracker

__all__ = ["fill_gaps", "frame_rng", "from_rows", "person_voxels", "run", "table_of", "velocities"]


def run(
    observations: Iterable[tuple[int, Observation | None]],
    fps: float,
    tracker: Tracker | None = None,
    seed: int = 0,
    gap_s: float = 1.0,
    most: int | None = None,
) -> TrackTable:
    """The tracks of all persons in a recording.

    Parameters
    ----------
    observations : iterable of (int, Observation or None)
        Frame number and what was seen (`hmc.tracking.blobs.observe`); None where the frame tells nothing.
    fps : float
    tracker : Tracker, optional
        By default as `hmc.tracking.trackers.make_tracker`.
    seed : int
        Of the random numbers.
    gap_s : float
        Gaps of a track up to this long are filled in.
    most : int, optional
        People who are there at once at most.

    Returns
    -------
    TrackTable
        With heads; persons numbered from 0 in the order in which they were first seen.
    """
    tracker = make_tracker() if tracker is None else tracker
    state, n_frames = init(fps, most), 0
    rows: list[TrackRow] = []
    for frame, observation in observations:
        state, info = tracker.step(frame_rng(seed, frame), state, frame, observation)
        rows += info.rows
        n_frames += 1
    rows += finish(state, n_frames, tracker.following)
    return table_of(rows, fps, gap_s, state.reidentified)


def frame_rng(seed: int, frame: int) -> np.random.Generator:
    """The random numbers of one frame: a run that goes on in the middle draws the same as one from the start."""
    return np.random.default_rng((seed, frame))


def table_of(rows: Iterable[TrackRow], fps: float, gap_s: float = 1.0, reidentified: tuple[tuple[int, int], ...] = ()) -> TrackTable:
    """The finished table: gaps up to `gap_s` seconds filled, persons numbered in the order in which they were first seen.

    `reidentified` are the persons who came back, with the numbers that they had before (`hmc.tracking.state.TrackerState`).
    """
    rows = [replace(row, person=original_number(reidentified, row.person)) for row in rows]
    return renumber(fill_gaps(from_rows(rows), round(gap_s * fps)))


def from_rows(rows: Iterable[TrackRow]) -> TrackTable:
    """The table of these rows, sorted by frame, then person."""
    rows = sorted(rows, key=lambda row: (row.frame, row.person))
    return TrackTable(
        np.array([row.frame for row in rows], int),
        np.array([row.person for row in rows], int),
        np.array([row.position for row in rows], float).reshape(-1, 3),
        np.array([row.head for row in rows], float).reshape(-1, 3),
    )


def fill_gaps(table: TrackTable, longest: int) -> TrackTable:
    """Fill gaps of at most `longest` frames in each person's track, on a straight line.

    Parameters
    ----------
    table : TrackTable
    longest : int
        Frames.

    Returns
    -------
    TrackTable
        Sorted by frame, then person.
    """
    values = table.positions if table.heads is None else np.hstack([table.positions, table.heads])
    frames, persons, filled = [table.frames], [table.persons], [values]
    for person in np.unique(table.persons):
        rows = np.flatnonzero(table.persons == person)
        rows = rows[np.argsort(table.frames[rows])]
        known = table.frames[rows]
        for before, after in pairwise(rows):
            a, b = table.frames[before], table.frames[after]
            if 1 < b - a <= longest + 1:
                frames.append(np.arange(a + 1, b))
                persons.append(np.full(b - a - 1, person))
                filled.append(np.stack([np.interp(frames[-1], known, column) for column in values[rows].T], axis=1))
    frame, number, value = np.concatenate(frames), np.concatenate(persons), np.concatenate(filled)
    order = np.lexsort([number, frame])
    heads = None if table.heads is None else value[order, 3:]
    return TrackTable(frame[order], number[order], value[order, :3], heads)


def renumber(table: TrackTable) -> TrackTable:
    """Persons numbered from 0 in the order in which they appear."""
    numbers, first = np.unique(table.persons, return_index=True)
    new = np.empty(len(numbers), int)
    new[np.argsort(table.frames[first], kind="stable")] = np.arange(len(numbers))
    persons = new[np.searchsorted(numbers, table.persons)]
    order = np.lexsort([persons, table.frames])
    heads = None if table.heads is None else table.heads[order]
    return TrackTable(table.frames[order], persons[order], table.positions[order], heads)


def velocities(table: TrackTable, fps: float, window_s: float = 0.4) -> np.ndarray:
    """Smooth velocity of each row's person: the slope of a line through the positions within half a window to either side.

    Parameters
    ----------
    table : TrackTable
    fps : float
    window_s : float
        Length of the window, seconds.

    Returns
    -------
    ndarray, shape (n, 3)
        Metres a second, by the positions that are known; zero where there is one only, or none.
    """
    result = np.zeros((len(table.frames), 3))
    half = max(1.0, window_s * fps / 2)
    for person in np.unique(table.persons):
        rows = np.flatnonzero((table.persons == person) & np.isfinite(table.positions).all(axis=1))
        rows = rows[np.argsort(table.frames[rows], kind="stable")]
        frames, places = table.frames[rows].astype(float), table.positions[rows]
        first, last = np.searchsorted(frames, frames - half, "left"), np.searchsorted(frames, frames + half, "right")
        for row, near in zip(rows, map(slice, first, last), strict=True):
            if near.stop - near.start > 1:
                t = frames[near] - frames[near].mean()
                result[row] = t @ places[near] / (t @ t) * fps
    return result


def person_voxels(observation: Observation, positions: np.ndarray, settings: FollowingSettings | None = None) -> list[np.ndarray]:
    """The occupied voxels of each person in a frame.

    Parameters
    ----------
    observation : Observation
    positions : ndarray, shape (k, 3)
        The persons' centroids in this frame, as in the table of tracks.
    settings : FollowingSettings, optional

    Returns
    -------
    list of ndarray of int, shape (n_k, 3)
        Indices into the grid, one array a position.
    """
    owners, _ = assign_voxels(observation, np.asarray(positions, float).reshape(-1, 3), settings)
    return [observation.indices[owners == k] for k in range(len(positions))]
