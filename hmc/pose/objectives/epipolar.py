"""How well 2-D detections in all views fit as images of a body's markers (Canton 2009, section 6.4.1.2, Eq. 6.4 to 6.10).

The epipolar distance of every two detections of two views is computed once a frame (`observe_markers`); particles then look it up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.epipolar import fundamental_matrices, symmetric_epipolar_distance
from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.pose.objectives.nearest_detections import nearest_detections

__all__ = ["MarkerLikelihood", "MarkerViews", "SeenMarkers", "marker_cost", "marker_views", "observe_markers", "project_markers"]

#: What is nearer to a camera than this has no image, metres.
NEAR_M = 0.05
#: Epipolar distances above this are all alike, pixels; their squares must not overflow.
FARTHEST_PX = 1e4


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


@dataclass(frozen=True)
class MarkerViews:
    """What the likelihood needs of the rig; the same in all frames.

    Parameters
    ----------
    projections : ndarray, shape (n_views, 3, 4)
        World to undistorted pixels, homogeneous.
    fundamentals : ndarray, shape (n_views, n_views, 3, 3)
    """

    projections: np.ndarray
    fundamentals: np.ndarray


@dataclass(frozen=True)
class SeenMarkers:
    """The detections of one frame in all views, in the form that is looked up.

    Parameters
    ----------
    views : MarkerViews
    detections : tuple of ndarray, shape (n, 2)
        Undistorted pixels, one array a view.
    gate_px : float
    stride : int
        Places a view has for detections; the last one always stands for none.
    uv : ndarray of float32, shape (2, n_views, stride)
        Detections; infinite after a view's last one.
    pairs : ndarray of float32, shape (n_pairs, stride, stride)
        Squared symmetric epipolar distances between the detections of views i < j, pairs in the order of ``np.triu_indices``; 0 with none.
    """

    views: MarkerViews
    detections: tuple[np.ndarray, ...]
    gate_px: float
    stride: int
    uv: np.ndarray
    pairs: np.ndarray


def marker_views(rig: Rig) -> MarkerViews:
    """Projections and fundamental matrices of a rig.

    Raises
    ------
    InputError
        When the rig has fewer than two cameras.
    """
    if len(rig) < 2:
        raise InputError("markers need two cameras at least: one view does not tell how far away they are")
    lenses = np.array([camera.matrix for camera in rig])
    outside = np.array([np.column_stack([camera.rotation, camera.translation]) for camera in rig])
    return MarkerViews(lenses @ outside, fundamental_matrices(rig))


def observe_markers(views: MarkerViews, detections: Sequence[np.ndarray], gate_px: float) -> SeenMarkers:
    """Prepare one frame's detections for the likelihood.

    Parameters
    ----------
    views : MarkerViews
    detections : sequence of ndarray, shape (n, 2)
        Undistorted pixels (`hmc.camera.epipolar.undistorted_pixels`), one array a view; an empty one where nothing was seen.
    gate_px : float

    Returns
    -------
    SeenMarkers
    """
    detections = tuple(np.asarray(points, float).reshape(-1, 2) for points in detections)
    stride = max(len(points) for points in detections) + 1
    uv = np.full((len(detections), stride, 2), np.nan)
    for view, points in enumerate(detections):
        uv[view, : len(points)] = points
    i, j = np.triu_indices(len(detections), 1)
    squared = symmetric_epipolar_distance(views.fundamentals[i, j][:, None, None], uv[i][:, :, None], uv[j][:, None, :]) ** 2
    pairs = np.where(np.isnan(squared), 0, np.minimum(squared, FARTHEST_PX**2)).astype(np.float32)
    flat = np.where(np.isnan(uv), np.inf, uv).transpose(2, 0, 1).astype(np.float32)
    return SeenMarkers(views, detections, gate_px, stride, flat, pairs)


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
    cost = np.zeros(markers * n, np.float32)
    if settings.reprojection < 1:
        cost += (1 - settings.reprojection) * _epipolar_score(seen, place, matched)
    if settings.reprojection > 0:
        cost += np.float32(settings.reprojection / views / seen.gate_px**2) * squared.sum(axis=0)
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
