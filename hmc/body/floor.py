"""People stand on the floor: how far a pose hangs in the air or is sunk in the ground.

Furniture hides legs from several cameras at once, and then the hull ends at the table's edge. Without the floor the legs
would fold up into what is left of the hull.
"""

from __future__ import annotations

import numpy as np

from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel

__all__ = ["HANG_M", "SINK_M", "above_floor", "floor_gap", "lowest_support"]

#: A lowest point this far above the floor is still standing (on tiptoe, on a mat, in the middle of a step), metres ...
HANG_M = 0.10
#: ... and this far below it (a shallow error of the calibration), metres.
SINK_M = 0.05

_SHANKS = np.array([LIMBS[leg].segments[1] for leg in ("r_leg", "l_leg")])


def floor_gap(body: BodyModel, rotations: np.ndarray, positions: np.ndarray, floor_z: float) -> np.ndarray:
    """Height of the lowest sole or knee over the band in which it stands on the floor; negative below the band, 0 in it.

    Parameters
    ----------
    body : BodyModel
    rotations : ndarray, shape (n, 14, 3, 3)
    positions : ndarray, shape (n, 14, 3)
        As from `hmc.body.kinematics.segment_transforms`.
    floor_z : float
        Height of the floor, metres.

    Returns
    -------
    ndarray, shape (n,)
        Metres.
    """
    return above_floor(lowest_support(body, rotations, positions)[0], floor_z)


def above_floor(height: np.ndarray, floor_z: float) -> np.ndarray:
    """The gap (`floor_gap`) of a height, metres, as from `lowest_support`."""
    height = height - floor_z
    return height - np.minimum(np.maximum(height, -SINK_M), HANG_M)


def lowest_support(body: BodyModel, rotations: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The lowest of both soles and both knees.

    Returns
    -------
    height : ndarray, shape (n,)
        Its z, metres.
    point : ndarray, shape (n, 3)
        World, metres.
    segment : ndarray of int, shape (n,)
        The shank that carries it.
    """
    reach = -(body.dimensions["shank"] + body.dimensions["ankle_height"])
    knees = positions[:, _SHANKS]
    soles = knees + reach * rotations[..., 2][:, _SHANKS]
    points = np.concatenate([soles, knees], axis=1)
    lowest = points[..., 2].argmin(axis=1)
    rows = np.arange(len(points))
    return points[rows, lowest, 2], points[rows, lowest], _SHANKS[lowest % 2]
