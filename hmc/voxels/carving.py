"""Shape from silhouette: which voxels lie inside the silhouettes of all cameras, or of nearly all.

Each voxel's centre is projected once into every camera (voxel-to-pixel tables); a frame is then gathers only. Source: Canton
(2009), section 2.2.4 (centre test, tolerance in the number of cameras), Hsiao (2008), section 3.1.3, Kehl (2006), section 4.1.

How a camera votes on a voxel:

- the voxel's centre falls on a foreground pixel: for it; on a background pixel: against it (a miss);
- the centre is behind the camera, beyond its lens or outside its image: `outside` says, "ignore" (no vote; the default), "carve"
  (a miss) or "keep" (a vote for it);
- the camera has no mask in this frame (``None``): no vote on any voxel.

A voxel is occupied when at most `tolerance` cameras miss it and at least `min_views` cameras voted on it. Tolerance 0 is the
strict visual hull, 1 the tolerant one, which keeps limbs that one silhouette lost and is fatter.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.camera.model import Camera, Rig, distort, project
from hmc.errors import InputError
from hmc.voxels.grid import VoxelGrid, check_memory

__all__ = ["CarvingTables", "carve", "carve_levels", "make_tables", "pixel_of_voxel", "pixels_at", "shared_tables"]

#: Side of a block of voxels, which is judged as a whole where it can be.
BLOCK = 8
BLOCK_VOXELS = BLOCK**3
#: A voxel must be voted on by this many cameras unless fewer have a mask.
DEFAULT_MIN_VIEWS = 3
#: Blocks that are projected at once.
PART = 32
#: Places (i, j, k) of a block's voxels in it, shape (512, 3), and which of them are its corners.
WITHIN = np.stack(np.unravel_index(np.arange(BLOCK_VOXELS), (BLOCK,) * 3), axis=-1)
CORNERS = np.flatnonzero(np.isin(WITHIN, (0, BLOCK - 1)).all(axis=1))
#: What is this near to a limit (pixels, and pixels times metres) is told with all digits; rounding is a thousandth of it at most where
#: the depth is above the second, metres.
CLEAR, CLEAR_M = 1e-6, 0.01
OUTSIDE_RULES = ("ignore", "carve", "keep")


@dataclass(frozen=True)
class CarvingTables:
    """Where each voxel falls in each image; made once for a grid and a rig by `make_tables`.

    Attributes
    ----------
    grid : VoxelGrid
    rig : Rig
    blocks : tuple of int
        Number of blocks of 8 x 8 x 8 voxels along x, y, z; the last ones may stand out beyond the grid.
    pixels : ndarray of int32, shape (n_cameras, n_blocks, 512)
        Flat pixel ``row * width + column`` of each voxel's centre, in block order; ``width * height`` where the camera does not see it.
    corners : ndarray of int32, shape (n_cameras, 4, n_blocks)
        Flat places, in the mask's integral image, of the corners of the rectangle that holds all pixels of a block.
    areas : ndarray of int32, shape (n_cameras, n_blocks)
        Pixels in that rectangle; 0 where the camera sees no voxel of the block.
    seen_whole : ndarray of bool, shape (n_cameras, n_blocks)
        The camera sees every voxel of the block.
    first : ndarray of int64, shape (n_blocks,)
        Flat place in the volume of each block's first voxel.
    sticks_out : ndarray of bool, shape (n_blocks,)
        Some of the block lies beyond the grid.
    """

    grid: VoxelGrid
    rig: Rig
    blocks: tuple[int, int, int]
    pixels: np.ndarray
    corners: np.ndarray
    areas: np.ndarray
    seen_whole: np.ndarray
    first: np.ndarray
    sticks_out: np.ndarray


def make_tables(grid: VoxelGrid, rig: Rig) -> CarvingTables:
    """Project every voxel's centre into every camera.

    Parameters
    ----------
    grid : VoxelGrid
    rig : Rig
        Cameras may differ in image size.

    Returns
    -------
    CarvingTables
        4 bytes a voxel and camera.

    Raises
    ------
    InputError
        When the tables would not fit in the memory there is.
    """
    check_memory(np.array(grid.shape) * grid.voxel_size_m, grid.voxel_size_m, len(rig))
    nx, ny, nz = (-(-n // BLOCK) for n in grid.shape)
    n_blocks = nx * ny * nz
    starts = np.stack(np.unravel_index(np.arange(n_blocks), (nx, ny, nz)), axis=-1) * BLOCK
    pixels = np.empty((len(rig), n_blocks, BLOCK_VOXELS), np.int32)
    corners = np.zeros((len(rig), 4, n_blocks), np.int32)
    areas = np.zeros((len(rig), n_blocks), np.int32)
    seen_whole = np.zeros((len(rig), n_blocks), bool)
    for c, camera in enumerate(rig):
        width, height = camera.size
        unseen, across = _sort_blocks(grid, camera, starts)
        pixels[c, unseen] = width * height
        asked, left_over = np.flatnonzero(~unseen & ~across), [np.flatnonzero(across)]
        tables = pixels[c], corners[c], areas[c], seen_whole[c]
        for part in _in_parts(asked):
            column, row, seen, unsure = _pixels_quickly(grid, camera, starts[part])
            _enter(tables, camera.size, part, column, row, seen)
            left_over.append(part[unsure])
        for part in _in_parts(np.concatenate(left_over)):
            _enter(tables, camera.size, part, *pixel_of_voxel(camera, grid.centres(starts[part, None, :] + WITHIN)))
    first = starts @ np.array([grid.shape[1] * grid.shape[2], grid.shape[2], 1])
    sticks_out = np.any(starts + BLOCK > grid.shape, axis=1)
    return CarvingTables(grid, rig, (nx, ny, nz), pixels, corners, areas, seen_whole, first, sticks_out)


def shared_tables(grid: VoxelGrid, rig: Rig) -> CarvingTables:
    """`make_tables`, or what it made last, where that was for the same grid and the same rig: the stages of a run share their tables.

    Parameters
    ----------
    grid : VoxelGrid
    rig : Rig
        The same object, as a recording has one.

    Returns
    -------
    CarvingTables
        Not to be written to. Those of one grid and rig stay in memory, until others are asked for.
    """
    return _last_tables(tuple(grid.origin.tolist()), grid.voxel_size_m, grid.shape, rig)


@functools.lru_cache(maxsize=1)
def _last_tables(origin: tuple[float, ...], voxel_size_m: float, shape: tuple[int, int, int], rig: Rig) -> CarvingTables:
    tables = make_tables(VoxelGrid(np.array(origin), voxel_size_m, shape), rig)
    for array in (tables.pixels, tables.corners, tables.areas, tables.seen_whole, tables.first, tables.sticks_out):
        array.setflags(write=False)
    return tables


def _in_parts(blocks: np.ndarray) -> Iterator[np.ndarray]:
    """So many blocks that what is told of their voxels stays in the second-level cache."""
    return (blocks[start : start + PART] for start in range(0, len(blocks), PART))


def _enter(tables: tuple[np.ndarray, ...], size: tuple[int, int], blocks: np.ndarray, column, row, seen) -> None:
    """Set pixels, corners, areas and `seen_whole` of some blocks of one camera, from what `pixel_of_voxel` tells, shape (n, 512)."""
    pixels, corners, areas, seen_whole = tables
    width, height = size
    pixels[blocks] = np.where(seen, row * np.int32(width) + column, np.int32(width * height))
    seen_whole[blocks] = seen.all(axis=1)
    low, high = (np.where(seen, places, np.int32(beyond)) for places, beyond in ((column, width), (column, -1)))
    left, right = low.min(axis=1), high.max(axis=1) + 1
    low, high = (np.where(seen, places, np.int32(beyond)) for places, beyond in ((row, height), (row, -1)))
    top, bottom = low.min(axis=1), high.max(axis=1) + 1
    some = right > 0
    areas[blocks] = np.where(some, (right - left) * (bottom - top), 0)
    stride = width + 1  # of the integral image
    places = [bottom * stride + right, top * stride + left, top * stride + right, bottom * stride + left]
    corners[:, blocks] = np.where(some, places, 0)


def _sort_blocks(grid: VoxelGrid, camera: Camera, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Blocks of which a camera sees no voxel, by their corners alone; and those that reach across the plane in which it lies.

    What a camera without distortion sees is a pyramid; of others it is only told what is behind them.
    """
    width, height = camera.size
    points = grid.centres(starts[:, None, :] + WITHIN[CORNERS])
    u, v, depth = (points @ row[:3] + row[3] for row in _pinhole(camera))
    unseen = (depth < -CLEAR_M).all(axis=1)
    if not camera.distortions.any():
        for beyond in (-u, -v, u - width * depth, v - height * depth):  # pixels times metres
            unseen |= (beyond > CLEAR).all(axis=1)
    return unseen, ~unseen & (depth < CLEAR_M).any(axis=1)


