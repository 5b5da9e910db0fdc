"""Point-based pose metrics: mean and deviation, and Canton's MMTP and MMTA, which part the landmarks that are tracked from the rest.

Source: Canton (2009), chapter 5, Eq. 5.1-5.6, with MMTA read as the fraction of matched landmarks. Everything works in 3-D (metres) and in
2-D (pixels); thresholds and results are in the unit of the points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hmc.errors import InputError

__all__ = ["LandmarkScores", "landmark_errors", "mean_and_deviation", "score"]


@dataclass(frozen=True)
class LandmarkScores:
    """Scores of a set of landmark errors; each a float, or an array with one value a joint or a frame.

    Attributes
    ----------
    mean : float or ndarray
        Mean error of the landmarks that were estimated (Eq. 5.1, 5.2).
    deviation : float or ndarray
        Over everything: standard deviation over frames of a frame's mean error (Eq. 5.3). By joint: over frames. By frame: over joints.
    mmtp : float or ndarray
        Multiple Marker Tracking Precision: mean error of the matched landmarks (Eq. 5.5); NaN where nothing matched.
    sigma_mmtp : float or ndarray
        Standard deviation of the matched landmarks' errors.
    mmta : float or ndarray
        Multiple Marker Tracking Accuracy: matched landmarks over true landmarks; a landmark without an estimate is not matched.
    estimated, expected : int or ndarray
        Landmarks with truth and estimate, and with truth.
    threshold : float
        Largest error at which a landmark counts as matched.
    """

    mean: np.ndarray
    deviation: np.ndarray
    mmtp: np.ndarray
    sigma_mmtp: np.ndarray
    mmta: np.ndarray
    estimated: np.ndarray
    expected: np.ndarray
    threshold: float


def landmark_errors(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Distances between estimated and true landmarks.

    Parameters
    ----------
    estimate, truth : ndarray, shape (n_frames, n_joints, d)
        NaN in any coordinate: not estimated, no truth.

    Returns
    -------
    ndarray, shape (n_frames, n_joints)
        In the points' unit; NaN where there is no truth, infinite where there is truth and no estimate.

    Raises
    ------
    InputError
        When the shapes differ.
    """
    estimate, truth = np.asarray(estimate, float), np.asarray(truth, float)
    if estimate.shape != truth.shape or truth.ndim != 3:
        raise InputError(f"`estimate` and `truth` must both be (n_frames, n_joints, d); got {estimate.shape} and {truth.shape}")
    errors = np.linalg.norm(estimate - truth, axis=-1)
    errors[np.isnan(estimate).any(axis=-1)] = np.inf
    errors[np.isnan(truth).any(axis=-1)] = np.nan
    return errors


def score(errors: np.ndarray, threshold: float, by: Literal["all", "joint", "frame"] = "all") -> LandmarkScores:
    """Mean, deviation, MMTP and MMTA of landmark errors.

    Parameters
    ----------
    errors : ndarray, shape (n_frames, n_joints)
        From `landmark_errors`. The rows may be frames of several persons.
    threshold : float
        Largest error of a matched landmark (Eq. 5.4), in the unit of the errors.
    by : {"all", "joint", "frame"}
        One score, or one a joint, or one a frame.

    Returns
    -------
    LandmarkScores
    """
    errors = np.asarray(errors, float)
    if errors.ndim != 2:
        raise InputError(f"`errors` must be (n_frames, n_joints); got {errors.shape}")
    if not threshold > 0:
        raise InputError(f"`threshold` must be above 0; got {threshold}")
    axis = {"all": None, "joint": 0, "frame": 1}[by]
    estimated, expected, matched = np.isfinite(errors), ~np.isnan(errors), errors <= threshold
    mean, spread = mean_and_deviation(errors, estimated, axis)
    if by == "all":
        frame_means, _ = mean_and_deviation(errors, estimated, 1)
        mean, spread = mean_and_deviation(frame_means, np.isfinite(frame_means), None)
    mmtp, sigma_mmtp = mean_and_deviation(errors, matched, axis)
    n_expected = expected.sum(axis=axis)
    return LandmarkScores(
        mean=mean,
        deviation=spread,
        mmtp=mmtp,
        sigma_mmtp=sigma_mmtp,
        mmta=_divide(matched.sum(axis=axis), n_expected),
        estimated=estimated.sum(axis=axis),
        expected=n_expected,
        threshold=float(threshold),
    )


def mean_and_deviation(values: np.ndarray, chosen: np.ndarray, axis: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the chosen values along an axis; NaN where there are none.

    Parameters
    ----------
    values : ndarray
    chosen : ndarray of bool, of the same shape
    axis : int or None
        None takes all values together.
    """
    count = chosen.sum(axis=axis)
    mean = _divide(np.where(chosen, values, 0.0).sum(axis=axis), count)
    off = np.where(chosen, values - (mean if axis is None else np.expand_dims(mean, axis)), 0.0)
    return mean, np.sqrt(_divide((off**2).sum(axis=axis), count))


def _divide(total: np.ndarray, count: np.ndarray) -> np.ndarray:
    """The quotient, NaN where the count is 0."""
    count = np.asarray(count)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)[()]
