"""Surface voxels: occupied voxels with at least one of the six face neighbours empty. Source: Kehl (2006), section 4.1."""

from __future__ import annotations

import numpy as np

__all__ = ["surface"]


def surface(occupied: np.ndarray) -> np.ndarray:
    """Find the surface voxels by index, never over the whole room.

    Parameters
    ----------
    occupied : ndarray of bool, shape (nx, ny, nz)

    Returns
    -------
    ndarray of int64, shape (n, 3)
        Indices (i, j, k) of the surface voxels, in C order. What lies beyond the grid counts as empty.
    """
    padded = np.zeros([n + 2 for n in occupied.shape], bool)
    padded[1:-1, 1:-1, 1:-1] = occupied
    flat = padded.ravel()
    index = np.flatnonzero(flat)
    _, ny, nz = padded.shape
    inner = np.ones(index.size, bool)
    for step in (ny * nz, nz, 1):
        inner &= flat.take(index + step)
        inner &= flat.take(index - step)
    return np.stack(np.unravel_index(index[~inner], padded.shape), axis=-1) - 1
