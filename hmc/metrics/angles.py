"""Angular errors of poses, whatever bodies they were estimated with: both are read as poses of one reference body.

Source: Canton (2009), section 5.3.2 and Eq. 5.9. The angles follow in closed form from labelled points. The reference body is in the
manner of Mikic (2003), with a waist: arms and legs hang down in its neutral pose, every limb has a ball joint (flexion forwards about
the side axis, then abduction outwards about the forward axis, then rotation about the limb) and a hinge. On images the reference body
is a flat stick figure with one angle a joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hmc.errors import InputError
from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import landmark_errors, mean_and_deviation

__all__ = [
    "IMAGE_ANGLES", "REFERENCE_ANGLES", "AngleScores", "angular_errors", "landmark_frame", "limb_angles", "reference_angles",
    "score_angles",
]  # fmt: skip

#: A limb that is bent less than this does not show how it is turned about itself.
LEAST_BEND_RAD = np.radians(15)
#: A limb that points sideways to within this shows neither its flexion nor its rotation.
LEAST_OFF_SIDE_RAD = np.radians(10)

_LIMBS = (("l_shoulder", "l_elbow", "l_wrist"), ("r_shoulder", "r_elbow", "r_wrist"),
          ("l_hip", "l_knee", "l_ankle"), ("r_hip", "r_knee", "r_ankle"))  # fmt: skip

#: The reference body's angles, each with the two landmarks that it belongs to: the joint and the far end of what it moves.
REFERENCE_ANGLES: dict[str, tuple[str, str]] = {
    "waist_bend": ("pelvis", "neck"), "waist_twist": ("pelvis", "neck"),
    "neck_bend": ("neck", "head_top"), "neck_nod": ("neck", "head_top"),
    **{name: pair for ball, hinge, end in _LIMBS for name, pair in (
        (f"{ball}_flexion", (ball, hinge)), (f"{ball}_abduction", (ball, hinge)), (f"{ball}_rotation", (hinge, end)),
        (f"{hinge}_flexion", (hinge, end)),
    )},
}  # fmt: skip

#: The same of the flat body.
IMAGE_ANGLES: dict[str, tuple[str, str]] = {
    "neck": ("neck", "head_top"),
    **{joint: pair for ball, hinge, end in _LIMBS for joint, pair in ((ball, (ball, hinge)), (hinge, (hinge, end)))},
}


@dataclass(frozen=True)
class AngleScores:
    """Scores of angular errors, in radians; each a float, or an array with one value an angle or a frame.

    Attributes
    ----------
    mean : float or ndarray
        Mean over frames of a frame's mean error (Eq. 5.9); by angle: over frames; by frame: over angles.
    deviation : float or ndarray
        Standard deviation over the same.
    counted : int or ndarray
        Angles that were compared.
    """

    mean: np.ndarray
    deviation: np.ndarray
    counted: np.ndarray


def reference_angles(points: np.ndarray) -> np.ndarray:
    """The angles of the reference body whose landmarks are given.

    Parameters
    ----------
    points : ndarray, shape (..., 15, 3) or (..., 15, 2)
        In the order of `hmc.landmarks.LANDMARKS`; NaN where missing. World (any right-handed frame), or pixels.

    Returns
    -------
    ndarray, shape (..., 20) or (..., 9)
        Radians in (-pi, pi], in the order of `REFERENCE_ANGLES` or `IMAGE_ANGLES`. NaN where the landmarks do not show the angle: one is
        missing, a limb is straight (`LEAST_BEND_RAD`; its rotation) or points sideways (`LEAST_OFF_SIDE_RAD`; flexion and rotation).

    Raises
    ------
    InputError
        When the shape is another.
    """
    points = np.asarray(points, float)
    if points.ndim < 2 or points.shape[-2] != len(LANDMARKS) or points.shape[-1] not in (2, 3):
        raise InputError(f"`points` must be (..., {len(LANDMARKS)}, 3), or 2 in images; got {points.shape}")
    at = {name: points[..., place, :] for place, name in enumerate(LANDMARKS)}
    with np.errstate(invalid="ignore", divide="ignore"):
        return _in_image(at) if points.shape[-1] == 2 else _in_space(at)


def angular_errors(estimate: np.ndarray, truth: np.ndarray, threshold: float | None = None) -> np.ndarray:
    """Absolute differences of the angles of two sets of poses, each read as the reference body.

    Parameters
    ----------
    estimate, truth : ndarray, shape (n_frames, 15, d)
        d is 3 or 2; NaN where missing.
    threshold : float, optional
        An angle counts only where both of its landmarks are matched: estimated and no farther from the truth than this (Eq. 5.4).

    Returns
    -------
    ndarray, shape (n_frames, n_angles)
        Radians in [0, pi]; NaN where the angle is not shown, or does not count.
    """
    errors = landmark_errors(estimate, truth)
    differences = reference_angles(estimate) - reference_angles(truth)
    differences = np.abs(differences - 2 * np.pi * np.round(differences / (2 * np.pi)))
    if threshold is not None:
        names = IMAGE_ANGLES if np.shape(truth)[-1] == 2 else REFERENCE_ANGLES
        places = np.array([[LANDMARKS.index(name) for name in pair] for pair in names.values()])
        differences[~(errors[:, places] <= threshold).all(axis=-1)] = np.nan
    return differences


def score_angles(errors: np.ndarray, by: Literal["all", "angle", "frame"] = "all") -> AngleScores:
    """Mean and deviation of angular errors.

    Parameters
    ----------
    errors : ndarray, shape (n_frames, n_angles)
        From `angular_errors`.
    by : {"all", "angle", "frame"}
        One score, or one an angle, or one a frame.

    Returns
    -------
    AngleScores
        NaN where nothing was compared.
    """
    errors = np.asarray(errors, float)
    if errors.ndim != 2:
        raise InputError(f"`errors` must be (n_frames, n_angles); got {errors.shape}")
    known = np.isfinite(errors)
    if by == "all":
        means, _ = mean_and_deviation(errors, known, 1)
        mean, deviation = mean_and_deviation(means, np.isfinite(means), None)
        return AngleScores(mean, deviation, known.sum())
    axis = {"angle": 0, "frame": 1}[by]
    return AngleScores(*mean_and_deviation(errors, known, axis), known.sum(axis=axis))


def _in_space(at: dict[str, np.ndarray]) -> np.ndarray:
    trunk = at["neck"] - at["pelvis"]
    pelvis = landmark_frame(trunk, at["l_hip"] - at["r_hip"], keep_side=True)
    chest = landmark_frame(trunk, at["l_shoulder"] - at["r_shoulder"], keep_side=False)
    # The pelvis is taken to be upright under the trunk, as its tilt shows in no landmark: two angles are left.
    turn = np.swapaxes(pelvis, -1, -2) @ chest
    columns = [np.arctan2(-turn[..., 1, 2], turn[..., 2, 2]), np.arctan2(-turn[..., 0, 1], turn[..., 0, 0])]
    x, y, z = np.moveaxis(_into(chest, _unit(at["head_top"] - at["neck"])), -1, 0)
    columns += [np.arctan2(-y, z), np.arcsin(np.clip(x, -1, 1))]
    for ball, hinge, end in _LIMBS:
        arm = hinge.endswith("elbow")
        carrier, side = chest if arm else pelvis, 1.0 if ball[0] == "l" else -1.0
        columns += limb_angles(_into(carrier, at[hinge] - at[ball]), _into(carrier, at[end] - at[hinge]), side, arm)
    return np.stack(columns, axis=-1)


def limb_angles(upper: np.ndarray, lower: np.ndarray, side: float, arm: bool) -> list[np.ndarray]:
    """Flexion, abduction, rotation and the hinge's angle of a limb, from its links in the frame that carries it.

    With the neutral limb along -z, the upper link is ``R_y(-flexion) R_x(side * abduction) R_z(side * rotation)`` of it, and the hinge
    turns about the link's own y axis: elbows bend forwards, knees backwards.

    Parameters
    ----------
    upper, lower : ndarray, shape (..., 3)
        From shoulder or hip to elbow or knee, and on to wrist or ankle; x forward, y to the left, z up.
    side : float
        1 for a left limb, -1 for a right one.
    arm : bool
        Whether the hinge is an elbow.

    Returns
    -------
    list of ndarray, shape (...)
        Radians, rotation outwards; NaN as in `reference_angles`.
    """
    upper, lower = _unit(upper), _unit(lower)
    normal = np.cross(upper, lower)
    bend = np.arctan2(np.linalg.norm(normal, axis=-1), (upper * lower).sum(axis=-1))
    flexion = np.arctan2(upper[..., 0], -upper[..., 2])
    abduction = np.arcsin(np.clip(upper[..., 1], -1, 1))
    # The hinge's axis after flexion and abduction are undone lies in the xy plane; its angle from y is the rotation.
    axis = -_unit(normal) if arm else _unit(normal)
    cos, sin = np.cos(flexion), np.sin(flexion)
    forward = cos * axis[..., 0] + sin * axis[..., 2]
    down = -sin * axis[..., 0] + cos * axis[..., 2]
    across = np.cos(abduction) * axis[..., 1] + np.sin(abduction) * down
    rotation = np.arctan2(-forward, across)
    aside = np.abs(abduction) > np.pi / 2 - LEAST_OFF_SIDE_RAD
    return [
        np.where(aside, np.nan, flexion),
        side * abduction,
        np.where(aside | (bend < LEAST_BEND_RAD), np.nan, side * rotation),
        bend,
    ]


def _in_image(at: dict[str, np.ndarray]) -> np.ndarray:
    """The angle of every bone of the flat body against the bone that carries it; head, arms and thighs hang on the trunk."""
    trunk = at["neck"] - at["pelvis"]
    columns = [_between(trunk, at["head_top"] - at["neck"])]
    for ball, hinge, end in _LIMBS:
        upper = at[hinge] - at[ball]
        columns += [_between(trunk, upper), _between(upper, at[end] - at[hinge])]
    return np.stack(columns, axis=-1)


def _between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Signed angle from one vector of the plane to another."""
    cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return np.where((cross == 0) & ((first * second).sum(axis=-1) == 0), np.nan, np.arctan2(cross, (first * second).sum(axis=-1)))


def landmark_frame(up: np.ndarray, left: np.ndarray, keep_side: bool) -> np.ndarray:
    """Rotation whose columns are forward, left and up; `left` is kept and `up` made perpendicular to it, or the other way round.

    Parameters
    ----------
    up, left : ndarray, shape (..., 3)
    keep_side : bool
        Keep `left`.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        NaN where the two are parallel, or one is 0.
    """
    first, second = (left, up) if keep_side else (up, left)
    first = _unit(first)
    second = _unit(second - (second * first).sum(axis=-1, keepdims=True) * first)
    left, up = (first, second) if keep_side else (second, first)
    return np.stack([np.cross(left, up), left, up], axis=-1)


def _into(frame: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("...ji,...j->...i", frame, vectors)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; NaN of a zero one."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 1e-12, length, np.nan)
