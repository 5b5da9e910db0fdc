"""The nouns of pose estimation: a method, what it follows, and what it tells of a frame.

A method is a record of named parts: where it starts, one step from frame to frame, how it recovers, how it tells the legs. A step is a
function ``step(rng, tracked, view) -> (tracked, info)``; parts of one method are given to another by composing other steps
(`hmc.pose.steps`). One driver runs them all (`hmc.pose.follow`), and one journal keeps them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from hmc.body.flesh import surface_coordinates
from hmc.body.joints import N_DOF, JointLimits, default_limits
from hmc.body.model import PARTS, BodyModel
from hmc.camera.model import Rig
from hmc.pose.objectives.four_scores import ScoreTable
from hmc.pose.objectives.keypoints import Beside
from hmc.pose.objectives.symmetric import BodyPoints, body_points
from hmc.pose.views.person_view import HULLS_FOR, PersonView
from hmc.search.filters import AnnealedInfo, ParticleState
from hmc.search.structural import StructuralInfo

__all__ = [
    "Alternatives",
    "Capture",
    "FindAlternatives",
    "FrameRng",
    "PoseMethod",
    "PoseStep",
    "Recover",
    "Start",
    "StartPose",
    "StepInfo",
    "StepResult",
    "Subject",
    "Tracked",
    "as_found",
    "begin_tracking",
    "make_subject",
    "other_rng",
    "particles_of",
    "unseen",
    "with_particles",
]  # fmt: skip

#: Points of a body's surface at which costs are taken.
SURFACE_POINTS = 350
#: Random generator of a frame of a window: the same whatever the order in which frames are visited.
FrameRng = Callable[[int], np.random.Generator]


@dataclass(frozen=True)
class Capture:
    """What is the same for every person in a recording.

    Parameters
    ----------
    fps : float
        Frames a second.
    voxel_size_m : float
        Of the hulls.
    room : ndarray, shape (2, 3), or None
        Limits of the room, metres; its lowest z is the floor, 0 where left out.
    rig : Rig or None
    drift : ndarray, shape (37,), or None
        P0 of filters: half of the largest variation expected in one frame, metres and radians (Canton 2009, section 3.2.2); None: that of
        everyday motion (`hmc.pose.steps.presets.drift`).
    beside : Beside
        Where a detector's keypoints lie beside the body's.
    workers : int
        Processes that may share a start's work (`hmc.processes`). The result does not depend on it.
    """

    fps: float = 30.0
    voxel_size_m: float = 0.03
    room: np.ndarray | None = None
    rig: Rig | None = None
    drift: np.ndarray | None = None
    beside: Beside = field(default_factory=Beside)
    workers: int = 1

    @property
    def floor_z(self) -> float:
        """Height of the floor, metres."""
        return 0.0 if self.room is None else float(self.room[0, 2])


@dataclass(frozen=True)
class Subject:
    """A person's body, and what is made of it once.

    Parameters
    ----------
    body : BodyModel
    capture : Capture
    points : BodyPoints
        At which the symmetric cost is taken.
    flesh : ScoreTable or None
        The body's flesh, where the four scores are used, be it by scouts for missing limbs alone.
    parts : ndarray of bool, shape (n_parts,)
        Which of `hmc.body.model.PARTS` are there: limbs that the data does not show may be left out.
    free : ndarray of bool, shape (37,)
        Angles that may move: those of the parts that are there.
    extras : mapping of str to object
        What else a method makes of a body.
    """

    body: BodyModel
    capture: Capture
    points: BodyPoints
    flesh: ScoreTable | None = None
    parts: np.ndarray = field(default_factory=lambda: np.ones(len(PARTS), bool))
    free: np.ndarray = field(default_factory=lambda: np.ones(N_DOF, bool))
    extras: Mapping[str, Any] = field(default_factory=dict)


def make_subject(body: BodyModel, capture: Capture, surface_points: int = SURFACE_POINTS) -> Subject:
    """A subject with the points of its surface: what most methods need of a body."""
    return Subject(body, capture, body_points(body, surface_coordinates(body, surface_points)))


@dataclass(frozen=True)
class Tracked:
    """One person's pose between two frames.

    Parameters
    ----------
    subject : Subject
    state : ndarray, shape (37,)
        The estimate, metres and radians in the order of `hmc.body.joints.DOF_NAMES`.
    velocity : ndarray, shape (37,)
        Change of the estimate in the last frame; zero at the start.
    memory : mapping of str to ndarray
        All else that steps want from the frames before. The journal saves and restores it without knowing what it is.
    """

    subject: Subject
    state: np.ndarray
    velocity: np.ndarray
    memory: Mapping[str, np.ndarray] = field(default_factory=dict)


def begin_tracking(
    subject: Subject, state: np.ndarray, velocity: np.ndarray | None = None, memory: Mapping[str, np.ndarray] | None = None
) -> Tracked:
    """A person in this pose (37,), at rest where no velocity is given."""
    state = np.asarray(state, float)
    velocity = np.zeros_like(state) if velocity is None else np.asarray(velocity, float)
    return Tracked(subject, state, velocity, {} if memory is None else memory)


@dataclass(frozen=True)
class Alternatives:
    """The poses of one frame, between which the frames around it decide.

    Parameters
    ----------
    states : ndarray, shape (m, 37)
        As followed, and with exchanged legs; of markers, other exchanges too.
    costs : ndarray, shape (m,)
        Square metres, from the same points; zero in a frame that tells nothing.
    """

    states: np.ndarray
    costs: np.ndarray


@dataclass(frozen=True)
class StepInfo:
    """What happened in one step.

    Parameters
    ----------
    status : str
        ``"fitted"``, or why not.
    cost : float
        Of the estimate, square metres or what the method minimises; NaN without a fit, and of likelihoods that are no costs.
    evaluations : int
        Of the objective, in all.
    missing : ndarray of bool, shape (37,), or None
        Angles of limbs that the data does not show; None: of none.
    alternatives : Alternatives or None
        Other poses of the frame, between which later frames decide.
    annealed : AnnealedInfo or None
        Of the annealed layers, where there are any.
    structural : StructuralInfo or None
        Of the layers of a hierarchy's models, where there are any.
    levels : ndarray, shape (n_models, 37), or None
        The estimates of a hierarchy's models, NaN where a model lacks the angle.
    details : mapping
        Plain values that a method tells of the frame, for its own tables.
    """

    status: str = "fitted"
    cost: float = np.nan
    evaluations: int = 0
    missing: np.ndarray | None = None
    alternatives: Alternatives | None = None
    annealed: AnnealedInfo | None = None
    structural: StructuralInfo | None = None
    levels: np.ndarray | None = None
    details: Mapping[str, Any] = field(default_factory=dict)


#: One frame on: ``step(rng, tracked, view) -> (tracked, info)``.
PoseStep = Callable[[np.random.Generator, Tracked, PersonView], tuple[Tracked, StepInfo]]


#: One frame on: the pose, and what is told of it.
StepResult = tuple[Tracked, StepInfo]


class Recover(Protocol):
    """Notices a pose that got lost as a whole, and finds it anew."""

    def first(self, costs: np.ndarray) -> Mapping[str, np.ndarray]:
        """Entries of the memory after a person's first frames, of these costs, shape (n,)."""

    def __call__(self, rng: np.random.Generator, before: Tracked, stepped: StepResult, view: PersonView) -> StepResult:
        """The step's pose, or another in its place."""


