"""Angles at rest, and how far people commonly go from there: what is likely where the data does not say."""

from __future__ import annotations

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.body.rest import RELAXED_DEG

__all__ = ["POSTURE", "posture_spread"]

# How far people commonly go from rest, degrees.
_SPREAD_DEG = {
    "torso_x": 25, "torso_y": 45, "torso_z": 25, "spine_x": 10, "spine_y": 15, "girdle_x": 10, "girdle_z": 12, "neck_x": 25, "neck_y": 30,
    "shoulder_x": 90, "shoulder_y": 40, "shoulder_z": 70, "elbow_z": 90,
    "hip_x": 30, "hip_y": 70, "hip_z": 25, "knee_y": 90, "ankle_y": 15, "ankle_z": 8,
}  # fmt: skip


def _posture() -> tuple[np.ndarray, np.ndarray]:
    spread = [next((value for key, value in _SPREAD_DEG.items() if name.endswith(key)), np.inf) for name in DOF_NAMES]
    return np.radians([RELAXED_DEG.get(name, 0.0) for name in DOF_NAMES]), np.radians(spread)


#: Rest and spread of every angle, radians, each of shape (37,); the root's are free (spread infinite).
POSTURE = _posture()
#: Legs open widely and cross little: which way each angle crosses them, and the spread that way, radians. Hulls confuse crossed legs with
#: legs side by side where furniture hides the thighs.
_INWARD = np.array([{"r_hip_x": 1.0, "l_hip_x": -1.0}.get(name, 0.0) for name in DOF_NAMES])
_INWARD_SPREAD = np.radians(8)


def posture_spread(states: np.ndarray) -> np.ndarray:
    """How far each angle commonly goes to the side of rest on which it is, radians, shape (..., 37): `POSTURE`, less for crossed legs.

    Parameters
    ----------
    states : ndarray, shape (..., 37)
    """
    return np.where(states * _INWARD > 0, _INWARD_SPREAD, POSTURE[1])
