"""The actors' skeleton: bones, their lengths, forward kinematics and the placing of limbs.

Body frame: X forward, Y to the person's left, Z up. In the rest pose (arms stretched sideways) every bone's frame equals the body's
frame. A pose is the root's position (n, 3) and the *orientation* of every bone, (n, n_bones, 3, 3), world from bone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.landmarks import LANDMARKS

__all__ = [
    "BONE_NAMES", "PARENTS", "PosedSkeleton", "Skeleton", "joint_positions", "landmark_positions", "limb_orientations", "make_skeleton",
    "reach",
]  # fmt: skip

_TREE: tuple[tuple[str, str], ...] = (
    ("pelvis", ""), ("abdomen", "pelvis"), ("chest", "abdomen"), ("neck", "chest"), ("head", "neck"),
    ("l_clavicle", "chest"), ("l_upper_arm", "l_clavicle"), ("l_forearm", "l_upper_arm"), ("l_hand", "l_forearm"),
    ("r_clavicle", "chest"), ("r_upper_arm", "r_clavicle"), ("r_forearm", "r_upper_arm"), ("r_hand", "r_forearm"),
    ("l_thigh", "pelvis"), ("l_shank", "l_thigh"), ("l_foot", "l_shank"), ("l_toes", "l_foot"),
    ("r_thigh", "pelvis"), ("r_shank", "r_thigh"), ("r_foot", "r_shank"), ("r_toes", "r_foot"),
)  # fmt: skip

#: Bones, each after its parent.
BONE_NAMES: tuple[str, ...] = tuple(name for name, _ in _TREE)
#: Index of each bone's parent, -1 for the root.
PARENTS: tuple[int, ...] = tuple(BONE_NAMES.index(parent) if parent else -1 for _, parent in _TREE)

#: The bone at whose origin each landmark lies; `head_top` is not an origin and is treated apart.
_LANDMARK_BONES = {
    "pelvis": "pelvis", "neck": "neck", "shoulder": "upper_arm", "elbow": "forearm", "wrist": "hand",
    "hip": "thigh", "knee": "shank", "ankle": "foot",
}  # fmt: skip


@dataclass(frozen=True)
class Skeleton:
    """Where joints lie when the person stands in the rest pose.

    Parameters
    ----------
    height_m : float
        Stature, sole to crown.
    offsets : ndarray, shape (n_bones, 3)
        Origin of each bone in its parent's frame, metres; zero for the root.
    head_top : ndarray, shape (3,)
        The crown in the head's frame, metres.
    """

    height_m: float
    offsets: np.ndarray
    head_top: np.ndarray

    def length(self, bone: str) -> float:
        """Distance from the bone's parent's origin to its own, metres."""
        return float(np.linalg.norm(self.offsets[BONE_NAMES.index(bone)]))

    @property
    def hip_height(self) -> float:
        """Height of the hip centres above the sole where the shorter leg is straight, metres."""
        return min(self.length(f"{side}_shank") + self.length(f"{side}_foot") for side in "lr") + self.ankle_height

    @property
    def ankle_height(self) -> float:
        """Height of the ankle centre above the sole, metres."""
        return self.height_m * ANKLE_HEIGHT


@dataclass(frozen=True)
class PosedSkeleton:
    """A skeleton in one pose.

    Parameters
    ----------
    skeleton : Skeleton
    joints : ndarray, shape (n_bones, 3)
        Origins of the bones, metres.
    frames : ndarray, shape (n_bones, 3, 3)
        Their orientations, world from bone.
    """

    skeleton: Skeleton
    joints: np.ndarray
    frames: np.ndarray


#: Ankle centre above the sole, as a fraction of stature.
ANKLE_HEIGHT = 0.047


def make_skeleton(height_m: float, sex: str, rng: np.random.Generator, longer_left: tuple[float, float] = (0.0, 0.0)) -> Skeleton:
    """A skeleton with the proportions of a person, which vary from person to person.

    Lengths between joint centres are fractions of stature as in anthropometric tables (Winter, *Biomechanics and Motor Control of Human
    Movement*, after Drillis and Contini), moved from the body surface to the centres of rotation.

    Parameters
    ----------
    height_m : float
        Stature.
    sex : {"man", "woman"}
        Women get wider hips and narrower shoulders.
    rng : Generator
        Individual variation, about 2.5 % (standard deviation) a length.
    longer_left : tuple of (float, float)
        By how much of its length the left arm, and the left leg, is longer than the right one.

    Returns
    -------
    Skeleton
    """

    def vary(mean: float, spread: float = 0.025) -> float:
        return mean * float(1 + spread * np.clip(rng.standard_normal(), -2, 2))

    woman = sex == "woman"
    upper_arm, forearm = vary(0.162), vary(0.1475)
    thigh, shank = vary(0.240), vary(0.248)
    shoulder, hip = vary(0.103 if woman else 0.110), vary(0.058 if woman else 0.055)
    hip_height = ANKLE_HEIGHT + thigh + shank
    head = vary(0.152)  # neck to crown
    trunk = 1 - hip_height - head
    foot = vary(0.073)
    offsets = {name: np.zeros(3) for name in BONE_NAMES}
    offsets["abdomen"] = np.array([-0.004, 0, 0.20 * trunk])
    offsets["chest"] = np.array([-0.004, 0, 0.31 * trunk])
    offsets["neck"] = np.array([-0.010, 0, 0.49 * trunk])
    offsets["head"] = np.array([0.012, 0, 0.42 * head])
    for side, sign in (("l", 1.0), ("r", -1.0)):
        offsets[f"{side}_clavicle"] = np.array([0.010, sign * 0.012, 0.37 * trunk])
        offsets[f"{side}_upper_arm"] = np.array([-0.014, sign * (shoulder - 0.012), -0.05 * trunk])
        arm, leg = (1 + 0.5 * sign * share for share in longer_left)
        offsets[f"{side}_forearm"] = np.array([0, sign * arm * upper_arm, 0])
        offsets[f"{side}_hand"] = np.array([0, sign * arm * forearm, 0])
        offsets[f"{side}_thigh"] = np.array([0, sign * hip, 0])
        offsets[f"{side}_shank"] = np.array([0, 0, -leg * thigh])
        offsets[f"{side}_foot"] = np.array([0, 0, -leg * shank])
        offsets[f"{side}_toes"] = np.array([foot, 0, -0.032])
    crown = np.array([0.006, 0, 0.58 * head])
    return Skeleton(height_m, height_m * np.array([offsets[name] for name in BONE_NAMES]), height_m * crown)


def joint_positions(skeleton: Skeleton, root: np.ndarray, orientations: np.ndarray) -> np.ndarray:
    """Origins of all bones.

    Parameters
    ----------
    skeleton : Skeleton
    root : ndarray, shape (..., 3)
        Position of the pelvis (the middle of the hips), world, metres.
    orientations : ndarray, shape (..., n_bones, 3, 3)
        World from bone.

    Returns
    -------
    ndarray, shape (..., n_bones, 3)
        World, metres.
    """
    root = np.asarray(root, float)
    positions = np.empty((*root.shape[:-1], len(BONE_NAMES), 3))
    positions[..., 0, :] = root
    for bone, parent in enumerate(PARENTS[1:], start=1):
        positions[..., bone, :] = positions[..., parent, :] + orientations[..., parent, :, :] @ skeleton.offsets[bone]
    return positions


def landmark_positions(skeleton: Skeleton, root: np.ndarray, orientations: np.ndarray) -> np.ndarray:
    """The fifteen landmarks of `hmc.landmarks.LANDMARKS`, shape (..., 15, 3); arguments as in `joint_positions`."""
    joints = joint_positions(skeleton, root, orientations)
    head = BONE_NAMES.index("head")
    crown = joints[..., head, :] + orientations[..., head, :, :] @ skeleton.head_top
    columns = []
    for name in LANDMARKS:
        side, _, joint = name.rpartition("_") if name[:2] in ("l_", "r_") else ("", "", name)
        if name == "head_top":
            columns.append(crown)
        else:
            bone = _LANDMARK_BONES[joint]
            columns.append(joints[..., BONE_NAMES.index(f"{side}_{bone}" if side else bone), :])
    return np.stack(columns, axis=-2)


def reach(start: np.ndarray, target: np.ndarray, first: float, second: float, pole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of two bones that carry ``start`` to ``target``, the joint between them turned towards ``pole``.

    A target out of reach is approached as far as the bones go.

    Parameters
    ----------
    start, target : ndarray, shape (n, 3)
    first, second : float
        Lengths of the bones, metres.
    pole : ndarray, shape (n, 3) or (3,)
        Direction in which the middle joint points.

    Returns
    -------
    first_direction, second_direction : ndarray, shape (n, 3)
        Unit vectors.
    """
    across = target - start
    distance = np.linalg.norm(across, axis=-1, keepdims=True)
    line = across / np.maximum(distance, 1e-9)
    distance = np.clip(distance, abs(first - second) + 1e-3, (first + second) * 0.9995)
    along = (distance**2 + first**2 - second**2) / (2 * distance)
    aside = np.sqrt(np.maximum(first**2 - along**2, 0))
    pole = pole - np.sum(pole * line, axis=-1, keepdims=True) * line
    pole = unit(pole)
    middle = along * line + aside * pole
    return unit(middle), unit(distance * line - middle)


def limb_orientations(limb: str, first: np.ndarray, second: np.ndarray, pole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orientations of the two bones of an arm or leg from their directions.

    The hinge (knee, elbow) is perpendicular to both bones; where the limb is nearly straight ``pole`` decides.

    Parameters
    ----------
    limb : {"leg", "l_arm", "r_arm"}
    first, second : ndarray, shape (n, 3)
        Unit directions of thigh and shank, or upper arm and forearm.
    pole : ndarray, shape (n, 3)
        Where the knee or elbow points.

    Returns
    -------
    ndarray, ndarray, each of shape (n, 3, 3)
    """
    hinge = np.cross(first, second) - 0.08 * np.cross(first, pole)
    return tuple(_bone_frame(limb, direction, hinge) for direction in (first, second))  # type: ignore[return-value]


def _bone_frame(limb: str, direction: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    hinge = unit(hinge - np.sum(hinge * direction, axis=-1, keepdims=True) * direction)
    if limb == "leg":
        y, z = hinge, -direction
    elif limb == "l_arm":
        y, z = direction, -hinge
    else:
        y, z = -direction, hinge
    return np.stack([np.cross(y, z), y, z], axis=-1)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors scaled to length one along the last axis."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
