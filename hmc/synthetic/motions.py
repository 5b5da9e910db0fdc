"""Motions as angles over time: what every motion shares.

A motion is a function ``(skeleton, times, rng, **options) -> Motion``. Legs are carried by where the feet are planted, trunk, arms and
head by angle curves or by where the hands go; out come the orientations of all bones in every frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from hmc.synthetic.skeleton import BONE_NAMES, PARENTS, Skeleton, limb_orientations, reach, unit

__all__ = [
    "Feet",
    "Motion",
    "Upper",
    "angles",
    "arms_by_angles",
    "arms_by_hands",
    "assemble",
    "keyframes",
    "lift_clavicle",
    "pelvis_height",
    "place",
    "roll_foot",
]


@dataclass(frozen=True)
class Motion:
    """A person's pose in every frame.

    Parameters
    ----------
    root : ndarray, shape (n, 3)
        The pelvis, world, metres.
    orientations : ndarray, shape (n, n_bones, 3, 3)
        World from bone.
    """

    root: np.ndarray
    orientations: np.ndarray

    def __len__(self) -> int:
        return len(self.root)


@dataclass(frozen=True)
class Feet:
    """Where both feet are, arrays over frames and sides (left, right).

    Parameters
    ----------
    ankles : ndarray, shape (n, 2, 3)
        Ankle centres, metres.
    yaw, pitch : ndarray, shape (n, 2)
        Heading, and toes up (positive) or heel up (negative), radians.
    toe_pitch : ndarray, shape (n, 2)
        Of the toes in the world, radians.
    """

    ankles: np.ndarray
    yaw: np.ndarray
    pitch: np.ndarray
    toe_pitch: np.ndarray


@dataclass(frozen=True)
class Upper:
    """Angle curves of trunk and head, radians, each (n, 3): roll (to the right), pitch (forwards), yaw (to the left); added up the spine.

    Parameters
    ----------
    pelvis : ndarray
        In the world.
    abdomen, chest, neck, head : ndarray
        Against the bone below.
    """

    pelvis: np.ndarray
    abdomen: np.ndarray
    chest: np.ndarray
    neck: np.ndarray
    head: np.ndarray


def euler(curve: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) from roll, pitch and yaw (n, 3): yaw first, then pitch, then roll, each about the turned axis."""
    return Rotation.from_euler("ZYX", curve[:, ::-1]).as_matrix()


def assemble(skeleton: Skeleton, root: np.ndarray, upper: Upper, feet: Feet, arms) -> Motion:
    """Put trunk, legs and arms together.

    Parameters
    ----------
    skeleton : Skeleton
    root : ndarray, shape (n, 3)
        The pelvis, metres.
    upper : Upper
    feet : Feet
    arms : callable
        ``arms(side, chest, shoulders) -> (upper_direction, forearm_direction, pole)``, each (n, 3) in the world, from the side
        (0 left, 1 right), the chest's orientation (n, 3, 3) and the shoulder's place (n, 3); the elbow points to the pole.

    Returns
    -------
    Motion
    """
    n = len(root)
    frames = np.tile(np.eye(3), (n, len(BONE_NAMES), 1, 1))
    positions = np.zeros((n, len(BONE_NAMES), 3))
    positions[:, 0] = root
    index = BONE_NAMES.index

    def put(bone: str, orientation: np.ndarray) -> None:
        frames[:, index(bone)] = orientation

    def locate(bone: str) -> np.ndarray:
        k = index(bone)
        parent = PARENTS[k]
        positions[:, k] = positions[:, parent] + frames[:, parent] @ skeleton.offsets[k]
        return positions[:, k]

    put("pelvis", euler(upper.pelvis))
    for bone, below in (("abdomen", "pelvis"), ("chest", "abdomen"), ("neck", "chest"), ("head", "neck")):
        put(bone, frames[:, index(below)] @ euler(getattr(upper, bone)))
        locate(bone)
    chest = frames[:, index("chest")]
    for s, side in enumerate(("l", "r")):
        sign = 1 - 2 * s
        put(f"{side}_clavicle", chest)
        locate(f"{side}_clavicle")
        shoulder = locate(f"{side}_upper_arm")
        first, second, pole = arms(s, chest, shoulder)
        put(f"{side}_clavicle", lift_clavicle(chest, first, sign))
        shoulder = locate(f"{side}_upper_arm")
        first, second, pole = arms(s, chest, shoulder)
        a, b = limb_orientations(f"{side}_arm", first, second, pole)
        put(f"{side}_upper_arm", a)
        put(f"{side}_forearm", b)
        put(f"{side}_hand", b)
        hip = locate(f"{side}_thigh")
        facing = euler(np.column_stack([np.zeros((n, 2)), feet.yaw[:, s]]))
        pole = unit(0.5 * facing[:, :, 0] + 0.5 * frames[:, 0, :, 0])
        first, second = reach(hip, feet.ankles[:, s], skeleton.length(f"{side}_shank"), skeleton.length(f"{side}_foot"), pole)
        a, b = limb_orientations("leg", first, second, pole)
        put(f"{side}_thigh", a)
        put(f"{side}_shank", b)
        for bone, pitch in (("foot", feet.pitch), ("toes", feet.toe_pitch)):
            put(f"{side}_{bone}", euler(np.column_stack([np.zeros(n), -pitch[:, s], feet.yaw[:, s]])))
    return Motion(np.asarray(root, float), frames)


