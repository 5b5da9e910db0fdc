"""Tracks of people by keypoints alone, for recordings whose silhouettes are not to be had: found in every frame, then linked over time.

The table is of the form that the trackers give (`hmc.tracking`), with the middle of the trunk for a position.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.io.journal import append_journal, open_journal
from hmc.io.keypoints.source import KeypointSource
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.views.keypoint_groups import find_people
from hmc.pose.views.keypoints import body_detections
from hmc.tracking.tracks import fill_gaps, renumber
from hmc.voxels.run_options import RunOptions

__all__ = ["link_people", "tracks_of_keypoints"]

#: How far a trunk may be from where it was: by the errors of both places, metres, and by its speed, metres a second.
ERROR_M, SPEED_M_S = 0.3, 4.0
#: A person who is not found for longer is another one afterwards; who is there for less is nobody. Seconds.
GAP_S, LEAST_S = 1.0, 0.5


def tracks_of_keypoints(recording: Recording, source: KeypointSource, run: RunOptions | None = None) -> TrackTable:
    """The tracks of all people in a recording's selection, by keypoints.

    Parameters
    ----------
    recording : Recording
        Where it says how many persons there are, no more are found at once. A room that is stated bounds where they are; one that was
        estimated does not.
    source : KeypointSource
    run : RunOptions, optional
        With a journal the run goes on where it was stopped.

    Returns
    -------
    TrackTable
        Positions are the middle of the trunk, heads about the top of the head, metres; persons numbered from 0 in the order in which they
        were first seen.

    Raises
    ------
    InputError
        When a file of keypoints is not as it should be.
    """
    run = run or RunOptions()
    room = None if recording.room_is_estimated else recording.room
    records = open_journal(run.journal, run.key, run.on_problem)
    first, end = recording.start + len(records), recording.start + recording.n_frames
    frames: Iterable = range(first, end)
    for frame in run.progress(frames, end - first) if run.progress and first < end else frames:
        found = find_people(recording.rig, body_detections(source, frame), room, recording.persons)
        records.append({"frame": frame, "positions": found.positions.tolist(), "heads": found.heads.tolist()})
        if run.journal is not None:
            append_journal(run.journal, records[-1])
    places = [np.array(one["positions"], float).reshape(-1, 3) for one in records]
    heads = [np.array(one["heads"], float).reshape(-1, 3) for one in records]
    return link_people([one["frame"] for one in records], places, heads, recording.fps)


def link_people(frames: Sequence[int], positions: Sequence[np.ndarray], heads: Sequence[np.ndarray], fps: float) -> TrackTable:
    """Tracks of people who were found frame by frame: each goes to the nearest, all taken together.

    Parameters
    ----------
    frames : sequence of int
        Rising.
    positions, heads : sequence of ndarray, shape (n_people, 3)
        Of each frame, metres.
    fps : float

    Returns
    -------
    TrackTable
        Gaps up to a second are bridged on a straight line; people who were there for less than half a second, or than the whole selection
        if that is shorter, are left out.
    """
    rows: list[tuple[int, int, np.ndarray]] = []
    last: dict[int, tuple[int, np.ndarray]] = {}
    known = 0
    for frame, found, tops in zip(frames, positions, heads, strict=True):
        last = {person: seen for person, seen in last.items() if frame - seen[0] <= round(GAP_S * fps) + 1}
        people = _whose(frame, found, last, fps)
        for k in range(len(found)):
            if people[k] < 0:
                people[k], known = known, known + 1
            last[people[k]] = frame, found[k]
            rows.append((frame, people[k], np.r_[found[k], tops[k]]))
    values = np.array([row[2] for row in rows]).reshape(-1, 6)
    table = TrackTable(np.array([row[0] for row in rows], int), np.array([row[1] for row in rows], int), values[:, :3], values[:, 3:])
    least = min(round(LEAST_S * fps), len(frames))
    lived = {person: np.ptp(table.frames[table.persons == person]) + 1 for person in np.unique(table.persons).tolist()}
    table = table.where(np.array([lived[person] >= least for person in table.persons.tolist()], bool))
    return renumber(fill_gaps(table, round(GAP_S * fps)))


def _whose(frame: int, found: np.ndarray, last: dict[int, tuple[int, np.ndarray]], fps: float) -> list[int]:
    """The number of each person who was found, -1 where it is nobody who was there before."""
    people = [-1] * len(found)
    if not len(found) or not last:
        return people
    before = np.array([place for _, place in last.values()])
    gate = ERROR_M + SPEED_M_S / fps * (frame - np.array([seen for seen, _ in last.values()]))
    apart = np.linalg.norm(found[:, None] - before, axis=-1)
    # One who is beyond the gate costs more than any two within theirs.
    rows, columns = linear_sum_assignment(np.where(apart < gate, apart, 1e3))
    numbers = list(last)
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        if apart[i, j] < gate[j]:
            people[i] = numbers[j]
    return people
