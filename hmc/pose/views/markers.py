"""Detections of markers in all views of one frame, in the form that is looked up. Canton (2009), section 6.4.1.2.

The epipolar distance of every two detections of two views is computed once a frame; particles then look it up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.epipolar import fundamental_matrices, symmetric_epipolar_distance, undistorted_pixels
from hmc.camera.model import Rig
from hmc.errors import InputError

__all__ = ["MarkerViews", "SeenMarkers", "marker_views", "observe_markers", "seen_in_frame"]

#: Epipolar distances above this are all alike, pixels; their squares must not overflow.
FARTHEST_PX = 1e4


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


def seen_in_frame(rig: Rig, views: MarkerViews, detections: Sequence[np.ndarray], gate_px: float) -> SeenMarkers:
    """One frame's detections, pixels as the images have them, ready for the likelihood.

    Parameters
    ----------
    rig : Rig
    views : MarkerViews
        From `marker_views`.
    detections : sequence of ndarray, shape (n, 2)
        One array a camera.
    gate_px : float
    """
    return observe_markers(views, [undistorted_pixels(camera, uv) for camera, uv in zip(rig, detections, strict=True)], gate_px)
