"""Where the feet of a pose are: the ends of both soles."""

from __future__ import annotations

import numpy as np

from hmc.body.joints import SEGMENTS
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.body.proportions import SOLE_PITCH, sole_ends

__all__ = ["foot_points"]

_FEET = np.array([[one.name for one in SEGMENTS].index(name) for name in ("l_foot", "l_foot", "r_foot", "r_foot")])

#: From the flat sole to the foot's flesh, which points down from it.
_UP = np.array([[np.cos(SOLE_PITCH), 0, -np.sin(SOLE_PITCH)], [0, 1, 0], [np.sin(SOLE_PITCH), 0, np.cos(SOLE_PITCH)]])


def foot_points(body: BodyModel, states: np.ndarray) -> np.ndarray:
    """Heels and toes of every state.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (..., 37)

    Returns
    -------
    ndarray, shape (..., 4, 3)
        World, metres, in the order of `hmc.landmarks.FOOT_POINTS`; NaN for a body without feet.
    """
    d = body.dimensions
    rotations, positions = segment_transforms(body, states)
    outward, down = d["ankle_flesh_outward"], -d["ankle_height"]
    flat = np.array([(x, sign * outward, down) for sign in (1, -1) for x in sole_ends(d)])
    local = flat @ _UP.T
    points = positions[..., _FEET, :] + (rotations[..., _FEET, :, :] @ local[..., None])[..., 0]
    return points if d["foot"] > 0 else np.full_like(points, np.nan)
