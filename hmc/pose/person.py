"""One person from the first sight to the last: watched, started, followed, and the legs told apart a little later.

A step takes what is known of a person and one frame's view and returns what is known then, with the rows of the frames that are decided, if
any. Whatever a step needs from earlier frames is in its state, and the random numbers of a frame depend on the seed, the person and the
frame alone, so a run can go on from the rows that it left (`resumed`). It is the same for all methods.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.body.model import BodyModel
from hmc.pose.legs import choose_legs, limb_points, no_alternatives
from hmc.pose.method import Alternatives, Capture, PoseMethod, StepInfo, StepResult, Subject, Tracked, begin_tracking
from hmc.pose.starts.walk import walk
from hmc.pose.views.person_view import PersonView
from hmc.processes import ahead, may_fork, share_out

__all__ = ["DecidedFrames", "PersonState", "PersonTrack", "PoseTask", "end_person", "person_step", "resumed", "starts_with"]

NO_START = "nothing to start from"
#: Frames of which alternatives are found by one process, which costs a hundredth of a second to start: their views are kept for so long,
#: and a decision waits for so many frames more.
TOGETHER = 15


@dataclass(frozen=True)
class PoseTask:
    """What is the same for every person in a run.

    Parameters
    ----------
    method : PoseMethod
    capture : Capture
    seed : int
    height_m : float or None
        None: estimated for each person.
    """

    method: PoseMethod
    capture: Capture
    seed: int = 0
    height_m: float | None = None

    @property
    def window(self) -> int:
        """Frames for which a person is watched: as many as there are in that time, and three at least."""
        return max(3, round(self.method.window_s * self.capture.fps))

    @property
    def lag(self) -> int:
        """Frames after which a frame is decided; 0: at once."""
        legs = self.method.legs
        return 0 if legs is None else max(1, round(legs.lag_s * self.capture.fps))

    @property
    def together(self) -> int:
        """Frames of which alternatives are found at once: as they come, where nobody shares the work."""
        return TOGETHER if self.capture.workers > 1 else 1

    @property
    def meanwhile(self) -> bool:
        """Whether a process of its own finds alternatives while later frames are followed."""
        return self.capture.workers > 1 and may_fork()

    def rng(self, person: int, frame: int) -> np.random.Generator:
        """The random numbers of a person's frame."""
        return np.random.default_rng([self.seed, person, frame])


@dataclass(frozen=True)
class PersonTrack:
    """A person's track.

    Parameters
    ----------
    number : int
    frames : ndarray of int, shape (n,)
        Rising.
    velocities : ndarray, shape (n, 3)
        Metres a second.
    ended : bool
        Whether the last of these frames is the person's last. Of a track that is still followed it may not be: what waits for later frames
        goes on waiting then, until `end_person`.
    """

    number: int
    frames: np.ndarray
    velocities: np.ndarray
    ended: bool = True

    def velocity(self, frames: int | Sequence[int]) -> np.ndarray:
        """Velocity in some of the person's frames, shape (..., 3), metres a second."""
        return self.velocities[np.searchsorted(self.frames, frames)]


@dataclass(frozen=True)
class FollowedFrame:
    """A frame that is followed and not decided yet; its alternatives may still be to be found, from the random numbers and the view, or be
    on their way: what is coming gives those of several frames in their order."""

    frame: int
    tracked: Tracked
    info: StepInfo
    find_from: tuple[np.random.Generator, PersonView] | None
    found: Alternatives | None = None
    coming: Iterator[Alternatives] | None = None

    @property
    def alternatives(self) -> Alternatives:
        """The poses between which later frames decide: that of the step, where there are no others."""
        return self.found or self.info.alternatives or Alternatives(self.tracked.state[None], np.array([self.info.cost]))


@dataclass(frozen=True)
class DecidedFrames:
    """Consecutive frames of a person that will not change any more.

    Parameters
    ----------
    person : int
    frames : tuple of int
    states : ndarray, shape (n, 37)
        NaN where there was nothing to start from.
    infos : tuple of StepInfo
        One a frame; of the journal's rows only what it keeps.
    tracked : Tracked or None
        From where the method goes on; None where it has not started.
    body : BodyModel or None
        The person's.
    """

    person: int
    frames: tuple[int, ...]
    states: np.ndarray
    infos: tuple[StepInfo, ...]
    tracked: Tracked | None = None
    body: BodyModel | None = None


