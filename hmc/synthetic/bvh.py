"""BVH motion files, and their motions on our actors.

A file's skeleton is read by the names of its joints, whatever the naming: only where joints lie is used, so that rest poses, axes and
units do not matter. Bones take the directions that the file's have; lengths stay the actor's own. Feet of files that were carried over
from one skeleton to another are turned as no ankle goes; these stop at an ankle's range.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.errors import InputError
from hmc.io.door import read_text_file
from hmc.synthetic.motions import Motion, lift_clavicle
from hmc.synthetic.skeleton import BONE_NAMES, Skeleton, joint_positions, limb_orientations, unit

__all__ = ["Bvh", "bvh_motion", "bvh_positions", "read_bvh"]

#: How far an ankle lifts the toes (negative) and lowers them, degrees: a passive range, as of a stretch or a dancer.
ANKLE_RANGE_DEG = (-30.0, 70.0)


@dataclass(frozen=True)
class Bvh:
    """A motion file.

    Parameters
    ----------
    names : tuple of str
        Joints, each after its parent; end sites are left out.
    parents : tuple of int
        -1 for the root.
    offsets : ndarray, shape (n_joints, 3)
        In the file's unit.
    channels : tuple of tuple of str
        Of each joint, such as ``("Zrotation", "Xrotation", "Yrotation")``.
    frame_time_s : float
    values : ndarray, shape (n_frames, n_channels)
        Degrees, and the file's unit.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: np.ndarray
    channels: tuple[tuple[str, ...], ...]
    frame_time_s: float
    values: np.ndarray