def lift_clavicle(chest: np.ndarray, upper_arm: np.ndarray, sign: int) -> np.ndarray:
    """Orientations of a clavicle, (n, 3, 3): the shoulder girdle lifts with the arm, by about a fifth of its rise beyond 35 degrees.

    Parameters
    ----------
    chest : ndarray, shape (n, 3, 3)
    upper_arm : ndarray, shape (n, 3)
        Its direction.
    sign : int
        1 left, -1 right.
    """
    rise = np.arccos(np.clip(-np.einsum("ni,ni->n", upper_arm, chest[:, :, 2]), -1, 1))
    lift = np.clip(rise - np.radians(35), 0, None) * 0.18
    return chest @ Rotation.from_rotvec(lift[:, None] * [sign, 0, 0]).as_matrix()


def arms_by_angles(swing: np.ndarray, flex: np.ndarray, out: np.ndarray):
    """Arms from angle curves, each (n, 2) for left and right, radians: swing forwards, elbow flexion, abduction."""

    def arms(s: int, chest: np.ndarray, shoulder: np.ndarray):
        sign = 1 - 2 * s

        def direction(forward: np.ndarray) -> np.ndarray:
            aside = np.sin(out[:, s])
            down = np.cos(out[:, s])
            return np.stack([np.sin(forward) * down, sign * aside, -np.cos(forward) * down], axis=-1)

        first, second = direction(swing[:, s]), direction(swing[:, s] + flex[:, s])
        pole = np.tile([-1.0, 0.0, 0.0], (len(swing), 1))
        return _turned(chest, first), _turned(chest, second), _turned(chest, pole)

    return arms


def arms_by_hands(skeleton: Skeleton, targets: np.ndarray, frame: str = "chest", elbow_out: float = 0.5):
    """Arms that carry the wrists to ``targets``.

    Parameters
    ----------
    skeleton : Skeleton
    targets : ndarray, shape (n, 2, 3)
        The y of the right wrist too is positive to the left.
    frame : {"chest", "world"}
        Targets are arm's lengths from the shoulder along the chest's axes, or places in metres.
    elbow_out : float
        How much the elbow points outwards rather than down and back.
    """

    def arms(s: int, chest: np.ndarray, shoulder: np.ndarray):
        sign = 1 - 2 * s
        upper, fore = skeleton.length(f"{'lr'[s]}_forearm"), skeleton.length(f"{'lr'[s]}_hand")
        goal = targets[:, s] if frame == "world" else shoulder + (upper + fore) * _turned(chest, targets[:, s])
        pole = _turned(chest, np.tile(unit(np.array([-0.5, sign * elbow_out, -0.8])), (len(chest), 1)))
        first, second = reach(shoulder, goal, upper, fore, pole)
        return first, second, pole

    return arms


