"""Points in space from their images in several views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.camera.model import Camera, undistort

__all__ = ["triangulate", "triangulate_pixels"]


def triangulate(projections: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Points from their images in several views, at least squared algebraic distance with every view weighed by one over its depth.

    Parameters
    ----------
    projections : ndarray, shape (n_views, 3, 4)
    uv : ndarray, shape (..., n_views, 2)
        Undistorted pixels; NaN where a view has none.

    Returns
    -------
    ndarray, shape (..., 3)
        World, metres; NaN with fewer than two views.
    """
    known = np.isfinite(uv).all(axis=-1)
    images = np.where(known[..., None], uv, 0.0)
    # Two equations a view: (u P_3 - P_1) X = 0 and (v P_3 - P_2) X = 0.
    rows = images[..., None] * projections[:, 2, None] - projections[:, :2]
    weight = known.astype(float)
    for _ in range(2):
        weighted = rows * weight[..., None, None]
        flat = weighted.reshape(*weighted.shape[:-3], 2 * len(projections), 4)
        a, b = flat[..., :3], flat[..., 3]
        normal = np.einsum("...ki,...kj->...ij", a, a)
        enough = known.sum(axis=-1) >= 2
        normal = np.where(enough[..., None, None], normal, np.eye(3))
        points = -np.linalg.solve(normal, np.einsum("...ki,...k->...i", a, b)[..., None])[..., 0]
        depth = np.einsum("vi,...i->...v", projections[:, 2, :3], points) + projections[:, 2, 3]
        weight = known / np.maximum(np.abs(depth), 0.05)
    return np.where(enough[..., None], points, np.nan)


def triangulate_pixels(cameras: Sequence[Camera], uv: np.ndarray) -> np.ndarray:
    """Points from pixels as the images have them, lens distortion and all.

    Parameters
    ----------
    cameras : sequence of Camera
    uv : ndarray, shape (..., n_views, 2)
        Pixels; NaN where a view has none.

    Returns
    -------
    ndarray, shape (..., 3)
        World; NaN with fewer than two views.
    """
    uv = np.asarray(uv, float)
    straight = np.stack(
        [np.where(np.isfinite(uv[..., v, :]), undistort(one, np.nan_to_num(uv[..., v, :])), np.nan) for v, one in enumerate(cameras)],
        axis=-2,
    )
    return triangulate(np.array([np.column_stack([one.rotation, one.translation]) for one in cameras]), straight)
