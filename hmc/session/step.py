"""People in images as they come: one frame of every camera in, and who is there out, without a recording and without an end.

It is the chain of `hmc.pose` (silhouettes, hulls, tracker, views, poses) taken a frame at a time: `session_step` takes a state and the
images of a moment and returns the state after it and what it shows. Who wants the state kept between calls takes `hmc.Session`.

One pass: what a recording's second pass learns from frames yet to come is not to be had. What a track learns late (where a person was
before they were one, gaps that are filled, numbers put in order) is left out too, and velocities are those of the frames so far. Delays
are bounded (`SessionSettings.first_delay_s`, `SessionSettings.delay_s`), and so is memory: a person is forgotten when their track ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel
from hmc.camera.model import Rig
from hmc.camera.segmentation import BackgroundModel
from hmc.io.masks import MaskStep
from hmc.io.recording import Frame, Recording
from hmc.pose.follow import known_landmarks
from hmc.pose.person import DecidedFrames, PersonState, PersonTrack, PoseTask, end_person, person_step
from hmc.pose.views.person_view import PersonView, views_of
from hmc.processes import one_thread
from hmc.session.images import Images, frame_images
from hmc.tracking.following import init, original_number
from hmc.tracking.resumable import observe_step
from hmc.tracking.state import TrackerState, TrackRow
from hmc.tracking.trackers import Tracker
from hmc.tracking.tracks import frame_rng, from_rows, velocities
from hmc.voxels.carving import CarvingTables
from hmc.voxels.completion import CompletionTables
from hmc.voxels.frontend_settings import FrontendSettings
from hmc.voxels.hulls import carve_step, settle
from hmc.voxels.looks import look_once

__all__ = ["FollowedPerson", "LiveFrame", "LivePerson", "SessionSettings", "SessionState", "end_session", "session_step"]

#: Velocities are those of so long, seconds: as far as those of a recording look back.
VELOCITY_S = 0.2
#: Of people who left, the colors of so many are remembered; of candidates who never became persons, places of so long, seconds.
MOST_DEPARTED, CANDIDATE_S = 50, 10.0


@dataclass(frozen=True, eq=False)
class SessionSettings:
    """What does not change from frame to frame; `session_settings` makes one.

    Attributes
    ----------
    rig : Rig
        The cameras, as their images come.
    scene : Recording
        Room, frames a second, and the rig of images as they are used, which may be smaller; it has no footage and no place on a disk.
    tracker : Tracker
    task : PoseTask or None
        None: people are tracked, not posed.
    coarse, fine : CarvingTables
        Of the voxels for tracks and for poses.
    completion : CompletionTables
    seed : int
    frontend : FrontendSettings
    """

    rig: Rig
    scene: Recording
    tracker: Tracker
    task: PoseTask | None
    coarse: CarvingTables
    fine: CarvingTables
    completion: CompletionTables
    seed: int = 0
    frontend: FrontendSettings = field(default_factory=FrontendSettings)

    @property
    def first_delay_s(self) -> float:
        """From the moment in which a person is tracked to their first decided pose, seconds: the window in which they are watched, and
        the time in which their legs are told apart."""
        return 0.0 if self.task is None else (self.task.window + self.task.lag) / self.scene.fps

    @property
    def delay_s(self) -> float:
        """How old the newest decided pose is at most from then on, seconds: poses are decided in turns of half of that."""
        return 0.0 if self.task is None else max(0, 2 * self.task.lag - 1) / self.scene.fps


@dataclass(frozen=True, eq=False)
class LivePerson:
    """What is known of a person in a frame; lengths in metres, in the world.

    Attributes
    ----------
    position, head : ndarray, shape (3,)
        Centroid and centre of the head, in this frame.
    landmarks : ndarray, shape (15, 3), or None
        The newest decided pose, in the order of `hmc.landmarks.LANDMARKS`; NaN where nothing shows a limb. None: there is none yet.
    state : ndarray, shape (37,), or None
        The same as angles (`hmc.body.joints.DOF_NAMES`), metres and radians.
    body : BodyModel or None
    decided_frame : int or None
        The frame of that pose.
    latest : ndarray, shape (15, 3), or None
        Landmarks in this very frame; left and right leg may yet be exchanged. None while the person is watched.
    """

    position: np.ndarray
    head: np.ndarray
    landmarks: np.ndarray | None = None
    state: np.ndarray | None = None
    body: BodyModel | None = None
    decided_frame: int | None = None
    latest: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """What a frame shows.

    Attributes
    ----------
    index : int
        Steps before it.
    people : mapping of int to LivePerson
        By number, of those whom the frame shows. Who comes back has a new number until they are known again by their colors.
    decided : tuple of DecidedFrames
        All poses that were decided by this frame, of whoever; each frame of a person is in one of them at most.
    silent : tuple of str
        Cameras without a silhouette: no image came, or nearly all of it changed at once.
    """

    index: int
    people: Mapping[int, LivePerson]
    decided: tuple[DecidedFrames, ...] = ()
    silent: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FollowedPerson:
    """A person between two frames: the last places (oldest first), what the poses go on from, and the newest decided pose."""

    trail: tuple[TrackRow, ...] = ()
    pose: PersonState = field(default_factory=PersonState)
    newest: DecidedFrames | None = None


@dataclass(frozen=True, eq=False)
class SessionState:
    """A session between two frames.

    Attributes
    ----------
    models : tuple of BackgroundModel
        One a camera.
    tracker : TrackerState
    people : mapping of int to FollowedPerson
        By the tracker's number, of tracks that go on.
    index : int
        Of the next frame.
    """

    models: tuple[BackgroundModel, ...]
    tracker: TrackerState
    people: Mapping[int, FollowedPerson] = field(default_factory=dict)
    index: int = 0


@one_thread()
def session_step(settings: SessionSettings, state: SessionState, images: Images) -> tuple[SessionState, LiveFrame]:
    """The state after one more frame of every camera, and what the frame shows.

    Parameters
    ----------
    settings : SessionSettings
    state : SessionState
        Is not changed, but for the models of the empty scene: their mixtures of Gaussians and means learn in place, every
        `hmc.camera.segmentation.SegmentationSettings.learn_every` frames and when a light is switched. Stepping again from a state gives
        the same again only in frames between.
    images : sequence of ndarray, shape (h, w, 3), uint8 BGR, or None; one a camera
        None where a camera has no image. They are copied.

    Returns
    -------
    state : SessionState
    found : LiveFrame
        Of a frame without any image nobody, and everybody is waited for.

    Raises
    ------
    InputError
        When there are not as many images as cameras, or one is no image of its camera's size; the state is good still.
    """
    scene, index = settings.scene, state.index
    frame = Frame(index, frame_images(settings.rig, images, scene.factors), None)
    with ThreadPoolExecutor(settings.frontend.threads or None) as pool:
        look, models = look_once(dict(enumerate(state.models)), frame, settings.frontend.segmentation.at_rate(scene.fps), pool)
    step = MaskStep(index, look.images, *settle(settings.completion, look, settings.frontend))
    coarse = carve_step(settings.coarse, step, settings.frontend)
    observation = observe_step(scene, settings.coarse.grid, coarse, images=settings.tracker.color)
    tracker, info = settings.tracker.step(frame_rng(settings.seed, index), state.tracker, index, observation)
    tracker = _forget(tracker)
    shown = _shown(index, info.rows, tracker, state.people)
    # Who is not shown for a moment goes on being followed where the tracker expects them.
    expected = [TrackRow(index, one.person, one.position, one.head) for one in tracker.tracks if one.person in state.people]
    rows = list(({row.person: row for row in expected} | shown).values())
    views: dict[int, PersonView] = {}
    if settings.task is not None and rows:
        fine = coarse if settings.fine is settings.coarse else carve_step(settings.fine, step, settings.frontend)
        views = views_of(scene, settings.fine.grid, from_rows(rows), fine, settings.task.method.needs)
    decided: list[DecidedFrames] = []
    people: dict[int, FollowedPerson] = {}
    for row in rows:
        people[row.person], new = _follow(settings, state.people.get(row.person, FollowedPerson()), row, views.get(row.person))
        decided += new
    decided += _left(settings.task, state.people, people)
    found = LiveFrame(
        index,
        {original_number(tracker.reidentified, number): _as_shown(row, people[number]) for number, row in sorted(shown.items())},
        _told(decided, tracker),
        tuple(name for name, mask in zip(scene.rig.names, look.masks, strict=True) if mask is None),
    )
    return SessionState(tuple(models[c] for c in range(len(scene.rig))), tracker, people, index + 1), found


@one_thread()
def end_session(settings: SessionSettings, state: SessionState) -> tuple[SessionState, tuple[DecidedFrames, ...]]:
    """Everybody leaves: the poses that still waited for later frames, and the state without people.

    Parameters
    ----------
    settings : SessionSettings
    state : SessionState
    """
    decided = _left(settings.task, state.people, {})
    empty = init(settings.scene.fps, settings.scene.persons)
    return replace(state, tracker=replace(empty, next_person=state.tracker.next_person), people={}), _told(decided, state.tracker)


def _shown(index: int, rows: Iterable[TrackRow], tracker: TrackerState, known: Mapping[int, FollowedPerson]) -> dict[int, TrackRow]:
    """Where the frame shows people. The tracker holds back rows of those who for a while do not look like a person, who sit on the floor or
    lie, and tells them later; here they are told at once of those who were told of before."""
    doubted = [replace(one.withheld[-1], person=one.person) for one in tracker.tracks if one.withheld and one.person in known]
    alive = {one.person for one in tracker.tracks}
    return {row.person: row for row in (*doubted, *rows) if row.frame == index and row.person in alive}


def _follow(
    settings: SessionSettings, person: FollowedPerson, row: TrackRow, view: PersonView | None
) -> tuple[FollowedPerson, list[DecidedFrames]]:
    """A person one frame on, and what is decided by it."""
    fps, task = settings.scene.fps, settings.task
    trail = tuple(one for one in (*person.trail, row) if row.frame - one.frame <= max(1, round(VELOCITY_S * fps)))
    if task is None or view is None:
        return replace(person, trail=trail), []
    speed = velocities(from_rows(trail), fps, 2 * VELOCITY_S)
    track = PersonTrack(row.person, np.array([one.frame for one in trail]), speed, ended=False)
    pose, decided = person_step(task, track, person.pose, replace(view, velocity=speed[-1]))
    fitted = [one for one in decided if one.body is not None and any(info.status == "fitted" for info in one.infos)]
    newest = replace(fitted[-1], tracked=None) if fitted else person.newest
    return FollowedPerson(trail, pose, newest), decided


def _left(task: PoseTask | None, before: Mapping[int, FollowedPerson], after: Mapping[int, FollowedPerson]) -> list[DecidedFrames]:
    """What was left to decide of those whose track ended."""
    if task is None:
        return []
    gone = [(number, person) for number, person in before.items() if number not in after]
    nothing = np.zeros(0, int), np.zeros((0, 3))
    return [one for number, person in gone for one in end_person(task, PersonTrack(number, *nothing), person.pose)]


def _told(decided: Iterable[DecidedFrames], tracker: TrackerState) -> tuple[DecidedFrames, ...]:
    """The same without what the method remembers, by the numbers that are told."""
    return tuple(replace(one, person=original_number(tracker.reidentified, one.person), tracked=None) for one in decided)


def _as_shown(row: TrackRow, person: FollowedPerson) -> LivePerson:
    """A person as they are told of."""
    tracked, newest = person.pose.tracked, person.newest
    latest = None if tracked is None else landmarks(tracked.subject.body, tracked.state)
    if newest is None or newest.body is None:
        return LivePerson(row.position, row.head, latest=latest)
    k = max(k for k, info in enumerate(newest.infos) if info.status == "fitted")
    state, missing = newest.states[k], newest.infos[k].missing
    missing = np.zeros(len(state), bool) if missing is None else missing
    places = known_landmarks(newest.body, state[None], missing[None])[0]
    return LivePerson(row.position, row.head, places, np.where(missing, np.nan, state), newest.body, newest.frames[k], latest)


def _forget(tracker: TrackerState) -> TrackerState:
    """The tracker's state without what would grow with time: those who left long ago, and the long past of candidates."""
    most, alive = round(CANDIDATE_S * tracker.fps), {track.person for track in tracker.tracks}
    return replace(
        tracker,
        departed=tracker.departed[-MOST_DEPARTED:],
        reidentified=tuple(pair for pair in tracker.reidentified if pair[0] in alive),
        candidates=tuple(replace(one, rows=one.rows[-most:]) if len(one.rows) > most else one for one in tracker.candidates),
    )
