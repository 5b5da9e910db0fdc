"""Poses of everybody in a recording by spectral skeletons and swarms: the counterpart of `hmc.pose.sequence`, with the same result.

A frame of a person costs a small record, so all of them are kept in a journal and a run that was stopped goes on where it was. The first
frames, in which it is not sure yet which way somebody faces, are gone through backwards once it is.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.body.proportions import default_body
from hmc.body.spin_skeleton import N_PARAMETERS, model_of_height, skeleton_landmarks
from hmc.errors import InputError
from hmc.io.files import atomic_write
from hmc.io.journal import append_journal, open_journal
from hmc.io.recording import Recording
from hmc.io.results import PoseStates, PoseTable, TrackTable
from hmc.landmarks import LANDMARKS
from hmc.pose.person import PersonTask
from hmc.pose.sequence import PosedPeople, frames_left, persons_of, unfitted_notes
from hmc.pose.spectral.graph import color_votes, face_neighbours
from hmc.pose.spectral.reading import BodyReading, ReadingSettings, read_body
from hmc.pose.starts.spectral import body_state
from hmc.pose.starts.window import estimate_height
from hmc.pose.steps.swarm.temporal import SwarmInfo, SwarmSettings, SwarmState, missed, swarm_step
from hmc.pose.views.hull_target import make_target, sound_hull
from hmc.tracking.resumable import observe_step, person_grid
from hmc.tracking.tracks import person_voxels
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, HullStep

__all__ = ["FitRow", "SwarmPreset", "SwarmTask", "pose_by_swarm", "swarm_preset", "write_fits"]

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


#: A person's voxels in a frame, their centres, metres, and the votes of their colours.
Seen = tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class SwarmPerson:
    """What is known of a person between two frames.

    Parameters
    ----------
    height_m : float or None
        Stature; None while the person is watched.
    swarm : SwarmState or None
        After the last frame; None while no pose was found.
    watched : tuple of (int, tuple or None)
        Frames of the window that is not over, and what was seen in them.
    done_to : int
        The last decided frame; -1: none is.
    """

    height_m: float | None = None
    swarm: SwarmState | None = None
    watched: tuple[tuple[int, Seen | None], ...] = ()
    done_to: int = -1


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
        With the error of each frame, metres, as its cost; states are those of the body of `hmc.body` with the same landmarks.
    rows : list of FitRow
        Every frame of everybody, in order of frame and person.
    """
    recording = task.recording
    grid = person_grid(recording, voxel_size_m)
    persons = persons_of(recording, tracks)
    states = dict.fromkeys(persons, SwarmPerson())
    rows: list[FitRow] = []
    for record in open_journal(journal, key):
        new = [_from_record(one) for one in record["rows"]]
        states[record["person"]] = SwarmPerson(new[-1].height_m, _swarm_of(record["after"]), done_to=new[-1].frame)
        rows += new
    done_to = {number: state.done_to for number, state in states.items()}
    for hull in frames_left(
        recording, grid, persons, done_to, frontend=frontend, masks=masks, key=key, on_problem=on_problem, progress=progress, images=True
    ):
        for number, seen in _seen(recording, grid, tracks, hull).items():
            if hull.index <= states[number].done_to:
                continue
            states[number], new = _person_step(task, grid, persons[number], states[number], hull.index, seen)
            rows += new
            if journal is not None and new:
                swarm = states[number].swarm
                after = None if swarm is None else asdict(swarm)
                append_journal(journal, {"person": number, "rows": [_to_record(row) for row in new], "after": after})
    rows.sort(key=lambda row: (row.frame, row.person))
    return _assemble(task, rows), rows


def _seen(recording: Recording, grid: VoxelGrid, tracks: TrackTable, hull: HullStep) -> dict[int, Seen | None]:
    """What is seen of everybody in a frame; None where there are no voxels of somebody."""
    rows = np.flatnonzero(tracks.frames == hull.index)
    out: dict[int, Seen | None] = dict.fromkeys(tracks.persons[rows].tolist())
    observation = observe_step(recording, grid, hull) if len(rows) else None
    if observation is None:
        return out
    for number, tolerant in zip(list(out), person_voxels(observation, tracks.positions[rows]), strict=True):
        voxels = sound_hull(tolerant[hull.strict[tuple(tolerant.T)]], tolerant)
        if len(voxels):
            votes = color_votes(face_neighbours(voxels), voxels, grid, recording.rig, hull.images, 40.0)
            out[number] = voxels, grid.centres(voxels), votes
    return out


