"""Poses of everybody in a recording by spectral skeletons and swarms: the counterpart of `hmc.pose.sequence`, with the same result.

A frame of a person costs a small record, so all of them are kept in a journal and a run that was stopped goes on where it was. The first
frames, in which it is not sure yet which way somebody faces, are gone through backwards once it is.
"""

from __future__ import annotations

import csv
import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.files import atomic_write
from hmc.frontend import FrontendSettings, HullStep, stream_hulls
from hmc.journal import append_journal, open_journal
from hmc.landmarks import LANDMARKS
from hmc.mask_store import kept_masks
from hmc.pose.annealed.hull_target import make_target
from hmc.pose.body.joints import DOF_NAMES
from hmc.pose.body.proportions import default_body
from hmc.pose.sequence import PosedPeople, frames_of_persons, unfitted_notes
from hmc.pose.spectral.graph import color_votes, face_neighbours
from hmc.pose.spectral.reading import BodyReading, ReadingSettings, read_body
from hmc.pose.spectral_start import body_state
from hmc.pose.start import estimate_height
from hmc.pose.swarm.model import N_PARAMETERS, SkeletonModel, model_of_height, skeleton_landmarks
from hmc.pose.swarm.temporal import SwarmInfo, SwarmSettings, SwarmState, missed, swarm_step
from hmc.recording import Recording
from hmc.results import PoseStates, PoseTable, TrackTable
from hmc.tracking.resumable import WARM_UP_FRAMES, observe_step, person_grid
from hmc.tracking.tracks import person_voxels

__all__ = ["FitRow", "SwarmPreset", "SwarmTask", "pose_by_swarm", "swarm_preset", "write_fits"]

logger = logging.getLogger("hmc")

#: Frames of the first window in which a start is tried.
ANCHORS = 3
NO_VOXELS = "no fit: no voxels of this person in this frame"


@dataclass(frozen=True)
class SwarmPreset:
    """Parameters of the method.

    Parameters
    ----------
    reading : ReadingSettings
    swarm : SwarmSettings
    thesis : bool
        The skeleton with the thesis's joint limits and one length a part.
    window_s : float
        How long a person is watched before the stature and the first pose are decided, seconds.
    """

    reading: ReadingSettings = field(default_factory=ReadingSettings)
    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    thesis: bool = False
    window_s: float = 0.7


def swarm_preset(name: str) -> SwarmPreset:
    """``"default"``, or ``"hsiao2008"``: limits as printed, curves alone, a start tried beside every frame's fit.

    Raises
    ------
    InputError
        When there is no such preset.
    """
    if name == "default":
        return SwarmPreset()
    if name == "hsiao2008":
        return SwarmPreset(swarm=SwarmSettings(always_check=True, voxels=False), thesis=True)
    raise InputError(f"there is no preset '{name}' of --method pso; use default or hsiao2008")


@dataclass(frozen=True)
class SwarmTask:
    """What is the same for everybody in a run.

    Parameters
    ----------
    recording : Recording
    preset : SwarmPreset
    seed : int
    height_m : float or None
        None: estimated for each person.
    """

    recording: Recording
    preset: SwarmPreset = field(default_factory=SwarmPreset)
    seed: int = 0
    height_m: float | None = None

    def rng(self, person: int, frame: int) -> np.random.Generator:
        """The random numbers of a person's frame."""
        return np.random.default_rng([self.seed, person, frame])

    @property
    def window(self) -> int:
        """Frames of `SwarmPreset.window_s`, three at least."""
        return max(3, round(self.preset.window_s * self.recording.fps))


@dataclass(frozen=True)
class FitRow:
    """One frame of a person: what is kept in the journal and told in ``fits.csv``.

    Parameters
    ----------
    frame, person : int
    height_m : float
    state : ndarray, shape (23,)
        NaN without a fit.
    info : SwarmInfo
    """

    frame: int
    person: int
    height_m: float
    state: np.ndarray
    info: SwarmInfo


@dataclass
class _Person:
    """A person while the recording is read: changed from frame to frame."""

    number: int
    frames: np.ndarray
    velocities: np.ndarray
    watched: list[tuple[int, np.ndarray, np.ndarray, tuple | None]] = field(default_factory=list)
    model: SkeletonModel | None = None
    height_m: float = np.nan
    state: SwarmState | None = None
    done_to: int = -1

    def velocity(self, frame: int) -> np.ndarray:
        return self.velocities[int(np.searchsorted(self.frames, frame))]


