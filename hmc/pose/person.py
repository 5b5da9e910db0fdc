"""One person from the first sight to the last: watched, started, followed, and the legs told apart a little later.

A step takes what is known of a person and one frame's hulls and returns what is known then, with the rows of the frames that are
decided, if any. Whatever a step needs from earlier frames is in its state, and the random numbers of a frame depend on the seed, the person
and the frame alone, so a run can go on from the rows that it left (`taken_up`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.body.model import BodyModel
from hmc.pose.legs import LegChoice, LegSettings, choose_legs, leg_choice, leg_points
from hmc.pose.recovery import LossSettings, loss_init, loss_step, recalled, remembered
from hmc.pose.starts.window import StartSettings, start_person
from hmc.pose.steps.annealed import PoseFilter, PoseInfo, PoseState, make_filter
from hmc.pose.steps.limb_search import LIMBS
from hmc.pose.steps.preset import PosePreset
from hmc.pose.steps.scalable import step_of
from hmc.pose.views.hull_target import HullTarget

__all__ = ["Decided", "FollowSettings", "PersonState", "PersonTask", "PoseTask", "person_step", "taken_up"]

NO_START = "no hull to start from"
#: Legs can be told apart where none of these is missing.
LEG_DOFS = np.concatenate([LIMBS["r_leg"], LIMBS["l_leg"]])


@dataclass(frozen=True)
class FollowSettings:
    """How people are followed, beside what the preset says of each frame.

    Parameters
    ----------
    window_s : float
        How long a person is watched before the body and the first pose are decided, seconds.
    start : StartSettings
    legs : LegSettings or None
        None: the legs stay as the filter has them. Presets without `refine` leave them too.
    loss : LossSettings or None
        How a pose that got lost as a whole is noticed and found anew; None: it is not, nor by presets without `refine`.
    """

    window_s: float = 1.5
    start: StartSettings = field(default_factory=StartSettings)
    legs: LegSettings | None = field(default_factory=LegSettings)
    loss: LossSettings | None = field(default_factory=LossSettings)


@dataclass(frozen=True)
class PoseTask:
    """What is the same for everybody in a run.

    Parameters
    ----------
    preset : PosePreset
    settings : FollowSettings
    fps : float
    room : ndarray, shape (2, 3)
    voxel_size_m : float
    seed : int
    height_m : float or None
        None: estimated for each person.
    """

    preset: PosePreset
    settings: FollowSettings
    fps: float
    room: np.ndarray
    voxel_size_m: float
    seed: int = 0
    height_m: float | None = None

    @property
    def window(self) -> int:
        """Frames for which a person is watched: as many as there are in that time, and three at least."""
        return max(3, round(self.settings.window_s * self.fps))

    @property
    def legs(self) -> LegSettings | None:
        """How legs are told apart, where they are."""
        return self.settings.legs if self.preset.refine is not None else None

    @property
    def loss(self) -> LossSettings | None:
        """How a lost pose is found anew, where it is."""
        return self.settings.loss if self.preset.refine is not None else None

    def rng(self, person: int, frame: int, *purpose: int) -> np.random.Generator:
        """The random numbers of a person's frame, others for every purpose."""
        return np.random.default_rng([self.seed, person, frame, *purpose])


@dataclass(frozen=True)
class PersonTask:
    """A person's track.

    Parameters
    ----------
    number : int
    frames : ndarray of int, shape (n,)
        Rising.
    velocities : ndarray, shape (n, 3)
        Metres a second.
    """

    number: int
    frames: np.ndarray
    velocities: np.ndarray

    def velocity(self, frames: int | Sequence[int]) -> np.ndarray:
        """Velocity in some of the person's frames, shape (..., 3), metres a second."""
        return self.velocities[np.searchsorted(self.frames, frames)]


@dataclass(frozen=True)
class Followed:
    """A frame that is followed and not decided yet."""

    frame: int
    pose: PoseState
    info: PoseInfo
    choice: LegChoice


