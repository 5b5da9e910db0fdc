"""Where a tolerant hull is needed: voxels on pixels of a silhouette that no voxel of the strict hull covers.

Cameras that agree make a strict hull that projects back on whole silhouettes: a tolerant one is then the same person and fatter. Where a
camera lost a forearm, the strict hull lacks it, and the silhouettes of the others show a forearm that nothing covers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.camera.model import Camera, Rig
from hmc.voxels.carving import pixel_of_voxel

__all__ = ["on_uncovered_pixels"]


def on_uncovered_pixels(
    rig: Rig, masks: Sequence[np.ndarray | None], known: np.ndarray, candidates: np.ndarray, spacing_m: float
) -> np.ndarray:
    """Which voxels show on pixels of silhouettes on which no known voxel shows.

    Parameters
    ----------
    rig : Rig
    masks : sequence of ndarray of bool, shape (height, width), or None
        Silhouettes, one a camera; None where a camera has none.
    known : ndarray, shape (n, 3)
        Voxel centres of the strict hull, world, metres.
    candidates : ndarray, shape (m, 3)
        Voxel centres, world, metres.
    spacing_m : float
        Side of a voxel, metres.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    new, left = np.zeros(len(candidates), bool), np.arange(len(candidates))
    for camera, mask in zip(rig, masks, strict=True):
        if mask is None:
            continue
        column, row, in_image = pixel_of_voxel(camera, candidates[left])
        seen = np.flatnonzero(in_image & mask.ravel().take(row * camera.size[0] + column))
        covered, step = _covered(camera, known, spacing_m)
        new[left.take(seen)] = ~covered[row.take(seen) // step, column.take(seen) // step]
        left = left[~new[left]]  # one camera is enough
    return new


def _covered(camera: Camera, known: np.ndarray, spacing_m: float) -> tuple[np.ndarray, int]:
    """Patches of the image on which known voxels show, and their side in pixels: a voxel's at the median distance."""
    column, row, in_image = pixel_of_voxel(camera, known)
    depth = known @ camera.rotation[2] + camera.translation[2]
    depth = depth[depth > 0]
    step = max(1, round(float(camera.matrix[0, 0] * spacing_m / np.median(depth)))) if len(depth) else 1
    covered = np.zeros((camera.size[1] // step + 1, camera.size[0] // step + 1), bool)
    covered[row[in_image] // step, column[in_image] // step] = True
    return covered, step