def pose_by_swarm(
    task: SwarmTask,
    tracks: TrackTable,
    voxel_size_m: float,
    *,
    frontend: FrontendSettings | None = None,
    journal: str | Path | None = None,
    masks: str | Path | None = None,
    key: str = "",
    on_problem: Callable[[str], None] | None = None,
    progress: Callable[[Iterable[HullStep], int], Iterable[HullStep]] | None = None,
) -> tuple[PosedPeople, list[FitRow]]:
    """Estimate the pose of every tracked person in every frame of their track.

    Parameters
    ----------
    task : SwarmTask
    tracks : TrackTable
        As from `hmc.tracking.resumable.track_recording`.
    voxel_size_m : float
    frontend, journal, masks, key, on_problem, progress
        As for `hmc.pose.sequence.pose_recording`.

    Returns
    -------
    people : PosedPeople
        With the error of each frame, metres, as its cost; states are those of the body of `hmc.pose.body` with the same landmarks.
    rows : list of FitRow
        Every frame of everybody, in order of frame and person.
    """
    recording = task.recording
    grid = person_grid(recording, voxel_size_m)
    end = recording.start + recording.n_frames
    people = {number: _Person(number, *rows) for number, rows in frames_of_persons(recording, tracks).items()}
    rows: list[FitRow] = []
    for record in open_journal(journal, key):
        decided = [_from_record(one) for one in record["rows"]]
        _take_up(task, people[record["person"]], decided, record["after"])
        rows += decided
    left = [int(frame) for person in people.values() for frame in person.frames[person.frames > person.done_to][:1]]
    if left:
        first = min(left)
        kept = None if masks is None else kept_masks(masks, key, first, end)
        stream = stream_hulls(
            recording, grid, frontend, first=first, warm_up=WARM_UP_FRAMES, masks=kept, on_problem=on_problem or logger.warning
        )
        for hull in progress(stream, end - first) if progress else stream:
            for number, seen in _seen(recording, grid, tracks, hull).items():
                person = people[number]
                if hull.index > person.done_to:
                    decided = _advance(task, person, hull.index, seen, grid)
                    rows += decided
                    if journal is not None and decided:
                        after = None if person.state is None else asdict(person.state)
                        append_journal(journal, {"person": number, "rows": [_to_record(row) for row in decided], "after": after})
    rows.sort(key=lambda row: (row.frame, row.person))
    return _assemble(task, rows), rows


def _seen(recording: Recording, grid, tracks: TrackTable, hull: HullStep) -> dict[int, tuple | None]:
    """Voxels, their centres and the colour votes of everybody in a frame; None where there are no voxels of somebody."""
    rows = np.flatnonzero(tracks.frames == hull.index)
    out: dict[int, tuple | None] = dict.fromkeys(tracks.persons[rows].tolist())
    observation = observe_step(recording, grid, hull) if len(rows) else None
    if observation is None:
        return out
    for number, tolerant in zip(list(out), person_voxels(observation, tracks.positions[rows]), strict=True):
        strict = tolerant[hull.strict[tuple(tolerant.T)]]
        # Where a camera lost the person, the tolerant hull stands for the strict one.
        voxels = strict if len(strict) > 0.5 * len(tolerant) else tolerant
        if len(voxels):
            votes = color_votes(face_neighbours(voxels), voxels, grid, recording.rig, hull.images, 40.0)
            out[number] = voxels, grid.centres(voxels), votes
    return out


def _advance(task: SwarmTask, person: _Person, frame: int, seen: tuple | None, grid) -> list[FitRow]:
    """One frame of a person, and the rows that it decides."""
    last = frame == int(person.frames[-1])
    if person.model is None:
        person.watched.append((frame, *(seen or (np.zeros((0, 3), int), np.zeros((0, 3)), None))))
        if len(person.watched) < task.window and not last:
            return []
        rows = _start(task, person, grid)
    else:
        reading = _read(task, person, seen, grid.voxel_size_m)
        state, info = _step(task, person, frame, reading, person.state)
        person.state = state
        rows = [_row(person, frame, state, info)]
    person.done_to = frame
    return rows


def _start(task: SwarmTask, person: _Person, grid) -> list[FitRow]:
    """The window is over: stature, readings of its frames, and the poses from the frame that shows most on, both ways."""
    targets = [make_target(grid, voxels, voxels) for _, voxels, _, _ in person.watched]
    floor_z = float(task.recording.room[0, 2])
    _set_height(task, person, task.height_m or estimate_height(targets, floor_z))
    readings = [_read(task, person, (v, p, c) if len(v) else None, grid.voxel_size_m) for _, v, p, c in person.watched]
    frames = [one[0] for one in person.watched]
    person.watched = []
    scores = [2 * r.segmentation.whole + 0.2 * len(r.curves) if r is not None and r.status == "read" else -1.0 for r in readings]
    feet = np.concatenate([np.zeros((0, 3)), *(r.feet for r in readings if r is not None)])
    # A frame can be misread and look whole: of those that show most, the one whose pose costs least.
    trials: dict[int, tuple[SwarmState | None, SwarmInfo]] = {}
    for k in np.argsort(-np.array(scores), kind="stable")[:ANCHORS].tolist():
        opening = readings[k]
        if opening is not None and scores[k] > 0:
            # At the start, the feet of the whole window say which way the person faces.
            opening = replace(opening, feet=feet)
        trials[k] = _step(task, person, frames[k], opening, None)
    anchor = min(trials, key=lambda k: trials[k][1].cost_m if trials[k][0] is not None else np.inf)
    found = {anchor: trials[anchor]}
    for order in (range(anchor + 1, len(frames)), range(anchor - 1, -1, -1)):
        state = found[anchor][0]
        for k in order:
            found[k] = _step(task, person, frames[k], readings[k], state)
            state = found[k][0]
    person.state = found[len(frames) - 1][0]
    return [_row(person, frame, *found[k]) for k, frame in enumerate(frames)]