@dataclass(frozen=True)
class PersonState:
    """What is known of a person between two frames.

    Parameters
    ----------
    subject : Subject or None
        None while the person is watched.
    tracked : Tracked or None
        Of the last frame that was followed.
    watched : tuple of PersonView
        The window that is not over. The only views that are kept.
    followed : tuple of FollowedFrame
        Frames that are not decided.
    context : tuple of (int, ndarray of shape (37,))
        The last decided frames, with their poses.
    done_to : int
        The last decided frame; -1: none is.
    """

    subject: Subject | None = None
    tracked: Tracked | None = None
    watched: tuple[PersonView, ...] = ()
    followed: tuple[FollowedFrame, ...] = ()
    context: tuple[tuple[int, np.ndarray], ...] = ()
    done_to: int = -1


def person_step(task: PoseTask, person: PersonTrack, state: PersonState, view: PersonView) -> tuple[PersonState, list[DecidedFrames]]:
    """What is known after one more frame of a person, and what is decided by it.

    Parameters
    ----------
    task : PoseTask
    person : PersonTrack
    state : PersonState
    view : PersonView
        Of the next of the person's frames.

    Returns
    -------
    state : PersonState
    decided : list of DecidedFrames
        In order.
    """
    is_last = person.ended and view.frame == int(person.frames[-1])
    if state.tracked is None:
        starts = starts_with(task, person, state, view.frame)
        state = replace(state, watched=(*state.watched, view))
        if not starts:
            return state, []
        started = _start(task, person, state)
        if started is None:
            # Nothing to start from yet: these frames stay without a pose, and the next window is tried.
            frames = tuple(one.frame for one in state.watched)
            nothing = DecidedFrames(
                person.number, frames, np.full((len(frames), len(DOF_NAMES)), np.nan), (StepInfo(NO_START),) * len(frames)
            )
            return replace(state, watched=(), done_to=view.frame), [nothing]
        state = started
    else:
        rng = task.rng(person.number, view.frame)
        stepped = task.method.step(rng, state.tracked, view)
        if task.method.recover is not None:
            stepped = task.method.recover(rng, state.tracked, stepped, view)
        followed = (*state.followed, _followed(task, rng, stepped, view))
        state = replace(state, tracked=stepped[0], followed=_asking(task, followed))
    return _decide(task, person, state, is_last)


def starts_with(task: PoseTask, person: PersonTrack, state: PersonState, frame: int) -> bool:
    """Whether this frame of a person ends the time for which they are watched: the first pose is found then, which takes long."""
    is_last = person.ended and frame == int(person.frames[-1])
    return state.tracked is None and (len(state.watched) + 1 >= task.window or is_last)


def end_person(task: PoseTask, person: PersonTrack, state: PersonState) -> list[DecidedFrames]:
    """What is left to decide of a person of whom no frame will follow; of one who was not watched for long enough nothing.

    Parameters
    ----------
    task : PoseTask
    person : PersonTrack
    state : PersonState
        Not to be used again.

    Returns
    -------
    list of DecidedFrames
    """
    return _decide(task, person, state, is_last=True)[1] if state.followed else []


def _start(task: PoseTask, person: PersonTrack, state: PersonState) -> PersonState | None:
    """The window is over: body and poses of its frames, none of them decided."""
    views, method = state.watched, task.method

    def frame_rng(k: int) -> np.random.Generator:
        return task.rng(person.number, views[k].frame)

    started = method.start(frame_rng, views, task.capture, task.height_m)
    if started is None:
        return None
    subject = method.equip(started.subject.body, task.capture)
    begun, workers = begin_tracking(subject, started.state, memory=started.memory), task.capture.workers
    path = walk(frame_rng, method.step, begun, started.anchor, views, workers=workers)
    if method.recover is not None:
        usual = method.recover.first(np.array([info.cost for _, info in path]))
        path = [(replace(tracked, memory={**tracked.memory, **usual}), info) for tracked, info in path]
    followed = tuple(_followed(task, frame_rng(k), path[k], view) for k, view in enumerate(views))
    followed = _with_alternatives(task, followed)
    return replace(state, subject=subject, tracked=path[-1][0], watched=(), followed=followed)


def _followed(task: PoseTask, rng: np.random.Generator, stepped: StepResult, view: PersonView) -> FollowedFrame:
    return FollowedFrame(view.frame, *stepped, None if task.method.alternatives is None else (rng, view))


def _asking(task: PoseTask, followed: tuple[FollowedFrame, ...]) -> tuple[FollowedFrame, ...]:
    """The same frames; once enough lack alternatives, they are found or on their way. No later frame is followed from them."""
    tasks = _to_find(task, followed)
    if len(tasks) < task.together:
        return followed
    if not task.meanwhile:
        return _with_alternatives(task, followed)
    coming = ahead(lambda: (one() for one in tasks), task.capture.workers)
    return tuple(row if row.find_from is None else replace(row, find_from=None, coming=coming) for row in followed)


