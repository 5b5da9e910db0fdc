"""A body by keypoints alone: lengths between the points where lines of sight meet, weighed against the proportions of people.

A detector's landmarks are no joints' centres, so that even a perfect median of a length is off by what both ends lie beside the joints.
Lengths of people of one stature differ too. The body is what is most likely by both, with one common scale, all in logarithms.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.body.joints import JointLimits
from hmc.body.keypoint_places import BODY_KEYPOINTS
from hmc.body.model import BodyModel
from hmc.body.proportions import DEFAULT_LENGTHS, default_body, make_body
from hmc.pose.objectives.keypoints import BESIDE_M

__all__ = ["body_of_keypoints", "measured_lengths"]

#: Statures: the middle of adults, metres, and the deviation of the logarithm, children among them; one that is given is known so well.
STATURE_M, STATURE_DEVIATION, KNOWN_DEVIATION = 1.70, 0.08, 0.01
#: The deviation of the logarithms of single lengths, from what they are at the common scale: more than among people, as it is weighed
#: against what landmarks lie beside joints, which is a habit of the detector and no scatter.
LENGTH_DEVIATION = 0.07
#: A length is measured in so many frames at least; so many frames one after the other tell as much as one.
LEAST_FRAMES, ALIKE = 3, 3
#: What is measured: the dimensions that go with it, its length over stature, and whose landmarks are its ends.
_SIDED = {"upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"), "thigh": ("hip", "knee"), "shank": ("knee", "ankle")}
_MEASURES: dict[str, tuple[tuple[str, ...], float, tuple[str, str]]] = {
    **{name: ((name,), DEFAULT_LENGTHS[name], ends) for name, ends in _SIDED.items()},
    "trunk": (("trunk", "shoulder_drop", "lumbar"), DEFAULT_LENGTHS["trunk"] - DEFAULT_LENGTHS["shoulder_drop"], ("shoulder", "hip")),
    "shoulders": (("shoulder_half_width", "collar"), 2 * DEFAULT_LENGTHS["shoulder_half_width"], ("shoulder", "shoulder")),
    "hips": (("hip_half_width",), 2 * DEFAULT_LENGTHS["hip_half_width"], ("hip", "hip")),
}


def measured_lengths(points: np.ndarray) -> dict[str, np.ndarray]:
    """Lengths between keypoints, frame by frame, both sides together.

    Parameters
    ----------
    points : ndarray, shape (n, 15, 3)
        Where lines of sight of each of `BODY_KEYPOINTS` meet, metres; NaN where none do.

    Returns
    -------
    dict of str to ndarray, shape (m,)
        Metres, of what can be measured: limbs by their names, "trunk" from the middle of the shoulders to that of the hips, and the
        distances of both "shoulders" and "hips".
    """
    at = {name: points[:, k] for k, name in enumerate(BODY_KEYPOINTS)}
    apart = {name: [at[f"{side}_{one}"] - at[f"{side}_{other}"] for side in "lr"] for name, (one, other) in _SIDED.items()}
    middle = {name: (at[f"l_{name}"] + at[f"r_{name}"]) / 2 for name in ("shoulder", "hip")}
    apart["trunk"] = [middle["shoulder"] - middle["hip"]]
    apart |= {f"{name}s": [at[f"l_{name}"] - at[f"r_{name}"]] for name in ("shoulder", "hip")}
    lengths = {name: np.linalg.norm(np.concatenate(ways), axis=1) for name, ways in apart.items()}
    return {name: values[np.isfinite(values)] for name, values in lengths.items()}


def body_of_keypoints(points: np.ndarray, height_m: float | None = None, limits: JointLimits | None = None) -> BodyModel:
    """The likeliest body by a person's keypoints in some frames.

    Parameters
    ----------
    points : ndarray, shape (n, 15, 3)
        As for `measured_lengths`.
    height_m : float, optional
        Stature, where it is known.
    limits : JointLimits, optional
        Of the body.
    """
    names, own = list(_MEASURES), LENGTH_DEVIATION
    size = len(names) + 1  # the common scale, then what each length differs by
    deviation = STATURE_DEVIATION if height_m is None else KNOWN_DEVIATION
    matrix, vector = np.diag(np.r_[deviation, np.full(len(names), own)] ** -2.0), np.zeros(size)
    stature = STATURE_M if height_m is None else height_m
    for name, values in measured_lengths(points).items():
        _, share, ends = _MEASURES[name]
        if len(values) >= LEAST_FRAMES:
            row = np.zeros(size)
            row[[0, 1 + names.index(name)]] = 1
            weight = 1 / _deviation(values, share * stature, ends) ** 2
            matrix += weight * np.outer(row, row)
            vector += weight * np.log(np.median(values) / (share * stature)) * row
    scale, *factors = np.linalg.solve(matrix, vector)
    dimensions = dict(default_body(stature * float(np.exp(scale))).dimensions)
    for name, factor in zip(names, factors, strict=True):
        for dimension in _MEASURES[name][0]:
            dimensions[dimension] *= float(np.exp(factor))
    return make_body(dimensions, limits)


def _deviation(values: np.ndarray, length: float, ends: Sequence[str]) -> float:
    """How far the logarithm of a measured length is not known: the median's error, and what landmarks lie beside the joints' centres."""
    beside = [BESIDE_M[BODY_KEYPOINTS.index(f"l_{end}")] for end in ends]
    # What both hips or shoulders lie outward is the same, and adds up.
    off = sum(beside) if ends[0] == ends[1] else float(np.hypot(*beside))
    scatter = 1.5 * np.median(np.abs(values - np.median(values)))
    error = 1.25 * max(scatter, 0.01) / np.sqrt(max(len(values) / ALIKE, 1))
    return float(np.hypot(off, error)) / length
