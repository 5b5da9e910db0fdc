"""Where lines of sight of several cameras meet: of two, and robustly of many, keypoint by keypoint."""

from __future__ import annotations

from itertools import combinations

import numpy as np

__all__ = ["LEAST_SINE", "MEET", "between_lines", "meeting_points", "passing"]

#: Lines that pass a point by more than so many deviations do not meet in it.
MEET = 3.0
#: Lines of sight that meet at a smaller angle (its sine) do not tell where.
LEAST_SINE = 0.05


def between_lines(centre: np.ndarray, one: np.ndarray, other_centre: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where two lines of sight are nearest to one another, and how far they pass one another there.

    Parameters
    ----------
    centre, other_centre : ndarray, shape (..., 3)
        World, metres.
    one, other : ndarray, shape (..., 3)
        Unit vectors.

    Returns
    -------
    places : ndarray, shape (..., 3)
        The middle between the lines; NaN where they do not meet in front of both cameras.
    gap : ndarray, shape (...)
        Metres; NaN there too.
    """
    way = other_centre - centre
    normal = np.cross(one, other)
    squared = (normal**2).sum(axis=-1)
    with np.errstate(all="ignore"):
        along = (np.cross(way, other) * normal).sum(axis=-1) / squared
        beyond = (np.cross(way, one) * normal).sum(axis=-1) / squared
        gap = np.abs((normal * way).sum(axis=-1)) / np.sqrt(squared)
        good = (squared > LEAST_SINE**2) & (along > 0) & (beyond > 0)
    ends = centre + along[..., None] * one + other_centre + beyond[..., None] * other
    return np.where(good[..., None], ends / 2, np.nan), np.where(good, gap, np.nan)


def passing(points: np.ndarray, centres: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How far lines pass points by.

    Parameters
    ----------
    points : ndarray, shape (..., k, 3)
        World, metres.
    centres : ndarray, shape (n_cameras, 3)
    directions : ndarray, shape (n_cameras, k, 3)
        Unit vectors.

    Returns
    -------
    ndarray, shape (..., n_cameras, k)
        Metres.
    """
    towards = points[..., None, :, :] - centres[:, None]
    along = np.einsum("...cki,cki->...ck", towards, directions)
    return np.linalg.norm(towards - along[..., None] * directions, axis=-1)


def meeting_points(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Where lines of sight meet, as most of them say.

    Of every two cameras' lines the place between them; the one that most lines pass, then the least squares of these.

    Parameters
    ----------
    centres : ndarray, shape (n_cameras, 3)
    directions : ndarray, shape (n_cameras, 15, 3)
        NaN where a camera has none.
    deviation : ndarray, shape (n_cameras, 15)
        Metres.

    Returns
    -------
    ndarray, shape (15, 3)
        World, metres; NaN where no two lines meet.
    """
    pairs = list(combinations(range(len(centres)), 2))
    if not pairs:
        return np.full((directions.shape[1], 3), np.nan)
    weight = np.where(np.isfinite(directions).all(axis=-1), deviation**-2.0, 0.0)
    lines = np.nan_to_num(directions)
    trials = np.array([_nearest(centres, lines, weight, np.isin(np.arange(len(centres)), pair)) for pair in pairs])
    off = np.where(weight > 0, passing(trials, centres, lines) / deviation, MEET)
    score = (np.minimum(off, MEET) ** 2).sum(axis=1)  # pairs, keypoints
    score = np.where(np.isfinite(trials).all(axis=-1), score, np.inf)
    best = score.argmin(axis=0)
    points = trials[best, np.arange(trials.shape[1])]
    for _ in range(2):
        off = np.where(weight > 0, passing(points, centres, lines) / deviation, np.inf)
        points = _nearest(centres, lines, np.where(off < MEET, weight, 0.0))
    return points


def _nearest(centres: np.ndarray, lines: np.ndarray, weight: np.ndarray, chosen: np.ndarray | None = None) -> np.ndarray:
    """The point of least weighed squared distance from lines, shape (k, 3); NaN with fewer than two."""
    weight = weight if chosen is None else weight * chosen[:, None]
    flat = np.eye(3) - lines[..., :, None] * lines[..., None, :]
    matrix = np.einsum("ck,ckij->kij", weight, flat)
    vector = np.einsum("ck,ckij,cj->ki", weight, flat, centres)
    enough = (weight > 0).sum(axis=0) >= 2
    matrix = np.where(enough[:, None, None], matrix, np.eye(3))
    with np.errstate(all="ignore"):
        scale = np.trace(matrix, axis1=1, axis2=2)
        enough &= np.linalg.det(matrix / scale[:, None, None]) > 1e-6  # lines that are hardly apart meet anywhere
    matrix = np.where(enough[:, None, None], matrix, np.eye(3))
    points = np.linalg.solve(matrix, vector[..., None])[..., 0]
    return np.where(enough[:, None], points, np.nan)
