"""Ghosts: places where the silhouettes of other people meet, so that the hull is occupied though nothing is there.

A real person accounts for parts of the silhouettes that nothing else accounts for; a ghost does not. So the detections are projected
into the views, and one that adds nothing in two views to the people who are known already is left out. Shown by the recipe
`close_queue`, where false positives go from 10 to 100 without it (naive tracker).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from hmc.camera.model import Camera
from hmc.tracking.rules.detection import owned_voxels
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.update import FrameUpdate
from hmc.tracking.views import FrameViews
from hmc.voxels.carving import pixel_of_voxel

__all__ = ["real_people", "reject_ghosts"]

#: Share of what a set of voxels covers in a view that must be its own for the view to speak for it.
OWN_SHARE = 0.3
#: Views that must speak for it, where there are as many.
OWN_VIEWS = 2


def reject_ghosts(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update without detections that are ghosts; all stay where there are no silhouettes."""
    observation = update.observation
    if not update.detections or observation.views is None:
        return update
    points = [observation.points[rows] for rows in update.detections]
    real = real_people(observation.views, observation.points[owned_voxels(update)], points, observation.voxel_size_m)
    return replace(update, detections=tuple(rows for rows, one in zip(update.detections, real, strict=True) if one))


def real_people(views: FrameViews, known: np.ndarray, sets: Sequence[np.ndarray], voxel_size_m: float) -> np.ndarray:
    """Which sets of voxels account for silhouettes that nothing else accounts for.

    The set that adds most is taken first and counts as known from then on, and so forth.

    Parameters
    ----------
    views : FrameViews
    known : ndarray, shape (n, 3)
        Centres of the voxels of the people known already, world, metres.
    sets : sequence of ndarray, shape (m, 3)
        Centres of the voxels of each set.
    voxel_size_m : float

    Returns
    -------
    ndarray of bool, shape (n_sets,)
    """
    cameras = [(camera, mask) for camera, mask in zip(views.rig, views.masks, strict=True) if mask is not None]
    sides = [_cell_side(camera, np.concatenate([known, *sets]), voxel_size_m) for camera, _ in cameras]
    covered = [_grow(_raster(camera, known, side)) for (camera, _), side in zip(cameras, sides, strict=True)]
    own = [[_raster(camera, points, side, mask) for points in sets] for (camera, mask), side in zip(cameras, sides, strict=True)]
    sizes = [[_raster(camera, points, side).sum() for points in sets] for (camera, _), side in zip(cameras, sides, strict=True)]
    real = np.zeros(len(sets), bool)
    while not real.all():
        # Cells, (n_views, n_sets), that a set alone accounts for.
        alone = np.array([[np.count_nonzero(mine & ~known_cells) for mine in row] for row, known_cells in zip(own, covered, strict=True)])
        speaks = alone >= OWN_SHARE * np.maximum(sizes, 1)
        left = np.flatnonzero((speaks.sum(axis=0) >= min(OWN_VIEWS, len(cameras))) & ~real)
        if left.size == 0:
            break
        best = left[alone.sum(axis=0)[left].argmax()]
        real[best] = True
        covered = [known_cells | _grow(row[best]) for row, known_cells in zip(own, covered, strict=True)]
    return real


def _cell_side(camera: Camera, points: np.ndarray, voxel_size_m: float) -> int:
    """Pixels that a voxel at the points' middle distance measures, so that neighbouring voxels fall on neighbouring cells."""
    depth = np.median((points @ camera.rotation.T + camera.translation)[:, 2]) if len(points) else 1.0
    return max(1, int(voxel_size_m * camera.matrix[0, 0] / max(depth, 1.0)))


def _raster(camera: Camera, points: np.ndarray, side: int, mask: np.ndarray | None = None) -> np.ndarray:
    """Cells of `side` pixels on which points fall, (rows, columns) bool; with a mask, only points on it count."""
    width, height = camera.size
    raster = np.zeros((-(-height // side), -(-width // side)), bool)
    column, row, seen = pixel_of_voxel(camera, points)
    if mask is not None:
        seen &= mask[row, column]
    raster[row[seen] // side, column[seen] // side] = True
    return raster


def _grow(raster: np.ndarray) -> np.ndarray:
    return cv2.dilate(raster.view(np.uint8), np.ones((3, 3), np.uint8)).view(bool)
