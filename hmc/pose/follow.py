"""The poses of all persons in a recording by any method: views in, poses out, streamed frame by frame.

Each person is a state that a step takes from frame to frame (`hmc.pose.person`). Only the views of people who have just appeared are held
in memory. Records of what is decided go to a journal, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from hmc.body.feet import foot_points
from hmc.body.joints import DOF_NAMES
from hmc.body.kinematics import landmark_masks, landmarks
from hmc.body.model import BodyModel
from hmc.body.proportions import make_bodies
from hmc.errors import InputError
from hmc.io.camera_faults import Faults, sentence
from hmc.io.camera_turns import TURNED_CAMERAS, write_turns
from hmc.io.detections import DetectionTable
from hmc.io.evidence import write_evidence
from hmc.io.fits import write_fits
from hmc.io.masks import MaskStep, keep_masks, kept_frames
from hmc.io.recording import Recording, for_voxels
from hmc.io.result_files import BESIDE
from hmc.io.results import PoseStates, PoseTable, TrackTable, write_joints, write_pose
from hmc.landmarks import FOOT_POINTS, LANDMARKS, landmark_index
from hmc.pose.finished import FinishedPeople
from hmc.pose.keypoint_cues import KeypointCues, with_keypoints
from hmc.pose.method import Capture, PoseMethod
from hmc.pose.person import DecidedFrames, PersonState, PersonTrack, PoseTask, person_step, resumed, starts_with
from hmc.pose.records import keep_decided, kept_decided
from hmc.pose.views.markers import marker_views, seen_in_frame
from hmc.pose.views.person_view import IMAGES_FOR, PersonView, check_needs, views_of
from hmc.pose.views.recent import RecentViews
from hmc.processes import ahead, each_ahead, may_fork, stepped_apart
from hmc.tracking.resumable import WARM_UP_FRAMES, kept_silhouettes, person_grid
from hmc.tracking.tracks import velocities
from hmc.voxels.carving import shared_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import HullStep, stream_hulls
from hmc.voxels.run_options import RunOptions

__all__ = ["FollowOptions", "PosedPeople", "follow", "for_method", "known_landmarks", "only_person", "persons_of", "unfitted_notes"]


@dataclass(frozen=True, repr=False)
class PosedPeople(FinishedPeople):
    """The poses of all persons.

    Parameters
    ----------
    poses : PoseTable
        Landmarks; NaN in a frame without a fit.
    states : PoseStates
        The same frames as state vectors, with the bodies.
    costs : ndarray, shape (n,)
        Of each row, as the method tells them; NaN where there is none.
    notes : tuple of str
        What a user should know, one line each.
    details : tuple of mapping
        What the method tells of each row beside that; empty for most.
    status : tuple of str
        ``"fitted"``, or why there is no pose, of each row.
    fps : float or None
        Frames a second of the recording, where they are known.
    passes_apart : ndarray, shape (n, 15), or None
        How far apart two passes, forward and backward in time, have each landmark, metres; NaN where a row has one pose only. None of
        one pass.
    evidence : mapping of str to ndarray, shape (n, 15), or None
        What trust rests on (`hmc.io.evidence.EVIDENCE`); None where silhouettes were not asked.
    turned : mapping of str to ndarray, shape (3,)
        Cameras that were turned back before poses were found (`hmc.pose.turned_back`).
    known : mapping of int to mapping of str to float
        How well each fitted dimension of each person's body is known (`hmc.body.dimensions.whole_deviations`). Of methods that fit none
        over the run none.
    """

    poses: PoseTable
    states: PoseStates
    costs: np.ndarray
    notes: tuple[str, ...]
    details: tuple[Mapping[str, object], ...] = ()
    status: tuple[str, ...] = ()
    fps: float | None = None
    passes_apart: np.ndarray | None = None
    evidence: Mapping[str, np.ndarray] | None = None
    turned: Mapping[str, np.ndarray] = field(default_factory=dict)
    known: Mapping[int, Mapping[str, float]] = field(default_factory=dict)

    @property
    def frames(self) -> np.ndarray:
        """Absolute frame number of each row, shape (n,)."""
        return self.poses.frames

    @property
    def persons(self) -> np.ndarray:
        """Person of each row, shape (n,)."""
        return self.poses.persons

    @property
    def positions(self) -> np.ndarray:
        """Landmarks, world, metres, shape (n, 15, 3), in the order of `hmc.landmarks.LANDMARKS`."""
        return self.poses.positions

    @property
    def angles(self) -> np.ndarray:
        """Angles of the joints and of the root, radians, shape (n, 34), in the order of `angle_names`."""
        return self.states.states[:, 3:]

    @property
    def angle_names(self) -> tuple[str, ...]:
        """What each angle is called."""
        return self.states.dof_names[3:]

    @property
    def feet(self) -> PoseTable:
        """Heels and toes (`hmc.landmarks.FOOT_POINTS`) of each row, with the views of the ankle; NaN of bodies without feet."""
        points = np.full((len(self.frames), len(FOOT_POINTS), 3), np.nan)
        for person, body in make_bodies(self.states.bodies).items():
            own = self.states.persons == person
            points[own] = foot_points(body, self.states.states[own])
        ankles = [landmark_index(f"{name[0]}_ankle") for name in FOOT_POINTS]
        views = None if self.poses.views is None else self.poses.views[:, ankles]
        return PoseTable(self.frames, self.persons, points, views, FOOT_POINTS)

    def to_frame(self):
        """A pandas frame with the columns of ``joints.csv``: frame, person, joint, x, y, z in metres; views and trust where known."""
        import pandas as pd

        rows, joints = self.positions.shape[:2]
        columns = {"frame": np.repeat(self.frames, joints), "person": np.repeat(self.persons, joints), "joint": list(LANDMARKS) * rows}
        columns |= dict(zip("xyz", self.positions.reshape(-1, 3).T, strict=True))
        if self.poses.views is not None:
            columns["views"] = self.poses.views.ravel().astype(int)
        if self.poses.trust is not None:
            columns["trust"] = self.poses.trust.ravel()
        return pd.DataFrame(columns)

    def save(self, folder: str | Path) -> None:
        """Write ``joints.csv``, ``pose.npz``, and what there is of `hmc.io.result_files.BESIDE`; no other run's of these stays."""
        folder, feet = Path(folder), self.feet
        others = set(BESIDE)
        write_joints(folder / "joints.csv", self.poses)
        if np.isfinite(feet.positions).any():
            write_joints(folder / "feet.csv", feet)
            others.remove("feet.csv")
        if self.evidence is not None:
            write_evidence(folder / "evidence.csv", self.poses, self.evidence)
            others.remove("evidence.csv")
        if any(self.details):
            write_fits(folder / "fits.csv", self.frames.tolist(), self.persons.tolist(), self.status, self.details)
            others.remove("fits.csv")
        if self.turned:
            write_turns(folder, self.turned)
            others.remove(TURNED_CAMERAS)
        write_pose(folder / "pose.npz", replace(self.states, costs=self.costs, fps=self.fps))
        # Last: a disk that is full takes nothing away.
        for name in others:
            (folder / name).unlink(missing_ok=True)


