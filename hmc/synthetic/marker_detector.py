"""The synthetic marker detector: what a detector of given quality would see of known markers (Canton 2009, section 6.6.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.cones import cone_distance
from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.camera.model import Rig, project
from hmc.errors import InputError

__all__ = ["SyntheticDetector", "detect_synthetic", "marker_visibility", "seen_by_ideal_detector"]

#: Steps along a line of sight, and how far along it flesh is looked for, metres.
STEP_M, REACH_M = 0.02, 1.4
#: A landmark lies inside the flesh of its own limb. It is taken to be seen through that much of it, metres.
OWN_FLESH_M = 0.14


@dataclass(frozen=True)
class SyntheticDetector:
    """Quality of a marker detector.

    Parameters
    ----------
    detection_rate : float
        Probability that a visible marker is detected (DR).
    false_positives : float
        Mean number of false detections a view (FP): drawn evenly from 0 to twice this.
    variance_px2 : float
        Variance of the Gaussian error of both coordinates of every detection, square pixels.

    Raises
    ------
    InputError
        When a number is out of its range.
    """

    detection_rate: float = 0.9
    false_positives: float = 20.0
    variance_px2: float = 4.0

    def __post_init__(self) -> None:
        if not 0 <= self.detection_rate <= 1 or not self.false_positives >= 0 or not self.variance_px2 >= 0:
            raise InputError(f"`detection_rate` must be in [0, 1], `false_positives` and `variance_px2` at least 0; got {self}")


def marker_visibility(body: BodyModel, state: np.ndarray, points: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Which cameras see which markers past the body's own flesh.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
    points : ndarray, shape (m, 3)
        Markers, world, metres.
    centres : ndarray, shape (n_views, 3)
        Camera centres.

    Returns
    -------
    ndarray of bool, shape (n_views, m)
        False where a line of sight meets a part of the body other than those that the marker lies in, or runs through more of these
        than `OWN_FLESH_M`.
    """
    away = centres[:, None] - points
    distance = np.linalg.norm(away, axis=-1, keepdims=True)
    along = np.arange(STEP_M, REACH_M, STEP_M)
    lines = points[:, None] + (away / distance)[:, :, None] * np.minimum(along[:, None], distance[:, :, None])
    rotations, positions = segment_transforms(body, state)
    through = np.zeros(lines.shape[:3], bool)
    hidden = np.zeros(lines.shape[:2], bool)
    cones = body.cones
    for part in np.unique(cones.part):
        inside, own = np.zeros(lines.shape[:3], bool), np.zeros(len(points), bool)
        for cone in np.flatnonzero(cones.part == part):
            segment = cones.segment[cone]
            inside |= cone_distance(cones, cone, (lines - positions[segment]) @ rotations[segment]) <= 0
            own |= cone_distance(cones, cone, (points - positions[segment]) @ rotations[segment]) <= STEP_M
        hidden |= inside.any(axis=-1) & ~own
        through |= inside & own[:, None]
    return ~hidden & (STEP_M * through.sum(axis=-1) <= OWN_FLESH_M)


def seen_by_ideal_detector(body: BodyModel, rig: Rig, points: np.ndarray, start: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Image formation: the markers that each view sees, with the body posed by inverse kinematics.

    Parameters
    ----------
    body : BodyModel
    rig : Rig
    points : ndarray, shape (15, 3)
        True markers, at the body's landmarks; NaN where there is none.
    start : ndarray, shape (37,)
        Where inverse kinematics starts: the state of the frame before.

    Returns
    -------
    detections : list of ndarray, shape (n, 2)
        Pixels (with the lens's distortion), one array a view.
    state : ndarray, shape (37,)
        The body's pose.
    """
    state, _ = fit_landmarks(body, points, start)
    known = np.isfinite(points).all(axis=1)
    points = points[known]
    visible = marker_visibility(body, state, points, rig.centres)
    uv, valid = project(rig, points)
    inside = [((one > -0.5) & (one < np.array(camera.size) - 0.5)).all(axis=-1) for camera, one in zip(rig, uv, strict=True)]
    return [one[shown & good & within] for one, shown, good, within in zip(uv, visible, valid, inside, strict=True)], state


def detect_synthetic(
    rng: np.random.Generator, ideal: list[np.ndarray], detector: SyntheticDetector, boxes: np.ndarray | None = None
) -> list[np.ndarray]:
    """What a detector makes of the markers that can be seen.

    Parameters
    ----------
    rng : numpy.random.Generator
    ideal : list of ndarray, shape (n, 2)
        From `seen_by_ideal_detector`.
    detector : SyntheticDetector
    boxes : ndarray, shape (n_views, 2, 2), optional
        Rectangles tightly around the subject, in which false detections lie, pixels: lower and upper corner. By default those around the
        markers that can be seen.

    Returns
    -------
    list of ndarray, shape (n, 2)
        Pixels, one array a view.
    """
    out = []
    for view, points in enumerate(ideal):
        found = points[rng.random(len(points)) < detector.detection_rate]
        count = int(rng.integers(0, round(2 * detector.false_positives) + 1))
        if boxes is not None:
            low, high = boxes[view]
        elif len(points):
            low, high = points.min(axis=0), points.max(axis=0)
        else:
            low = high = np.zeros(2)
            count = 0
        together = np.concatenate([found, rng.uniform(low, high, (count, 2))])
        out.append(together + np.sqrt(detector.variance_px2) * rng.standard_normal(together.shape))
    return out