def _pinhole(camera: Camera) -> np.ndarray:
    """World to (u + .5) w, (v + .5) w and w = depth, shape (3, 4), without distortion: its quotients, rounded down, are pixels."""
    matrix = np.vstack([camera.matrix[:2], [0.0, 0.0, 1.0]])
    matrix[:2, 2] += 0.5
    return matrix @ np.column_stack([camera.rotation, camera.translation])


def _pixels_quickly(grid: VoxelGrid, camera: Camera, starts: np.ndarray) -> tuple[np.ndarray, ...]:
    """`pixel_of_voxel` of all voxels of blocks before a camera, shape (n, 512), and of which blocks not to believe it, shape (n,).

    What is linear in a voxel's place is a sum of what belongs to x, to y and to z. Its last digits are others than those of
    `pixel_of_voxel`, and what is within `CLEAR` of a limit may be rounded otherwise.
    """
    x, y, z = np.moveaxis(grid.centres(starts[:, None, :] + np.arange(BLOCK)[:, None]), -1, 0)
    distorted, shape = bool(camera.distortions.any()), (len(starts), BLOCK_VOXELS)
    matrix = np.column_stack([camera.rotation, camera.translation]) if distorted else _pinhole(camera)
    u, v, depth = (
        (((a * x + d)[:, :, None] + (b * y)[:, None, :])[..., None] + (c * z)[:, None, None, :]).reshape(shape) for a, b, c, d in matrix
    )
    u /= depth
    v /= depth
    seen, unsure = np.ones(shape, bool), np.zeros(len(starts), bool)
    if distorted:
        r2, most = u * u + v * v, camera.max_radius**2
        if np.isfinite(most):
            seen = r2 < most
            unsure = (np.abs(r2 - most) < CLEAR).any(axis=1)
        xy = distort(camera, np.stack([u, v], axis=-1))
        (a, b, c), (d, e, f) = camera.matrix[:2]
        u, v = a * xy[..., 0] + b * xy[..., 1] + (c + 0.5), d * xy[..., 0] + e * xy[..., 1] + (f + 0.5)
    pixel = []
    for values, size in ((u, camera.size[0]), (v, camera.size[1])):
        np.clip(values, -0.5, size + 0.5, out=values)
        seen &= (values >= 0) & (values < size)
        pixel.append(values.astype(np.int32))
        values -= pixel[-1]
        np.abs(values, out=values)
        unsure |= (values.min(axis=1) < CLEAR) | (values.max(axis=1) > 1 - CLEAR)
    return pixel[0], pixel[1], seen, unsure