#: Other poses of a frame, between which later frames decide.
FindAlternatives = Callable[[np.random.Generator, StepResult, PersonView], Alternatives]


@dataclass(frozen=True)
class StartPose:
    """A first pose.

    Parameters
    ----------
    subject : Subject
        With the person's body.
    anchor : int
        Place of its frame among those that were watched.
    state : ndarray, shape (37,)
    memory : mapping of str to ndarray
        What steps are to know in that frame.
    costs : ndarray, shape (n,)
        Mean cost of each candidate that was followed to the end, the winner first; square metres.
    """

    subject: Subject
    anchor: int
    state: np.ndarray
    memory: Mapping[str, np.ndarray] = field(default_factory=dict)
    costs: np.ndarray = field(default_factory=lambda: np.array([np.nan]))


class Start(Protocol):
    """Finds a person's body and first pose in a window of frames."""

    def __call__(
        self, frame_rng: FrameRng, views: Sequence[PersonView], capture: Capture, height_m: float | None = None
    ) -> StartPose | None:
        """The first pose; None where no frame of the window has anything to start from."""


@dataclass(frozen=True)
class PoseMethod:
    """How poses are estimated.

    Parameters
    ----------
    name : str
    source : str
        The work it is from.
    start : Start
    step : callable
        `PoseStep`.
    needs : frozenset of str
        What it reads of a frame (`hmc.pose.views.person_view.EVIDENCE`).
    equip : callable
        ``equip(body, capture)`` makes the `Subject` that the step takes.
    recover : callable or None
        ``recover(rng, before, (tracked, info), view)`` notices a pose that got lost and finds it anew (`hmc.pose.recovery`).
    alternatives : callable or None
        ``alternatives(rng, (tracked, info), view)`` gives the frame's `Alternatives`; None: those of the step, if any.
    legs : LegSettings or None
        How the frames around decide between alternatives (`hmc.pose.legs`); None: the pose stays as the step has it.
    back : BackwardSettings or None
        How a second pass goes, backward in time (`hmc.pose.backward`); None: there is none.
    keypoints : bool
        Whether it takes the keypoints of a detector, where there are some; beside the hulls unless it `needs` nothing else.
    limits : JointLimits
        Of the bodies that the start makes.
    window_s : float
        How long a person is watched before the body and the first pose are decided, seconds.
    gate_px : float
        Of methods that need detections: farther than this from where a marker should be, a detection is not its own.
    settings : object
        Its parameters, for ``run.toml``: plain values and dataclasses. A run goes on only under the same.
    """

    name: str
    source: str
    start: Start
    step: PoseStep
    needs: frozenset[str] = frozenset({"hulls"})
    equip: Callable[[BodyModel, Capture], Subject] = make_subject
    recover: Recover | None = None
    alternatives: FindAlternatives | None = None
    legs: Any = None
    back: Any = None
    keypoints: bool = False
    limits: JointLimits = field(default_factory=default_limits)
    window_s: float = 1.5
    gate_px: float = 30.0
    settings: Any = None

    @property
    def needs_tracks(self) -> bool:
        """Whether people are tracked first: not where detections are all that is read."""
        return not self.needs <= {"detections"}

    @property
    def needs_hulls(self) -> bool:
        """Whether silhouettes are made and carved: not where detections or keypoints are all that is read."""
        return bool(self.needs & HULLS_FOR)