def pelvis_height(
    skeleton: Skeleton, pelvis_xy: np.ndarray, yaw: np.ndarray, feet: Feet, slack: float = 0.996, smooth: float = 2.0
) -> np.ndarray:
    """As high as the legs allow: the height of the pelvis, (n,), metres.

    Parameters
    ----------
    skeleton : Skeleton
    pelvis_xy : ndarray, shape (n, 2)
        Metres.
    yaw : ndarray, shape (n,)
        Heading of the pelvis, radians.
    feet : Feet
        Where the ankles are.
    slack : float
        To this fraction of its length the more stretched leg is straight.
    smooth : float
        Standard deviation of the smoothing over frames.
    """
    heights = []
    for s, side in enumerate("lr"):
        leg = (skeleton.length(f"{side}_shank") + skeleton.length(f"{side}_foot")) * slack
        out = skeleton.offsets[BONE_NAMES.index(f"{side}_thigh"), 1]
        hip = pelvis_xy + out * np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)
        level = np.sum((feet.ankles[:, s, :2] - hip) ** 2, axis=-1)
        heights.append(feet.ankles[:, s, 2] + np.sqrt(np.maximum(leg**2 - level, (0.3 * leg) ** 2)))
    lowest = np.minimum(*heights)
    smoothed = gaussian_filter1d(lowest, smooth, mode="nearest")
    # Smoothing lifts the pelvis where the limit dips; pull it back under the limit there, smoothly.
    return smoothed - gaussian_filter1d(np.maximum(smoothed - lowest, 0), smooth, mode="nearest")


def roll_foot(skeleton: Skeleton, pitch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the ankle goes when a foot on the floor rolls over its heel (toes up, positive) or over the joint of its toes (negative).

    Parameters
    ----------
    skeleton : Skeleton
    pitch : ndarray, shape (n,)
        Radians.

    Returns
    -------
    forward : ndarray, shape (n,)
        From where the ankle is with the foot flat, metres.
    height : ndarray, shape (n,)
        Above the floor, metres.
    """
    toes = skeleton.offsets[BONE_NAMES.index("l_toes")]
    ahead = np.where(pitch > 0, -0.020 * skeleton.height_m, toes[0])
    below = np.where(pitch > 0, skeleton.ankle_height, -toes[2])
    forward = ahead - np.cos(pitch) * ahead - np.sin(pitch) * below
    return forward, skeleton.ankle_height - below + below * np.cos(pitch) - ahead * np.sin(pitch)


def keyframes(times: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at ``times`` through keys ``(at, values)``, without overshoot and resting at flat stretches; held before and after."""
    return PchipInterpolator(at, np.asarray(values, float), axis=0)(np.clip(times, at[0], at[-1]))


def place(motion: Motion, start_m, heading_deg: float) -> Motion:
    """Turn a motion that starts at the origin facing X so that it starts at ``start_m`` (x, y) facing ``heading_deg``."""
    turn = Rotation.from_euler("z", heading_deg, degrees=True).as_matrix()
    return Motion(motion.root @ turn.T + np.append(np.asarray(start_m, float), 0.0), turn @ motion.orientations)


def angles(motion: Motion) -> np.ndarray:
    """Joint angles: rotation vectors of every bone against its parent, (n, n_bones, 3), radians; the root's against the world."""
    frames = motion.orientations
    parents = frames[:, np.maximum(PARENTS, 0)].copy()
    parents[:, 0] = np.eye(3)
    local = parents.transpose(0, 1, 3, 2) @ frames
    return Rotation.from_matrix(local.reshape(-1, 3, 3)).as_rotvec().reshape(*frames.shape[:2], 3)


def _turned(rotations: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", rotations, vectors)
