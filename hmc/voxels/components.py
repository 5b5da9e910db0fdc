"""Connected components of the occupied voxels (26 neighbours), and what each is like. Source: Canton (2009), Eq. 4.1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
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
    runs, labels = _label_runs(occupied)
    sizes = np.bincount(labels, weights=runs.length).astype(np.int64)
    ranks = np.argsort(-sizes, kind="stable")
    ranks = ranks[sizes[ranks] >= min_voxels]
    sizes = sizes[ranks]
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    rank_of = np.full(labels.max(initial=-1) + 1, len(ranks))
    rank_of[ranks] = np.arange(len(ranks))
    order = np.argsort(rank_of[labels], kind="stable")
    order = order[: np.count_nonzero(rank_of[labels] < len(ranks))]
    runs = Runs(*(column[order] for column in (runs.x, runs.y, runs.z, runs.length)))
    voxels = runs.voxels()
    if len(sizes) == 0:
        return Components(voxels, starts, np.zeros((0, 3)), np.zeros((0, 2, 3)), np.zeros(0))
    first = np.searchsorted(np.cumsum(runs.length), starts[:-1], side="right")  # first run of each blob
    last = runs.z + runs.length - 1
    middle = np.stack([runs.x, runs.y, (runs.z + last) / 2], axis=-1) * runs.length[:, None]
    size_m = grid.voxel_size_m
    centroids = grid.origin + size_m * (np.add.reduceat(middle, first, axis=0) / sizes[:, None] + 0.5)
    lowest = [np.minimum.reduceat(column, first) for column in (runs.x, runs.y, runs.z)]
    highest = [np.maximum.reduceat(column, first) + 1 for column in (runs.x, runs.y, last)]
    bounds = grid.origin + size_m * np.stack([np.stack(lowest, axis=-1), np.stack(highest, axis=-1)], axis=1)
    return Components(voxels, starts, centroids, bounds, sizes * size_m**3)


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
    runs, labels = _label_runs(occupied)
    return runs.voxels(), np.repeat(labels, runs.length)


@dataclass(frozen=True)
class Runs:
    """Vertical runs of occupied voxels: (x, y, z) to (x, y, z + length - 1); arrays of one length."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    length: np.ndarray

    def voxels(self) -> np.ndarray:
        """All voxels of the runs, run after run, shape (n, 3)."""
        ends = np.cumsum(self.length)
        z = np.arange(ends[-1] if len(ends) else 0) + np.repeat(self.z - ends + self.length, self.length)
        return np.stack([np.repeat(self.x, self.length), np.repeat(self.y, self.length), z], axis=-1)


def _label_runs(occupied: np.ndarray) -> tuple[Runs, np.ndarray]:
    """Runs in C order, and the component of each. A person is some thousand voxels but some hundred runs."""
    _, ny, nz = occupied.shape
    index = np.flatnonzero(occupied)
    column = index // nz
    breaks = np.flatnonzero((np.diff(index) != 1) | (np.diff(column) != 0)) + 1
    first = np.concatenate([[0], breaks]) if index.size else breaks
    length = np.diff(np.concatenate([first, [index.size]])) if index.size else breaks
    start = index[first]
    column = start // nz
    runs = Runs(column // ny, column % ny, start - column * nz, length)
    # Keys that grow with (x, y, z), with a gap between columns, so that a neighbour beyond a border matches no voxel.
    stride_y = nz + 2
    stride_x = (ny + 1) * stride_y
    low = runs.x * stride_x + runs.y * stride_y + runs.z
    high = low + length - 1
    if not len(low):
        return runs, np.zeros(0, np.int32)
    steps = np.array([stride_y, stride_x - stride_y, stride_x, stride_x + stride_y])  # the four neighbouring columns that lie ahead
    begin = np.searchsorted(high, low[:, None] + (steps - 1)).ravel()
    count = np.maximum(np.searchsorted(low, high[:, None] + (steps + 1), side="right").ravel() - begin, 0)
    ends = np.cumsum(count)
    neighbours = np.arange(ends[-1]) + np.repeat(begin - ends + count, count)
    pointers = np.concatenate([[0], ends[len(steps) - 1 :: len(steps)]])
    graph = csr_array((np.ones(neighbours.size), neighbours.astype(np.int32), pointers.astype(np.int32)), shape=(len(low), len(low)))
    return runs, connected_components(graph, directed=False)[1]
