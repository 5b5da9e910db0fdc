"""A pose from keypoints that several cameras saw: inverse kinematics to where their lines of sight meet."""

from __future__ import annotations

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import dof_index
from hmc.body.keypoint_places import BODY_KEYPOINTS
from hmc.body.model import BodyModel, neutral_state
from hmc.landmarks import LANDMARKS
from hmc.pose.views.keypoints import SeenKeypoints

__all__ = ["LEAST_LANDMARKS", "keypoint_pose", "landmarks_seen", "standing_pose"]

#: Fewer landmarks do not tell a pose.
LEAST_LANDMARKS = 6
HEADING = int(dof_index("root_rz")[0])
_SHARED = [(LANDMARKS.index(name), k) for k, name in enumerate(BODY_KEYPOINTS) if name in LANDMARKS]
_PLACES, _KEYPOINTS = (np.array(column) for column in zip(*_SHARED, strict=True))


def landmarks_seen(seen: SeenKeypoints) -> np.ndarray:
    """Where the landmarks are by the keypoints alone, shape (15, 3), world, metres; NaN where that is not known."""
    points = np.full((len(LANDMARKS), 3), np.nan)
    points[_PLACES] = seen.points[_KEYPOINTS]
    return points


def keypoint_pose(body: BodyModel, seen: SeenKeypoints | None, start: np.ndarray) -> list[np.ndarray]:
    """The pose that keypoints show, or none where they show too little.

    Parameters
    ----------
    body : BodyModel
    seen : SeenKeypoints or None
    start : ndarray, shape (37,)
        What keypoints leave open stays near it.

    Returns
    -------
    list of ndarray, shape (37,)
        One or none.
    """
    if seen is None:
        return []
    points = landmarks_seen(seen)
    if np.isfinite(points).all(axis=1).sum() < LEAST_LANDMARKS:
        return []
    return [fit_landmarks(body, points, start)[0]]


def standing_pose(body: BodyModel, seen: SeenKeypoints | None) -> list[np.ndarray]:
    """The pose that keypoints show, from a standing one that is turned as shoulders and hips are; or none where they show too little.

    Parameters
    ----------
    body : BodyModel
    seen : SeenKeypoints or None

    Returns
    -------
    list of ndarray, shape (37,)
        One or none.
    """
    if seen is None:
        return []
    points = landmarks_seen(seen)
    at = {name: points[LANDMARKS.index(name)] for name in ("l_shoulder", "r_shoulder", "l_hip", "r_hip")}
    ways = np.array([at["l_shoulder"] - at["r_shoulder"], at["l_hip"] - at["r_hip"]])
    ways, trunk = (values[np.isfinite(values).all(axis=1)] for values in (ways, np.array(list(at.values()))))
    if not len(ways):
        return []
    left = ways.sum(axis=0)
    start = neutral_state("down", body.limits)
    start[:3] = trunk.mean(axis=0)
    start[HEADING] = np.arctan2(-left[0], left[1])
    return keypoint_pose(body, seen, start)
