"""Angles with clinical names and signs, in closed form from the fifteen landmarks. docs/angles.md has the table and a picture.

In the manner of the International Society of Biomechanics: Wu et al. (2002) for trunk, hip and ankle (flexion about the carrier's side
axis, then sideways about the floating axis, then rotation about the segment: Grood and Suntay 1983), Wu et al. (2005) for the shoulder
(plane of elevation, elevation, rotation). Joint centres alone do not show all of it; what they do not show is NaN:

- the tilt of the pelvis, of which only the line of the hips is known: it is taken to be upright along z (the body's states have one);
- how a limb is turned about itself while it is nearly straight;
- feet, which the body's states have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hmc.body.joints import dof_index
from hmc.body.proportions import SOLE_PITCH
from hmc.errors import InputError
from hmc.io.results import PoseTable
from hmc.landmarks import ENOUGH_VIEWS, LANDMARKS, landmark_index
from hmc.metrics.angles import LEAST_BEND_RAD, LEAST_OFF_SIDE_RAD, landmark_frame, limb_angles
from hmc.motion.trajectory import Trajectory

__all__ = ["CLINICAL_ANGLES", "angle_table", "clinical_angles", "doubtful_angles", "state_angles"]

_SIDES = {"l": 1.0, "r": -1.0}

#: The columns, in order: degrees.
CLINICAL_ANGLES: tuple[str, ...] = (
    "pelvis_rotation_deg", "pelvis_obliquity_deg", "pelvis_tilt_deg",
    "trunk_flexion_deg", "trunk_lateral_flexion_deg", "trunk_rotation_deg",
    *(f"{side}_{name}_deg" for side in _SIDES for name in (
        "hip_flexion", "hip_adduction", "hip_internal_rotation", "knee_flexion", "ankle_dorsiflexion", "foot_turning_out",
    )),
    *(f"{side}_{name}_deg" for side in _SIDES for name in (
        "shoulder_plane_of_elevation", "shoulder_elevation", "shoulder_internal_rotation", "elbow_flexion",
    )),
)  # fmt: skip

#: What ends the name of a column of trust, in place of that of an angle.
TRUST_SUFFIX = "_trust"
_HIPS, _CHEST = ("l_hip", "r_hip"), ("pelvis", "neck", "l_shoulder", "r_shoulder")
#: The landmarks that an angle rests on, as docs/angles.md has them; SIDE is the side's letter.
_RESTS_ON: dict[str, tuple[str, ...]] = {
    "pelvis": _HIPS, "trunk": (*_HIPS, "neck"), "trunk_rotation": (*_HIPS, *_CHEST),
    "hip": (*_HIPS, "SIDE_knee"), "hip_internal_rotation": (*_HIPS, "SIDE_knee", "SIDE_ankle"),
    "knee": ("SIDE_hip", "SIDE_knee", "SIDE_ankle"), "ankle": ("SIDE_knee", "SIDE_ankle"), "foot": ("SIDE_ankle",),
    "shoulder": (*_CHEST, "SIDE_elbow"), "shoulder_internal_rotation": (*_CHEST, "SIDE_elbow", "SIDE_wrist"),
    "elbow": ("SIDE_shoulder", "SIDE_elbow", "SIDE_wrist"),
}  # fmt: skip


def clinical_angles(positions: np.ndarray) -> dict[str, np.ndarray]:
    """The angles that the landmarks show.

    Parameters
    ----------
    positions : ndarray, shape (n, 15, 3)
        World with z up, any unit, in the order of `hmc.landmarks.LANDMARKS`; NaN where missing.

    Returns
    -------
    dict
        The names of `CLINICAL_ANGLES` but for those of tilt and feet, each to an ndarray of shape (n,): degrees in (-180, 180]. NaN where
        landmarks do not show it: one is missing, a limb is straight to within 15 degrees (its rotation), a thigh points sideways to
        within 10 degrees (flexion and rotation), an arm hangs down or points up to within 10 degrees (plane of elevation and rotation),
        or the line of the hips is upright to within 10 degrees (all that refers to the pelvis).

    Raises
    ------
    InputError
        When the shape is another.
    """
    positions = np.asarray(positions, float)
    if positions.ndim != 3 or positions.shape[1:] != (len(LANDMARKS), 3):
        raise InputError(f"`positions` must be (n, {len(LANDMARKS)}, 3); got {positions.shape}")
    at = {name: positions[:, place] for place, name in enumerate(LANDMARKS)}
    found: dict[str, np.ndarray] = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        pelvis, chest = _pelvis(at), landmark_frame(at["neck"] - at["pelvis"], at["l_shoulder"] - at["r_shoulder"], keep_side=False)
        left = pelvis[..., 1]
        found["pelvis_rotation"] = np.arctan2(-left[:, 0], left[:, 1])
        found["pelvis_obliquity"] = np.arcsin(np.clip(left[:, 2], -1, 1))
        turn = np.swapaxes(pelvis, -1, -2) @ chest  # = R_y(flexion) R_x(lateral flexion) R_z(rotation)
        found["trunk_flexion"] = np.arctan2(turn[:, 0, 2], turn[:, 2, 2])
        found["trunk_lateral_flexion"] = np.arcsin(np.clip(-turn[:, 1, 2], -1, 1))
        found["trunk_rotation"] = np.arctan2(turn[:, 1, 0], turn[:, 1, 1])
        for side, sign in _SIDES.items():
            hip, knee, ankle, shoulder, elbow, wrist = (at[f"{side}_{j}"] for j in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"))
            flexion, abduction, outwards, _ = limb_angles(_into(pelvis, knee - hip), _into(pelvis, ankle - knee), sign, arm=False)
            found[f"{side}_hip_flexion"], found[f"{side}_hip_adduction"] = flexion, -abduction
            found[f"{side}_hip_internal_rotation"], found[f"{side}_knee_flexion"] = -outwards, _bend(knee - hip, ankle - knee)
            plane, elevation, inwards = _shoulder(_into(chest, elbow - shoulder), _into(chest, wrist - elbow), sign)
            found[f"{side}_shoulder_plane_of_elevation"], found[f"{side}_shoulder_elevation"] = plane, elevation
            found[f"{side}_shoulder_internal_rotation"], found[f"{side}_elbow_flexion"] = inwards, _bend(elbow - shoulder, wrist - elbow)
    return {name: np.degrees(found[name.removesuffix("_deg")]) for name in CLINICAL_ANGLES if name.removesuffix("_deg") in found}


def state_angles(one: Trajectory) -> dict[str, np.ndarray]:
    """The angles that the landmarks do not show, from the body's states.

    Parameters
    ----------
    one : Trajectory

    Returns
    -------
    dict
        As `clinical_angles`, for tilt and feet. NaN without states; of feet also of a body that has none or holds them, and where fewer
        than two cameras show the ankle clear: there the foot is where posture puts it.
    """
    names = [name for name in CLINICAL_ANGLES if any(word in name for word in ("tilt", "ankle", "foot"))]
    found = {name: np.full(len(one.frames), np.nan) for name in names}
    if one.states is None or one.body is None:
        return found
    turned = {
        name: np.degrees(one.states[:, dof_index(name)[0]]) for name in ("root_ry", *(f"{s}_ankle_{a}" for s in _SIDES for a in "yz"))
    }
    found["pelvis_tilt_deg"] = turned["root_ry"]
    if not one.body.dimensions.get("foot", 0) > 0:
        return found
    for side, sign in _SIDES.items():
        views = None if one.views is None else one.views[:, landmark_index(f"{side}_ankle")]
        hidden = np.zeros(len(one.frames), bool) if views is None else views < ENOUGH_VIEWS
        down, about = turned[f"{side}_ankle_y"], turned[f"{side}_ankle_z"]
        # Methods whose body has feet that do not turn hold them at 0.
        if np.nan_to_num(down).any() or np.nan_to_num(about).any():
            found[f"{side}_ankle_dorsiflexion_deg"] = np.where(hidden, np.nan, np.degrees(SOLE_PITCH) - down)
            found[f"{side}_foot_turning_out_deg"] = np.where(hidden, np.nan, sign * about)
    return found


def angle_table(found: Sequence[Trajectory]) -> dict[str, np.ndarray]:
    """The angles of several persons as columns of one table.

    Parameters
    ----------
    found : sequence of Trajectory
        At least one.

    Returns
    -------
    dict
        ``frame``, ``time_s``, ``person`` and all of `CLINICAL_ANGLES`, each to an ndarray of shape (rows,): a row a person and frame,
        person after person. Where trust is known of somebody, a column an angle more, ``..._trust`` for ``..._deg``: the least trust of the
        landmarks that the angle rests on, NaN where there is no angle.
    """
    angles = [clinical_angles(one.positions) | state_angles(one) for one in found]
    table = {
        "frame": np.concatenate([one.frames for one in found]),
        "time_s": np.concatenate([one.times_s for one in found]),
        "person": np.concatenate([np.full(len(one.frames), one.person) for one in found]),
        **{name: np.concatenate([of_one[name] for of_one in angles]) for name in CLINICAL_ANGLES},
    }
    if all(one.trust is None for one in found):
        return table
    trust = np.concatenate([np.full(one.positions.shape[:2], np.nan) if one.trust is None else one.trust for one in found])
    for name in CLINICAL_ANGLES:
        least = trust[:, _rests_on(name)].min(axis=1)
        table[name.removesuffix("_deg") + TRUST_SUFFIX] = np.where(np.isfinite(table[name]), least, np.nan)
    return table


def doubtful_angles(table: Mapping[str, np.ndarray], poses: PoseTable) -> dict[str, np.ndarray]:
    """Which angles rest on a doubtful landmark.

    Parameters
    ----------
    table : mapping
        As `angle_table` has it.
    poses : PoseTable
        The landmarks of the same result, with their views and trust.

    Returns
    -------
    dict
        Of each angle of the table a bool array, shape (rows,); all False where nothing is known of the landmarks.
    """
    doubtful = poses.doubtful
    rows = dict(zip(zip(poses.persons.tolist(), poses.frames.tolist(), strict=True), range(len(poses.frames)), strict=True))
    places = np.array([rows.get(one, -1) for one in zip(table["person"].tolist(), table["frame"].tolist(), strict=True)], int)
    known = np.zeros((len(places), len(LANDMARKS)), bool) if doubtful is None else np.where(places[:, None] >= 0, doubtful[places], False)
    found: dict[str, np.ndarray] = {}
    for column in (name for name in CLINICAL_ANGLES if name in table):
        found[column] = np.asarray(known[:, _rests_on(column)].any(axis=1))
    return found


def _rests_on(column: str) -> list[int]:
    """Places of the landmarks that an angle rests on."""
    side, name = (column[0], column[2:]) if column[1] == "_" else ("", column)
    names = _RESTS_ON.get(name.removesuffix("_deg")) or _RESTS_ON[name.partition("_")[0]]
    return [landmark_index(one.replace("SIDE", side)) for one in names]


def _pelvis(at: dict[str, np.ndarray]) -> np.ndarray:
    """Forward, left and up of a pelvis that is not tilted."""
    left = at["l_hip"] - at["r_hip"]
    upright = np.abs(left[:, 2]) > np.cos(LEAST_OFF_SIDE_RAD) * np.linalg.norm(left, axis=-1)
    frame = landmark_frame(np.broadcast_to([0.0, 0.0, 1.0], left.shape), left, keep_side=True)
    return np.where(upright[:, None, None], np.nan, frame)


def _shoulder(upper: np.ndarray, lower: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plane of elevation, elevation and rotation inwards, from an arm's links in the chest's frame.

    Wu et al. (2005), 2.4.7, with axes forward, outward and up of the arm's own side, and elevation counted positive.
    """
    upper, lower = (vectors * [1.0, sign, 1.0] / np.linalg.norm(vectors, axis=-1, keepdims=True) for vectors in (upper, lower))
    plane = np.arctan2(upper[:, 0], upper[:, 1])
    level = np.hypot(upper[:, 0], upper[:, 1])
    elevation = np.arctan2(level, -upper[:, 2])
    # Where a forearm points that bends forwards, and the axis about which it then turns, of an arm without rotation.
    zero = np.zeros_like(plane)
    ahead = np.stack([np.cos(plane), -np.sin(plane), zero], axis=-1)
    aside = np.stack([np.sin(plane) * np.cos(elevation), np.cos(plane) * np.cos(elevation), np.sin(elevation)], axis=-1)
    inwards = np.arctan2(-(lower * aside).sum(axis=-1), (lower * ahead).sum(axis=-1))
    along = level < np.sin(LEAST_OFF_SIDE_RAD)
    return np.where(along, np.nan, plane), elevation, np.where(along | (_bend(upper, lower) < LEAST_BEND_RAD), np.nan, inwards)


def _bend(upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """Angle of a hinge, whatever is known of what carries the limb; NaN of a link without length."""
    angle = np.arctan2(np.linalg.norm(np.cross(upper, lower), axis=-1), (upper * lower).sum(axis=-1))
    return np.where((upper != 0).any(axis=-1) & (lower != 0).any(axis=-1), angle, np.nan)


def _into(frame: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nji,nj->ni", frame, vectors)