def _set_height(task: SwarmTask, person: _Person, height_m: float) -> None:
    person.height_m = height_m
    person.model = model_of_height(height_m, task.preset.thesis)


def _read(task: SwarmTask, person: _Person, seen: tuple | None, voxel_size_m: float) -> BodyReading | None:
    if seen is None:
        return None
    voxels, points, votes = seen
    return read_body(voxels, points, voxel_size_m, person.height_m, task.preset.reading, votes)


def _step(task, person, frame, reading, state) -> tuple[SwarmState | None, SwarmInfo]:
    if reading is None:
        return missed(state), SwarmInfo(NO_VOXELS, np.nan, False, False, 0, ())
    return swarm_step(
        task.rng(person.number, frame), person.model, state, reading, task.recording.fps, person.velocity(frame), task.preset.swarm
    )


def _row(person: _Person, frame: int, state: SwarmState | None, info: SwarmInfo) -> FitRow:
    found = np.full(N_PARAMETERS, np.nan) if state is None or info.status != "fitted" else state.state
    return FitRow(frame, person.number, person.height_m, found, info)


def _take_up(task: SwarmTask, person: _Person, rows: Sequence[FitRow], after: dict[str, Any] | None) -> None:
    """A person as they were after these rows of a run that was stopped."""
    if person.model is None:
        _set_height(task, person, rows[-1].height_m)
    if after is not None:
        person.state = SwarmState(**after | {name: np.array(after[name], float) for name in ("state", "velocity")})
    person.done_to = rows[-1].frame


def _to_record(row: FitRow) -> dict[str, Any]:
    info = row.info
    return {
        "frame": row.frame, "person": row.person, "height_m": row.height_m, "state": None if np.isnan(row.state).any() else row.state,
        "status": info.status, "error_m": info.error_m if np.isfinite(info.error_m) else None, "started": info.started,
        "turned": info.turned, "evaluations": info.evaluations, "doubts": list(info.doubts),
        "cost_m": info.cost_m if np.isfinite(info.cost_m) else None,
    }  # fmt: skip


def _from_record(record: dict[str, Any]) -> FitRow:
    state = np.full(N_PARAMETERS, np.nan) if record["state"] is None else np.array(record["state"], float)
    error, cost = (np.nan if record[name] is None else record[name] for name in ("error_m", "cost_m"))
    info = SwarmInfo(record["status"], error, record["started"], record["turned"], record["evaluations"], tuple(record["doubts"]), cost)
    return FitRow(record["frame"], record["person"], record["height_m"], state, info)


def _assemble(task: SwarmTask, rows: Sequence[FitRow]) -> PosedPeople:
    frames, persons = np.array([row.frame for row in rows], int), np.array([row.person for row in rows], int)
    positions = np.full((len(rows), len(LANDMARKS), 3), np.nan)
    states = np.full((len(rows), len(DOF_NAMES)), np.nan)
    heights = {row.person: row.height_m for row in rows}
    bodies = {person: default_body(height) for person, height in heights.items()}
    for k, row in enumerate(rows):
        if row.info.status == "fitted":
            positions[k] = skeleton_landmarks(model_of_height(row.height_m, task.preset.thesis), row.state)
            states[k] = body_state(bodies[row.person], positions[k])
    notes = unfitted_notes(persons, (row.info.status for row in rows))
    return PosedPeople(
        PoseTable(frames, persons, positions),
        PoseStates(frames, persons, states, DOF_NAMES, {person: body.dimensions for person, body in bodies.items()}),
        np.array([row.info.error_m if row.info.status == "fitted" else np.nan for row in rows]),
        tuple(notes),
    )


def write_fits(path: str | Path, rows: Sequence[FitRow]) -> None:
    """Write what became of every frame: frame, person, status, error_m, started, turned, doubts.

    Parameters
    ----------
    path : path
    rows : sequence of FitRow
    """
    with atomic_write(path) as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["frame", "person", "status", "error_m", "started", "turned", "doubts"])
        for row in rows:
            info = row.info
            error = f"{info.error_m:.4f}" if np.isfinite(info.error_m) else ""
            out.writerow([row.frame, row.person, info.status, error, int(info.started), int(info.turned), "; ".join(info.doubts)])
