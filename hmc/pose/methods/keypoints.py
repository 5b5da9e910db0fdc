"""Keypoints alone: for recordings of which no silhouettes are to be had, outdoors or by cameras that move people's surroundings.

Tracks come from the keypoints too (`hmc.pose.keypoint_tracks`). The body is that of the lengths between the points where lines of sight
meet; each pose the one that misses the lines least, by the likely postures of people, refined from the last pose and from the points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hmc.pose.method import Capture, FrameRng, PoseMethod, PoseStep, StartPose, StepInfo, Tracked, make_subject, unseen
from hmc.pose.objectives.keypoints import KeypointCost, KeypointSettings
from hmc.pose.objectives.objective import Sum
from hmc.pose.objectives.posture import PostureCost, PostureSettings
from hmc.pose.starts.keypoint_body import body_of_keypoints
from hmc.pose.steps.refine import RefineSettings, refine_all
from hmc.pose.views.keypoint_pose import LEAST_LANDMARKS, keypoint_pose, landmarks_seen, standing_pose
from hmc.pose.views.keypoints import SeenKeypoints
from hmc.pose.views.person_view import PersonView

__all__ = ["KeypointPreset", "KeypointStart", "keypoint_method", "on_keypoints"]

#: How long people are watched before their lengths are told, seconds: of keypoints alone more frames are held than of hulls.
WINDOW_S = 3.0
NOT_SEEN = "no keypoints of this person in this frame"
TOO_FEW = "too few keypoints that two cameras see"


@dataclass(frozen=True)
class KeypointPreset:
    """How poses are fitted to keypoints.

    Parameters
    ----------
    keypoints : KeypointSettings
    posture : PostureSettings
    refine : RefineSettings
    """

    keypoints: KeypointSettings = field(default_factory=KeypointSettings)
    posture: PostureSettings = field(default_factory=PostureSettings)
    refine: RefineSettings = field(default_factory=RefineSettings)


@dataclass(frozen=True)
class KeypointStart:
    """A person's body by the lengths between keypoints, and the pose of a frame that shows many of them."""

    def __call__(
        self, frame_rng: FrameRng, views: Sequence[PersonView], capture: Capture, height_m: float | None = None
    ) -> StartPose | None:
        """Body and first pose; None where no frame shows which way a person is turned, and enough of the rest."""
        seen = [view.keypoints for view in views]
        shown = np.array([_n_landmarks(one) for one in seen])
        order = np.lexsort([np.abs(np.arange(len(views)) - len(views) // 2), -shown])
        body = body_of_keypoints(np.array([one.points for one in seen if one is not None]).reshape(-1, 15, 3), height_m)
        for k in order.tolist():
            pose = standing_pose(body, seen[k])
            if pose:
                return StartPose(make_subject(body, capture), k, pose[0])
        return None


def _n_landmarks(seen: SeenKeypoints | None) -> int:
    return 0 if seen is None else int(np.isfinite(landmarks_seen(seen)).all(axis=1).sum())


def on_keypoints(preset: KeypointPreset) -> PoseStep:
    """The step that refines on keypoints and posture, from the last pose and from where lines of sight meet."""

    def step(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[Tracked, StepInfo]:
        seen, subject = view.keypoints, tracked.subject
        if seen is None:
            return unseen(tracked, NOT_SEEN)
        if _n_landmarks(seen) < LEAST_LANDMARKS:
            return unseen(tracked, TOO_FEW)
        body = subject.body
        objective = Sum(
            [
                KeypointCost(body, seen, subject.capture.beside, preset.keypoints),
                PostureCost(body, subject.points.axes, preset.posture),
            ]
        )
        starts = [tracked.state, *keypoint_pose(body, seen, tracked.state), *standing_pose(body, seen)]
        trials = refine_all(objective, starts, preset.refine, anchor=tracked.state)
        state, info = min(trials, key=lambda trial: trial[1].cost_after)
        after = Tracked(subject, state, state - tracked.state, tracked.memory)
        return after, StepInfo("fitted", info.cost, sum(one.evaluations for _, one in trials))

    return step


def keypoint_method(preset: KeypointPreset | None = None) -> PoseMethod:
    """The method of a preset."""
    preset = KeypointPreset() if preset is None else preset
    return PoseMethod(
        "keypoints",
        "this package",
        start=KeypointStart(),
        step=on_keypoints(preset),
        needs=frozenset({"keypoints"}),
        keypoints=True,
        window_s=WINDOW_S,
        settings=preset,
    )
