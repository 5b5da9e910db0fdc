"""Exact distance to the nearest occupied voxel, as far as a bound: a body's surface that is farther off pulls no more."""

from __future__ import annotations

import numpy as np

__all__ = ["near_distance"]


def near_distance(occupied: np.ndarray, reach: int) -> np.ndarray:
    """Distance of every voxel's centre to that of the nearest occupied one.

    Squares of whole numbers, one axis after the other as in an exact Euclidean transform (Felzenszwalb and Huttenlocher 2012), but
    from the voxels within reach alone, which is a minimum of shifted copies.

    Parameters
    ----------
    occupied : ndarray of bool, shape (nx, ny, nz)
    reach : int
        Voxels, at least 1.

    Returns
    -------
    ndarray of float32, shape (nx, ny, nz)
        Voxels; ``reach + 1`` where it is that or more.
    """
    beyond = (reach + 1) ** 2
    kind = np.min_scalar_type(beyond + reach**2)
    squared = np.where(occupied, kind.type(0), kind.type(beyond))
    for axis in range(squared.ndim):
        before, out = np.moveaxis(squared, axis, 0), squared.copy()
        after = np.moveaxis(out, axis, 0)
        for shift in range(1, min(reach + 1, len(before))):
            shifted = before + kind.type(shift**2)
            np.minimum(after[shift:], shifted[:-shift], out=after[shift:])
            np.minimum(after[:-shift], shifted[shift:], out=after[:-shift])
        squared = out
    return np.sqrt(np.arange(beyond + 1, dtype=np.float32)).take(squared)
