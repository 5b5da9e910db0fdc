"""Poses of everybody in a recording: hulls in, poses out, streamed frame by frame.

Each person is a state that a step takes from frame to frame (`hmc.pose.person`). Only the hulls of people who have just
appeared are held in memory. Records of what is decided go to a journal, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.body.kinematics import landmark_masks, landmarks
from hmc.io.masks import MaskStep, kept_masks
from hmc.io.recording import Recording, iterate_frames
from hmc.io.results import PoseStates, PoseTable, TrackTable
from hmc.landmarks import LANDMARKS
from hmc.pose.person import Decided, FollowSettings, PersonState, PersonTask, PoseTask, person_step, taken_up
from hmc.pose.records import keep_decided, kept_decided
from hmc.pose.steps.preset import PosePreset
from hmc.pose.views.hull_target import HullTarget, make_target
from hmc.pose.views.rays import with_rays
from hmc.pose.views.unexplained import explaining
from hmc.tracking.resumable import WARM_UP_FRAMES, observe_step, person_grid
from hmc.tracking.tracks import person_voxels, velocities
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, HullStep, stream_hulls

__all__ = ["PosedPeople", "frames_left", "persons_of", "pose_recording", "posed_people", "targets_of", "unfitted_notes"]

logger = logging.getLogger("hmc")

#: Of so few cameras, hulls in which one or two may miss are mostly nobody: they count only where silhouettes ask for them. Of more, they
#: are little fatter than the strict one, and hold what furniture hides without silhouettes that would ask for it.
FEW_CAMERAS = 4


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
    settings: FollowSettings | None = None,
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
    recording : Recording
    tracks : TrackTable
        As from `hmc.tracking.resumable.track_recording`.
    voxel_size_m : float
    preset : PosePreset
    seed : int
        The same seed gives the same result, stopped and resumed or not.
    height_m : float, optional
        Stature of everybody; estimated from each person's volume where left out.
    settings : FollowSettings, optional
    frontend : FrontendSettings, optional
    journal : path, optional
        File in which the run is kept, and from which it goes on.
    masks : path, optional
        File in which silhouettes were kept under the same key; where it lacks any that are needed, they are made again.
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
    task = PoseTask(preset, settings or FollowSettings(), recording.fps, recording.room, voxel_size_m, seed, height_m)
    persons = persons_of(recording, tracks)
    states = dict.fromkeys(persons, PersonState())
    done: list[Decided] = []
    for decided in kept_decided(journal, key, preset):
        done.append(replace(decided, pose=None))
        states[decided.person] = taken_up(task, states[decided.person], decided)
    done_to = {number: state.done_to for number, state in states.items()}
    for hull in frames_left(
        recording, grid, persons, done_to, frontend=frontend, masks=masks, key=key, on_problem=on_problem, progress=progress
    ):
        for number, target in targets_of(recording, grid, tracks, hull).items():
            before = states[number].done_to
            if hull.index <= before:
                continue
            states[number], new = person_step(task, persons[number], states[number], hull.index, target)
            for decided in new:
                keep_decided(journal, preset, decided, before)
                done.append(replace(decided, pose=None))  # particles are not kept for long
    return posed_people(done)


def frames_left(
    recording: Recording,
    grid: VoxelGrid,
    persons: Mapping[int, PersonTask],
    done_to: Mapping[int, int],
    *,
    frontend: FrontendSettings | None = None,
    masks: str | Path | None = None,
    key: str = "",
    on_problem: Callable[[str], None] | None = None,
    progress: Callable[[Iterable[HullStep], int], Iterable[HullStep]] | None = None,
    images: bool = False,
) -> Iterator[HullStep]:
    """The frames from the first that somebody still needs to the end of the selection; none where all is done.

    Parameters
    ----------
    recording : Recording
    grid : VoxelGrid
    persons : mapping of int to PersonTask
    done_to : mapping of int to int
        The last frame of each person that is done.
    frontend, masks, key, on_problem, progress
        As for `pose_recording`.
    images : bool
        Whether images are wanted too where silhouettes were kept.

    Yields
    ------
    HullStep
    """
    needed = [frame for number, person in persons.items() for frame in person.frames[person.frames > done_to[number]][:1].tolist()]
    if not needed:
        return
    first, end, report = min(needed), recording.start + recording.n_frames, on_problem or logger.warning
    kept: Iterable[MaskStep] | None = None if masks is None else kept_masks(masks, key, first, end)
    if kept is not None and images:
        frames = iterate_frames(recording, first, end, report)
        kept = (replace(step, images=frame.images) for step, frame in zip(kept, frames, strict=True))
    stream = stream_hulls(recording, grid, frontend, first=first, warm_up=WARM_UP_FRAMES, masks=kept, on_problem=report)
    yield from progress(stream, end - first) if progress else stream


def targets_of(recording: Recording, grid: VoxelGrid, tracks: TrackTable, hull: HullStep) -> dict[int, HullTarget | None]:
    """Everybody's hulls in one frame.

    Parameters
    ----------
    recording : Recording
    grid : VoxelGrid
    tracks : TrackTable
    hull : HullStep

    Returns
    -------
    dict of int to HullTarget or None
        Every person of the frame; None where there is no hull of them.
    """
    rows = np.flatnonzero(tracks.frames == hull.index)
    targets: dict[int, HullTarget | None] = dict.fromkeys(tracks.persons[rows].tolist())
    observation = observe_step(recording, grid, hull) if len(rows) else None
    if observation is not None:
        # The tolerant hull is shared out among the people; the rest of the loose one is anybody's.
        spare, floor_z = hull.loose & ~hull.tolerant, float(recording.room[0, 2])
        tolerant = person_voxels(observation, tracks.positions[rows])
        strict = [voxels[hull.strict[tuple(voxels.T)]] for voxels in tolerant]
        new = None
        if sum(mask is not None for mask in hull.masks) <= FEW_CAMERAS:
            everybody = grid.centres(np.concatenate([np.zeros((0, 3), int), *strict]))
            new = partial(explaining, recording.rig, hull.masks, everybody, spacing_m=grid.voxel_size_m)
        for k, person in enumerate(targets):
            target = make_target(grid, strict[k], tolerant[k], spare, floor_z, new)
            if target is not None:
                others = grid.centres(np.concatenate([np.zeros((0, 3), int), *strict[:k], *strict[k + 1 :]]))
                target = with_rays(target, recording.rig, hull.masks, others)
            targets[person] = target
    return targets


def persons_of(recording: Recording, tracks: TrackTable) -> dict[int, PersonTask]:
    """Everybody who is tracked in the recording's selection.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable
        Rows outside of the selection do not count.
    """
    tracks = tracks.where((tracks.frames >= recording.start) & (tracks.frames < recording.start + recording.n_frames))
    speed = velocities(tracks, recording.fps)
    persons = {}
    for number in np.unique(tracks.persons).tolist():
        rows = np.flatnonzero(tracks.persons == number)
        rows = rows[np.argsort(tracks.frames[rows])]
        persons[number] = PersonTask(number, tracks.frames[rows], speed[rows])
    return persons


def unfitted_notes(persons: Iterable[int], status: Iterable[str]) -> list[str]:
    """A line for every reason why somebody has frames without a pose.

    Parameters
    ----------
    persons, status : iterables of one length
        Person and status of every frame of a track; "fitted" is a pose.
    """
    why = Counter((int(person), str(reason)) for person, reason in zip(persons, status, strict=True) if reason != "fitted")
    return [f"person {who}: {n} frame{'s' if n > 1 else ''} without a pose: {reason}" for (who, reason), n in sorted(why.items())]


def posed_people(rows: Sequence[Decided]) -> PosedPeople:
    """Tables of all rows of a run, in order of frame and person.

    Parameters
    ----------
    rows : sequence of Decided
    """
    none = np.zeros((0, len(DOF_NAMES)))
    frames = np.array([frame for one in rows for frame in one.frames], int)
    persons = np.array([one.person for one in rows for _ in one.frames], int)
    states = np.concatenate([none, *(one.states for one in rows)])
    costs = np.array([cost for one in rows for cost in one.costs])
    status = np.array([status for one in rows for status in one.status], object)
    order = np.lexsort([persons, frames])
    frames, persons, states, costs, status = frames[order], persons[order], states[order], costs[order], status[order]
    bodies = {one.person: one.body for one in rows if one.body is not None}
    missing = np.concatenate([none.astype(bool), *(_missing(one) for one in rows)])[order]
    positions = np.full((len(frames), len(LANDMARKS), 3), np.nan)
    for person, body in bodies.items():
        fitted = (persons == person) & (status == "fitted")
        positions[fitted] = landmarks(body, states[fitted])
        # An angle that no data shows is not a number, and neither is what it moves.
        unknown = missing[fitted].astype(int) @ landmark_masks(body).T
        positions[fitted] = np.where(unknown[..., None] > 0, np.nan, positions[fitted])
    states = np.where(missing, np.nan, states)
    notes = unfitted_notes(persons, status) + _limb_notes(persons, missing)
    return PosedPeople(
        PoseTable(frames, persons, positions),
        PoseStates(frames, persons, states, DOF_NAMES, {person: body.dimensions for person, body in bodies.items()}),
        costs,
        tuple(notes),
    )


def _missing(one: Decided) -> np.ndarray:
    return np.zeros((len(one.frames), len(DOF_NAMES)), bool) if one.missing is None else one.missing


def _limb_notes(persons: np.ndarray, missing: np.ndarray) -> list[str]:
    """In how many frames each person lacks which joints."""
    notes = []
    for person in np.unique(persons[missing.any(axis=1)]).tolist():
        counts: dict[str, int] = {}
        for dof, n in enumerate(missing[persons == person].sum(axis=0)):
            joint = DOF_NAMES[dof].rpartition("_")[0]
            counts[joint] = max(counts.get(joint, 0), int(n))
        lacking = ", ".join(f"{joint} {n}" for joint, n in counts.items() if n)
        notes.append(f"person {person}: frames in which the data does not show what hangs on a joint: {lacking}")
    return notes
