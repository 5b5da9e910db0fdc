"""The skeleton model: twelve segments moved by 23 parameters, with self-spin. Hsiao (2008), section 3.2.1 and Tables 3-1, 3-2 and 3-4.

State: the torso's centre p0 (3) and the neck p1 (3) in the world, metres, the spin about the torso's axis, and the sixteen angles of Table
3-2, radians. The torso's axis turns Z onto p1 - p0, then the spin turns about that axis (Eqs. 3-22 and 3-23); only the direction of p1
counts, as the torso has its own length. Neutral pose: arms stretched sideways along Y, X forward, Y to the left, Z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.joints import ADDED_JOINTS, DOF_NAMES, N_DOF, JointLimits, dof_index
from hmc.body.joints import default_limits as body_limits
from hmc.body.model import BodyModel
from hmc.body.proportions import default_body, make_body
from hmc.landmarks import LANDMARKS

__all__ = [
    "ANGLES",
    "ANGLE_INDEX",
    "N_PARAMETERS",
    "SEGMENTS",
    "SkeletonModel",
    "default_limits",
    "joint_shares",
    "model_of_body",
    "model_of_height",
    "part_chains",
    "part_lengths",
    "segment_ends",
    "skeleton_landmarks",
    "skeleton_state",
    "thesis_body",
    "thesis_limits",
    "torso_frames",
]

#: The sixteen angles, in the order of Table 3-2 (theta 1 to 16).
ANGLES: tuple[str, ...] = (
    "neck_x", "neck_y",
    "l_shoulder_x", "r_shoulder_x", "l_shoulder_y", "r_shoulder_y", "l_shoulder_z", "r_shoulder_z",
    "l_elbow_z", "r_elbow_z",
    "l_hip_x", "r_hip_x", "l_hip_y", "r_hip_y",
    "l_knee_y", "r_knee_y",
)  # fmt: skip
N_PARAMETERS = 7 + len(ANGLES)
#: Where each angle is in a state.
ANGLE_INDEX: dict[str, int] = {name: 7 + k for k, name in enumerate(ANGLES)}
#: The ten segments that a hull shows (shoulder and hip bars are inside), in the order of `segment_ends`.
SEGMENTS: tuple[str, ...] = (
    "torso", "head", "l_upper_arm", "l_forearm", "r_upper_arm", "r_forearm", "l_thigh", "l_shank", "r_thigh", "r_shank",
)  # fmt: skip

# Table 3-4, radians over pi, in the order of ANGLES. Its rows of theta 3 and 5, 7 stand as "left shoulder", 4, 6, 8 as "right shoulder".
_TABLE_3_4 = (
    (-1 / 2, 1 / 2), (-1 / 2, 1 / 2),
    (-1, 1), (-1, 1), (-1, 1 / 2), (-1 / 2, 1), (-1 / 2, 3 / 4), (-3 / 4, 1 / 2),
    (-1, 0), (0, 1),
    (-1 / 3, 1 / 2), (-1 / 2, 1 / 3), (-1, 1 / 2), (-1, 1 / 2),
    (0, 1), (0, 1),
)  # fmt: skip


@dataclass(frozen=True)
class SkeletonModel:
    """Lengths of Table 3-1, metres, and what they leave out.

    Parameters
    ----------
    torso, head, upper_arm, lower_arm, thigh, calf, shoulder, hip : float
        L0 to L7. The lower arm ends at the finger tips, the calf at the sole: so far reach the skeleton curves.
    forearm, shank : float
        From elbow to wrist and from knee to ankle: where the landmarks are.
    shoulder_drop : float
        How far the shoulders are below the neck; 0 in the thesis.
    low, high : ndarray, shape (16,)
        Ranges of the angles, radians.
    """

    torso: float
    head: float
    upper_arm: float
    lower_arm: float
    thigh: float
    calf: float
    shoulder: float
    hip: float
    forearm: float
    shank: float
    shoulder_drop: float
    low: np.ndarray
    high: np.ndarray


def thesis_limits() -> tuple[np.ndarray, np.ndarray]:
    """Ranges of the sixteen angles as Table 3-4 prints them, radians, each of shape (16,)."""
    bounds = np.pi * np.array(_TABLE_3_4)
    return bounds[:, 0], bounds[:, 1]


def default_limits() -> tuple[np.ndarray, np.ndarray]:
    """Anatomical ranges on the same axes, radians, each of shape (16,).

    Three rows of Table 3-4 do not fit its own axes. A left arm goes forwards with negative theta 7, and the table lets it go 90 degrees
    forwards and 135 backwards: the rows of theta 7 and 8 are exchanged. Mirrored joints turn about Y with the same sign, so theta 6 has the
    range of theta 5. The rest is narrower than the table, as in `hmc.body.joints.default_limits`.
    """
    limits = body_limits()
    index = dof_index(*ANGLES)
    return limits.low[index], limits.high[index]


def model_of_height(height_m: float, thesis: bool = False) -> SkeletonModel:
    """The model of a person of this stature; the thesis sets lengths by the stature beforehand.

    Parameters
    ----------
    height_m : float
    thesis : bool
        Ranges as printed, and shoulders as high as the neck.
    """
    return model_of_body(thesis_body(height_m) if thesis else default_body(height_m), thesis)


def thesis_body(height_m: float) -> BodyModel:
    """The thesis's skeleton as a body of `hmc.body`: straight, shoulders as high as the neck (Table 3-2), ranges as printed.

    Lengths are "decided beforehand based on the stature" (section 3.2.1.2) and not printed: those of average people.

    Parameters
    ----------
    height_m : float
    """
    low, high = np.full(N_DOF, -np.inf), np.full(N_DOF, np.inf)
    places = dof_index(*ANGLES)
    low[places], high[places] = thesis_limits()
    lacking = [k for k, name in enumerate(DOF_NAMES) if name.startswith(("torso", "r_hip_z", "l_hip_z", *ADDED_JOINTS))]
    low[lacking] = high[lacking] = 0.0
    straight = ("shoulder_drop", "chest_forward", "head_forward", "head_flesh_back", "lumbar", "collar")
    return make_body(default_body(height_m).dimensions | dict.fromkeys(straight, 0.0), JointLimits(low, high))


def model_of_body(body: BodyModel, thesis: bool = False) -> SkeletonModel:
    """The skeleton with the lengths of a body.

    Parameters
    ----------
    body : BodyModel
        Both sides get the mean of its limbs.
    thesis : bool
        Ranges as printed.
    """
    part = body.dimensions
    low, high = thesis_limits() if thesis else default_limits()
    return SkeletonModel(
        part["trunk"],
        part["head"],
        part["upper_arm"],
        part["forearm"] + part["hand"],
        part["thigh"],
        part["shank"] + part["ankle_height"],
        2 * part["shoulder_half_width"],
        2 * part["hip_half_width"],
        part["forearm"],
        part["shank"],
        part["shoulder_drop"],
        low,
        high,
    )


def skeleton_state(model: SkeletonModel, points: np.ndarray, state: np.ndarray) -> np.ndarray:
    """The skeleton's state that is nearest to a pose of a body.

    Parameters
    ----------
    model : SkeletonModel
    points : ndarray, shape (15, 3)
        The body's landmarks, world, metres.
    state : ndarray, shape (37,)
        The body's angles; a bent waist is taken into the torso's axis and spin, and arms and legs keep their angles.

    Returns
    -------
    ndarray, shape (23,)
    """
    at = dict(zip(LANDMARKS, points, strict=True))
    out = np.zeros(N_PARAMETERS)
    out[:3] = 0.5 * (at["pelvis"] + at["neck"])
    axis = at["neck"] - at["pelvis"]
    out[3:6] = out[:3] + 0.5 * model.torso * axis / max(float(np.linalg.norm(axis)), 1e-9)
    across = torso_frames(out).T @ (at["l_hip"] - at["r_hip"] + at["l_shoulder"] - at["r_shoulder"])
    out[6] = np.arctan2(-across[0], across[1])
    out[7:] = np.clip(state[dof_index(*ANGLES)], model.low, model.high)
    return out


def torso_frames(states: np.ndarray) -> np.ndarray:
    """World from torso, (..., 3, 3): the shortest turn of Z onto p1 - p0 after the spin about Z.

    Turning Z onto the axis and then spinning about that axis is the same as spinning about Z first.

    Parameters
    ----------
    states : ndarray, shape (..., 23)
    """
    axis = states[..., 3:6] - states[..., :3]
    size = np.linalg.norm(axis, axis=-1, keepdims=True)
    axis = np.where(size > 1e-9, axis / np.maximum(size, 1e-9), [0.0, 0.0, 1.0])
    x, y, z = np.moveaxis(axis, -1, 0)
    # Rodrigues about Z x axis; for an axis straight down, half a turn about X.
    k = 1 / np.maximum(1 + z, 1e-9)
    down = z < -1 + 1e-9
    turn = np.empty((*states.shape[:-1], 3, 3))
    turn[..., 0, 0] = np.where(down, 1.0, 1 - x * x * k)
    turn[..., 0, 1] = turn[..., 1, 0] = np.where(down, 0.0, -x * y * k)
    turn[..., 1, 1] = np.where(down, -1.0, 1 - y * y * k)
    turn[..., :, 2] = axis
    turn[..., 2, 0], turn[..., 2, 1] = -x, -y
    cos, sin = np.cos(states[..., 6]), np.sin(states[..., 6])
    out = np.empty_like(turn)
    out[..., 0] = cos[..., None] * turn[..., 0] + sin[..., None] * turn[..., 1]
    out[..., 1] = -sin[..., None] * turn[..., 0] + cos[..., None] * turn[..., 1]
    out[..., 2] = turn[..., 2]
    return out


def segment_ends(model: SkeletonModel, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of the ten segments (Eq. 3-26).

    Parameters
    ----------
    model : SkeletonModel
    states : ndarray, shape (..., 23)

    Returns
    -------
    starts, ends : ndarray, shape (..., 10, 3)
        In the order of `SEGMENTS`, world, metres. Of the torso, pelvis and neck; of the others, the end nearer to the torso first.
    """
    states = np.asarray(states, float)
    shape = states.shape[:-1]
    cos, sin = np.cos(states[..., 7:]), np.sin(states[..., 7:])
    c = {name: cos[..., k] for k, name in enumerate(ANGLES)}
    s = {name: sin[..., k] for k, name in enumerate(ANGLES)}
    start, end = np.zeros((*shape, 10, 3)), np.zeros((*shape, 10, 3))
    half = model.torso / 2
    start[..., 0, 2], end[..., 0, 2] = -half, half
    # Head: R_x R_y along Z.
    start[..., 1, 2] = half
    end[..., 1, 0] = s["neck_y"]
    end[..., 1, 1] = -s["neck_x"] * c["neck_y"]
    end[..., 1, 2] = c["neck_x"] * c["neck_y"]
    end[..., 1, :] = start[..., 1, :] + model.head * end[..., 1, :]
    for k, (side, sign) in enumerate((("l", 1.0), ("r", -1.0))):
        upper, fore, thigh, calf = 2 + 2 * k, 3 + 2 * k, 6 + 2 * k, 7 + 2 * k
        start[..., upper, 1] = sign * model.shoulder / 2
        start[..., upper, 2] = half - model.shoulder_drop
        cx, sx = c[f"{side}_shoulder_x"], s[f"{side}_shoulder_x"]
        cy, sy = c[f"{side}_shoulder_y"], s[f"{side}_shoulder_y"]

        def turned(x, y, cx=cx, sx=sx, cy=cy, sy=sy):
            # R_x R_y of a vector in the XY plane
            return np.stack([cy * x, cx * y + sx * sy * x, sx * y - cx * sy * x], axis=-1)

        cz, sz = c[f"{side}_shoulder_z"], s[f"{side}_shoulder_z"]
        ce, se = c[f"{side}_elbow_z"], s[f"{side}_elbow_z"]
        along, across = sign * -sz, sign * cz  # R_z of the arm's direction
        end[..., upper, :] = start[..., upper, :] + model.upper_arm * turned(along, across)
        start[..., fore, :] = end[..., upper, :]
        bent_along, bent_across = sign * -(sz * ce + cz * se), sign * (cz * ce - sz * se)
        end[..., fore, :] = start[..., fore, :] + model.lower_arm * turned(bent_along, bent_across)
        start[..., thigh, 1] = sign * model.hip / 2
        start[..., thigh, 2] = -half
        hx, gx = c[f"{side}_hip_x"], s[f"{side}_hip_x"]
        hy, gy = c[f"{side}_hip_y"], s[f"{side}_hip_y"]
        kc, ks = c[f"{side}_knee_y"], s[f"{side}_knee_y"]

        def leg(cos_y, sin_y, hx=hx, gx=gx):
            # R_x R_y of straight down
            return np.stack([-sin_y, gx * cos_y, -hx * cos_y], axis=-1)

        end[..., thigh, :] = start[..., thigh, :] + model.thigh * leg(hy, gy)
        start[..., calf, :] = end[..., thigh, :]
        end[..., calf, :] = start[..., calf, :] + model.calf * leg(hy * kc - gy * ks, gy * kc + hy * ks)
    frames = torso_frames(states)
    centre = states[..., None, :3]
    return centre + start @ np.swapaxes(frames, -1, -2), centre + end @ np.swapaxes(frames, -1, -2)