@dataclass(frozen=True)
class Decided:
    """Consecutive frames of a person that will not change any more.

    Parameters
    ----------
    person : int
    frames : tuple of int
    states : ndarray, shape (n, 27)
        NaN where there was nothing to start from.
    costs : tuple of float
        As `PoseInfo.cost`.
    status : tuple of str
        As `PoseInfo.status`.
    pose : PoseState or None
        From where the filter goes on; None where it has not started.
    body : BodyModel or None
        The person's.
    missing : ndarray of bool, shape (n, 27), or None
        Angles of limbs that the data does not show; None: of none.
    """

    person: int
    frames: tuple[int, ...]
    states: np.ndarray
    costs: tuple[float, ...]
    status: tuple[str, ...]
    pose: PoseState | None = None
    body: BodyModel | None = None
    missing: np.ndarray | None = None


@dataclass(frozen=True)
class PersonState:
    """What is known of a person between two frames.

    Parameters
    ----------
    filter : PoseFilter or None
        None while the person is watched.
    pose : PoseState or None
        Of the last frame that was followed.
    watched : tuple of (int, HullTarget or None)
        Frames and hulls of the window that is not over. The only hulls that are kept.
    followed : tuple of Followed
        Frames that are not decided.
    context : tuple of (int, ndarray of shape (27,))
        The last decided frames, with their poses.
    done_to : int
        The last decided frame; -1: none is.
    """

    filter: PoseFilter | None = None
    pose: PoseState | None = None
    watched: tuple[tuple[int, HullTarget | None], ...] = ()
    followed: tuple[Followed, ...] = ()
    context: tuple[tuple[int, np.ndarray], ...] = ()
    done_to: int = -1


def person_step(
    task: PoseTask, person: PersonTask, state: PersonState, frame: int, target: HullTarget | None
) -> tuple[PersonState, list[Decided]]:
    """One frame of a person.

    Parameters
    ----------
    task : PoseTask
    person : PersonTask
    state : PersonState
    frame : int
        The next of the person's frames.
    target : HullTarget or None
        None where there is no hull of the person in this frame.

    Returns
    -------
    state : PersonState
    decided : list of Decided
        In order.
    """
    is_last = frame == int(person.frames[-1])
    if state.filter is None or state.pose is None:
        state = replace(state, watched=(*state.watched, (frame, target)))
        if len(state.watched) < task.window and not is_last:
            return state, []
        started = _start(task, person, state)
        if started is None:
            # Nothing to start from yet: these frames stay without a pose, and the next window is tried.
            frames = tuple(number for number, _ in state.watched)
            n = len(frames)
            nothing = Decided(person.number, frames, np.full((n, len(DOF_NAMES)), np.nan), (np.nan,) * n, (NO_START,) * n)
            return replace(state, watched=(), done_to=frame), [nothing]
        state = started
    else:
        rng = task.rng(person.number, frame)
        pose, info = step_of(task.preset)(rng, state.filter, state.pose, target)
        pose, info = _found_again(task, person, state.filter, state.pose, frame, pose, info, target)
        state = replace(state, pose=pose, followed=(*state.followed, _followed(task, rng, state.filter, frame, pose, info, target)))
    return _decide(task, person, state, is_last)


def _start(task: PoseTask, person: PersonTask, state: PersonState) -> PersonState | None:
    """The window is over: body and poses of its frames, none of them decided."""
    frames, targets = [frame for frame, _ in state.watched], [target for _, target in state.watched]
    started = start_person(
        lambda k: task.rng(person.number, frames[k]),
        task.preset,
        task.fps,
        targets,
        task.height_m,
        person.velocity(frames),
        task.room,
        task.settings.start,
    )
    if started is None:
        return None
    poses = started.states
    if task.loss is not None:
        usual = remembered(loss_init(np.array([info.cost for info in started.infos]), task.loss))
        poses = [replace(pose, memory={**pose.memory, **usual}) for pose in poses]
    followed = tuple(
        _followed(task, task.rng(person.number, frame), started.filter, frame, pose, info, target)
        for frame, target, pose, info in zip(frames, targets, poses, started.infos, strict=True)
    )
    return replace(state, filter=started.filter, pose=poses[-1], watched=(), followed=followed)


