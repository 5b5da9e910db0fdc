"""Double occupancy, counted: how many of each body part's voxels another part takes too (Canton 2009, Eq. 6.12 and 6.14)."""

from __future__ import annotations

import numpy as np

from hmc.body.flesh import FleshTable, place_points
from hmc.body.model import PARTS

__all__ = ["exact_overlap"]


def exact_overlap(flesh: FleshTable, rotations: np.ndarray, positions: np.ndarray, origin: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Fraction of each part's voxels in voxels that another part takes too (Eq. 6.14).

    Parameters
    ----------
    flesh : FleshTable
    rotations, positions : ndarray, shape (n, 16, 3, 3) and (n, 16, 3)
    origin : ndarray, shape (3,)
        A corner of the voxels' lattice, world, metres.
    voxel_size_m : float

    Returns
    -------
    ndarray, shape (n, n_parts)
    """
    bits = (1 << np.arange(len(PARTS))).astype(np.uint16)
    members = [np.flatnonzero(flesh.part == part) for part in range(len(PARTS))]
    counts = np.array([member.size for member in members])
    out = np.empty((len(rotations), len(PARTS)))
    for particle, (rotation, position) in enumerate(zip(rotations, positions, strict=True)):
        voxels = np.floor((place_points(rotation, position, flesh.points, flesh.segment) - origin) / voxel_size_m).astype(np.int64)
        voxels -= voxels.min(0)
        shape = voxels.max(0) + 1
        flat = np.ravel_multi_index(tuple(voxels.T), tuple(shape))
        takers = np.zeros(np.prod(shape), np.uint16)
        for part, member in enumerate(members):
            takers[flat[member]] |= bits[part]
        double = (takers[flat] & ~bits[flesh.part]) != 0
        out[particle] = np.bincount(flesh.part, double, len(PARTS)) / counts
    return out
