"""What is seen of people in a frame, from hulls, silhouettes and images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Rig
from hmc.camera.stacked import Views, project_in, stack_views
from hmc.voxels.color import color_voxels, visibility
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

__all__ = ["Crop", "Skin", "crop_images", "observe_voxels", "to_yuv"]

#: Around a person's voxels so much of the image is kept, metres at their depth.
MARGIN_M = 0.15
#: BGR to YUV (ITU-R BT.601).
_YUV = np.array([[0.114, 0.587, 0.299], [0.436, -0.289, -0.147], [-0.100, -0.515, 0.615]]).T


@dataclass(frozen=True)
class Crop:
    """The part of a camera's image that shows a person.

    Parameters
    ----------
    image : ndarray of uint8, shape (h, w, 3)
    left, top : int
        Of the part in the image, pixels.
    """

    image: np.ndarray
    left: int
    top: int


@dataclass(frozen=True)
class Skin:
    """What is seen of a person in a frame.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Surface voxels, world, metres.
    colors : ndarray, shape (n, 3), or None
        Theirs in YUV; NaN where unknown.
    views : Views or None
        The cameras.
    crops : tuple of Crop or None, one a camera
        What they show of the person; None where a camera has no image.
    """

    points: np.ndarray
    colors: np.ndarray | None = None
    views: Views | None = None
    crops: tuple[Crop | None, ...] = ()


def to_yuv(colors: np.ndarray) -> np.ndarray:
    """BGR, (..., 3), 0 to 255, to YUV."""
    return np.asarray(colors, float) @ _YUV


def observe_voxels(grid: VoxelGrid, rig: Rig, occupied: np.ndarray, voxels: np.ndarray, images, masks) -> Skin:
    """What is seen of one person.

    Parameters
    ----------
    grid : VoxelGrid
    rig : Rig
    occupied : ndarray of bool, shape (nx, ny, nz)
        All that may stand in the way of a view.
    voxels : ndarray of int, shape (n, 3)
        The person's.
    images, masks : sequences, one a camera
        As in `hmc.voxels.hulls.HullStep`.
    """
    low = voxels.min(axis=0)
    solid = np.zeros(voxels.max(axis=0) - low + 1, bool)
    solid[tuple((voxels - low).T)] = True
    skin = surface(solid) + low
    points = grid.centres(skin)
    if all(image is None for image in images):
        return Skin(points)
    colors = to_yuv(color_voxels(grid, rig, images, skin, visibility(occupied, grid, rig, skin, mode="quick"), masks))
    views = stack_views(rig)
    return Skin(points, colors, views, crop_images(views, images, points))


def crop_images(views: Views, images, points: np.ndarray) -> tuple[Crop | None, ...]:
    """The part of each image that shows some points, with a margin.

    Parameters
    ----------
    views : Views
    images : sequence of ndarray of uint8, shape (h, w, 3), or None
    points : ndarray, shape (n, 3)
    """
    crops: list[Crop | None] = []
    for k, image in enumerate(images):
        crop = None
        if image is not None:
            uv, slopes, valid = project_in(views, np.full(len(points), k), points)
            if valid.any():
                margin = MARGIN_M * np.sqrt(0.5 * (slopes[valid] ** 2).sum(axis=(1, 2)).max())
                height, width = image.shape[:2]
                left, top = np.clip(uv[valid].min(axis=0) - margin, 0, (width, height)).astype(int)
                right, bottom = np.clip(uv[valid].max(axis=0) + margin, 0, (width, height)).astype(int)
                if right - left > 2 and bottom - top > 2:
                    crop = Crop(image[top:bottom, left:right].copy(), int(left), int(top))
        crops.append(crop)
    return tuple(crops)
