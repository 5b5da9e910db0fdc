"""What people look like: histograms of the colors of their surface voxels, and which voxels are colored at all.

Source: Canton (2009), sections 4.3.2 and 4.3.3: histograms in YCbCr with 21 bins a channel, an adaptive reference (Eq. 4.11), the
Bhattacharyya coefficient (Eq. 4.10) and the threshold below which a color is not the person's (after Eq. 4.21). The histogram is
joint, 21 x 21 x 21, so that "the histogram value for the tested color" is one number.
"""

from __future__ import annotations

import numpy as np

from hmc.tracking.blobs import Observation
from hmc.voxels.color import color_voxels, visibility
from hmc.voxels.surface import surface

__all__ = ["N_COLORS", "adapt", "bhattacharyya", "color_bins", "color_surface", "histogram", "similar_colors"]

BINS = 21
#: Bins of a joint histogram.
N_COLORS = BINS**3
#: From BGR to Y, Cb - 128 and Cr - 128 (ITU-R BT.601, full range).
YCBCR = np.array([[0.114, 0.587, 0.299], [0.5, -0.331264, -0.168736], [-0.081312, -0.418688, 0.5]], np.float32)


def color_bins(bgr: np.ndarray) -> np.ndarray:
    """Bin of each color in the joint YCbCr histogram.

    Parameters
    ----------
    bgr : ndarray, shape (n, 3)
        0 to 255; NaN where no color is known.

    Returns
    -------
    ndarray of int64, shape (n,)
        0 to ``N_COLORS - 1``, or -1 where no color is known.
    """
    ycc = np.asarray(bgr, np.float32) @ YCBCR.T + np.array([0, 128, 128], np.float32)
    known = ~np.isnan(ycc[:, 0])
    bins = np.clip(ycc[known] * np.float32(BINS / 256), 0, BINS - 1).astype(np.int64)
    result = np.full(len(ycc), -1)
    result[known] = bins @ (BINS * BINS, BINS, 1)
    return result


def histogram(bins: np.ndarray) -> np.ndarray:
    """Shares of the colors, shape (N_COLORS,); empty where no bin is known (all negative)."""
    known = bins[bins >= 0]
    return np.bincount(known, minlength=N_COLORS) / len(known) if len(known) else np.zeros(0)


def adapt(reference: np.ndarray, seen: np.ndarray, keep: float) -> np.ndarray:
    """The reference histogram after a frame (Canton, Eq. 4.11): ``keep`` of the old one. An empty histogram changes nothing."""
    if reference.size == 0 or seen.size == 0:
        return reference if seen.size == 0 else seen
    return keep * reference + (1 - keep) * seen


def bhattacharyya(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Bhattacharyya coefficient of histograms that sum to 1: 0 without a common color, 1 where equal; shape (..., n) to (...)."""
    return np.sqrt(np.asarray(a) * np.asarray(b)).sum(axis=-1)


def similar_colors(reference: np.ndarray, share: float = 0.8) -> np.ndarray:
    """The commonest colors, which together make up a share of the histogram.

    Parameters
    ----------
    reference : ndarray, shape (n,)
        Sums to 1.
    share : float
        Canton's 80 %: the threshold on a bin's value is chosen so that the bins above it hold this much.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    filled = np.sort(reference[reference > 0])[::-1]
    if filled.size == 0:
        return np.zeros(len(reference), bool)
    threshold = filled[min(int(np.searchsorted(filled.cumsum(), share - 1e-9)), len(filled) - 1)]
    return reference >= threshold


def color_surface(observation: Observation, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The colors of the surface of some of the voxels, from the cameras that have direct sight of it; nothing else is colored.

    Parameters
    ----------
    observation : Observation
        Its views hold the images.
    rows : ndarray of int, shape (m,)
        The voxels that are asked for. Of the others, those of the strict hull may hide them.

    Returns
    -------
    rows : ndarray of int, shape (s,)
        Those on the surface.
    bins : ndarray of int, shape (s,)
        Their colors (`color_bins`), -1 where no camera sees the voxel.
    """
    views, grid = observation.views, observation.grid
    voxels = observation.indices[rows]
    if views is None or not len(views.images) or not len(rows):
        return np.zeros(0, int), np.zeros(0, int)
    occupied = np.zeros(grid.shape, bool)
    occupied[tuple(observation.indices[observation.certain].T)] = True
    occupied[tuple(voxels.T)] = True
    place = np.full(grid.shape, -1, np.int32)
    place[tuple(voxels.T)] = rows
    skin = surface(occupied)
    skin_rows = place[tuple(skin.T)]
    skin, skin_rows = skin[skin_rows >= 0], skin_rows[skin_rows >= 0].astype(int)
    seen = visibility(occupied, grid, views.rig, skin, mode="quick")
    return skin_rows, color_bins(color_voxels(grid, views.rig, views.images, skin, seen, views.masks))
