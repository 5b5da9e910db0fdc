"""Epipolar geometry of a rig: fundamental matrices, epipolar lines and the symmetric epipolar distance, over arrays.

Everything here is in undistorted pixels: ``undistorted_pixels`` takes image points there. Source: Canton (2009), section 6.4.1.2,
Eq. 6.6 and 6.7.
"""

from __future__ import annotations

import numpy as np

from hmc.camera.model import Camera, Rig, undistort

__all__ = ["epipolar_lines", "fundamental_matrices", "generalised_epipolar_distance", "symmetric_epipolar_distance", "undistorted_pixels"]

#: Cameras nearer to each other than this (metres) share their centre.
SAME_PLACE_M = 1e-9


def undistorted_pixels(camera: Camera, uv: np.ndarray) -> np.ndarray:
    """Pixels as a lens without distortion would show them, (..., 2) to (..., 2)."""
    return undistort(camera, uv) @ camera.matrix[:2, :2].T + camera.matrix[:2, 2]


def fundamental_matrices(rig: Rig) -> np.ndarray:
    """The fundamental matrix of every ordered pair of cameras.

    Parameters
    ----------
    rig : Rig

    Returns
    -------
    ndarray, shape (n, n, 3, 3)
        ``F[i, j]`` turns a point of camera i into its line in camera j: ``x_j^T F[i, j] x_i = 0``. Undistorted pixels, homogeneous. From
        the known poses, ``F = K_j^-T [t]_x R K_i^-1`` with (R, t) from camera i to camera j; zero where i = j or two cameras share a
        centre, since no line is defined there.
    """
    rotations = np.array([camera.rotation for camera in rig])
    translations = np.array([camera.translation for camera in rig])
    inverses = np.linalg.inv([camera.matrix for camera in rig])
    relative = np.einsum("jab,icb->ijac", rotations, rotations)  # R_j R_i^T
    shift = translations[None] - np.einsum("ijab,ib->ija", relative, translations)
    # Rounding must not make lines out of nothing.
    apart = np.linalg.norm(shift, axis=-1, keepdims=True) > SAME_PLACE_M
    essential = cross_matrices(np.where(apart, shift, 0.0)) @ relative
    return np.einsum("jba,ijbc,icd->ijad", inverses, essential, inverses)


def cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """``[v]_x`` with ``[v]_x w = v x w``, (..., 3) to (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors, float), -1, 0)
    zero = np.zeros_like(x)
    return np.stack([np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))], axis=-2)


def epipolar_lines(fundamental: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Lines that points of one view draw in another.

    Parameters
    ----------
    fundamental : ndarray, shape (..., 3, 3)
        ``F[i, j]``; leading axes broadcast against those of ``points``.
    points : ndarray, shape (..., 2)
        Undistorted pixels of view i.

    Returns
    -------
    ndarray, shape (..., 3)
        (a, b, c) with ``a u + b v + c = 0`` and ``a^2 + b^2 = 1``, so that ``a u + b v + c`` is a signed distance in pixels; nan where
        the point is the epipole.
    """
    lines = np.einsum("...ab,...b->...a", fundamental[..., :2], points) + fundamental[..., 2]
    length = np.linalg.norm(lines[..., :2], axis=-1, keepdims=True)
    return lines / np.where(length > 0, length, np.nan)


def symmetric_epipolar_distance(fundamental: np.ndarray, points_i: np.ndarray, points_j: np.ndarray) -> np.ndarray:
    """Distance of two points from each other's epipolar lines, root of the sum of both squares (Canton Eq. 6.6).

    Parameters
    ----------
    fundamental : ndarray, shape (..., 3, 3)
        ``F[i, j]``.
    points_i, points_j : ndarray, shape (..., 2)
        Undistorted pixels; leading axes broadcast.

    Returns
    -------
    ndarray, shape (...)
        Pixels; nan where a point is nan or an epipole.
    """
    there = _distance(epipolar_lines(fundamental, points_i), points_j)
    back = _distance(epipolar_lines(np.swapaxes(fundamental, -1, -2), points_j), points_i)
    return np.hypot(there, back)


def _distance(lines: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.einsum("...a,...a->...", lines[..., :2], points) + lines[..., 2]


def generalised_epipolar_distance(fundamentals: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How far points of several views are from being one point of the world (Canton Eq. 6.7, over all pairs i < j).

    Parameters
    ----------
    fundamentals : ndarray, shape (n, n, 3, 3)
        From `fundamental_matrices`.
    points : ndarray, shape (..., n, 2)
        Undistorted pixels, one point a view; nan where a view has none.

    Returns
    -------
    ndarray, shape (...)
        Root of the sum of the squared distances of all pairs whose points are both there, pixels; nan where there is no such pair.
    """
    i, j = np.triu_indices(len(fundamentals), 1)
    squared = symmetric_epipolar_distance(fundamentals[i, j], points[..., i, :], points[..., j, :]) ** 2
    known = ~np.isnan(squared)
    return np.sqrt(np.where(known.any(axis=-1), np.where(known, squared, 0.0).sum(axis=-1), np.nan))
