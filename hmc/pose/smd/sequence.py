"""Everybody's poses in a recording by multi-cue descent: the counterpart of `hmc.pose.sequence`, with the same result."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hmc.frontend import FrontendSettings, HullStep, stream_hulls
from hmc.landmarks import LANDMARKS
from hmc.mask_store import kept_masks
from hmc.pose.annealed.hull_target import HullTarget
from hmc.pose.annealed.presets import pose_preset
from hmc.pose.body.joints import DOF_NAMES
from hmc.pose.body.kinematics import landmarks
from hmc.pose.body.model import BodyModel
from hmc.pose.sequence import PosedPeople, targets_of
from hmc.pose.smd.body import solid_body
from hmc.pose.smd.cues import Observed
from hmc.pose.smd.samples import surface_grid
from hmc.pose.smd.start import find_da_vinci
from hmc.pose.smd.tracker import SmdPreset, SmdTracker, TrackState, track_init, track_step
from hmc.pose.start import start_person
from hmc.recording import Recording
from hmc.results import PoseStates, PoseTable, TrackTable
from hmc.tracking.resumable import WARM_UP_FRAMES, observe_step, person_grid
from hmc.tracking.tracks import person_voxels, velocities
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

__all__ = ["FirstPose", "SmdTask", "pose_by_descent"]

logger = logging.getLogger("hmc")

#: How long a person is watched for the pose of da Vinci's man before a start from any other pose is made, seconds.
WINDOW_S = 1.5
#: The first pose is settled by so many passes over its frame.
SETTLE = 4
NO_START = "no hull to start from"


@dataclass(frozen=True)
class FirstPose:
    """Body and pose (27,) of one of the frames that were watched, by its place among them."""

    place: int
    body: BodyModel
    state: np.ndarray


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
        Start from a pose that is not da Vinci's; by default that of the annealed filter (`hmc.pose.start`).
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
    """A person while the recording is read."""

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
    people = _people(tracks, recording.fps)
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


def observe_people(recording: Recording, grid: VoxelGrid, tracks: TrackTable, hull: HullStep) -> dict[int, Observed]:
    """What is seen of everybody in a frame: the surface of the strict hull's part that is theirs.

    Parameters
    ----------
    recording : Recording
    grid : VoxelGrid
    tracks : TrackTable
    hull : HullStep

    Returns
    -------
    dict of int to Observed
        Whoever has voxels.
    """
    rows = np.flatnonzero(tracks.frames == hull.index)
    observation = observe_step(recording, grid, hull) if len(rows) else None
    if observation is None:
        return {}
    out = {}
    for number, voxels in zip(tracks.persons[rows].tolist(), person_voxels(observation, tracks.positions[rows]), strict=True):
        strict = voxels[hull.strict[tuple(voxels.T)]]
        if len(strict):
            low = strict.min(axis=0)
            solid = np.zeros(strict.max(axis=0) - low + 1, bool)
            solid[tuple((strict - low).T)] = True
            out[number] = Observed(grid.centres(surface(solid) + low))
    return out


def _try_start(task: SmdTask, person: _Person, grid: VoxelGrid) -> list:
    """Start in the frame that came last if its pose is da Vinci's, at the end of the window from whatever pose there is."""
    recording = task.recording
    frame, observed, _ = person.watched[-1]
    floor = float(recording.room[0, 2])
    spread = None if observed is None else find_da_vinci(observed.points, grid.voxel_size_m, floor, task.height_m)
    if spread is not None:
        first = FirstPose(len(person.watched) - 1, spread.body, spread.state)
    else:
        enough = len(person.watched) >= max(3, round(WINDOW_S * recording.fps)) or frame == int(person.frames[-1])
        if not enough:
            return []
        frames = [number for number, _, _ in person.watched]
        speed = person.velocities[np.searchsorted(person.frames, frames)]
        start = task.any_start or (lambda rng, targets, speed: _annealed_start(task, rng, targets, speed))
        found = start(lambda k: task.rng(person.number, frames[k]), [target for _, _, target in person.watched], speed)
        if found is None:
            rows = [(frame, person.number, np.full(len(DOF_NAMES), np.nan), np.nan, NO_START) for frame in frames]
            person.watched = []
            return rows
        first = found
    return _begin(task, person, first)


def _annealed_start(task: SmdTask, rng, targets, speed) -> FirstPose | None:
    """By the annealed filter's start, the waist taken into the trunk."""
    recording = task.recording
    started = start_person(rng, pose_preset("default"), recording.fps, targets, task.height_m, speed, recording.room)
    if started is None:
        return None
    place = int(np.nanargmin([info.cost for info in started.infos]))
    state = started.states[place].state.copy()
    state[3] += 0.5 * state[8]  # half of the waist's twist: hips and shoulders are off by as much
    state[6:9] = 0.0
    return FirstPose(place, started.filter.body, state)


def _begin(task: SmdTask, person: _Person, first: FirstPose) -> list:
    """Settle in the first pose, and follow from there forwards and backwards through the frames that were watched."""
    body = solid_body(first.body)
    person.tracker = SmdTracker(body, surface_grid(body), task.preset)
    frame, observed, _ = person.watched[first.place]
    state = track_init(first.state)
    for k in range(SETTLE):
        state, _ = track_step(np.random.default_rng([task.seed, person.number, frame, k]), person.tracker, state, observed)
    state = replace(state, velocity=0 * state.velocity)
    rows = []
    for places in (range(first.place - 1, -1, -1), range(first.place, len(person.watched))):
        person.state = state
        for k in places:
            rows.append(_follow(task, person, person.watched[k][0], person.watched[k][1]))
    person.watched = []
    return rows


def _follow(task: SmdTask, person: _Person, frame: int, observed: Observed | None) -> tuple:
    person.state, info = track_step(task.rng(person.number, frame), person.tracker, person.state, observed)
    return frame, person.number, person.state.state, info.value, info.status


def _people(tracks: TrackTable, fps: float) -> dict[int, _Person]:
    speed = velocities(tracks, fps)
    people = {}
    for number in np.unique(tracks.persons).tolist():
        rows = np.flatnonzero(tracks.persons == number)
        rows = rows[np.argsort(tracks.frames[rows])]
        people[number] = _Person(number, tracks.frames[rows], speed[rows], [])
    return people


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
    why = Counter((row[1], row[4]) for row in rows if row[4] != "fitted")
    notes = [f"person {who}: {n} frame{'s' if n > 1 else ''} without a pose: {reason}" for (who, reason), n in sorted(why.items())]
    return PosedPeople(
        PoseTable(frames, persons, positions), PoseStates(frames, persons, states, DOF_NAMES, bodies), np.array([row[3] for row in rows]),
        tuple(notes),
    )  # fmt: skip