@dataclass(frozen=True)
class FollowOptions:
    """What a method is run with.

    Parameters
    ----------
    voxel_size_m : float
    seed : int
        The same seed gives the same result, stopped and resumed or not.
    height_m : float or None
        Stature of every person; estimated for each where left out.
    detections : DetectionTable or None
        For methods that need them; one person's.
    drift : ndarray, shape (37,), or None
        P0 of filters, as in `hmc.pose.method.Capture`.
    keypoints : KeypointCues or None
        What a detector of 2-D keypoints saw.
    recent : RecentViews or None
        Where the pass forward leaves views for the pass backward; None: that makes all of them again. The result is the same.
    change : callable or None
        What is made of every frame's hulls before the pass forward sees them: what an experiment hides.
    """

    voxel_size_m: float = 0.03
    seed: int = 0
    height_m: float | None = None
    detections: DetectionTable | None = None
    drift: np.ndarray | None = None
    keypoints: KeypointCues | None = None
    recent: RecentViews | None = None
    change: Callable[[HullStep], HullStep] | None = None


def follow(
    recording: Recording,
    tracks: TrackTable | None,
    method: PoseMethod,
    options: FollowOptions | None = None,
    run: RunOptions | None = None,
) -> PosedPeople:
    """The pose of every tracked person in every frame of their track.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable or None
        As from `hmc.tracking.resumable.track_recording`; None for a method that needs none: there is one person then, in all frames.
    method : PoseMethod
    options : FollowOptions, optional
    run : RunOptions, optional

    Returns
    -------
    PosedPeople

    Raises
    ------
    InputError
        When the voxels are too many for the memory, or what the method needs is not given.
    """
    options, run, needs = options or FollowOptions(), run or RunOptions(), check_needs(method.needs)
    if "detections" in needs and options.detections is None:
        raise InputError(f"method {method.name} needs detections (frame, camera, u, v)")
    if "keypoints" in needs and options.keypoints is None:
        raise InputError(f"method {method.name} needs keypoints of a 2-D detector (hmc.io.keypoints.open_keypoints)")
    tracks = only_person(recording) if tracks is None else tracks
    capture = Capture(recording.fps, options.voxel_size_m, recording.room, recording.rig, options.drift, workers=run.workers)
    task, persons = PoseTask(method, capture, options.seed, options.height_m), persons_of(recording, tracks)
    states = dict.fromkeys(persons, PersonState())
    done: list[DecidedFrames] = []
    for decided in kept_decided(run.journal, run.key, task, run.on_problem):
        done.append(replace(decided, tracked=None))
        states[decided.person] = resumed(task, states[decided.person], decided)
    left = {number: person.frames[person.frames > states[number].done_to] for number, person in persons.items()}
    first = min((int(frames[0]) for frames in left.values() if len(frames)), default=None)
    views = iter(()) if first is None else _kept(_views_from(recording, tracks, method, options, run, first), method, options)
    for decided, before in _decided(task, persons, states, views, run):
        keep_decided(run.journal, decided, before)
        done.append(replace(decided, tracked=None))  # memories are not kept for long
    return replace(_posed_people(done), fps=recording.fps)


