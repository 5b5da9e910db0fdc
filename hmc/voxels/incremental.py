"""The visual hull kept up to date: only voxels behind pixels that changed are looked at again. Kehl (2006), section 4.1.

Each camera has a table from its pixels to the voxels whose centres fall on them. A voxel has one bit a camera, 1 where its pixel is
foreground or the camera does not see it; it belongs to the hull when at most `tolerance` of the voting cameras' bits are 0. From frame to
frame, the bits of the voxels behind changed pixels are turned over, and these voxels are decided again. The hull is that of
`hmc.voxels.carving.carve` with ``outside="ignore"`` to the voxel.

It is slower than carving each frame from scratch by blocks where much changes; it is kept as the paper's method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.voxels.carving import DEFAULT_MIN_VIEWS, pixel_of_voxel
from hmc.voxels.color import color_voxels, visibility
from hmc.voxels.grid import VoxelGrid, check_memory
from hmc.voxels.surface import surface

__all__ = ["HullState", "PixelTables", "colored_surface", "hull_init", "hull_step", "make_pixel_tables"]

#: A voxel's bits are in one number.
MOST_CAMERAS = 32


@dataclass(frozen=True)
class PixelTables:
    """Which voxels lie behind each pixel.

    Parameters
    ----------
    grid : VoxelGrid
    rig : Rig
    first : tuple of ndarray of int32, shape (width * height + 1,), one a camera
        Where the voxels of each flat pixel ``row * width + column`` begin in `voxels`.
    voxels : tuple of ndarray of int32, one a camera
        Flat voxels, sorted by pixel.
    unseen : ndarray of unsigned int, shape (n_voxels,)
        Bits of the cameras that do not see the voxel; 8 of them where there are no more cameras, else 16 or 32.
    """

    grid: VoxelGrid
    rig: Rig
    first: tuple[np.ndarray, ...]
    voxels: tuple[np.ndarray, ...]
    unseen: np.ndarray


@dataclass(frozen=True)
class HullState:
    """The hull of one frame and what it takes to change it.

    Parameters
    ----------
    masks : tuple of ndarray of bool, shape (height, width), or None, one a camera
    bits : ndarray of unsigned int, shape (n_voxels,)
    occupied : ndarray of bool, shape (nx, ny, nz)
    """

    masks: tuple[np.ndarray | None, ...]
    bits: np.ndarray
    occupied: np.ndarray


def make_pixel_tables(grid: VoxelGrid, rig: Rig) -> PixelTables:
    """Project every voxel's centre and sort the voxels by pixel, camera by camera.

    Parameters
    ----------
    grid : VoxelGrid
    rig : Rig
        At most 32 cameras.

    Raises
    ------
    InputError
        When there are more cameras, or when the tables would not fit in the memory there is.
    """
    if len(rig) > MOST_CAMERAS:
        raise InputError(f"the incremental hull has one bit a camera and room for {MOST_CAMERAS}; the rig has {len(rig)}")
    check_memory(np.array(grid.shape) * grid.voxel_size_m, grid.voxel_size_m, len(rig))
    first, voxels = [], []
    unseen = np.zeros(grid.n_voxels, np.uint8 if len(rig) <= 8 else np.uint16 if len(rig) <= 16 else np.uint32)
    for c, camera in enumerate(rig):
        n_pixels = camera.size[0] * camera.size[1]
        pixel = np.empty(grid.n_voxels, np.int32)
        slab = grid.shape[1] * grid.shape[2]
        for i in range(grid.shape[0]):
            indices = np.stack(np.unravel_index(np.arange(i * slab, (i + 1) * slab), grid.shape), axis=-1)
            column, row, seen = pixel_of_voxel(camera, grid.centres(indices))
            pixel[i * slab : (i + 1) * slab] = np.where(seen, row * camera.size[0] + column, n_pixels)
        unseen[pixel == n_pixels] |= unseen.dtype.type(1 << c)
        order = np.argsort(pixel, kind="stable").astype(np.int32)
        starts = np.searchsorted(pixel[order], np.arange(n_pixels + 1)).astype(np.int32)
        first.append(starts)
        voxels.append(order[: starts[-1]])
    return PixelTables(grid, rig, tuple(first), tuple(voxels), unseen)


def hull_init(tables: PixelTables, masks: Sequence[np.ndarray | None], tolerance: int = 0, min_views: int | None = None) -> HullState:
    """The hull of a first frame, from scratch.

    Parameters
    ----------
    tables : PixelTables
    masks : sequence of ndarray of bool, shape (height, width), or None
        One a camera; None where a camera does not vote in this frame.
    tolerance : int
        Voting cameras that may miss a voxel.
    min_views : int, optional
        Cameras that must see a voxel; as for `hmc.voxels.carving.carve`.

    Raises
    ------
    InputError
        When the masks disagree with the rig.
    """
    masks = _checked(tables, masks)
    bits = tables.unseen.copy()
    for c, mask in enumerate(masks):
        if mask is not None:
            bits[_behind(tables, c, np.flatnonzero(mask))] |= bits.dtype.type(1 << c)
    occupied = _decide(tables, masks, bits, slice(None), tolerance, min_views)
    return HullState(masks, bits, occupied.reshape(tables.grid.shape))


def hull_step(
    tables: PixelTables, state: HullState, masks: Sequence[np.ndarray | None], tolerance: int = 0, min_views: int | None = None
) -> HullState:
    """The hull of the next frame; arguments as for `hull_init`.

    A camera that votes in one of the two frames only changes what all voxels need: then all are decided again.

    Parameters
    ----------
    tables : PixelTables
    state : HullState
        Of the frame before, with the same tolerance and number of views.
    masks, tolerance, min_views
        As for `hull_init`.
    """
    masks = _checked(tables, masks)
    if [mask is None for mask in masks] != [mask is None for mask in state.masks]:
        return hull_init(tables, masks, tolerance, min_views)
    bits = state.bits.copy()
    touched = []
    for c, (before, now) in enumerate(zip(state.masks, masks, strict=True)):
        if before is None or now is None or before is now:
            continue
        voxels = _behind(tables, c, np.flatnonzero(before != now))
        bits[voxels] ^= bits.dtype.type(1 << c)  # a voxel lies behind one pixel of a camera
        touched.append(voxels)
    occupied = state.occupied.copy()
    if touched:
        voxels = np.concatenate(touched)
        occupied.reshape(-1)[voxels] = _decide(tables, masks, bits, voxels, tolerance, min_views)
    return HullState(masks, bits, occupied)


def colored_surface(tables: PixelTables, state: HullState, images: Sequence[np.ndarray | None]) -> tuple[np.ndarray, np.ndarray]:
    """The hull's surface voxels with the colors that the cameras in sight of them see.

    Parameters
    ----------
    tables : PixelTables
    state : HullState
    images : sequence of ndarray of uint8, shape (height, width, 3), or None
        One a camera.

    Returns
    -------
    voxels : ndarray of int, shape (n, 3)
    colors : ndarray of float32, shape (n, 3)
        BGR; NaN where no camera tells anything.
    """
    voxels = surface(state.occupied)
    seen = visibility(state.occupied, tables.grid, tables.rig, voxels, mode="quick")
    return voxels, color_voxels(tables.grid, tables.rig, images, voxels, seen, state.masks)


def _checked(tables: PixelTables, masks: Sequence[np.ndarray | None]) -> tuple[np.ndarray | None, ...]:
    if len(masks) != len(tables.rig):
        raise InputError(f"`masks` must hold one mask a camera: {len(tables.rig)}; got {len(masks)}")
    for camera, mask in zip(tables.rig, masks, strict=True):
        if mask is not None and mask.shape != camera.size[::-1]:
            raise InputError(f"camera '{camera.name}': the mask must be (height, width) = {camera.size[::-1]}; got {mask.shape}")
    return tuple(None if mask is None else np.asarray(mask, bool) for mask in masks)


def _behind(tables: PixelTables, camera: int, pixels: np.ndarray) -> np.ndarray:
    """Flat voxels behind some flat pixels."""
    starts, ends = tables.first[camera].take(pixels), tables.first[camera].take(pixels + 1)
    counts = ends - starts
    # Ranges side by side: a running number, less where each range begins in it, plus where it begins in the table.
    shift = np.repeat(starts - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    return tables.voxels[camera].take(np.arange(len(shift)) + shift)


def _decide(tables: PixelTables, masks, bits: np.ndarray, voxels, tolerance: int, min_views: int | None) -> np.ndarray:
    """Whether voxels belong to the hull."""
    voting = [c for c, mask in enumerate(masks) if mask is not None]
    some = bits[voxels]
    if not voting:
        return np.zeros(some.shape, bool)
    vote = bits.dtype.type(sum(1 << c for c in voting))
    needed = min(DEFAULT_MIN_VIEWS, len(voting)) if min_views is None else min_views
    seeing = np.bitwise_count(~tables.unseen[voxels] & vote)
    if tolerance == 0:
        return ((some & vote) == vote) & (seeing >= needed)
    return (np.bitwise_count(~some & vote) <= tolerance) & (seeing >= needed)
