"""How well 2-D detections in all views fit as images of a body's markers (Canton 2009, section 6.4.1.2, Eq. 6.4 to 6.10).

The epipolar distance of every two detections of two views is computed once a frame (`observe_markers`); particles then look it up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.errors import InputError
from hmc.pose.objectives.nearest_detections import nearest_detections
from hmc.pose.views.markers import FARTHEST_PX, MarkerViews, SeenMarkers
from hmc.search.fitness import combined_cost

__all__ = ["MarkerLikelihood", "marker_cost", "project_markers"]

#: What is nearer to a camera than this has no image, metres.
NEAR_M = 0.05


@dataclass(frozen=True)
class MarkerLikelihood:
    """Settings of the likelihood.

    Parameters
    ----------
    gate_px : float
        Farther than this from where a marker should be, a detection is not its own (rho, below Eq. 6.5).
    reprojection : float
        Share of the reprojection score, in [0, 1]; the rest is the epipolar score. With 0 it is the thesis's likelihood, which asks
        whether the nearest detections agree with each other, and not where in the gate they lie.
    sigma : float
        Of Eq. 6.10.

    Raises
    ------
    InputError
        When a number is out of its range.
    """

    gate_px: float = 30.0
    reprojection: float = 0.5
    sigma: float = 1.0

    def __post_init__(self) -> None:
        if not self.gate_px > 0 or not self.sigma > 0 or not 0 <= self.reprojection <= 1:
            raise InputError(f"`gate_px` and `sigma` must be above 0 and `reprojection` in [0, 1]; got {self}")


def project_markers(views: MarkerViews, points: np.ndarray) -> np.ndarray:
    """Markers into all views (Eq. 6.4).

    Parameters
    ----------
    views : MarkerViews
    points : ndarray, shape (3, n)
        World, metres.

    Returns
    -------
    ndarray of float32, shape (2, n_views, n)
        Undistorted pixels; far away for what lies behind a camera.
    """
    # Rows in the order u, v, depth, each of all views.
    rows = np.moveaxis(views.projections, 1, 0).reshape(-1, 4).astype(np.float32)
    flat = rows[:, :3] @ points.astype(np.float32, copy=False)
    flat += rows[:, 3:]
    u, v, depth = flat.reshape(3, len(views.projections), -1)
    behind = depth <= NEAR_M
    if behind.any():
        depth = np.where(behind, np.float32(1), depth)
        u[behind] = v[behind] = -FARTHEST_PX
    np.divide(u, depth, out=u)
    np.divide(v, depth, out=v)
    return flat.reshape(3, len(views.projections), -1)[:2]


def marker_cost(seen: SeenMarkers, points: np.ndarray, settings: MarkerLikelihood) -> tuple[np.ndarray, np.ndarray]:
    """The cost of markers against the detections (Eq. 6.8 and 6.9).

    A marker's epipolar score is the root mean square of the symmetric epipolar distances of its detections over all pairs of views, over
    the most that two detections within the gate can be apart (2 sqrt 2 gate: each is a gate away from one point, on both lines), at
    most 1; it is 1 with fewer than two detections. Its reprojection score is the mean over all views of the squared distance from where
    the marker should be, over the squared gate; 1 for a view without a detection.

    Parameters
    ----------
    seen : SeenMarkers
    points : ndarray of float32, shape (3, n_markers, n)
        World, metres; n particles.
    settings : MarkerLikelihood

    Returns
    -------
    cost : ndarray, shape (n,)
        In [0, 1]; the log likelihood is ``-cost ** 2 / (2 sigma ** 2)`` (Eq. 6.10).
    matched : ndarray of int, shape (n_markers, n)
        In how many views each marker has a detection.
    """
    markers, n = points.shape[1:]
    uv = project_markers(seen.views, points.reshape(3, -1))
    views = uv.shape[1]
    place, squared = (one.reshape(views, -1) for one in nearest_detections(seen.uv, uv.reshape(2, views, markers, n), seen.gate_px))
    matched = np.add.reduce(place < seen.stride - 1, axis=0, dtype=np.int32)
    scores, shares = [], []
    if settings.reprojection < 1:
        scores.append(_epipolar_score(seen, place, matched))
        shares.append(1 - settings.reprojection)
    if settings.reprojection > 0:
        scores.append(np.float32(1 / views / seen.gate_px**2) * squared.sum(axis=0))
        shares.append(settings.reprojection)
    cost = combined_cost(np.stack(scores, axis=-1), shares)
    return cost.reshape(markers, n).mean(axis=0, dtype=float), matched.reshape(markers, n)


def _epipolar_score(seen: SeenMarkers, place: np.ndarray, matched: np.ndarray) -> np.ndarray:
    total = np.zeros(place.shape[1], np.float32)
    rows = place * seen.stride
    tables = seen.pairs.reshape(len(seen.pairs), -1)
    for table, i, j in zip(tables, *np.triu_indices(len(place), 1), strict=True):
        total += table.take(rows[i] + place[j], mode="wrap")
    pairs = matched * (matched - 1) // 2
    most = 8 * seen.gate_px**2
    score = np.sqrt(total / (np.maximum(pairs, 1) * np.float32(most)))
    return np.where(pairs > 0, np.minimum(score, 1), np.float32(1))