def _with_alternatives(task: PoseTask, followed: tuple[FollowedFrame, ...]) -> tuple[FollowedFrame, ...]:
    """The same frames with the alternatives of all: those that are on their way, and the others, shared out."""
    there = [row if row.coming is None else replace(row, coming=None, found=next(row.coming)) for row in followed]
    found = iter(share_out(_to_find(task, followed), task.capture.workers))
    return tuple(row if row.find_from is None else replace(row, find_from=None, found=next(found)) for row in there)


def _to_find(task: PoseTask, followed: tuple[FollowedFrame, ...]) -> list[partial[Alternatives]]:
    """What finds the alternatives of the frames that lack them."""
    find = task.method.alternatives
    if find is None:
        return []
    return [
        partial(find, rng, (row.tracked, row.info), view) for row in followed if row.find_from is not None for rng, view in [row.find_from]
    ]


def _decide(task: PoseTask, person: PersonTrack, state: PersonState, is_last: bool) -> tuple[PersonState, list[DecidedFrames]]:
    """Decide what has waited for its legs long enough; everything in the person's last frame."""
    if state.subject is None:
        return state, []
    decided: list[DecidedFrames] = []
    wait = task.together if task.meanwhile else 0
    # By the same frames, however long they have waited.
    while task.lag and len(state.followed) >= _enough(task, state) + (1 if is_last else wait):
        state, one = _with_decided(task, person, state, _enough(task, state), task.lag)
        decided.append(one)
    if state.followed and (is_last or not task.lag):
        state, one = _with_decided(task, person, state, len(state.followed), 0)
        decided.append(one)
    return state, decided


def _enough(task: PoseTask, state: PersonState) -> int:
    """Frames from which those before the last `lag` are decided.

    The window's frames were followed from its middle on; a run goes on from frames that were followed one after the other.
    """
    return 2 * task.lag if state.context else task.window + task.lag


def _with_decided(task: PoseTask, person: PersonTrack, state: PersonState, asked: int, undecided: int) -> tuple[PersonState, DecidedFrames]:
    """So many of the first frames are asked, and all but the last of these decided by them."""
    rows, later = _with_alternatives(task, state.followed[:asked]), state.followed[asked:]
    picks, due = _picks(task, state, rows), asked - undecided
    chosen = [(row, int(pick)) for row, pick in zip(rows[:due], picks, strict=False)]
    decided = DecidedFrames(
        person.number,
        tuple(row.frame for row, _ in chosen),
        np.array([row.alternatives.states[pick] for row, pick in chosen]),
        tuple(replace(row.info, cost=float(row.alternatives.costs[pick])) if pick else row.info for row, pick in chosen),
        chosen[-1][0].tracked,
        None if state.subject is None else state.subject.body,
    )
    context = _context(task, state.context, decided)
    return replace(state, followed=(*rows[due:], *later), context=context, done_to=decided.frames[-1]), decided


def _picks(task: PoseTask, state: PersonState, rows: Sequence[FollowedFrame]) -> np.ndarray:
    """Which of the alternatives of every frame the motion bears out; the first, where there are none."""
    legs = task.method.legs
    if legs is None or state.subject is None:
        return np.zeros(len(rows), int)
    n = max(len(row.alternatives.costs) for row in rows)
    # A frame that tells nothing has the same pose in all ways.
    given = [row.alternatives if len(row.alternatives.costs) == n else no_alternatives(row.tracked.state, n) for row in rows]
    given = [no_alternatives(known, n) for _, known in state.context] + given
    frames = np.array([frame for frame, _ in state.context] + [row.frame for row in rows])
    costs, points = np.array([one.costs for one in given]), np.array([limb_points(state.subject.body, one.states, legs) for one in given])
    picks = choose_legs(frames, costs, points, task.capture.fps, legs)[len(state.context) :]
    return np.where([len(row.alternatives.costs) == n for row in rows], picks, 0)


def _context(task: PoseTask, context: tuple[tuple[int, np.ndarray], ...], decided: DecidedFrames) -> tuple[tuple[int, np.ndarray], ...]:
    """The last decided frames, as many as the velocity of the legs is taken from."""
    legs = task.method.legs
    if legs is None:
        return ()
    return (*context, *zip(decided.frames, decided.states, strict=True))[-1 - legs.reach(task.capture.fps) :]


def resumed(task: PoseTask, state: PersonState, decided: DecidedFrames) -> PersonState:
    """The state of a person after these rows, all that a stopped run leaves.

    Parameters
    ----------
    task : PoseTask
    state : PersonState
        After the rows before them; empty for the first.
    decided : DecidedFrames
    """
    done_to = decided.frames[-1]
    if decided.body is None:
        return replace(state, done_to=done_to)
    tracked = decided.tracked
    subject = None if tracked is None else tracked.subject
    return PersonState(subject, tracked, context=_context(task, state.context, decided), done_to=done_to)