def read_bvh(path: str | Path) -> Bvh:
    """Read a BVH file.

    Raises
    ------
    InputError
        When the file is missing or is no BVH file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such motion file")
    head, found, tail = read_text_file(path, guess=True).partition("MOTION")
    tokens = head.split()
    if not found or not tokens or tokens[0].upper() != "HIERARCHY":
        raise InputError(f"{path}: not a BVH file; it has no HIERARCHY and MOTION")
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[tuple[str, ...]] = []
    stack: list[int] = []
    current = -1
    k = 1
    try:
        while k < len(tokens):
            word = tokens[k].upper()
            if word in ("ROOT", "JOINT"):
                names.append(tokens[k + 1])
                parents.append(stack[-1] if stack else -1)
                offsets.append([0.0, 0.0, 0.0])
                channels.append(())
                current = len(names) - 1
                k += 2
            elif word == "END":
                current = -1
                k += 2
            elif word == "{":
                stack.append(current)
                k += 1
            elif word == "}":
                stack.pop()
                k += 1
            elif word == "OFFSET":
                if stack[-1] >= 0:
                    offsets[stack[-1]] = [float(x) for x in tokens[k + 1 : k + 4]]
                k += 4
            elif word == "CHANNELS":
                count = int(tokens[k + 1])
                channels[stack[-1]] = tuple(tokens[k + 2 : k + 2 + count])
                k += 2 + count
            else:
                raise ValueError(f"unexpected word {tokens[k]!r}")
        match = re.match(r"\s*Frames:\s*(\d+)\s*Frame Time:\s*(\S+)\s*", tail)
        if match is None:
            raise ValueError("no frame count and frame time")
        count, width = int(match[1]), sum(len(c) for c in channels)
        values = np.array(tail[match.end() :].split(), float)
        if values.size < count * width or count < 1:
            raise ValueError(f"{count} frames of {width} numbers are announced, {values.size} numbers are there")
        frame_time = float(match[2])
    except (ValueError, IndexError) as error:
        raise InputError(f"{path}: not a readable BVH file ({error})") from None
    return Bvh(tuple(names), tuple(parents), np.array(offsets), tuple(channels), frame_time, values[: count * width].reshape(count, width))


def bvh_positions(motion: Bvh) -> tuple[np.ndarray, np.ndarray]:
    """Forward kinematics of a motion file.

    Returns
    -------
    positions : ndarray, shape (n_frames, n_joints, 3)
        The file's unit and axes.
    rotations : ndarray, shape (n_frames, n_joints, 3, 3)
        World from joint.
    """
    n = len(motion.values)
    positions = np.zeros((n, len(motion.names), 3))
    rotations = np.tile(np.eye(3), (n, len(motion.names), 1, 1))
    column = 0
    for joint, (parent, channels) in enumerate(zip(motion.parents, motion.channels, strict=True)):
        values = motion.values[:, column : column + len(channels)]
        column += len(channels)
        place = np.tile(motion.offsets[joint], (n, 1))
        moves = [c for c, name in enumerate(channels) if name.lower().endswith("position")]
        for c in moves:
            axis = "xyz".index(channels[c][0].lower())
            place[:, axis] = values[:, c] + (motion.offsets[joint, axis] if parent < 0 else 0.0)
        turns = [c for c, name in enumerate(channels) if name.lower().endswith("rotation")]
        local = np.tile(np.eye(3), (n, 1, 1))
        for c in turns:
            local = local @ Rotation.from_euler(channels[c][0].lower(), values[:, c : c + 1], degrees=True).as_matrix().reshape(n, 3, 3)
        if parent < 0:
            positions[:, joint], rotations[:, joint] = place, local
        else:
            positions[:, joint] = positions[:, parent] + np.einsum("nij,nj->ni", rotations[:, parent], place)
            rotations[:, joint] = rotations[:, parent] @ local
    return positions, rotations


# Joint names, lower case without prefix and punctuation, in order of preference; {side} stands for left or l, right or r.
_NAMES: dict[str, tuple[str, ...]] = {
    "hip": ("{side}upleg", "{side}thigh", "{side}upperleg", "{side}hip"),
    "knee": ("{side}leg", "{side}calf", "{side}lowleg", "{side}lowerleg", "{side}shin", "{side}knee"),
    "ankle": ("{side}foot", "{side}ankle"),
    "toe": ("{side}toebase", "{side}toe", "{side}toes", "{side}ball"),
    "shoulder": ("{side}arm", "{side}upperarm", "{side}uparm", "{side}shoulder"),
    "elbow": ("{side}forearm", "{side}lowarm", "{side}lowerarm", "{side}elbow"),
    "wrist": ("{side}hand", "{side}wrist"),
}
_MIDDLE = {"neck": ("neck", "necktwist01", "neck01", "neck1"), "head": ("head",), "spine": ("spine1", "spine01", "chest", "spine", "torso")}


def _find_joints(motion: Bvh) -> dict[str, int]:
    plain = [re.sub(r"[^a-z0-9]", "", re.sub(r"^(.*:|cc_base_|bip\d*[_ ]?)", "", name.lower())) for name in motion.names]
    wanted: dict[str, tuple[str, ...]] = {
        f"{short}_{joint}": tuple(form.format(side=side) for form in forms for side in sides)
        for short, sides in (("l", ("left", "l")), ("r", ("right", "r")))
        for joint, forms in _NAMES.items()
    }
    wanted.update(_MIDDLE)
    found = {}
    for joint, names in wanted.items():
        place = next((plain.index(name) for name in names if name in plain), None)
        if place is None:
            raise InputError(
                f"the motion file has no joint that could be the {joint}; names tried: {', '.join(names)}; it has {', '.join(motion.names)}"
            )
        found[joint] = place
    return found


def bvh_motion(motion: Bvh, skeleton: Skeleton, times: np.ndarray, start_s: float = 0.0) -> Motion:
    """A file's motion on an actor's skeleton.

    Parameters
    ----------
    motion : Bvh
        Y is up, as in nearly every file.
    skeleton : Skeleton
    times : ndarray, shape (n,)
        Seconds; beyond the end of the file its last pose is held.
    start_s : float
        Where in the file time 0 lies.

    Returns
    -------
    Motion
        From the origin, facing X in the first frame.

    Raises
    ------
    InputError
        When a joint cannot be found by name.
    """
    found = _find_joints(motion)
    positions, rotations = bvh_positions(motion)
    at = np.clip((times + start_s) / motion.frame_time_s, 0, len(positions) - 1)
    low = np.minimum(at.astype(int), max(len(positions) - 2, 0))
    high = np.minimum(low + 1, len(positions) - 1)
    share = (at - low)[:, None]
    y_up = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # file's (x, y, z) to world (z, x, y)
    joint = {name: ((1 - share) * positions[low, k] + share * positions[high, k]) @ y_up.T for name, k in found.items()}
    # How the head has turned since the first frame that the file holds; the first pose counts as looking ahead with the chest.
    head = y_up @ rotations[np.rint(at).astype(int), found["head"]] @ y_up.T
    frames = _orientations(joint, skeleton)
    chest = frames[:, BONE_NAMES.index("chest")]
    rest = np.linalg.inv(head[0]) @ chest[0]
    frames[:, BONE_NAMES.index("head")] = head @ rest
    return _grounded(_root(joint, skeleton), frames, skeleton)


def _orientations(joint: dict[str, np.ndarray], skeleton: Skeleton) -> np.ndarray:
    n = len(joint["neck"])
    frames = np.tile(np.eye(3), (n, len(BONE_NAMES), 1, 1))

    def put(bone: str, orientation: np.ndarray) -> None:
        frames[:, BONE_NAMES.index(bone)] = orientation

    hips = (joint["l_hip"] + joint["r_hip"]) / 2
    slope = _foot_slope(joint)
    low, high, neck = (skeleton.offsets[BONE_NAMES.index(bone)] for bone in ("abdomen", "chest", "neck"))
    pelvis = _upright(joint["l_hip"] - joint["r_hip"], joint["spine"] - hips, low)
    chest = _upright(joint["l_shoulder"] - joint["r_shoulder"], joint["neck"] - (joint["spine"] + hips) / 2, (low + high) / 2 + neck)
    halfway = Rotation.from_rotvec(Rotation.from_matrix(pelvis.transpose(0, 2, 1) @ chest).as_rotvec() / 2).as_matrix()
    put("pelvis", pelvis)
    put("abdomen", pelvis @ halfway)
    put("chest", chest)
    put("neck", chest)
    for side, sign in (("l", 1), ("r", -1)):
        upper, fore = (unit(joint[f"{side}_{b}"] - joint[f"{side}_{a}"]) for a, b in (("shoulder", "elbow"), ("elbow", "wrist")))
        first, second = limb_orientations(f"{side}_arm", upper, fore, unit(-chest[:, :, 0] - 0.3 * chest[:, :, 2]))
        put(f"{side}_clavicle", lift_clavicle(chest, upper, sign))
        put(f"{side}_upper_arm", first)
        put(f"{side}_forearm", second)
        put(f"{side}_hand", second)
        thigh, shank = (unit(joint[f"{side}_{b}"] - joint[f"{side}_{a}"]) for a, b in (("hip", "knee"), ("knee", "ankle")))
        first, second = limb_orientations("leg", thigh, shank, pelvis[:, :, 0])
        put(f"{side}_thigh", first)
        put(f"{side}_shank", second)
        foot = _foot(joint[f"{side}_toe"] - joint[f"{side}_ankle"], second, slope)
        put(f"{side}_foot", foot)
        put(f"{side}_toes", foot)
    return frames


def _upright(left: np.ndarray, up: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Orientations whose y is ``left``, turned about it so that ``rest``, upright in the rest pose, points as ``up`` does."""
    y = unit(left)
    x = unit(np.cross(y, up))
    frame = np.stack([x, y, np.cross(x, y)], axis=-1)
    return frame @ Rotation.from_euler("y", -np.arctan2(rest[0], rest[2])).as_matrix()