def pixel_of_voxel(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The pixel on which each point falls (pixel centres on whole numbers, so it rounds).

    Parameters
    ----------
    camera : Camera
    points : ndarray, shape (..., 3)
        World, metres.

    Returns
    -------
    column, row : ndarray of int32, shape (...)
        0 where not seen.
    seen : ndarray of bool, shape (...)
        In front of the camera, within its lens and its image.
    """
    uv, valid = project(camera, points)
    u, v = uv[..., 0], uv[..., 1]
    width, height = camera.size
    # Compared before the cast: a far-away point's pixel may not fit in an integer.
    seen = valid & (u >= -0.5) & (u < width - 0.5) & (v >= -0.5) & (v < height - 0.5)
    column, row = (np.floor(np.where(seen, place, 0.0) + 0.5).astype(np.int32) for place in (u, v))
    return column, row, seen


def pixels_at(tables: CarvingTables, voxels: np.ndarray) -> np.ndarray:
    """Where some voxels fall in the images, from the tables.

    Parameters
    ----------
    tables : CarvingTables
    voxels : ndarray of int, shape (n, 3)
        (i, j, k) in the grid.

    Returns
    -------
    ndarray of int32, shape (n_cameras, n)
        Flat pixel ``row * width + column``; ``width * height`` where the camera does not see the voxel.
    """
    block = np.ravel_multi_index(tuple((voxels // BLOCK).T), tables.blocks)
    place = np.ravel_multi_index(tuple((voxels % BLOCK).T), (BLOCK,) * 3)
    flat = block * BLOCK_VOXELS + place
    return np.stack([pixels.ravel().take(flat) for pixels in tables.pixels])


def carve(
    tables: CarvingTables,
    masks: Sequence[np.ndarray | None],
    tolerance: int = 0,
    *,
    outside: str = "ignore",
    min_views: int | None = None,
    despeckle: bool = False,
) -> np.ndarray:
    """The visual hull of one frame's silhouettes.

    Parameters
    ----------
    tables : CarvingTables
    masks : sequence of ndarray of bool, shape (height, width), or None
        One a camera; ``None`` where a camera does not vote in this frame.
    tolerance : int
        Number of voting cameras that may miss a voxel.
    outside : {"ignore", "carve", "keep"}
        What a camera says of a voxel that it does not see.
    min_views : int, optional
        Cameras that must have voted on a voxel. Where left out: 3, or all that have a mask if they are fewer.
    despeckle : bool
        Take a 3 x 3 median of each mask first. Single wrong pixels do not change the hull's shape but keep whole blocks from
        being judged at once; use it on masks that were not cleaned.

    Returns
    -------
    ndarray of bool, shape (nx, ny, nz)

    Raises
    ------
    InputError
        When the masks disagree with the rig in number or size, or an option has no meaning.
    """
    return carve_levels(tables, masks, (tolerance,), outside=outside, min_views=min_views, despeckle=despeckle)[0]


def carve_levels(
    tables: CarvingTables,
    masks: Sequence[np.ndarray | None],
    tolerances: Sequence[int] = (0, 1),
    *,
    outside: str = "ignore",
    min_views: int | None = None,
    despeckle: bool = False,
) -> tuple[np.ndarray, ...]:
    """Visual hulls of several tolerances in one pass, by default the strict and the tolerant one.

    Parameters
    ----------
    tolerances : sequence of int
        One hull for each.
    tables, masks, outside, min_views, despeckle
        As for `carve`.

    Returns
    -------
    tuple of ndarray of bool, shape (nx, ny, nz)
        In the order of `tolerances`; a smaller tolerance's hull lies inside a larger one's.
    """
    if outside not in OUTSIDE_RULES:
        raise InputError(f"`outside` must be one of {', '.join(OUTSIDE_RULES)}; got {outside!r}")
    if not tolerances or min(tolerances) < 0:
        raise InputError(f"`tolerance` must be 0 or more cameras; got {tolerances}")
    images = _check_masks(tables, masks, despeckle)
    voting = [c for c, image in enumerate(images) if image is not None]
    hulls = tuple(np.zeros(tables.grid.shape, bool) for _ in tolerances)
    if voting:
        needed = min(DEFAULT_MIN_VIEWS, len(voting)) if min_views is None else min_views
        judged = _judge_blocks(tables, images, voting, max(tolerances), outside, needed)
        voxels, misses = _judge_voxels(tables, images, judged, max(tolerances), outside, needed)
        places, misses = _places(tables, voxels, misses)
        for hull, tolerance in zip(hulls, tolerances, strict=True):
            hull.ravel()[places[misses <= tolerance]] = True
    return hulls


def _check_masks(tables: CarvingTables, masks: Sequence[np.ndarray | None], despeckle: bool) -> list[np.ndarray | None]:
    """The masks as contiguous uint8 images of 0 and 1, checked against the rig."""
    if len(masks) != len(tables.rig):
        raise InputError(f"`masks` must hold one mask a camera: {len(tables.rig)}; got {len(masks)}")
    images: list[np.ndarray | None] = []
    for camera, mask in zip(tables.rig, masks, strict=True):
        if mask is None:
            images.append(None)
            continue
        width, height = camera.size
        if mask.shape != (height, width):
            raise InputError(f"camera '{camera.name}': the mask must be (height, width) = ({height}, {width}); got {mask.shape}")
        image = np.ascontiguousarray(mask, bool).view(np.uint8)
        images.append(cv2.medianBlur(image, 3) if despeckle else image)
    return images


@dataclass(frozen=True)
class _Judged:
    """What the blocks' rectangles tell.

    Parameters
    ----------
    blocks : ndarray of int, shape (n,)
        Those that may hold occupied voxels; all others are empty.
    missing, voted : ndarray of uint8, shape (n,)
        Cameras that miss every voxel of a block; cameras that have voted on every voxel of it.
    mixed : dict of int to ndarray of bool, shape (n,)
        By camera, the one that rejects most first: whether the block's voxels have to be asked for one by one.
    """

    blocks: np.ndarray
    missing: np.ndarray
    voted: np.ndarray
    mixed: dict[int, np.ndarray]


def _judge_blocks(tables, images, voting, tolerance, outside, min_views) -> _Judged:
    """What each camera says of whole blocks, camera by camera; blocks that cannot be occupied are left out at once."""
    blocks = np.arange(tables.areas.shape[1])
    missing, full, absent = np.zeros((3, blocks.size), np.uint8)  # cameras that miss all voxels, show all on people, vote on none
    mixed = np.zeros((len(voting), blocks.size), bool)
    foreground = []
    for done, c in enumerate(voting):
        integral = cv2.integral(images[c]).ravel()
        bottom_right, top_left, top_right, bottom_left = (integral.take(corner.take(blocks)) for corner in tables.corners[c])
        inside = bottom_right + top_left - top_right - bottom_left
        area, whole = tables.areas[c].take(blocks), tables.seen_whole[c].take(blocks)
        misses = (inside == 0) & (whole if outside != "carve" else True)
        shows = (inside == area) & (whole if outside != "keep" else True)
        missing += misses
        full += shows
        told = misses | shows
        if outside == "ignore":
            absent += area == 0
            told |= area == 0
        mixed[done, blocks] = ~told
        foreground.append(float(np.count_nonzero(images[c])))
        if done >= tolerance:
            possible = np.flatnonzero((missing <= tolerance) & (absent <= len(voting) - min_views))
            blocks, missing, full, absent = (array.take(possible) for array in (blocks, missing, full, absent))
    order = np.argsort(foreground, kind="stable")
    return _Judged(blocks, missing, missing + full, {voting[i]: mixed[i].take(blocks) for i in order})


def _judge_voxels(tables, images, judged, tolerance, outside, min_views) -> tuple[np.ndarray, np.ndarray]:
    """The occupied voxels, as block * 512 + place in the block, and how many cameras miss each."""
    # One number a pixel: `vote` for having voted plus 1 for a miss; in the sum over cameras the low part is the number of misses.
    vote: int = 16 if len(judged.mixed) < 16 else 1 << 16
    dtype: type = np.uint8 if len(judged.mixed) < 16 else np.uint32
    beyond = {"ignore": 0, "carve": vote + 1, "keep": vote}[outside]
    blocks, alive = judged.blocks, np.ones(judged.blocks.size, bool)
    total = np.repeat(judged.voted.astype(dtype) * dtype(vote) + judged.missing, BLOCK_VOXELS).reshape(-1, BLOCK_VOXELS)
    for c, mixed in judged.mixed.items():
        codes = np.empty(images[c].size + 1, dtype)
        np.subtract(dtype(vote + 1), images[c].ravel(), out=codes[:-1])
        codes[-1] = beyond
        asked = np.flatnonzero(mixed & alive)
        sums = total.take(asked, axis=0)
        sums += codes.take(tables.pixels[c].take(blocks.take(asked), axis=0))
        total[asked] = sums
        alive[asked] = (sums & dtype(vote - 1)).min(axis=1) <= tolerance
    misses = total & dtype(vote - 1)
    voxels = np.flatnonzero((misses <= tolerance) & (total >= min_views * vote))
    return _number_voxels(blocks, voxels), misses.ravel().take(voxels)


def _number_voxels(blocks: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Places in the list of the blocks' voxels to block * 512 + place in the block."""
    return blocks.take(places // BLOCK_VOXELS) * BLOCK_VOXELS + places % BLOCK_VOXELS


def _places(tables: CarvingTables, voxels: np.ndarray, misses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Flat places in the volume of voxels, given as block * 512 + place in the block, with their misses; without those beyond the grid."""
    _, ny, nz = tables.grid.shape
    block, place = voxels // BLOCK_VOXELS, voxels % BLOCK_VOXELS
    flat = tables.first.take(block) + (WITHIN @ np.array([ny * nz, nz, 1])).take(place)
    suspects = np.flatnonzero(tables.sticks_out.take(block))
    if suspects.size:
        corner = np.stack(np.unravel_index(block[suspects], tables.blocks), axis=-1) * BLOCK
        beyond = suspects[(corner + WITHIN[place[suspects]] >= tables.grid.shape).any(axis=1)]
        flat, misses = np.delete(flat, beyond), np.delete(misses, beyond)
    return flat, misses
