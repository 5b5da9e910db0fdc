"""A pose from keypoints that several cameras saw: inverse kinematics to where their lines of sight meet."""

from __future__ import annotations

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.keypoint_places import BODY_KEYPOINTS
from hmc.body.model import BodyModel
from hmc.landmarks import LANDMARKS
from hmc.pose.views.keypoints import SeenKeypoints

__all__ = ["keypoint_pose", "landmarks_seen"]

#: Fewer landmarks do not tell a pose.
LEAST_LANDMARKS = 6
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
    start : ndarray, shape (33,)
        What keypoints leave open stays near it.

    Returns
    -------
    list of ndarray, shape (33,)
        One or none.
    """
    if seen is None:
        return []
    points = landmarks_seen(seen)
    if np.isfinite(points).all(axis=1).sum() < LEAST_LANDMARKS:
        return []
    return [fit_landmarks(body, points, start)[0]]
