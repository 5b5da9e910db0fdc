"""The colors of a camera's silhouettes, patch by patch, each as one of a few hundred bins.

A patch is as wide as a wrist where the person stands, so that its mean is the color of one part of a body, and noise is gone.
"""

from __future__ import annotations

import cv2
import numpy as np

from hmc.camera.model import Camera

__all__ = ["N_BINS", "OUTSIDE", "PATCH_M", "patch_bins", "patch_means", "patch_of_pixel", "patch_shape", "patch_side"]

#: Side of a patch on the person, metres.
PATCH_M = 0.03
#: Steps of lightness, and of each of the two others, in CIE L*a*b*; clothes and skin lie within so much of grey (of OpenCV's 128).
STEPS, CHROMA = 8, 32.0
N_BINS = STEPS**3
#: A patch of which less than this share is silhouette has no color.
MOST_OF = 0.6
#: What stands in the place of the bin of such a patch.
OUTSIDE = -1


def patch_side(camera: Camera, depth_m: float) -> int:
    """Side of a patch in pixels, for people at a depth along the camera's axis, metres."""
    return max(2, round(PATCH_M * float(camera.matrix[0, 0]) / max(depth_m, 1.0)))


def patch_shape(camera: Camera, side: int) -> tuple[int, int]:
    """Rows and columns of patches in a camera's image."""
    width, height = camera.size
    return -(-height // side), -(-width // side)


def patch_of_pixel(camera: Camera, side: int, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """The flat patch in which pixels lie, of the shape of both."""
    return row // side * patch_shape(camera, side)[1] + column // side


def patch_means(camera: Camera, image: np.ndarray, mask: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """The mean color of each patch over its silhouette, where it is not hardly silhouette.

    Parameters
    ----------
    camera : Camera
    image : ndarray of uint8, shape (h, w, 3)
        BGR.
    mask : ndarray of bool, shape (h, w)
    side : int
        Of a patch, pixels.

    Returns
    -------
    patch : ndarray of int, shape (n,)
        Flat, rising.
    mean : ndarray of float32, shape (n, 3)
        CIE L*a*b* as OpenCV has it in bytes: lightness of 255, and grey at 128.
    """
    n_columns = patch_shape(camera, side)[1]
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return np.empty(0, int), np.empty((0, 3), np.float32)
    (top, bottom), (left, right) = ((ends[0] // side, ends[-1] // side + 1) for ends in (rows, columns))
    box = slice(top * side, bottom * side), slice(left * side, right * side)
    there, lab = mask[box].astype(np.float32), cv2.cvtColor(np.ascontiguousarray(image[box]), cv2.COLOR_BGR2LAB)
    values = np.dstack([there, there[..., None] * lab])
    values = np.pad(values, ((0, (bottom - top) * side - len(there)), (0, (right - left) * side - there.shape[1]), (0, 0)))
    sums = values.reshape(bottom - top, side, right - left, side, 4).sum(axis=(1, 3))
    own = sums[..., 0] >= MOST_OF * side * side
    at = np.flatnonzero(own)
    patch = (top + at // (right - left)) * n_columns + left + at % (right - left)
    return patch, sums[own][:, 1:] / sums[own][:, :1]


def patch_bins(camera: Camera, image: np.ndarray, mask: np.ndarray, side: int) -> np.ndarray:
    """The bin of each patch's mean color over its silhouette.

    Parameters
    ----------
    camera, image, mask, side
        As for `patch_means`.

    Returns
    -------
    ndarray of int16, shape (n_rows * n_columns,)
        `OUTSIDE` where the patch is hardly silhouette.
    """
    bins = np.full(np.prod(patch_shape(camera, side)), OUTSIDE, np.int16)
    patch, mean = patch_means(camera, image, mask, side)
    low, step = np.array([0.0, 128 - CHROMA, 128 - CHROMA]), np.array([256, 2 * CHROMA, 2 * CHROMA]) / STEPS
    place = np.clip(((mean - low) / step).astype(int), 0, STEPS - 1)
    bins[patch] = np.ravel_multi_index(tuple(place.T), (STEPS,) * 3)
    return bins
