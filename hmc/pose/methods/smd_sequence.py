"""Everybody's poses in a recording by multi-cue descent: the counterpart of `hmc.pose.sequence`, with the same result and journal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.objectives.color_cue import ColorModel
from hmc.pose.person import NO_START, Decided, PersonTask
from hmc.pose.records import keep_decided, kept_decided
from hmc.pose.sequence import PosedPeople, frames_left, persons_of, posed_people, targets_of
from hmc.pose.starts.da_vinci import find_da_vinci
from hmc.pose.starts.settle import FirstPose, begin
from hmc.pose.starts.window import start_person
from hmc.pose.steps.annealed import pose_init
from hmc.pose.steps.descent.tracker import SmdPreset, SmdTracker, TrackInfo, TrackState, make_tracker, track_step
from hmc.pose.steps.preset import pose_preset
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.skin import Observed, observe_people
from hmc.tracking.resumable import person_grid
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, HullStep

__all__ = ["SmdTask", "pose_by_descent"]

#: How long a person is watched before body and first pose are decided, seconds.
WINDOW_S = 1.5
#: Its start by the spectral route is this preset's, and so are the body's joint limits.
ANNEALED = pose_preset("default")


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
        Start from a pose that is not da Vinci's; by default by the spectral route (`hmc.pose.starts.spectral`).
    """

    recording: Recording
    preset: SmdPreset
    seed: int = 0
    height_m: float | None = None
    any_start: AnyStart | None = None

    def rng(self, person: int, frame: int) -> np.random.Generator:
        """The random numbers of a person's frame."""
        return np.random.default_rng([self.seed, person, frame])

    @property
    def window(self) -> int:
        """Frames of `WINDOW_S`, three at least."""
        return max(3, round(WINDOW_S * self.recording.fps))


@dataclass(frozen=True)
class SmdPerson:
    """What is known of a person between two frames.

    Parameters
    ----------
    tracker : SmdTracker or None
        None while the person is watched.
    pose : TrackState or None
        Of the last frame that was followed.
    watched : tuple of (int, Observed or None, HullTarget or None)
        Frames of the window that is not over, and what was seen in them.
    done_to : int
        The last decided frame; -1: none is.
    """

    tracker: SmdTracker | None = None
    pose: TrackState | None = None
    watched: tuple[tuple[int, Observed | None, HullTarget | None], ...] = ()
    done_to: int = -1