_Views = Iterator[tuple[int, dict[int, PersonView]]]


def _kept(frames: _Views, method: PoseMethod, options: FollowOptions) -> _Views:
    """Pass views on, and leave them for the pass backward."""
    for frame, views in frames:
        if options.recent is not None and method.back is not None:
            options.recent.add(frame, views)
        yield frame, views


def _decided(
    task: PoseTask, persons: Mapping[int, PersonTrack], states: dict[int, PersonState], frames: _Views, run: RunOptions
) -> Iterator[tuple[DecidedFrames, int]]:
    """What is decided of all people, as it is, with the last frame of the person that was decided before.

    Who has started beside somebody else is followed by a process of their own from then on.
    """
    apart: dict[int, Generator[list[tuple[DecidedFrames, int]], PersonView | None, None]] = {}
    with ExitStack() as stack:
        for frame, views in frames:
            views = {number: replace(view, velocity=persons[number].velocity(frame)) for number, view in views.items()}
            for number in apart.keys() & views:
                yield from apart[number].send(views[number])
            for number in [number for number in views if number not in apart and frame > states[number].done_to]:
                starts = starts_with(task, persons[number], states[number], frame)
                if starts:
                    run.say("first pose")
                states[number], new = _stepped(task, persons[number], states[number], views[number])
                if starts:
                    run.say("following")
                yield from new
                started = [one for one, state in states.items() if state.tracked is not None and one not in apart]
                if number in started[1:] and len(apart) < run.workers and run.workers > 1 and may_fork():
                    apart[number] = stack.enter_context(closing(stepped_apart(partial(_stepped, task, persons[number]), states[number])))
        for one in apart.values():
            yield from one.send(None)


def _stepped(
    task: PoseTask, person: PersonTrack, state: PersonState, view: PersonView
) -> tuple[PersonState, list[tuple[DecidedFrames, int]]]:
    """`person_step`, with the last frame that was decided before beside what is decided."""
    after, decided = person_step(task, person, state, view)
    return after, [(one, state.done_to) for one in decided]


def _views_from(
    recording: Recording, tracks: TrackTable, method: PoseMethod, options: FollowOptions, run: RunOptions, first: int
) -> Iterator[tuple[int, dict[int, PersonView]]]:
    """What each frame shows of every person, from the first that one still needs to the end of the selection."""
    end = recording.start + recording.n_frames
    cues = options.keypoints if method.keypoints else None
    if not method.needs_hulls:
        frames: Iterable = range(first, end)
        for frame in run.progress(frames, end - first) if run.progress else frames:
            persons = tracks.persons[tracks.frames == frame].tolist()
            blank = with_keypoints({person: PersonView(frame) for person in persons}, recording.rig, tracks, cues)
            yield frame, _with_markers(blank, recording, method, options)
        return
    grid = person_grid(recording, options.voxel_size_m)

    def seen(hulls: Iterable[HullStep]) -> Iterator[tuple[int, dict[int, PersonView]]]:
        for hull in hulls if options.change is None else map(options.change, hulls):
            views = with_keypoints(views_of(recording, grid, tracks, hull, method.needs), recording.rig, tracks, cues, hull.masks)
            yield hull.index, _with_markers(views, recording, method, options)

    def again(masks: Iterable[MaskStep] | None) -> Iterator[tuple[int, dict[int, PersonView]]]:
        return seen(stream_hulls(recording, grid, run.frontend, masks=masks or ()))

    if method.needs & IMAGES_FOR:  # videos are read in order
        masks = kept_silhouettes(recording, run, first, images=True)
        views = seen(_new_hulls(recording, grid, run, first)) if masks is None else ahead(lambda: again(masks), run.workers)
    elif kept_silhouettes(recording, run, first) is None:
        views = seen(_new_hulls(recording, grid, run, first))
    else:
        shared_tables(grid, recording.rig)  # once, for all processes
        views = each_ahead(lambda frames: again(kept_frames(run.masks or "", run.key, frames)), range(first, end), run.workers)
    yield from run.progress(views, end - first) if run.progress else views


