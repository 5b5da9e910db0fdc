"""Everybody's poses in a recording by multi-cue descent: the counterpart of `hmc.pose.sequence`, with the same result."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from hmc.frontend import FrontendSettings, HullStep, stream_hulls
from hmc.landmarks import LANDMARKS
from hmc.mask_store import kept_masks
from hmc.pose.annealed.hull_target import HullTarget
from hmc.pose.annealed.presets import pose_preset
from hmc.pose.body.joints import DOF_NAMES
from hmc.pose.body.kinematics import landmarks
from hmc.pose.sequence import PosedPeople, frames_of_persons, targets_of, unfitted_notes
from hmc.pose.smd.begin import FirstPose, begin
from hmc.pose.smd.cues import Observed
from hmc.pose.smd.observe import observe_people
from hmc.pose.smd.start import find_da_vinci
from hmc.pose.smd.tracker import SmdPreset, SmdTracker, TrackState, track_step
from hmc.pose.start import start_person
from hmc.recording import Recording
from hmc.results import PoseStates, PoseTable, TrackTable
from hmc.tracking.resumable import WARM_UP_FRAMES, person_grid
from hmc.voxels.grid import VoxelGrid

__all__ = ["SmdTask", "pose_by_descent"]

logger = logging.getLogger("hmc")

#: How long a person is watched before body and first pose are decided, seconds.
WINDOW_S = 1.5
NO_START = "no hull to start from"


#: ``start(frame_rng, targets, velocities)`` finds a first pose in hulls of consecutive frames, or None.
AnyStart = Callable[[Callable[[int], np.random.Generator], Sequence[HullTarget | None], np.ndarray], FirstPose | None]


@dataclass(frozen=True)
class SmdTask:
    """What is the same for everybody in a run.

    Parameters
    ----------
    recording : Recording
    preset : SmdPreset
    seed : int
    height_m : float or None
        None: estimated for each person.
    any_start : callable, optional
        Start from a pose that is not da Vinci's; by default by the spectral route (`hmc.pose.spectral_start`).
    """

    recording: Recording
    preset: SmdPreset
    seed: int = 0
    height_m: float | None = None
    any_start: AnyStart | None = None

    def rng(self, person: int, frame: int) -> np.random.Generator:
        """The random numbers of a person's frame."""
        return np.random.default_rng([self.seed, person, frame])


@dataclass
class _Person:
    """A person while the recording is read: changed from frame to frame."""

    number: int
    frames: np.ndarray
    velocities: np.ndarray
    watched: list[tuple[int, Observed | None, HullTarget | None]]
    tracker: SmdTracker | None = None
    state: TrackState | None = None


def pose_by_descent(
    task: SmdTask,
    tracks: TrackTable,
    voxel_size_m: float,
    *,
    frontend: FrontendSettings | None = None,
    masks: str | Path | None = None,
    key: str = "",
    on_problem: Callable[[str], None] | None = None,
    progress: Callable[[Iterable[HullStep], int], Iterable[HullStep]] | None = None,
) -> PosedPeople:
    """Estimate the pose of every tracked person in every frame of their track.

    Parameters
    ----------
    task : SmdTask
    tracks : TrackTable
        As from `hmc.tracking.resumable.track_recording`.
    voxel_size_m : float
    frontend, masks, key, on_problem, progress
        As for `hmc.pose.sequence.pose_recording`.

    Returns
    -------
    PosedPeople
        With the objective of each frame as its cost.
    """
    recording = task.recording
    grid = person_grid(recording, voxel_size_m)
    end = recording.start + recording.n_frames
    people = {number: _Person(number, *rows, []) for number, rows in frames_of_persons(recording, tracks).items()}
    if not people:
        return _assemble([], {})
    rows: list[tuple[int, int, np.ndarray, float, str]] = []
    first = min(int(person.frames[0]) for person in people.values())
    kept = None if masks is None else kept_masks(masks, key, first, end)
    stream = stream_hulls(
        recording, grid, frontend, first=first, warm_up=WARM_UP_FRAMES, masks=kept, on_problem=on_problem or logger.warning
    )
    for hull in progress(stream, end - first) if progress else stream:
        present = [people[number] for number in tracks.persons[tracks.frames == hull.index].tolist()]
        seen = observe_people(recording, grid, tracks, hull)
        waiting = any(person.tracker is None for person in present)
        targets = targets_of(recording, grid, tracks, hull) if waiting else {}
        for person in present:
            observed = seen.get(person.number)
            if person.tracker is None:
                person.watched.append((hull.index, observed, targets.get(person.number)))
                rows += _try_start(task, person, grid)
            else:
                rows.append(_follow(task, person, hull.index, observed))
    return _assemble(rows, {number: person.tracker for number, person in people.items()})


