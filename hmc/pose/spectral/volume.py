"""A person's voxels themselves, for fits: where curves are missing, run twice along a limb or along two, voxels are there all the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

__all__ = ["FARTHEST_M", "BodyVolume", "observe_volume"]

#: Farther than this is all the same, metres: a piece of the hull that is no person's must not draw limbs from afar.
FARTHEST_M = 0.15


@dataclass(frozen=True)
class BodyVolume:
    """A person's voxels, for `hmc.pose.objectives.volume.volume_error`.

    Parameters
    ----------
    shell : ndarray, shape (m, 3)
        Centres of some voxels of the hull's surface, metres.
    outside_m : ndarray, shape (nx, ny, nz)
        Distance of each voxel of a crop to the nearest one of the person, metres.
    origin : ndarray, shape (3,)
        Centre of the crop's first voxel, metres.
    voxel_size_m : float
    """

    shell: np.ndarray
    outside_m: np.ndarray
    origin: np.ndarray
    voxel_size_m: float


def observe_volume(voxels: np.ndarray, points: np.ndarray, voxel_size_m: float, samples: int = 120) -> BodyVolume:
    """What a fit needs of a person's voxels.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
        At least one.
    points : ndarray, shape (n, 3)
        Their centres, world, metres.
    voxel_size_m : float
    samples : int
        Voxels of the surface that count, evenly strewn over it.
    """
    margin = int(np.ceil(FARTHEST_M / voxel_size_m))
    low = voxels.min(0) - margin
    occupied = np.zeros(voxels.max(0) - low + margin + 1, bool)
    occupied[tuple((voxels - low).T)] = True
    inner = ndimage.binary_erosion(occupied)
    shell = points[~inner[tuple((voxels - low).T)]]
    # In the order of the voxels, every so many: even over the body, and the same in each run.
    chosen = np.unique(np.linspace(0, len(shell) - 1, min(samples, len(shell))).astype(int))
    outside = ndimage.distance_transform_edt(~occupied).astype(np.float32) * voxel_size_m
    return BodyVolume(shell[chosen], outside, points[0] - voxel_size_m * (voxels[0] - low), voxel_size_m)