def _found_again(
    task: PoseTask,
    person: PersonTask,
    filt: PoseFilter,
    before: PoseState,
    frame: int,
    pose: PoseState,
    info: PoseInfo,
    target: HullTarget | None,
) -> tuple[PoseState, PoseInfo]:
    """The pose and its account, replaced where the pose was lost; what is known of that goes on in its memory."""
    if task.loss is None:
        return pose, info
    rng, velocity = task.rng(person.number, frame, 1), person.velocity(frame)
    known = recalled(before.memory)
    pose, info, known = loss_step(rng, filt, task.fps, pose, info, target, velocity, known, task.loss, task.settings.start)
    return replace(pose, memory={**pose.memory, **remembered(known)}), info


def _followed(
    task: PoseTask, rng: np.random.Generator, filt: PoseFilter, frame: int, pose: PoseState, info: PoseInfo, target: HullTarget | None
) -> Followed:
    if task.legs is None:
        return Followed(frame, pose, info, LegChoice(pose.state[None], np.array([info.cost])))
    tells = info.status == "fitted" and (info.missing is None or not info.missing[LEG_DOFS].any())
    choice = leg_choice(rng, filt, pose.state, target if tells else None)
    return Followed(frame, pose, info, choice)


def _decide(task: PoseTask, person: PersonTask, state: PersonState, is_last: bool) -> tuple[PersonState, list[Decided]]:
    """Decide what has waited for its legs long enough; everything in the person's last frame."""
    lag = 0 if task.legs is None else max(1, round(task.legs.lag_s * task.fps))
    # The window's frames were followed from its middle on; a run goes on from frames that were followed one after the other.
    enough = 2 * lag if state.context else task.window + lag
    if state.filter is None or (lag and len(state.followed) < enough and not is_last):
        return state, []
    body, rows, context = state.filter.body, state.followed, state.context
    picks = np.zeros(len(rows), int)
    if task.legs is not None:
        frames = np.array([frame for frame, _ in context] + [row.frame for row in rows])
        choices = [LegChoice(np.stack([known, known]), np.zeros(2)) for _, known in context] + [row.choice for row in rows]
        costs, legs = np.array([one.costs for one in choices]), np.array([leg_points(body, one.states) for one in choices])
        picks = choose_legs(frames, costs, legs, task.fps, task.legs)[len(context) :]
    rows = rows if is_last else rows[: len(rows) - lag]
    chosen = [(row, row.choice, pick) for row, pick in zip(rows, picks, strict=False)]
    decided = Decided(
        person.number,
        tuple(row.frame for row in rows),
        np.array([choice.states[pick] for _, choice, pick in chosen]),
        tuple(float(choice.costs[pick]) if pick else row.info.cost for row, choice, pick in chosen),
        tuple(row.info.status for row in rows),
        rows[-1].pose,
        body,
        _missing(rows),
    )
    state = replace(state, followed=state.followed[len(rows) :], context=_context(task, context, decided), done_to=rows[-1].frame)
    return state, [decided]


def _missing(rows: tuple[Followed, ...]) -> np.ndarray | None:
    """Of every row, which angles are missing; None where none is in any."""
    nothing = np.zeros(len(DOF_NAMES), bool)
    missing = np.array([nothing if row.info.missing is None else row.info.missing for row in rows])
    return missing if missing.any() else None


def _context(task: PoseTask, context: tuple[tuple[int, np.ndarray], ...], decided: Decided) -> tuple[tuple[int, np.ndarray], ...]:
    """The last decided frames, as many as the velocity of the legs is taken from."""
    if task.legs is None:
        return ()
    return (*context, *zip(decided.frames, decided.states, strict=True))[-1 - task.legs.reach(task.fps) :]


def taken_up(task: PoseTask, state: PersonState, decided: Decided) -> PersonState:
    """The state of a person after these rows, all that a stopped run leaves.

    Parameters
    ----------
    task : PoseTask
    state : PersonState
        After the rows before them; empty for the first.
    decided : Decided
    """
    done_to = decided.frames[-1]
    if decided.body is None or decided.pose is None:
        return replace(state, done_to=done_to)
    filt = state.filter or make_filter(decided.body, task.preset, task.fps, task.voxel_size_m, task.room)
    return PersonState(filt, decided.pose, context=_context(task, state.context, decided), done_to=done_to)
