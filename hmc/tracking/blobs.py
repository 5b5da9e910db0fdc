"""What the tracker sees of one frame: the occupied voxels, their connected components and the components' features.

Source: Canton (2009), section 4.2.3, Eq. 4.1 and Table 4.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.tracking.views import FrameViews
from hmc.voxels.components import label_voxels
from hmc.voxels.grid import VoxelGrid

__all__ = ["Blobs", "Observation", "blob_features", "observe"]

#: Density of a body, kilograms a cubic metre (Table 4.1: 1.1 g / cm^3).
DENSITY = 1100.0


@dataclass(frozen=True)
class Blobs:
    """Features of n sets of voxels, one row a set; an empty set's are zero.

    Attributes
    ----------
    counts : ndarray of int, shape (n,)
        Voxels.
    volume_m3, weight_kg : ndarray, shape (n,)
    centroid : ndarray, shape (n, 3)
        World, metres.
    lowest, highest : ndarray, shape (n, 3)
        Corners of the bounding box, outer faces of the voxels, metres. ``highest[:, 2]`` is Table 4.1's "top".
    """

    counts: np.ndarray
    volume_m3: np.ndarray
    weight_kg: np.ndarray
    centroid: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def top_m(self) -> np.ndarray:
        """Height of the highest point above the floor, shape (n,)."""
        return self.highest[:, 2]

    @property
    def height_m(self) -> np.ndarray:
        """From the lowest to the highest point, shape (n,)."""
        return self.highest[:, 2] - self.lowest[:, 2]

    @property
    def sides_m(self) -> np.ndarray:
        """Longer and shorter horizontal side of the bounding box, shape (n, 2)."""
        sides = (self.highest - self.lowest)[:, :2]
        return np.stack([sides.max(axis=1), sides.min(axis=1)], axis=1)


@dataclass(frozen=True)
class Observation:
    """The occupied voxels of one frame.

    Attributes
    ----------
    voxel_size_m : float
    room : ndarray, shape (2, 3)
        Lowest and highest corner of the grid, metres.
    indices : ndarray of int, shape (n, 3)
        Occupied voxels of the grid, in C order.
    points : ndarray, shape (n, 3)
        Their centres, world, metres.
    labels : ndarray of int, shape (n,)
        Connected component (26 neighbours) of each, from 0.
    blobs : Blobs
        Features of the components, in the order of their labels.
    certain : ndarray of bool, shape (n,)
        Voxels in which no camera is contradicted: those of the strict hull.
    views : FrameViews, optional
        The silhouettes, by which ghosts are told from people, and the images, by which people are told from one another.
    """

    voxel_size_m: float
    room: np.ndarray
    indices: np.ndarray
    points: np.ndarray
    labels: np.ndarray
    blobs: Blobs
    certain: np.ndarray
    views: FrameViews | None = None

    @property
    def grid(self) -> VoxelGrid:
        """The grid of which the voxels are."""
        shape = np.rint(np.ptp(self.room, axis=0) / self.voxel_size_m).astype(int)
        return VoxelGrid(self.room[0], self.voxel_size_m, tuple(shape))


def observe(grid: VoxelGrid, occupied: np.ndarray, certain: np.ndarray | None = None, views: FrameViews | None = None) -> Observation:
    """Components and features of one frame's occupied voxels.

    Parameters
    ----------
    grid : VoxelGrid
    occupied : ndarray of bool, shape (nx, ny, nz)
        The hull; best the tolerant one, so that no person is lost whom a camera does not see.
    certain : ndarray of bool, shape (nx, ny, nz), optional
        The strict hull, by which people are located where it has enough of them. All of `occupied` where left out.
    views : FrameViews, optional
        The silhouettes, their cameras and, where colors are asked for, the images.

    Returns
    -------
    Observation
    """
    indices, labels = label_voxels(occupied)
    points = grid.centres(indices)
    n_blobs = int(labels.max(initial=-1)) + 1
    blobs = blob_features(points, labels, n_blobs, grid.voxel_size_m)
    sure = np.ones(len(indices), bool) if certain is None else certain[tuple(indices.T)]
    return Observation(grid.voxel_size_m, grid.bounds, indices, points, labels, blobs, sure, views)


def blob_features(points: np.ndarray, labels: np.ndarray, n_blobs: int, voxel_size_m: float) -> Blobs:
    """Features of labelled voxels.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Centres of voxels, world, metres.
    labels : ndarray of int, shape (n,)
        Set of each voxel, 0 to ``n_blobs - 1``; negative ones belong to none.
    n_blobs : int
    voxel_size_m : float

    Returns
    -------
    Blobs
    """
    order = np.argsort(labels, kind="stable")[np.count_nonzero(labels < 0) :]
    counts = np.bincount(labels[order], minlength=n_blobs)
    some = counts > 0
    sums, lowest, highest = np.zeros((3, n_blobs, 3))
    if order.size:
        points, starts = points[order], (np.cumsum(counts) - counts)[some]
        sums[some] = np.add.reduceat(points, starts)
        lowest[some] = np.minimum.reduceat(points, starts) - voxel_size_m / 2
        highest[some] = np.maximum.reduceat(points, starts) + voxel_size_m / 2
    volume = counts * voxel_size_m**3
    return Blobs(
        counts=counts,
        volume_m3=volume,
        weight_kg=volume * DENSITY,
        centroid=sums / np.maximum(counts, 1)[:, None],
        lowest=lowest,
        highest=highest,
    )
