"""Images made smaller by whole factors, where voxels show no more of them, and the cameras, masks and pixels that go with them.

Blocks of pixels are averaged. The centre of the top-left pixel is (0, 0), so what is at ``u`` in the image is at ``(u + .5) / factor - .5``
in the smaller one. Rows and columns that fill no block, at the lower and the right border, are left out.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from hmc.camera.model import Camera, Rig

__all__ = ["reduce_image", "reduce_mask", "reduce_pixels", "reduced_camera", "reduction_factors"]

#: The side of a voxel in the middle of the room covers so many pixels at least of a smaller image. Of 1.95 to 2.9 poses lost nothing, of
#: 1.65 a millimetre or two (benchmarks/README.md).
LEAST_VOXEL_PX = 1.9
#: Of coarser voxels than this the images are no smaller, metres: what silhouettes lack moves the middle of a hull, however coarse it is.
COARSEST_M = 0.03
#: The longer side of a smaller image, pixels: silhouettes of smaller ones are completed without the network that tells shades
#: (`hmc.camera.segmentation.MOST_ZOOM`).
LEAST_SIDE_PX = 320


def reduction_factors(rig: Rig, room: np.ndarray, voxel_size_m: float) -> tuple[int, ...]:
    """How many times smaller the images of each camera may be, 1 or more, without voxels showing less.

    Parameters
    ----------
    rig : Rig
    room : ndarray, shape (2, 3)
        Lower and upper corner, metres.
    voxel_size_m : float

    Returns
    -------
    tuple of int, one a camera
    """
    factors, side = [], min(voxel_size_m, COARSEST_M)
    for camera in rig:
        distance = float(np.linalg.norm(camera.centre - np.mean(room, axis=0)))
        focal = float(np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1]))
        voxel_px = side * focal / max(distance, side)
        factors.append(max(1, min(int(voxel_px / LEAST_VOXEL_PX), max(camera.size) // LEAST_SIDE_PX)))
    return tuple(factors)


def reduced_camera(camera: Camera, factor: int) -> Camera:
    """The camera of the smaller images."""
    if factor == 1:
        return camera
    width, height = camera.size
    return replace(camera.scaled(1 / factor), size=(width // factor, height // factor))


def reduce_image(image: np.ndarray, factor: int) -> np.ndarray:
    """The image made smaller, uint8, (h, w) or (h, w, 3); the same array where the factor is 1."""
    if factor == 1:
        return image
    height, width = (side // factor for side in image.shape[:2])
    return np.asarray(cv2.resize(image[: height * factor, : width * factor], (width, height), interpolation=cv2.INTER_AREA))


def reduce_mask(mask: np.ndarray, factor: int) -> np.ndarray:
    """The mask made smaller, bool, (h, w): set where half of a block is, or more."""
    return mask if factor == 1 else reduce_image(mask.view(np.uint8) * np.uint8(255), factor) > 127


def reduce_pixels(uv: np.ndarray, factor: int) -> np.ndarray:
    """Where pixels, (..., 2), are in the smaller image."""
    return uv if factor == 1 else (uv + 0.5) / factor - 0.5
