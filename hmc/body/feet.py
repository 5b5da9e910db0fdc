"""Where the feet of a pose are: the ends of both soles."""

from __future__ import annotations

import numpy as np

from hmc.body.joints import SEGMENTS
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.body.proportions import SOLE_PITCH, sole_ends

__all__ = ["foot_places", "foot_points"]

_FEET = np.array([[one.name for one in SEGMENTS].index(name) for name in ("l_foot", "l_foot", "r_foot", "r_foot")])

#: From the flat sole to the foot's flesh, which points down from it.
_UP = np.array([[np.cos(SOLE_PITCH), 0, -np.sin(SOLE_PITCH)], [0, 1, 0], [np.sin(SOLE_PITCH), 0, np.cos(SOLE_PITCH)]])


def foot_places(body: BodyModel) -> tuple[np.ndarray, np.ndarray] | None:
    """Where in the body heels and toes are, in the order of `hmc.landmarks.FOOT_POINTS`; None for a body without feet.

    Parameters
    ----------
    body : BodyModel

    Returns
    -------
    segments : ndarray of int, shape (4,)
        Places in `hmc.body.joints.SEGMENTS`.
    offsets : ndarray, shape (4, 3)
        In the segments' frames, metres.
    """
    d = body.dimensions
    if not d.get("foot", 0) > 0:
        return None
    outward, down = d["ankle_flesh_outward"], -d["ankle_height"]
    flat = np.array([(x, sign * outward, down) for sign in (1, -1) for x in sole_ends(d)])
    return _FEET, flat @ _UP.T


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
    rotations, positions = segment_transforms(body, states)
    places = foot_places(body)
    if places is None:
        return np.full((*positions.shape[:-2], len(_FEET), 3), np.nan)
    segments, offsets = places
    return positions[..., segments, :] + (rotations[..., segments, :, :] @ offsets[..., None])[..., 0]