def as_found(method: PoseMethod) -> PoseMethod:
    """The method without smoothing of its own (`hmc.pose.back_settings.BackwardSettings.smooth_s`), for who smooths otherwise, or not."""
    return method if method.back is None else replace(method, back=replace(method.back, smooth_s=None))


def unseen(tracked: Tracked, status: str = "no hull of this person in this frame") -> tuple[Tracked, StepInfo]:
    """A frame that shows nothing of the person: the pose stays."""
    return Tracked(tracked.subject, tracked.state, np.zeros_like(tracked.velocity), tracked.memory), StepInfo(status)


def particles_of(tracked: Tracked, name: str = "") -> ParticleState:
    """Particles that a step left in the memory under a name; where there are none, one on the pose itself."""
    if f"particles{name}" not in tracked.memory:
        return ParticleState(tracked.state[None], np.zeros(1))
    return ParticleState(tracked.memory[f"particles{name}"], tracked.memory[f"log_weights{name}"])


def with_particles(particles: ParticleState, name: str = "") -> dict[str, np.ndarray]:
    """Particles as entries of a memory."""
    return {f"particles{name}": particles.particles, f"log_weights{name}": particles.log_weights}


def other_rng(rng: np.random.Generator, purpose: int) -> np.random.Generator:
    """Random numbers of the same frame for another purpose, 1 or more (0 would give the frame's own), whatever was drawn of the first."""
    entropy = rng.bit_generator.seed_seq.entropy  # type: ignore[attr-defined]
    return np.random.default_rng([*np.atleast_1d(np.array(entropy, object)).tolist(), purpose])
