"""What spectral skeletons and swarms propose in a frame. Hsiao (2008), chapter 3."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel
from hmc.body.spin_skeleton import SkeletonModel, model_of_body, skeleton_landmarks, skeleton_state
from hmc.pose.method import Capture, Subject, Tracked, make_subject
from hmc.pose.spectral.reading import BodyReading, ReadingSettings, read_body
from hmc.pose.steps.proposal import Proposal, Propose
from hmc.pose.steps.swarm.temporal import SwarmInfo, SwarmSettings, SwarmState, fit_near, swarm_step
from hmc.pose.views.person_view import PersonView

__all__ = ["NO_VOXELS", "Read", "SwarmPreset", "read_view", "swarm_memory", "swarm_subject", "swarmed", "swarmed_near"]

NO_VOXELS = "no fit: no voxels of this person in this frame"
#: What is read in a person's voxels, by the stature in metres: None where there are none.
Read = Callable[[PersonView, float], BodyReading | None]
#: The skeleton of 23 parameters among a subject's extras.
_SKELETON = "skeleton"
#: What a swarm remembers, in this order, under this name.
_REMEMBERED = ("usual_m", "facing", "missed")
_NAME = "swarm"


@dataclass(frozen=True)
class SwarmPreset:
    """Parameters of the method.

    Parameters
    ----------
    reading : ReadingSettings
    swarm : SwarmSettings
    thesis : bool
        The skeleton with the thesis's joint limits and one length a part.
    window_s : float
        How long a person is watched before the stature and the first pose are decided, seconds; of the thesis's start.
    """

    reading: ReadingSettings = field(default_factory=ReadingSettings)
    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    thesis: bool = False
    window_s: float = 0.7


def swarm_subject(body: BodyModel, capture: Capture, preset: SwarmPreset) -> Subject:
    """A subject with the skeleton of 23 parameters that has its lengths.

    Parameters
    ----------
    body : BodyModel
    capture : Capture
    preset : SwarmPreset
    """
    return replace(make_subject(body, capture), extras={_SKELETON: model_of_body(body, preset.thesis)})


def swarmed(preset: SwarmPreset, read: Read | None = None) -> Propose:
    """A swarm near the last pose, on the curves of the person's voxels; the skeleton it finds, posed as the subject's body.

    Parameters
    ----------
    preset : SwarmPreset
    read : callable, optional
        In place of `read_view` by the preset.

    Returns
    -------
    callable
        `Propose`, of subjects as from `swarm_subject`.
    """
    read = read or partial(read_view, settings=preset.reading)

    def propose(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> Proposal:
        subject, before = tracked.subject, _before(tracked)
        model: SkeletonModel = subject.extras[_SKELETON]
        reading = read(view, subject.body.height_m)
        if reading is None:
            missed = replace(before, missed=before.missed + 1)
            return Proposal(tracked.state, tracked.state, status=NO_VOXELS, memory=swarm_memory(missed))
        after, info = swarm_step(rng, model, before, reading, subject.capture.fps, view.velocity, preset.swarm)
        if after is None or info.status != "fitted":
            memory = swarm_memory(before if after is None else after)
            return Proposal(tracked.state, tracked.state, info.error_m, info.evaluations, memory, info.status, details=_details(info))
        state, _ = fit_landmarks(subject.body, skeleton_landmarks(model, after.state), tracked.state)
        return Proposal(state, state, info.error_m, info.evaluations, swarm_memory(after), details=_details(info))

    return propose


def swarmed_near(preset: SwarmPreset) -> Propose:
    """The swarm near the last pose alone, for methods that start, search and recover in another way.

    Parameters
    ----------
    preset : SwarmPreset
    """

    def propose(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> Proposal:
        subject, before = tracked.subject, _before(tracked)
        reading = read_view(view, subject.body.height_m, preset.reading)
        if reading is None or reading.volume is None:
            return Proposal(tracked.state, tracked.state, status=NO_VOXELS)
        model: SkeletonModel = subject.extras[_SKELETON]
        found = fit_near(rng, model, before, reading, subject.capture.fps, preset.swarm)
        state, _ = fit_landmarks(subject.body, skeleton_landmarks(model, found.state), tracked.state)
        details = {"error_m": found.error_m, "doubts": "; ".join(reading.segmentation.doubts)}
        return Proposal(state, state, found.error_m, found.evaluations, details=details)

    return propose


def read_view(view: PersonView, height_m: float, settings: ReadingSettings) -> BodyReading | None:
    """The curves in a frame's voxels; None where there are no voxels."""
    seen = view.voxels
    return None if seen is None else read_body(seen.voxels, seen.points, seen.voxel_size_m, height_m, settings, seen.votes)


def swarm_memory(state: SwarmState) -> dict[str, np.ndarray]:
    """What a swarm remembers beside the pose."""
    return {_NAME: np.array([getattr(state, name) for name in _REMEMBERED], float)}


def _before(tracked: Tracked) -> SwarmState:
    """The swarm's state of a pose, whichever method found it."""
    model, body = tracked.subject.extras[_SKELETON], tracked.subject.body
    now, last = (skeleton_state(model, landmarks(body, one), one) for one in (tracked.state, tracked.state - tracked.velocity))
    memory: Mapping[str, np.ndarray] = tracked.memory
    usual, facing, missed = memory[_NAME].tolist() if _NAME in memory else (0.0, 0.0, 0)
    return SwarmState(now, now - last, usual, facing, int(missed))


def _details(info: SwarmInfo) -> dict[str, object]:
    return {"error_m": info.error_m, "started": info.started, "turned": info.turned, "doubts": "; ".join(info.doubts)}
