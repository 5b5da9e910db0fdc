"""The first pose, where the person stands as da Vinci's man does: arms and legs spread. Kehl (2006), section 6.3.

Planes sweep from below for the feet, from the sides for the hands and from above for the head; limb lengths follow by proportion.
The paper takes the ratios from Dreyfuss (1959), which we do not have; ours are those of `hmc.body.proportions`, and the arms
get the length that the span from hand to hand says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import dof_index
from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import default_body, make_body
from hmc.landmarks import LANDMARKS

__all__ = ["DaVinci", "find_da_vinci"]

#: What is looked at, in shares of the stature: the sole's slice, that of the shanks, and the heights between which hands are.
_SOLE, _SHANK = (0.0, 0.045), (0.10, 0.20)
_HANDS = (0.62, 1.0)
#: Spread arms span this share of the stature at least, and the feet stand this far apart.
_LEAST_SPAN, _LEAST_STEP = 0.80, 0.12
#: The span may change the arms' lengths by these factors at most.
_ARMS = (0.88, 1.12)
#: Half a voxel and the hull's fullness make a body look larger by about so many voxels, at every end.
_FULL_VOXELS = 0.5


@dataclass(frozen=True)
class DaVinci:
    """A first pose and the body of it."""

    body: BodyModel
    state: np.ndarray


def find_da_vinci(points: np.ndarray, voxel_size_m: float, floor_z: float, height_m: float | None = None) -> DaVinci | None:
    """Recognise the pose in a hull.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Surface voxels of one person, world, metres.
    voxel_size_m : float
    floor_z : float
    height_m : float, optional
        The stature, where known.

    Returns
    -------
    DaVinci or None
        None where the person does not stand like that.
    """
    if len(points) < 100:
        return None
    top = points[:, 2].max() + (0.5 - _FULL_VOXELS) * voxel_size_m
    stature = top - floor_z
    if not 0.5 < stature < 2.6:
        return None
    level = (points[:, 2] - floor_z) / stature

    def between(bounds: tuple[float, float]) -> np.ndarray:
        return points[(level >= bounds[0]) & (level < bounds[1])]

    high = between(_HANDS)
    spread = high[:, :2] - high[:, :2].mean(axis=0)
    across = np.linalg.svd(spread, full_matrices=False)[2][0]
    feet = _two_feet(between(_SHANK), across)
    soles = between(_SOLE)
    if feet is None or np.linalg.norm(feet[0] - feet[1]) < _LEAST_STEP * stature or not len(soles):
        return None
    toes = soles[:, :2].mean(axis=0) - between(_SHANK)[:, :2].mean(axis=0)
    forward = np.array([-across[1], across[0]])
    if forward @ toes < 0:
        forward = -forward
    left = _left_of(forward)
    along = high[:, :2] @ left
    reach = 2 * voxel_size_m
    hands = [high[along >= along.max() - reach].mean(axis=0), high[along <= along.min() + reach].mean(axis=0)]
    span = along.max() - along.min() + (1 - 2 * _FULL_VOXELS) * voxel_size_m
    if span < _LEAST_SPAN * stature:
        return None
    body = _with_arms(default_body(height_m or stature), span)
    return DaVinci(body, _pose(body, feet, hands, top, forward, floor_z))


def _left_of(forward: np.ndarray) -> np.ndarray:
    return np.array([-forward[1], forward[0]])


def _two_feet(points: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Middles (x, y) of what stands on either side of the widest gap."""
    if len(points) < 8:
        return None
    along = np.sort(points[:, :2] @ across)
    widest = int(np.argmax(np.diff(along)))
    cut = (along[widest] + along[widest + 1]) / 2
    side = points[:, :2] @ across > cut
    return points[side, :2].mean(axis=0), points[~side, :2].mean(axis=0)


def _with_arms(body: BodyModel, span: float) -> BodyModel:
    d = body.dimensions
    arm = d["upper_arm"] + d["forearm"] + d["hand"]
    factor = np.clip((span / 2 - d["shoulder_half_width"]) / arm, *_ARMS)
    return make_body(d | {name: d[name] * float(factor) for name in ("upper_arm", "forearm", "hand")}, body.limits)


def _pose(body: BodyModel, feet, hands, top: float, forward: np.ndarray, floor_z: float) -> np.ndarray:
    """Inverse kinematics to the ends that were found."""
    d, left = body.dimensions, _left_of(forward)
    state = neutral_state("sideways", body.limits)
    if feet[0] @ left < feet[1] @ left:
        feet = feet[::-1]
    middle = (feet[0] + feet[1]) / 2
    half = np.linalg.norm(feet[0] - feet[1]) / 2 - d["hip_half_width"]
    legs = d["thigh"] + d["shank"]
    pelvis = floor_z + d["ankle_height"] + np.sqrt(np.maximum(legs**2 - half**2, (0.8 * legs) ** 2))
    state[:3] = (*middle, pelvis)
    state[3] = np.arctan2(forward[1], forward[0])
    goal = np.full((len(LANDMARKS), 3), np.nan)

    def put(name: str, point) -> None:
        goal[LANDMARKS.index(name)] = point

    put("pelvis", state[:3])
    put("head_top", (*(middle + d["head_forward"] * forward), top))
    for side, foot, hand, sign in (("l", feet[0], hands[0], 1.0), ("r", feet[1], hands[1], -1.0)):
        put(f"{side}_ankle", (*foot, floor_z + d["ankle_height"]))
        put(f"{side}_wrist", hand - np.append(sign * d["hand"] * left, 0.0))
    state, _ = fit_landmarks(body, goal, state)
    state[dof_index("torso_x", "torso_y", "torso_z")] = 0.0
    return state