def _foot_slope(joint: dict[str, np.ndarray]) -> float:
    """How far ankle-to-ball directions point down where feet stand, radians: the median over both and all frames, as most of them do."""
    feet = np.stack([joint[f"{side}_toe"] - joint[f"{side}_ankle"] for side in "lr"])
    return float(np.median(np.arctan2(-feet[..., 2], np.hypot(feet[..., 0], feet[..., 1]))))


def _foot(forward: np.ndarray, shank: np.ndarray, slope: float) -> np.ndarray:
    """Orientations of a foot whose ankle-to-ball direction is ``forward``, at the end of a shank of these orientations."""
    x = unit(forward)
    y = unit(shank[:, :, 1] - np.sum(shank[:, :, 1] * x, axis=-1, keepdims=True) * x)
    flat = Rotation.from_euler("y", -slope).as_matrix()
    in_shank = shank.transpose(0, 2, 1) @ np.stack([x, y, np.cross(x, y)], axis=-1) @ flat
    lowered = np.arctan2(-in_shank[:, 2, 0], in_shank[:, 0, 0])
    back = np.clip(lowered, *np.radians(ANKLE_RANGE_DEG)) - lowered
    return shank @ Rotation.from_euler("y", back[:, None]).as_matrix() @ in_shank


def _root(joint: dict[str, np.ndarray], skeleton: Skeleton) -> np.ndarray:
    """The path of the hips, scaled by the length of the legs; that settles the file's unit too."""
    bones = (("hip", "knee"), ("knee", "ankle"))
    lengths = [np.linalg.norm(joint[f"{side}_{b}"] - joint[f"{side}_{a}"], axis=-1).mean() for side in "lr" for a, b in bones]
    scale = sum(skeleton.length(f"{side}_{bone}") for side in "lr" for bone in ("shank", "foot")) / sum(lengths)
    return (joint["l_hip"] + joint["r_hip"]) / 2 * scale


def _grounded(root: np.ndarray, frames: np.ndarray, skeleton: Skeleton) -> Motion:
    """Turn to face X at the origin in the first frame, and put the feet on the floor."""
    facing = frames[0, 0, :, 0]
    turn = Rotation.from_euler("z", -np.arctan2(facing[1], facing[0])).as_matrix()
    frames = turn @ frames
    root = (root - root[0] * [1, 1, 0]) @ turn.T
    joints = joint_positions(skeleton, root, frames)
    soles = []
    for side in ("l", "r"):
        foot = BONE_NAMES.index(f"{side}_foot")
        for spot in ((-0.03 * skeleton.height_m, 0, -skeleton.ankle_height), (0.11 * skeleton.height_m, 0, -skeleton.ankle_height)):
            soles.append(joints[:, foot, 2] + frames[:, foot, 2] @ np.array(spot))
    lowest = np.min(soles, axis=0)
    height = root[:, 2] - np.percentile(lowest, 20)
    lowest = lowest - np.percentile(lowest, 20)
    return Motion(np.column_stack([root[:, :2], height + np.maximum(-lowest, 0)]), frames)