def _person_step(
    task: SwarmTask, grid: VoxelGrid, person: PersonTask, state: SwarmPerson, frame: int, seen: Seen | None
) -> tuple[SwarmPerson, list[FitRow]]:
    """One frame of a person, and the rows that it decides."""
    if state.height_m is None:
        state = replace(state, watched=(*state.watched, (frame, seen)))
        if len(state.watched) < task.window and frame != int(person.frames[-1]):
            return state, []
        return _start(task, grid, person, state)
    reading = _read(task, state.height_m, seen, grid.voxel_size_m)
    found = _fit(task, person, state.height_m, frame, reading, state.swarm)
    return replace(state, swarm=found[0], done_to=frame), [_row(person, state.height_m, frame, *found)]


def _start(task: SwarmTask, grid: VoxelGrid, person: PersonTask, state: SwarmPerson) -> tuple[SwarmPerson, list[FitRow]]:
    """The window is over: stature, readings of its frames, and the poses from the frame that shows most on, both ways."""
    frames = [frame for frame, _ in state.watched]
    height_m = task.height_m or _height_of(task, grid, state)
    readings = [_read(task, height_m, seen, grid.voxel_size_m) for _, seen in state.watched]
    scores = [2 * r.segmentation.whole + 0.2 * len(r.curves) if r is not None and r.status == "read" else -1.0 for r in readings]
    feet = np.concatenate([np.zeros((0, 3)), *(r.feet for r in readings if r is not None)])
    # A frame can be misread and look whole: of those that show most, the one whose pose costs least.
    trials: dict[int, tuple[SwarmState | None, SwarmInfo]] = {}
    for k in np.argsort(-np.array(scores), kind="stable")[:ANCHORS].tolist():
        opening = readings[k]
        if opening is not None and scores[k] > 0:
            # At the start, the feet of the whole window say which way the person faces.
            opening = replace(opening, feet=feet)
        trials[k] = _fit(task, person, height_m, frames[k], opening, None)
    anchor = min(trials, key=lambda k: trials[k][1].cost_m if trials[k][0] is not None else np.inf)
    found = {anchor: trials[anchor]}
    for order in (range(anchor + 1, len(frames)), range(anchor - 1, -1, -1)):
        swarm = found[anchor][0]
        for k in order:
            found[k] = _fit(task, person, height_m, frames[k], readings[k], swarm)
            swarm = found[k][0]
    rows = [_row(person, height_m, frame, *found[k]) for k, frame in enumerate(frames)]
    return SwarmPerson(height_m, found[len(frames) - 1][0], done_to=frames[-1]), rows


def _height_of(task: SwarmTask, grid: VoxelGrid, state: SwarmPerson) -> float:
    """The stature of somebody who was watched."""
    nothing = np.zeros((0, 3), int)
    hulls = [nothing if seen is None else seen[0] for _, seen in state.watched]
    return estimate_height([make_target(grid, voxels, voxels) for voxels in hulls], float(task.recording.room[0, 2]))


def _read(task: SwarmTask, height_m: float, seen: Seen | None, voxel_size_m: float) -> BodyReading | None:
    if seen is None:
        return None
    voxels, points, votes = seen
    return read_body(voxels, points, voxel_size_m, height_m, task.preset.reading, votes)


def _fit(
    task: SwarmTask, person: PersonTask, height_m: float, frame: int, reading: BodyReading | None, swarm: SwarmState | None
) -> tuple[SwarmState | None, SwarmInfo]:
    """One frame from the state before it."""
    if reading is None:
        return missed(swarm), SwarmInfo(NO_VOXELS, np.nan, False, False, 0, ())
    model = model_of_height(height_m, task.preset.thesis)
    return swarm_step(task.rng(person.number, frame), model, swarm, reading, task.recording.fps, person.velocity(frame), task.preset.swarm)


def _row(person: PersonTask, height_m: float, frame: int, swarm: SwarmState | None, info: SwarmInfo) -> FitRow:
    found = np.full(N_PARAMETERS, np.nan) if swarm is None or info.status != "fitted" else swarm.state
    return FitRow(frame, person.number, height_m, found, info)


def _swarm_of(record: dict[str, Any] | None) -> SwarmState | None:
    """A state from its record."""
    if record is None:
        return None
    return SwarmState(**record | {name: np.array(record[name], float) for name in ("state", "velocity")})


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