def pose_by_descent(
    task: SmdTask,
    tracks: TrackTable,
    voxel_size_m: float,
    *,
    frontend: FrontendSettings | None = None,
    journal: str | Path | None = None,
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
    frontend, journal, masks, key, on_problem, progress
        As for `hmc.pose.sequence.pose_recording`.

    Returns
    -------
    PosedPeople
        With the objective of each frame as its cost.
    """
    recording = task.recording
    grid = person_grid(recording, voxel_size_m)
    persons = persons_of(recording, tracks)
    states = dict.fromkeys(persons, SmdPerson())
    done: list[Decided] = []
    for decided in kept_decided(journal, key, ANNEALED):
        done.append(replace(decided, pose=None))
        states[decided.person] = _taken_up(task, states[decided.person], decided)
    done_to = {number: state.done_to for number, state in states.items()}
    for hull in frames_left(
        recording, grid, persons, done_to, frontend=frontend, masks=masks, key=key, on_problem=on_problem, progress=progress, images=True
    ):
        left = [number for number in tracks.persons[tracks.frames == hull.index].tolist() if hull.index > states[number].done_to]
        seen = observe_people(recording, grid, tracks, hull)
        waiting = any(states[number].tracker is None for number in left)
        targets = targets_of(recording, grid, tracks, hull) if waiting else {}
        for number in left:
            before = states[number].done_to
            states[number], new = _step(task, grid, persons[number], states[number], hull.index, seen.get(number), targets.get(number))
            if new is not None:
                keep_decided(journal, ANNEALED, new, before)
                done.append(replace(new, pose=None))
    return posed_people(done)


def _step(
    task: SmdTask,
    grid: VoxelGrid,
    person: PersonTask,
    state: SmdPerson,
    frame: int,
    observed: Observed | None,
    target: HullTarget | None,
) -> tuple[SmdPerson, Decided | None]:
    """One frame of a person, and the frames that it decides."""
    if state.tracker is not None and state.pose is not None:
        pose, info = track_step(task.rng(person.number, frame), state.tracker, state.pose, observed)
        return replace(state, pose=pose, done_to=frame), _decided(person, state.tracker, {frame: (pose, info)})
    state = replace(state, watched=(*state.watched, (frame, observed, target)))
    if len(state.watched) < task.window and frame != int(person.frames[-1]):
        return state, None
    found = _start(task, grid, person, state)
    if found is None:
        # Nothing to start from yet: these frames stay without a pose, and the next window is tried.
        frames = tuple(number for number, _, _ in state.watched)
        nothing = np.full((len(frames), len(DOF_NAMES)), np.nan)
        rows = Decided(person.number, frames, nothing, (np.nan,) * len(frames), (NO_START,) * len(frames))
        return replace(state, watched=(), done_to=frame), rows
    tracker, followed = found
    return SmdPerson(tracker, followed[frame][0], done_to=frame), _decided(person, tracker, followed)


def _start(
    task: SmdTask, grid: VoxelGrid, person: PersonTask, state: SmdPerson
) -> tuple[SmdTracker, dict[int, tuple[TrackState, TrackInfo]]] | None:
    """The window is over: body and poses of its frames, from the first whose pose is da Vinci's on, or from whatever pose there is."""
    frames = [frame for frame, _, _ in state.watched]
    observed, targets = [one for _, one, _ in state.watched], [target for _, _, target in state.watched]
    first, floor = None, float(task.recording.room[0, 2])
    for k, seen in enumerate(observed):
        spread = None if seen is None else find_da_vinci(seen.points, grid.voxel_size_m, floor, task.height_m)
        if spread is not None:
            first = FirstPose(k, spread.body, spread.state)
            break
    if first is None:
        start = task.any_start or partial(_spectral_start, task)
        first = start(lambda k: task.rng(person.number, frames[k]), targets, person.velocity(frames))
    if first is None:
        return None
    rng = np.random.default_rng([task.seed, person.number, frames[first.place], 1])
    tracker, settled = begin(rng, task.preset, first, observed, targets, task.height_m is not None)
    followed = {}
    for places in (range(first.place - 1, -1, -1), range(first.place, len(frames))):
        pose = settled
        for k in places:
            pose, info = track_step(task.rng(person.number, frames[k]), tracker, pose, observed[k])
            followed[frames[k]] = pose, info
    return tracker, followed


def _spectral_start(task: SmdTask, rng, targets, speed) -> FirstPose | None:
    """By the start of the annealed filters with candidates from the spectral skeleton, the waist taken into the trunk."""
    recording = task.recording
    preset = replace(ANNEALED, start="spectral")
    started = start_person(rng, preset, recording.fps, targets, task.height_m, speed, recording.room)
    if started is None:
        return None
    place = int(np.nanargmin([info.cost for info in started.infos]))
    state = started.states[place].state.copy()
    state[3] += 0.5 * state[8]  # half of the waist's twist: hips and shoulders are off by as much
    state[6:9] = 0.0
    return FirstPose(place, started.filter.body, state, is_fitted=True)


def _decided(person: PersonTask, tracker: SmdTracker, followed: dict[int, tuple[TrackState, TrackInfo]]) -> Decided:
    """The rows of frames that were followed, with all that is needed to go on from the last."""
    frames = tuple(sorted(followed))
    rows = [followed[frame] for frame in frames]
    last = rows[-1][0]
    colors = {} if last.colors is None else {"mean": last.colors.mean, "deviation": last.colors.deviation}
    return Decided(
        person.number,
        frames,
        np.array([pose.state for pose, _ in rows]),
        tuple(info.value for _, info in rows),
        tuple(info.status for _, info in rows),
        pose_init(last.state, last.velocity, memory=colors),
        tracker.body.skeleton,
    )


def _taken_up(task: SmdTask, state: SmdPerson, decided: Decided) -> SmdPerson:
    """The state of a person after these rows of a run that was stopped."""
    done_to = decided.frames[-1]
    if decided.body is None or decided.pose is None:
        return replace(state, done_to=done_to)
    tracker = state.tracker or make_tracker(decided.body, task.preset)
    memory = decided.pose.memory
    colors = ColorModel(memory["mean"], memory["deviation"]) if memory else None
    return SmdPerson(tracker, TrackState(decided.pose.state, decided.pose.velocity, colors), done_to=done_to)