def part_chains(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The six parts as chains of three points: torso, head, left arm, right arm, left leg, right leg.

    Parameters
    ----------
    starts, ends : ndarray, shape (..., 10, 3)
        As from `segment_ends`.

    Returns
    -------
    ndarray, shape (..., 6, 3, 3)
        Start, joint (of torso and head the middle) and end of each part.
    """
    out = np.empty((*starts.shape[:-2], 6, 3, 3))
    out[..., :2, 0, :], out[..., :2, 2, :] = starts[..., :2, :], ends[..., :2, :]
    out[..., :2, 1, :] = 0.5 * (starts[..., :2, :] + ends[..., :2, :])
    out[..., 2:, 0, :], out[..., 2:, 1, :] = starts[..., 2::2, :], ends[..., 2::2, :]
    out[..., 2:, 2, :] = ends[..., 3::2, :]
    return out


def joint_shares(model: SkeletonModel) -> np.ndarray:
    """Where the joint of each of the six parts is, as a share of the part's length, shape (6,)."""
    arm = model.upper_arm / (model.upper_arm + model.lower_arm)
    leg = model.thigh / (model.thigh + model.calf)
    return np.array([0.5, 0.5, arm, arm, leg, leg])


def part_lengths(model: SkeletonModel) -> np.ndarray:
    """Lengths of the six parts, metres, shape (6,)."""
    arm, leg = model.upper_arm + model.lower_arm, model.thigh + model.calf
    return np.array([model.torso, model.head, arm, arm, leg, leg])


def skeleton_landmarks(model: SkeletonModel, states: np.ndarray) -> np.ndarray:
    """The fifteen landmarks of `hmc.landmarks.LANDMARKS`, world, metres: (..., 23) to (..., 15, 3)."""
    starts, ends = segment_ends(model, states)
    out = np.empty((*starts.shape[:-2], len(LANDMARKS), 3))

    def put(name: str, value: np.ndarray) -> None:
        out[..., LANDMARKS.index(name), :] = value

    put("pelvis", starts[..., 0, :])
    put("neck", ends[..., 0, :])
    put("head_top", ends[..., 1, :])
    for k, side in enumerate("lr"):
        upper, fore, thigh, calf = 2 + 2 * k, 3 + 2 * k, 6 + 2 * k, 7 + 2 * k
        put(f"{side}_shoulder", starts[..., upper, :])
        put(f"{side}_elbow", starts[..., fore, :])
        put(f"{side}_wrist", starts[..., fore, :] + (ends - starts)[..., fore, :] * model.forearm / model.lower_arm)
        put(f"{side}_hip", starts[..., thigh, :])
        put(f"{side}_knee", starts[..., calf, :])
        put(f"{side}_ankle", starts[..., calf, :] + (ends - starts)[..., calf, :] * model.shank / model.calf)
    return out
