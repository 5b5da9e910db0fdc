"""What the cameras' silhouettes agree on, seen from each camera: the visual hull, back in the images.

A silhouette holds shadows, mirror images and people outside of the room; others have gaps. In the hull of all cameras these have no
place, and what one camera missed is still in the hull in which a camera may be wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt, label

from hmc.camera.coverage import nearest_pixels
from hmc.camera.model import Camera
from hmc.voxels.carving import CarvingTables, carve_levels
from hmc.voxels.components import components
from hmc.voxels.grid import voxels_of

__all__ = ["agreed_views", "bodies", "hull_view"]

#: Smaller blobs are no person, cubic metres.
LEAST_VOLUME = 0.01
#: How far people may reach beyond the tolerant hull, metres.
REACH_M = 0.1
#: A hull that ends this near above the floor goes on to it: legs hold people up. Metres.
LEGS_M = 1.2
#: One that ends so high hangs in the air, and its legs are within this of what is above them, seen from above. Metres.
HANGING_M, SPREAD_M = 0.4, 0.2


def agreed_views(
    tables: CarvingTables, masks: Sequence[np.ndarray | None], tolerance: int = 1
) -> tuple[list[np.ndarray | None], list[np.ndarray | None], list[np.ndarray | None]]:
    """Where in each image people surely are, where they may be, and where legs are if nothing else holds them up, as all cameras tell.

    Parameters
    ----------
    tables : CarvingTables
        The first layer of the grid lies on the floor.
    masks : sequence of ndarray of bool, shape (height, width), or None
        One a camera.
    tolerance : int
        Cameras that may have missed a person; none where fewer than four have a mask.

    Returns
    -------
    surely, possibly, below : lists of ndarray of bool, shape (height, width), or None
        The hull of all cameras in each view; the one in which `tolerance` cameras may be wrong, down to the floor and a little
        further all around; and what is under those parts of the first that end in the air. ``None`` where there is no mask.
    """
    n_masks = sum(mask is not None for mask in masks)
    strict, tolerant = (bodies(hull, tables) for hull in carve_levels(tables, masks, (0, tolerance if n_masks >= 4 else 0)))
    size = tables.grid.voxel_size_m
    lowest = tolerant.argmax(axis=2)
    down = tolerant.any(axis=2) & (lowest * size < LEGS_M)
    tolerant |= down[..., None] & (np.arange(tolerant.shape[2]) < lowest[..., None])
    points = [tables.grid.centres(voxels_of(hull)) for hull in (strict, tolerant, _below(strict, size))]
    surely, possibly, below = (
        [None if mask is None else hull_view(camera, centres, radius) for camera, mask in zip(tables.rig, masks, strict=True)]
        for centres, radius in zip(points, (0.65 * size, 0.65 * size + REACH_M, 0.65 * size), strict=True)
    )
    return surely, possibly, below


def _below(hull: np.ndarray, size_m: float) -> np.ndarray:
    """What is under those parts of a hull that end in the air, down to the floor."""
    below = np.zeros_like(hull)
    parts, n = label(hull.any(axis=2), np.ones((3, 3)))
    for part in range(1, n + 1):
        lowest = int(hull[parts == part].any(axis=0).argmax())
        if HANGING_M < lowest * size_m < LEGS_M:
            below[distance_transform_edt(parts != part) * size_m <= SPREAD_M, :lowest] = True
    return below


def bodies(hull: np.ndarray, tables: CarvingTables) -> np.ndarray:
    """The hull without blobs that are too small for a person."""
    blobs = components(hull, tables.grid, max(1, round(LEAST_VOLUME / tables.grid.voxel_size_m**3)))
    kept = np.zeros_like(hull)
    kept[tuple(blobs.voxels.T)] = True
    return kept


def hull_view(camera: Camera, points: np.ndarray, radius_m: float) -> np.ndarray:
    """Image of balls, all drawn as large as one at the middle depth."""
    pixels, seen = nearest_pixels(camera, points)
    mask: np.ndarray = np.zeros(camera.size[::-1], np.uint8)
    if seen.any():
        mask[pixels[seen, 1], pixels[seen, 0]] = 1
        depth = float(np.median((points[seen] @ camera.rotation.T + camera.translation)[:, 2]))
        side = 2 * int(np.ceil(camera.matrix[0, 0] * radius_m / depth)) + 1
        mask = cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    return mask.view(bool)