def _new_hulls(recording: Recording, grid: VoxelGrid, run: RunOptions, first: int) -> Iterator[HullStep]:
    """Hulls from a frame on, of silhouettes that are made now, and kept where they are to be."""
    stream = stream_hulls(
        recording, grid, run.frontend, first=first, warm_up=WARM_UP_FRAMES, on_problem=run.on_problem, workers=run.workers
    )
    steps = stream if run.masks is None else keep_masks(run.masks, run.key, first, stream, run.on_problem)
    faults = Faults()
    for step in steps:
        faults = faults.plus(step.index, step.faults)
        yield step
    for fault in faults.all:
        run.on_problem(sentence(fault, recording.start + recording.n_frames))
        run.on_fault(fault)


def _with_markers(views: dict[int, PersonView], recording: Recording, method: PoseMethod, options: FollowOptions) -> dict[int, PersonView]:
    """The same with the frame's detections, where the method needs them."""
    if "detections" not in method.needs or options.detections is None:
        return views
    rig, detections = recording.rig, options.detections
    return {
        person: replace(view, markers=seen_in_frame(rig, marker_views(rig), detections.in_frame(view.frame, rig.names), method.gate_px))
        for person, view in views.items()
    }


def for_method(recording: Recording, method: PoseMethod, voxel_size_m: float) -> Recording:
    """The recording with images no larger than the method's voxels show; as it is for a method without, or with gates in pixels.

    Parameters
    ----------
    recording : Recording
    method : PoseMethod
    voxel_size_m : float
        Side of the smallest voxels, metres.
    """
    return for_voxels(recording, voxel_size_m) if method.needs_hulls and "detections" not in method.needs else recording


def only_person(recording: Recording) -> TrackTable:
    """The track of a person who is there in every frame of the selection, at an unknown position: person 0."""
    frames = np.arange(recording.start, recording.start + recording.n_frames)
    return TrackTable(frames, np.zeros(len(frames), int), np.zeros((len(frames), 3)))


def persons_of(recording: Recording, tracks: TrackTable) -> dict[int, PersonTrack]:
    """The tracks of all persons in the recording's selection, by number.

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
        persons[number] = PersonTrack(number, tracks.frames[rows], speed[rows])
    return persons


def unfitted_notes(persons: Iterable[int], status: Iterable[str]) -> list[str]:
    """A line for every reason why a person has frames without a pose.

    Parameters
    ----------
    persons, status : iterables of one length
        Person and status of every frame of a track; "fitted" is a pose.
    """
    why = Counter((int(person), str(reason)) for person, reason in zip(persons, status, strict=True) if reason != "fitted")
    return [f"person {one}: {n} frame{'s' if n > 1 else ''} without a pose: {reason}" for (one, reason), n in sorted(why.items())]


def _posed_people(rows: Sequence[DecidedFrames]) -> PosedPeople:
    """Tables of all rows of a run, in order of frame and person."""
    none = np.zeros((0, len(DOF_NAMES)))
    frames = np.array([frame for one in rows for frame in one.frames], int)
    persons = np.array([one.person for one in rows for _ in one.frames], int)
    states, infos = np.concatenate([none, *(one.states for one in rows)]), [info for one in rows for info in one.infos]
    order = np.lexsort([persons, frames])
    frames, persons, states, infos = frames[order], persons[order], states[order], [infos[k] for k in order]
    status = np.array([info.status for info in infos], object)
    missing = np.array([np.zeros(len(DOF_NAMES), bool) if info.missing is None else info.missing for info in infos]).reshape(states.shape)
    bodies = {one.person: one.body for one in rows if one.body is not None}
    positions = np.full((len(frames), len(LANDMARKS), 3), np.nan)
    for person, body in bodies.items():
        fitted = (persons == person) & (status == "fitted")
        positions[fitted] = known_landmarks(body, states[fitted], missing[fitted])
    return PosedPeople(
        PoseTable(frames, persons, positions),
        PoseStates(
            frames, persons, np.where(missing, np.nan, states), DOF_NAMES, {person: one.dimensions for person, one in bodies.items()}
        ),
        np.array([info.cost for info in infos], float),
        tuple(unfitted_notes(persons, status) + _limb_notes(persons, missing)),
        tuple(info.details for info in infos),
        tuple(status.tolist()),
    )


def known_landmarks(body: BodyModel, states: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Landmarks of poses; an angle that no data shows is not a number, and neither is what it moves.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (n, 37)
    missing : ndarray of bool, shape (n, 37)
        Angles that no data shows.

    Returns
    -------
    ndarray, shape (n, 15, 3)
        World, metres.
    """
    unknown = missing.astype(int) @ landmark_masks(body).T
    return np.where(unknown[..., None] > 0, np.nan, landmarks(body, states))


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
