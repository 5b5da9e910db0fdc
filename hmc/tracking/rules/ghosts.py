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
from hmc.tracking.views import FrameViews, cell_grid, cells_of

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
    grids = [cell_grid(camera, np.concatenate([known, *sets]), voxel_size_m) for camera, _ in cameras]
    covered = [_grow(_raster(camera, known, grid)) for (camera, _), grid in zip(cameras, grids, strict=True)]
    own = [[_raster(camera, points, grid, mask) for points in sets] for (camera, mask), grid in zip(cameras, grids, strict=True)]
    sizes = [[_raster(camera, points, grid).sum() for points in sets] for (camera, _), grid in zip(cameras, grids, strict=True)]
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


def _raster(camera: Camera, points: np.ndarray, grid: tuple[int, tuple[int, int]], mask: np.ndarray | None = None) -> np.ndarray:
    """Cells on which points fall, (rows, columns) bool; with a mask, only points on it count."""
    side, shape = grid
    raster = np.zeros(shape[0] * shape[1] + 1, bool)
    raster[cells_of(camera, points, side, mask)] = True
    return raster[:-1].reshape(shape)


def _grow(raster: np.ndarray) -> np.ndarray:
    return cv2.dilate(raster.view(np.uint8), np.ones((3, 3), np.uint8)).view(bool)
