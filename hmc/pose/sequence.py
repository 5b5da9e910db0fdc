"""Poses of everybody in a recording: hulls in, poses out, streamed frame by frame.

Each tracked person is first watched for a window of some seconds, from which the body and the first pose come
(`hmc.pose.start`); then every frame is one step of the filter. Only the windows of people who have just appeared are held
in memory. Records of what is done go to a journal, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hmc.files import atomic_write
from hmc.frontend import FrontendSettings, HullStep, stream_hulls
from hmc.journal import append_journal, read_journal
from hmc.landmarks import LANDMARKS
from hmc.montecarlo.filters import ParticleState
from hmc.pose.annealed.apf import PoseFilter, PoseInfo, PoseState, make_filter, pose_init, pose_step
from hmc.pose.annealed.hull_target import HullTarget, make_target
from hmc.pose.annealed.presets import PosePreset
from hmc.pose.body.joints import DOF_NAMES
from hmc.pose.body.kinematics import landmarks
from hmc.pose.body.model import BodyModel
from hmc.pose.body.proportions import make_body
from hmc.pose.start import start_person
from hmc.recording import Recording
from hmc.results import PoseStates, PoseTable, TrackTable
from hmc.tracking.resumable import WARM_UP_FRAMES, observe_step, person_grid
from hmc.tracking.tracks import person_voxels, velocities
from hmc.voxels.grid import VoxelGrid

__all__ = ["PosedPeople", "pose_recording"]

logger = logging.getLogger("hmc")

#: How long a person is watched before the body and the first pose are decided, seconds, and at most this many frames.
WINDOW_S, WINDOW_FRAMES = 1.5, 45


@dataclass(frozen=True)
class PosedPeople:
    """Everybody's poses.

    Parameters
    ----------
    poses : PoseTable
        Landmarks; NaN in a frame without a fit.
    states : PoseStates
        The same frames as state vectors, with the bodies.
    costs : ndarray, shape (n,)
        Of each row, square metres; NaN where there is none.
    notes : tuple of str
        What a user should know, one line each.
    """

    poses: PoseTable
    states: PoseStates
    costs: np.ndarray
    notes: tuple[str, ...]


def pose_recording(
    recording: Recording,
    tracks: TrackTable,
    voxel_size_m: float,
    preset: PosePreset,
    seed: int = 0,
    *,
    height_m: float | None = None,
    frontend: FrontendSettings | None = None,
    journal: str | Path | None = None,
    key: str = "",
    on_problem: Callable[[str], None] | None = None,
    progress: Callable[[Iterable[HullStep], int], Iterable[HullStep]] | None = None,
) -> PosedPeople:
    """Estimate the pose of every tracked person in every frame of their track.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable
        As from `hmc.tracking.resumable.track_recording`.
    voxel_size_m : float
    preset : PosePreset
    seed : int
        The same seed gives the same result, stopped and resumed or not.
    height_m : float, optional
        Stature of everybody; estimated from each person's volume where left out.
    frontend : FrontendSettings, optional
    journal : path, optional
        File in which the run is kept, and from which it goes on.
    key : str
        Says what the run depends on. A journal with another key is begun anew.
    on_problem : callable, optional
        Called with one line for everything that was survived.
    progress : callable, optional
        ``progress(steps, total)`` passes the frames on and may show how far they are.

    Returns
    -------
    PosedPeople

    Raises
    ------
    InputError
        When the voxels are too many for the memory.
    """
    grid = person_grid(recording, voxel_size_m)
    records = _Records(journal, key)
    work = _Work(recording, tracks, grid, preset, seed, height_m, records)
    first, end = work.next_frame(), recording.start + recording.n_frames
    if first < end:
        report = on_problem or logger.warning
        stream = stream_hulls(recording, grid, frontend, first=first, warm_up=WARM_UP_FRAMES, on_problem=report)
        for hull in progress(stream, end - first) if progress else stream:
            work.frame(hull)
    return _assemble(records.all(), preset)


class _Records:
    """What is done, in a journal on disk or, without one, in memory."""

    def __init__(self, path: str | Path | None, key: str) -> None:
        self.path = path
        self.kept: list[dict[str, Any]] = []
        self.written: dict[int, int] = {}
        if path is not None:
            found = read_journal(path)
            if not found or found[0].get("key") != key:
                Path(path).unlink(missing_ok=True)
                append_journal(path, {"key": key})

    def add(self, record: dict[str, Any]) -> None:
        if self.path is None:
            self.kept.append(record)
        else:
            append_journal(self.path, record)

    def keep_particles(self, person: int, frame: int, particles: ParticleState) -> None:
        """Beside the journal; those of the frame before stay until the frame after, should the run stop between two writes."""
        if self.path is not None:
            self.written[person] = self.written.get(person, 0) + 1
            with atomic_write(self._particle_file(person, self.written[person] % 2), "wb") as file:
                np.savez(file, frame=frame, particles=particles.particles, log_weights=particles.log_weights)

    def particles(self, person: int, frame: int) -> ParticleState | None:
        """Those kept for this frame; the next are then written to the other file."""
        for turn in (0, 1) if self.path is not None else ():
            if self._particle_file(person, turn).exists():
                with np.load(self._particle_file(person, turn), allow_pickle=False) as data:
                    if int(data["frame"]) == frame:
                        self.written[person] = turn
                        return ParticleState(data["particles"], data["log_weights"])
        return None

    def _particle_file(self, person: int, turn: int) -> Path:
        path = Path(self.path or "")
        return path.with_name(f"{path.name}.{person}.{turn}.npz")

    def all(self) -> list[dict[str, Any]]:
        return self.kept if self.path is None else read_journal(self.path)[1:]


class _Work:
    """The people of a run in their various stages: still watched, followed, or done."""

    def __init__(self, recording, tracks: TrackTable, grid: VoxelGrid, preset: PosePreset, seed: int, height_m, records: _Records) -> None:
        self.recording, self.tracks, self.grid, self.preset, self.seed, self.height_m = recording, tracks, grid, preset, seed, height_m
        self.records = records
        self.window = max(3, min(WINDOW_FRAMES, round(WINDOW_S * recording.fps)))
        self.spans = {int(p): (f := tracks.frames[tracks.persons == p], int(f.min()), int(f.max()))[1:] for p in np.unique(tracks.persons)}
        self.speed = velocities(tracks, recording.fps)
        self.watched: dict[int, list[HullTarget | None]] = {}
        self.followed: dict[int, tuple[PoseFilter, PoseState]] = {}
        self.done_to: dict[int, int] = {}  # person -> last frame with a record
        for record in records.all():
            self._take_up(record)

    def _take_up(self, record: dict[str, Any]) -> None:
        person = record["person"]
        if "body" in record:
            body = _body_of(record["body"], self.preset)
            filt = make_filter(body, self.preset, self.recording.fps, self.grid.voxel_size_m, self.recording.room)
            self.followed[person] = (filt, pose_init(np.zeros(len(DOF_NAMES))))
        self.done_to[person] = record["frames"][-1]
        if record["states"]:
            particles = self.records.particles(person, record["frames"][-1])
            state = pose_init(np.array(record["states"][-1]), np.array(record["velocity"]), particles)
            self.followed[person] = (self.followed[person][0], state)

    def next_frame(self) -> int:
        """First frame that anybody still needs; the end of the selection when all is done."""
        end = self.recording.start + self.recording.n_frames
        needed = []
        for person, (first, last) in self.spans.items():
            start = self.done_to[person] + 1 if person in self.done_to else first
            if start <= last:
                needed.append(start)
        return min(needed, default=end)

    def rng(self, person: int, frame: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, person, frame])

    def frame(self, hull: HullStep) -> None:
        """One frame of everybody who is in it."""
        rows = np.flatnonzero(self.tracks.frames == hull.index)
        persons = [int(p) for p in self.tracks.persons[rows]]
        targets: list[HullTarget | None] = [None] * len(rows)
        observation = observe_step(self.recording, self.grid, hull) if len(rows) else None
        if observation is not None:
            # The tolerant hull is shared out among the people; the rest of the loose one is anybody's.
            spare, floor_z = hull.loose & ~hull.tolerant, float(self.recording.room[0, 2])
            for k, voxels in enumerate(person_voxels(observation, self.tracks.positions[rows])):
                targets[k] = make_target(self.grid, voxels[hull.strict[tuple(voxels.T)]], voxels, spare, floor_z)
        for person, target in zip(persons, targets, strict=True):
            if self.done_to.get(person, -1) >= hull.index:
                continue
            if person in self.followed:
                filt, state = self.followed[person]
                state, info = pose_step(self.rng(person, hull.index), filt, state, target)
                self.followed[person] = (filt, state)
                self._record(person, [hull.index], [state], [info])
            else:
                self.watched.setdefault(person, []).append(target)
                if len(self.watched[person]) >= self.window or hull.index == self.spans[person][1]:
                    self._start(person, hull.index)

    def _start(self, person: int, last: int) -> None:
        targets = self.watched.pop(person)
        rows = np.flatnonzero((self.tracks.persons == person) & (self.tracks.frames <= last))[-len(targets) :]
        frames = self.tracks.frames[rows].tolist()
        started = start_person(
            lambda k: self.rng(person, frames[k]),
            self.preset,
            self.recording.fps,
            targets,
            self.height_m,
            self.speed[rows],
            self.recording.room,
        )
        if started is None:
            # Nothing to start from yet: these frames stay without a pose, and the next window is tried.
            nothing = PoseInfo(np.nan, (), 0, None, "no hull to start from")
            self.records.add({"person": person, "frames": frames, "states": [], "costs": [], "status": [nothing.status] * len(frames)})
            return
        self.followed[person] = (started.filter, started.states[-1])
        self._record(person, frames, started.states, started.infos, started.filter.body)

    def _record(self, person: int, frames, states: list[PoseState], infos: list[PoseInfo], body: BodyModel | None = None) -> None:
        record = {
            "person": person,
            "frames": frames,
            "states": [one.state for one in states],
            "velocity": states[-1].velocity,
            "costs": [info.cost if np.isfinite(info.cost) else None for info in infos],
            "status": [info.status for info in infos],
        }
        if self.preset.refine is None:
            self.records.keep_particles(person, frames[-1], states[-1].particles)
        self.records.add(record | ({"body": body.dimensions} if body is not None else {}))


def _body_of(dimensions: dict[str, float], preset: PosePreset) -> BodyModel:
    from hmc.pose.body.joints import canton_limits, default_limits

    return make_body(dimensions, canton_limits() if preset.body == "canton" else default_limits())


def _assemble(records: list[dict[str, Any]], preset: PosePreset) -> PosedPeople:
    """Tables in order of frame and person from the records of a run."""
    bodies = {record["person"]: _body_of(record["body"], preset) for record in records if "body" in record}
    frames, persons, states, costs, fitted, notes = [], [], [], [], [], []
    for record in records:
        for k, state in enumerate(record["states"]):
            frames.append(record["frames"][k])
            persons.append(record["person"])
            states.append(state)
            costs.append(np.nan if record["costs"][k] is None else record["costs"][k])
            fitted.append(record["status"][k] == "fitted")
    order = np.lexsort([persons, frames])
    frame, person = np.array(frames, int)[order], np.array(persons, int)[order]
    state = np.array(states, float).reshape(-1, len(DOF_NAMES))[order]
    is_fitted = np.array(fitted, bool)[order]
    positions = np.full((len(frame), len(LANDMARKS), 3), np.nan)
    for who, body in bodies.items():
        rows = (person == who) & is_fitted
        positions[rows] = landmarks(body, state[rows])
    for reason, who, count in _unfitted(records):
        notes.append(f"person {who}: {count} frame{'s' if count > 1 else ''} without a pose: {reason}")
    return PosedPeople(
        PoseTable(frame, person, positions),
        PoseStates(frame, person, state, DOF_NAMES, {who: body.dimensions for who, body in bodies.items()}),
        np.array(costs, float)[order],
        tuple(notes),
    )


def _unfitted(records: list[dict[str, Any]]) -> Iterator[tuple[str, int, int]]:
    counts: dict[tuple[str, int], int] = {}
    for record in records:
        for status in record["status"]:
            if status != "fitted":
                counts[status, record["person"]] = counts.get((status, record["person"]), 0) + 1
    for (status, person), count in sorted(counts.items(), key=lambda entry: entry[0][1]):
        yield status, person, count
