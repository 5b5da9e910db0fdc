"""People stand on the floor: how far a pose hangs in the air or is sunk in the ground.

Furniture hides legs from several cameras at once, and then the hull ends at the table's edge. Without the floor the legs
would fold up into what is left of the hull. But people jump, climb and sit on tables too: to hang in the air costs no more than so
much, however high, and the floor decides what silhouettes leave open.
"""

from __future__ import annotations

import numpy as np

from hmc.body.feet import foot_places
from hmc.body.joints import SEGMENTS
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel
from hmc.body.proportions import sole_ends

__all__ = ["AIR_M", "HANG_M", "SINK_M", "STANDING_M", "above_floor", "floor_gap", "gap_slope", "lowest_support", "off_floor", "sole_places"]

#: A lowest point this far above the floor is still standing (on tiptoe, on a mat, in the middle of a step), metres ...
HANG_M = 0.10
#: ... and this far below it (a shallow error of the calibration), metres.
SINK_M = 0.05
#: Beyond that, hanging in the air costs as its square at first, and never more than this height's square, metres.
AIR_M = 0.12
#: A sole that is known to stand is no farther from the floor than this, metres: so well is a floor known, and so thick is a mat.
STANDING_M = 0.015

_SHANKS = np.array([LIMBS[leg].segments[1] for leg in ("r_leg", "l_leg")])
_FEET = np.array([[one.name for one in SEGMENTS].index(f"{side}_foot") for side in "rl"])
#: Where a sole bears: at the heel and at the ball, of the way from the heel's end to the toes'.
_BEARING = (0.1, 0.75)
#: Carriers of the points of `lowest_support`, in their order.
_BEARERS = np.r_[_FEET, _FEET, _SHANKS]


def floor_gap(body: BodyModel, rotations: np.ndarray, positions: np.ndarray, floor_z: float) -> np.ndarray:
    """What the height of the lowest sole or knee counts as over the band in which it stands on the floor (`above_floor`).

    Parameters
    ----------
    body : BodyModel
    rotations : ndarray, shape (n, 16, 3, 3)
    positions : ndarray, shape (n, 16, 3)
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
    """What heights count as, metres: nothing in the band in which a sole stands, below it the depth (negative), above it at first the
    height over it and far up no more than `AIR_M`, the root of the loss of Geman and McClure (1985).

    Parameters
    ----------
    height : ndarray
        Of the lowest support (`lowest_support`), metres.
    floor_z : float
    """
    height = height - floor_z
    gap = height - np.minimum(np.maximum(height, -SINK_M), HANG_M)
    return gap / np.sqrt(_aloft(gap))


def gap_slope(height: np.ndarray, floor_z: float) -> np.ndarray:
    """How `above_floor` changes with the height where it is not 0; parameters as there."""
    height = height - floor_z
    return _aloft(height - HANG_M) ** -1.5


def _aloft(gap: np.ndarray) -> np.ndarray:
    return 1 + (np.maximum(gap, 0) / AIR_M) ** 2


def off_floor(height: np.ndarray, floor_z: float) -> np.ndarray:
    """How far a sole that stands is above the band in which it may be, or below it (negative), metres."""
    height = height - floor_z
    return height - np.clip(height, -STANDING_M, STANDING_M)


def lowest_support(body: BodyModel, rotations: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The lowest of both knees and of the heels and balls of both soles.

    Returns
    -------
    height : ndarray, shape (n,)
        Its z, metres.
    point : ndarray, shape (n, 3)
        World, metres.
    segment : ndarray of int, shape (n,)
        The foot or shank that carries it.
    """
    (heel, toe), ankle = sole_ends(body.dimensions), body.dimensions["ankle_height"]
    turns, ankles = rotations[:, _FEET], positions[:, _FEET]
    soles = [ankles + (heel + share * (toe - heel)) * turns[..., 0] - ankle * turns[..., 2] for share in _BEARING]
    points = np.concatenate([*soles, positions[:, _SHANKS]], axis=1)
    lowest = points[..., 2].argmin(axis=1)
    rows = np.arange(len(points))
    return points[rows, lowest, 2], points[rows, lowest], _BEARERS[lowest]


def sole_places(body: BodyModel, rotations: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where both soles bear: heel and ball of the left foot, then of the right one.

    Parameters
    ----------
    body : BodyModel
        With feet.
    rotations : ndarray, shape (n, 16, 3, 3)
    positions : ndarray, shape (n, 16, 3)
        As from `hmc.body.kinematics.segment_transforms`.

    Returns
    -------
    points : ndarray, shape (n, 4, 3)
        World, metres.
    segment : ndarray of int, shape (4,)
        What carries each.
    """
    places = foot_places(body)
    if places is None:
        return np.zeros((len(rotations), 0, 3)), np.zeros(0, int)
    segments, ends = places
    ends = ends.reshape(2, 2, 3)  # foot, heel and toe
    bearing = np.stack([ends[:, 0] + share * (ends[:, 1] - ends[:, 0]) for share in _BEARING], axis=1).reshape(-1, 3)
    return positions[:, segments] + (rotations[:, segments] @ bearing[..., None])[..., 0], segments
