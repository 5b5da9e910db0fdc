"""A regular partition of the room into cubes of equal size. Source: Canton (2009), section 2.2.4.

Convention: voxel ``(i, j, k)`` is the cube from ``origin + size * (i, j, k)`` to ``origin + size * (i + 1, j + 1, k + 1)``; its
centre is ``origin + size * (i + 0.5, j + 0.5, k + 0.5)``. A rounded coordinate is therefore *not* a voxel's index: use
`VoxelGrid.index_of`, which floors. Volumes are arrays of shape ``(nx, ny, nz)`` in C order, so k runs quickest.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass

import numpy as np

from hmc.errors import InputError

__all__ = ["VoxelGrid", "available_memory", "check_memory", "voxels_of"]

#: Bytes that a volume costs a voxel without any camera: two occupancy volumes and a label.
BYTES_PER_VOXEL = 6
#: Bytes of one entry of a camera's voxel-to-pixel table.
BYTES_PER_CAMERA = 4
#: Share of the free memory that a grid may take.
MEMORY_SHARE = 0.6


@dataclass(frozen=True)
class VoxelGrid:
    """Cubes of one size that fill a box with sides along the world's axes.

    Parameters
    ----------
    origin : ndarray, shape (3,)
        Lowest corner of voxel (0, 0, 0), world, metres. A corner, not a centre.
    voxel_size_m : float
        Side of a voxel, metres.
    shape : (nx, ny, nz)
        Number of voxels along x, y and z.

    Raises
    ------
    InputError
        When a value is not finite or not positive.
    """

    origin: np.ndarray
    voxel_size_m: float
    shape: tuple[int, int, int]

    def __post_init__(self) -> None:
        origin = np.array(self.origin, float).ravel()
        if origin.shape != (3,) or not np.all(np.isfinite(origin)):
            raise InputError(f"a voxel grid's `origin` must be 3 finite numbers in metres; got {self.origin!r}")
        size = float(self.voxel_size_m)
        if not np.isfinite(size) or size <= 0:
            raise InputError(f"the voxel size must be a positive number of metres; got {self.voxel_size_m}")
        shape = tuple(int(n) for n in self.shape)
        if len(shape) != 3 or min(shape) < 1:
            raise InputError(f"a voxel grid's `shape` must be three positive whole numbers; got {self.shape}")
        origin.setflags(write=False)
        object.__setattr__(self, "origin", origin)
        object.__setattr__(self, "voxel_size_m", size)
        object.__setattr__(self, "shape", shape)

    @classmethod
    def from_room(cls, room, voxel_size_m: float, n_cameras: int = 0) -> VoxelGrid:
        """The grid that covers a room, starting at its lowest corner; the last voxels may stand out beyond the room.

        Parameters
        ----------
        room : array_like, shape (2, 3)
            Lowest and highest corner, world, metres.
        voxel_size_m : float
            Side of a voxel, metres.
        n_cameras : int
            Cameras whose tables will be made for this grid: they are counted in the memory check.

        Raises
        ------
        InputError
            When the room is empty or not finite, or when the grid would not fit in the memory there is.
        """
        room = np.asarray(room, float)
        if room.shape != (2, 3) or not np.all(np.isfinite(room)):
            raise InputError(f"`room` must be two corners [[x0, y0, z0], [x1, y1, z1]] in metres; got {room.tolist()}")
        extent = room[1] - room[0]
        if np.any(extent <= 0):
            raise InputError(f"the room is empty: its corners {room[0].tolist()} and {room[1].tolist()} must be lowest and highest")
        if not np.isfinite(voxel_size_m) or voxel_size_m <= 0:
            raise InputError(f"the voxel size must be a positive number of metres; got {voxel_size_m}")
        counts = np.maximum(1, np.ceil(extent / voxel_size_m - 1e-9))
        check_memory(extent, voxel_size_m, n_cameras)
        return cls(room[0], voxel_size_m, (int(counts[0]), int(counts[1]), int(counts[2])))

    @property
    def n_voxels(self) -> int:
        """Number of voxels."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner, shape (2, 3), metres."""
        return np.stack([self.origin, self.origin + self.voxel_size_m * np.array(self.shape)])

    def centres(self, indices: np.ndarray | None = None) -> np.ndarray:
        """Centres of voxels, world, metres.

        Parameters
        ----------
        indices : ndarray of int, shape (..., 3), optional
            Voxels (i, j, k); they may lie outside the grid. All voxels, shape (nx, ny, nz, 3), where left out.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        if indices is None:
            indices = np.moveaxis(np.indices(self.shape), 0, -1)
        return self.origin + self.voxel_size_m * (np.asarray(indices) + 0.5)

    def index_of(self, points: np.ndarray) -> np.ndarray:
        """The voxel in which each point lies: (..., 3) metres to (..., 3) int64. Points outside give indices outside the grid."""
        return np.floor((np.asarray(points, float) - self.origin) / self.voxel_size_m).astype(np.int64)


def voxels_of(volume: np.ndarray) -> np.ndarray:
    """Which voxels of a volume are set: as `numpy.argwhere`, in a tenth of its time.

    Parameters
    ----------
    volume : ndarray of bool, shape (nx, ny, nz)

    Returns
    -------
    ndarray of int, shape (n, 3)
    """
    return np.stack(np.unravel_index(np.flatnonzero(volume), volume.shape), axis=-1)


def available_memory() -> int:
    """Bytes of memory free for this process: what the system tells (a stated guess of 2 GiB where it does not), and no more than its own
    limit leaves (`ulimit -v`)."""
    return min(_free_memory(), _left_of_limit())


def _left_of_limit() -> int:
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        with open("/proc/self/statm", encoding="ascii") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
    except (ImportError, OSError, ValueError, IndexError):
        return sys.maxsize
    return sys.maxsize if limit == resource.RLIM_INFINITY else max(0, limit - used)


def _free_memory() -> int:
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
    except (OSError, ValueError, IndexError):
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
    except (AttributeError, OSError, ValueError):
        return 2 << 30


def check_memory(extent, voxel_size_m: float, n_cameras: int, available: int | None = None) -> None:
    """Refuse a grid that would not fit, and say which voxel size would.

    Parameters
    ----------
    extent : array_like, shape (3,)
        Sides of the room, metres.
    voxel_size_m : float
    n_cameras : int
    available : int, optional
        Bytes that are free; the system is asked where left out.

    Raises
    ------
    InputError
        When more than `MEMORY_SHARE` of the free memory would be needed.
    """
    budget = (available_memory() if available is None else available) * MEMORY_SHARE
    per_voxel = BYTES_PER_VOXEL + BYTES_PER_CAMERA * n_cameras
    extent = np.asarray(extent, float)
    needed = float(np.prod(np.ceil(extent / voxel_size_m))) * per_voxel
    if needed <= budget:
        return
    fits = voxel_size_m * (needed / budget) ** (1 / 3)
    while np.prod(np.ceil(extent / fits)) * per_voxel > budget:
        fits *= 1.02
    fits = np.ceil(fits * 1000) / 1000
    raise InputError(
        f"voxels of {voxel_size_m:g} m in a room of {extent[0]:.2f} x {extent[1]:.2f} x {extent[2]:.2f} m with {n_cameras} cameras need "
        f"{needed / 2**30:.1f} GiB and {budget / 2**30:.1f} GiB may be used; voxels of {fits:.3f} m would fit"
    )
