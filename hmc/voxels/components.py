"""Connected components of the occupied voxels (26 neighbours), and what each is like. Source: Canton (2009), Eq. 4.1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from hmc.voxels.grid import VoxelGrid

__all__ = ["Components", "components"]


@dataclass(frozen=True)
class Components:
    """Disjoint blobs of voxels, the largest first.

    Attributes
    ----------
    voxels : ndarray of int64, shape (n, 3)
        All occupied voxels (i, j, k), blob after blob; within a blob in C order.
    starts : ndarray of int64, shape (n_blobs + 1,)
        Blob b owns ``voxels[starts[b]:starts[b + 1]]``.
    centroids : ndarray, shape (n_blobs, 3)
        Mean of the voxels' centres, world, metres.
    bounds : ndarray, shape (n_blobs, 2, 3)
        Lowest and highest corner of the blob's voxels (faces, not centres), world, metres.
    volumes : ndarray, shape (n_blobs,)
        Cubic metres.
    """

    voxels: np.ndarray
    starts: np.ndarray
    centroids: np.ndarray
    bounds: np.ndarray
    volumes: np.ndarray

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def sizes(self) -> np.ndarray:
        """Voxels in each blob, shape (n_blobs,)."""
        return np.diff(self.starts)

    @property
    def labels(self) -> np.ndarray:
        """Blob number of each row of `voxels`, shape (n,)."""
        return np.repeat(np.arange(len(self)), self.sizes)

    def of(self, blob: int) -> np.ndarray:
        """Voxels (i, j, k) of one blob, shape (m, 3)."""
        return self.voxels[self.starts[blob] : self.starts[blob + 1]]


def components(occupied: np.ndarray, grid: VoxelGrid, min_voxels: int = 1) -> Components:
    """Split the occupied voxels into connected components, over the occupied voxels alone and never over the whole room.

    Parameters
    ----------
    occupied : ndarray of bool, shape grid.shape
    grid : VoxelGrid
    min_voxels : int
        Smaller blobs are left out.

    Returns
    -------
    Components
        With no blobs where nothing is occupied.
    """
    voxels, labels = label_voxels(occupied)
    sizes = np.bincount(labels) if labels.size else np.zeros(0, np.int64)
    ranks = np.argsort(-sizes, kind="stable")
    rank_of = np.empty(len(sizes), np.int64)
    rank_of[ranks] = np.arange(len(sizes))
    order = np.argsort(rank_of[labels], kind="stable")
    sizes = sizes[ranks]
    sizes = sizes[sizes >= min_voxels]
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    voxels = voxels[order[: starts[-1]]]
    if len(sizes) == 0:
        return Components(voxels, starts, np.zeros((0, 3)), np.zeros((0, 2, 3)), np.zeros(0))
    size_m = grid.voxel_size_m
    centroids = grid.origin + size_m * (np.add.reduceat(voxels, starts[:-1], axis=0) / sizes[:, None] + 0.5)
    lowest = grid.origin + size_m * np.minimum.reduceat(voxels, starts[:-1], axis=0)
    highest = grid.origin + size_m * (np.maximum.reduceat(voxels, starts[:-1], axis=0) + 1)
    return Components(voxels, starts, centroids, np.stack([lowest, highest], axis=1), sizes * size_m**3)


def label_voxels(occupied: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Occupied voxels and the number of the component each belongs to.

    Parameters
    ----------
    occupied : ndarray of bool, shape (nx, ny, nz)

    Returns
    -------
    voxels : ndarray of int64, shape (n, 3)
        In C order.
    labels : ndarray of int32, shape (n,)
        From 0, numbered by each component's first voxel.
    """
    index = np.flatnonzero(occupied)
    voxels = np.stack(np.unravel_index(index, occupied.shape), axis=-1)
    if index.size == 0:
        return voxels, np.zeros(0, np.int32)
    # Padded in y and z, a flat step cannot run over the end of a row into the next one.
    _, ny, nz = occupied.shape
    stride_y, stride_x = nz + 1, (ny + 1) * (nz + 1)
    flat = voxels @ np.array([stride_x, stride_y, 1])
    rows, columns = [], []
    # The 13 forward neighbours are one voxel along z and four runs of three voxels.
    steps = [1] + [step + k for step in (stride_y, stride_x - stride_y, stride_x, stride_x + stride_y) for k in (-1, 0, 1)]
    for step in steps:
        place = np.searchsorted(flat, flat + step)
        hit = np.flatnonzero(flat.take(place, mode="clip") == flat + step)
        rows.append(hit)
        columns.append(place[hit])
    row, column = np.concatenate(rows), np.concatenate(columns)
    graph = coo_array((np.ones(row.size, bool), (row, column)), shape=(index.size, index.size))
    return voxels, connected_components(graph, directed=False)[1]
