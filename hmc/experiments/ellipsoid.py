"""The ellipsoid that stands for a person in figures 4.7 and 4.9 of Canton (2009): half axes of .3, .3 and 1 m in voxels of 2 cm."""

from __future__ import annotations

import numpy as np

from hmc.voxels.surface import surface

__all__ = ["RADII_M", "VOXEL_M", "person_voxels"]

RADII_M = (0.3, 0.3, 1.0)
VOXEL_M = 0.02


def person_voxels(voxel_m: float = VOXEL_M) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The ellipsoid in a grid with a margin of three voxels; its centre is the grid's.

    Parameters
    ----------
    voxel_m : float

    Returns
    -------
    occupied : ndarray of bool, shape (nx, ny, nz)
    shell, interior : ndarray of int, shape (n, 3)
        Indices of its surface voxels and of all others.
    """
    half = np.ceil(np.array(RADII_M) / voxel_m).astype(int) + 3
    ticks = [voxel_m * np.arange(-n, n + 1) / radius for n, radius in zip(half, RADII_M, strict=True)]
    x, y, z = np.meshgrid(*ticks, indexing="ij")
    occupied = x**2 + y**2 + z**2 <= 1
    shell = surface(occupied)
    inner = occupied.copy()
    inner[tuple(shell.T)] = False
    return occupied, shell, np.argwhere(inner)