def _try_start(task: SmdTask, person: _Person, grid: VoxelGrid) -> list:
    """When the window is over: start from the first frame whose pose is da Vinci's, or from whatever pose there is."""
    recording = task.recording
    frames = [number for number, _, _ in person.watched]
    if len(frames) < max(3, round(WINDOW_S * recording.fps)) and frames[-1] != int(person.frames[-1]):
        return []
    observed, targets = [one for _, one, _ in person.watched], [target for _, _, target in person.watched]
    first, floor = None, float(recording.room[0, 2])
    for k, seen in enumerate(observed):
        spread = None if seen is None else find_da_vinci(seen.points, grid.voxel_size_m, floor, task.height_m)
        if spread is not None:
            first = FirstPose(k, spread.body, spread.state)
            break
    if first is None:
        speed = person.velocities[np.searchsorted(person.frames, frames)]
        start = task.any_start or partial(_spectral_start, task)
        first = start(lambda k: task.rng(person.number, frames[k]), targets, speed)
    person.watched, watched = [], person.watched
    if first is None:
        return [(frame, person.number, np.full(len(DOF_NAMES), np.nan), np.nan, NO_START) for frame in frames]
    rng = np.random.default_rng([task.seed, person.number, frames[first.place], 1])
    person.tracker, state = begin(rng, task.preset, first, observed, targets, task.height_m is not None)
    rows = []
    for places in (range(first.place - 1, -1, -1), range(first.place, len(frames))):
        person.state = state
        rows += [_follow(task, person, watched[k][0], watched[k][1]) for k in places]
    return rows


def _spectral_start(task: SmdTask, rng, targets, speed) -> FirstPose | None:
    """By the start of the annealed filters with candidates from the spectral skeleton, the waist taken into the trunk."""
    recording = task.recording
    preset = replace(pose_preset("default"), start="spectral")
    started = start_person(rng, preset, recording.fps, targets, task.height_m, speed, recording.room)
    if started is None:
        return None
    place = int(np.nanargmin([info.cost for info in started.infos]))
    state = started.states[place].state.copy()
    state[3] += 0.5 * state[8]  # half of the waist's twist: hips and shoulders are off by as much
    state[6:9] = 0.0
    return FirstPose(place, started.filter.body, state, is_fitted=True)


def _follow(task: SmdTask, person: _Person, frame: int, observed: Observed | None) -> tuple:
    if person.tracker is None or person.state is None:
        return frame, person.number, np.full(len(DOF_NAMES), np.nan), np.nan, NO_START
    person.state, info = track_step(task.rng(person.number, frame), person.tracker, person.state, observed)
    return frame, person.number, person.state.state, info.value, info.status


def _assemble(rows: list, trackers: dict[int, SmdTracker | None]) -> PosedPeople:
    """Tables in order of frame and person."""
    rows = sorted(rows, key=lambda row: row[:2])
    frames, persons = (np.array([row[k] for row in rows], int) for k in (0, 1))
    states = np.array([row[2] for row in rows]).reshape(-1, len(DOF_NAMES))
    fitted = np.array([row[4] == "fitted" for row in rows], bool)
    positions = np.full((len(rows), len(LANDMARKS), 3), np.nan)
    bodies = {}
    for number, tracker in trackers.items():
        if tracker is not None:
            bodies[number] = tracker.body.skeleton.dimensions
            own = fitted & (persons == number)
            positions[own] = landmarks(tracker.body.skeleton, states[own])
    notes = unfitted_notes(persons, (row[4] for row in rows))
    return PosedPeople(
        PoseTable(frames, persons, positions), PoseStates(frames, persons, states, DOF_NAMES, bodies), np.array([row[3] for row in rows]),
        tuple(notes),
    )  # fmt: skip
