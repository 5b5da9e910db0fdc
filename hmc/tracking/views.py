"""The silhouettes and images of one frame, with the cameras that took them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Camera, Rig
from hmc.voxels.carving import pixel_of_voxel

__all__ = ["FrameViews", "cell_grid", "cells_of"]


@dataclass(frozen=True)
class FrameViews:
    """The silhouettes and images of one frame, with the cameras that took them.

    Attributes
    ----------
    rig : Rig
    masks : sequence of ndarray of bool, shape (height, width), or None; one a camera
    images : sequence of ndarray of uint8, shape (height, width, 3), or None; one a camera
        Empty where the tracker does not use colors.
    """

    rig: Rig
    masks: Sequence[np.ndarray | None]
    images: Sequence[np.ndarray | None] = ()


def cell_grid(camera: Camera, points: np.ndarray, voxel_size_m: float) -> tuple[int, tuple[int, int]]:
    """Square cells of a picture, as large as a voxel at the points' middle distance: neighbouring voxels fall on neighbouring cells.

    Parameters
    ----------
    camera : Camera
    points : ndarray, shape (n, 3)
        World, metres.
    voxel_size_m : float

    Returns
    -------
    side : int
        Pixels.
    shape : (int, int)
        Rows and columns of cells in the picture.
    """
    depth = np.median(points @ camera.rotation[2] + camera.translation[2]) if len(points) else 1.0
    side = max(1, int(voxel_size_m * camera.matrix[0, 0] / max(depth, 1.0)))
    width, height = camera.size
    return side, (-(-height // side), -(-width // side))


def cells_of(camera: Camera, points: np.ndarray, side: int, mask: np.ndarray | None = None) -> np.ndarray:
    """Number of the cell, row by row, on which each point falls, (n,); -1 outside the picture and, with a mask, off the mask."""
    column, row, seen = pixel_of_voxel(camera, points)
    if mask is not None:
        seen &= mask[row, column]
    return np.where(seen, row // side * -(-camera.size[0] // side) + column // side, -1)
