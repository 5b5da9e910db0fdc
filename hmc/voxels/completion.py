"""Silhouettes completed by what other cameras see: a camera's doubts are decided by the rest of the rig.

A pale sleeve before a pale wall looks to one camera exactly as a shadow on that wall would: the wall's color, a little darker. To the
camera alone the two are the same, to a rig they are not:

- A shadow lies on a surface. Where the ray of a doubtful pixel meets the floor, other cameras look at the same spot: if it is a shadow,
  they see it as one too; if it was a leg before the floor, they see the bare floor there.
- A sleeve fills room. Somewhere along the ray lie voxels at which every camera sees a person or doubts, and several see one.

So doubtful pixels become part of the silhouette where they are no shadow on the floor and look at such voxels. A miss on weak evidence
is thereby no miss, while a camera that surely sees the empty scene, or furniture before the person, carves as ever.

How much is completed depends on what was lost. Where several cameras lost much, all that the rig agrees upon is added; elsewhere the
thin rims of a hull of coarse voxels would make people fat, so that only solid pieces are: a thigh, not an outline.

Measured by ``python -m hmc.experiments run repairs``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.camera.coverage import floor_points
from hmc.camera.model import Camera, Rig
from hmc.voxels.carving import CarvingTables, carve, make_tables, pixel_of_voxel, pixels_at
from hmc.voxels.grid import VoxelGrid

__all__ = ["CompletionTables", "complete_masks", "doubted_floor", "doubtful_hull", "floor_shadows", "make_completion_tables", "shown"]

#: Voxels in which cameras are compared, metres (a forearm is two wide), and the most of them: in a hall they are larger.
VOXEL_M, MOST_VOXELS = 0.04, 4e6
#: Cameras that must see a person at a voxel, and the fewest with a silhouette for anything to be decided.
LEAST_VIEWS, LEAST_MASKS = 3, 4
#: Side of a cell of the floor, and how far beyond the room the floor is looked at, metres.
CELL_M, AROUND_M = 0.03, 0.5
#: Widths in cells: holes in shadows that are closed, and the rim added to them.
SHADOW_CLOSE, SHADOW_RIM = 7, 3
#: Doubtful pixels this near to one that is agreed upon go with it. Metres at the person.
NEAR_M = 0.08
#: Masks are completed where so many cameras lost something, as one camera's loss the tolerant hull forgives; much was lost where so many
#: lost this share of their silhouettes. Rims that are added where nothing was lost make people fat: the first 40 frames of a woman who sits
#: down (recipe `sit`) went from 83 to 216 mm, as she was taken to face the other way.
LEAST_LOSS, LEAST_LOSERS = 0.06, 2
#: Doubts tell nothing in a camera that doubts so much of the empty scene beside people: its light changed. Of pale clothes (`pale`) 2 % is
#: doubted there, under a lamp that was dimmed (`close_white`) a quarter to a third, and all of the wall between people became people.
MOST_DOUBT = 0.1
#: Rows of an image whose rays are cast at once.
BAND_PX = 128
#: Rounds: what is completed in one camera lets others complete more.
ROUNDS = 2


@dataclass(frozen=True)
class Pieces:
    """What of the doubts is added: how deep they must lie in the agreed shape's image, and half the width they must have, metres there."""

    deep_m: float
    solid_m: float


ANY, SOLID = Pieces(0.02, 0.0), Pieces(0.04, 0.02)


@dataclass(frozen=True)
class CompletionTables:
    """Where voxels and floor cells fall in the images; made once by `make_completion_tables`.

    Attributes
    ----------
    carving : CarvingTables
        Of the room in coarse voxels.
    cells : tuple of int
        Number of floor cells along x and y.
    cell_pixels : tuple of ndarray of int64, shape (n_cells,), one a camera
        Flat pixel on which each cell's centre falls; ``width * height`` where the camera does not see it.
    pixel_cells : tuple of ndarray of int32, shape (height, width), one a camera
        Flat cell at which each pixel's ray meets the floor; ``n_cells`` where it does not.
    """

    carving: CarvingTables
    cells: tuple[int, int]
    cell_pixels: tuple[np.ndarray, ...]
    pixel_cells: tuple[np.ndarray, ...]


def make_completion_tables(room: np.ndarray, rig: Rig) -> CompletionTables:
    """Tables for a room with its floor at the lower z limit.

    Parameters
    ----------
    room : ndarray, shape (2, 3)
        Lower and upper corner, world, metres.
    rig : Rig

    Returns
    -------
    CompletionTables

    Raises
    ------
    InputError
        When the voxels would not fit in the memory there is.
    """
    first, floor_z = room[0, :2] - AROUND_M, float(room[0, 2])
    nx, ny = (int(n) for n in np.ceil((room[1, :2] + AROUND_M - first) / CELL_M))
    corners = np.indices((nx, ny)).reshape(2, -1).T
    centres = np.column_stack([first + (corners + 0.5) * CELL_M, np.full(nx * ny, floor_z)])
    cell_pixels, pixel_cells = [], []
    for camera in rig:
        column, row, seen = pixel_of_voxel(camera, centres)
        width, height = camera.size
        cell_pixels.append(np.where(seen, row * width + column, width * height).astype(np.int64))
        pixel_cells.append(np.full((height, width), nx * ny, np.int32))
        for top in range(0, height, BAND_PX):  # large images would need much memory at once
            band = slice(top, min(top + BAND_PX, height))
            uv = np.stack(np.meshgrid(np.arange(width), np.arange(band.start, band.stop)), axis=-1).astype(float)
            place = np.floor((floor_points(camera, uv, floor_z) - first) / CELL_M)
            inside = np.all((place >= 0) & (place < (nx, ny)), axis=-1)  # NaN compares as false
            pixel_cells[-1][band][inside] = place[inside] @ (ny, 1)
    voxel_size_m = max(VOXEL_M, float(np.prod(room[1] - room[0]) / MOST_VOXELS) ** (1 / 3))
    grid = VoxelGrid.from_room(room, voxel_size_m, len(rig))
    return CompletionTables(make_tables(grid, rig), (nx, ny), tuple(cell_pixels), tuple(pixel_cells))


def complete_masks(
    tables: CompletionTables, masks: Sequence[np.ndarray | None], doubtful: Sequence[np.ndarray | None]
) -> tuple[tuple[np.ndarray | None, ...], bool]:
    """Silhouettes with those doubtful pixels that the other cameras show to be people.

    Parameters
    ----------
    tables : CompletionTables
    masks : sequence of ndarray of bool, shape (height, width), or None
        One a camera.
    doubtful : sequence of ndarray of bool, shape (height, width), or None
        Where each image is not quite the empty scene (`hmc.camera.segmentation.BackgroundModel.doubtful`); ``None`` where a
        camera has no doubts.

    Returns
    -------
    completed : tuple of ndarray of bool, shape (height, width), or None
        Each holds the mask it came from, and is that very mask where it lost nothing. With fewer than four masks, and where only one lost
        anything, the masks as they are.
    much : bool
        Whether several cameras lost much: the people look like what is around them.
    """
    given = {c: mask for c, mask in enumerate(masks) if mask is not None}
    if len(given) < LEAST_MASKS or all(doubtful[c] is None for c in given):
        return tuple(masks), False
    shadow = np.append(floor_shadows(tables, masks, doubtful), False)
    possible = {c: _possible(mask, doubtful[c], shadow, tables.pixel_cells[c]) for c, mask in given.items()}
    grid = tables.carving.grid
    # Of a flat array: much quicker than of a volume.
    voxels = np.flatnonzero(carve(tables.carving, [possible.get(c) for c in range(len(masks))]))
    voxels = np.stack(np.unravel_index(voxels, grid.shape), axis=-1)
    points, pixels = grid.centres(voxels), pixels_at(tables.carving, voxels).astype(np.int64)  # as gathers want them
    before = {c: np.ascontiguousarray(mask).view(np.uint8) for c, mask in given.items()}
    done, pieces, losers = before, SOLID, set[int]()
    telling = {c for c in given if doubtful[c] is not None}
    for turn in range(ROUNDS):
        agreed = np.flatnonzero(_votes(done, pixels) >= LEAST_VIEWS)
        if not len(agreed):
            break
        there = points[agreed]
        shapes = {c: shown(tables.carving.rig[c], there, pixels[c].take(agreed)) for c in telling}
        if turn == 0:
            telling = {c for c in telling if _doubted_beside(*shapes[c], done[c], possible[c]) <= MOST_DOUBT}
        gaps = {c: _gap(*shapes[c], done[c], possible[c], grid.voxel_size_m) for c in telling}
        if turn == 0:
            lost = [_join(gaps[c], shapes[c][1], done[c], ANY)[1] for c in telling]
            pieces = ANY if sum(share > LEAST_LOSS for share in lost) >= LEAST_LOSERS else SOLID
        joined = {c: _join(gaps[c], shapes[c][1], done[c], pieces) for c in telling}
        losers |= {c for c, (_, share) in joined.items() if share > 0}
        last, done = done, done | {c: mask for c, (mask, _) in joined.items()}
        if all(done[c] is last[c] for c in given):  # another round would find the same
            break
    if len(losers) < LEAST_LOSERS:
        return tuple(masks), False
    completed = tuple(mask if mask is None or done[c] is before[c] else done[c].view(bool) for c, mask in enumerate(masks))
    return completed, pieces is ANY


def doubtful_hull(
    tables: CarvingTables, masks: Sequence[np.ndarray | None], doubtful: Sequence[np.ndarray | None], min_views: int = 2
) -> np.ndarray:
    """Where people may be though most cameras only doubt it: shadows and people before them.

    Legs in their own shadow stay out of the completed silhouettes, as nothing tells them from it in one image. No camera sees the
    empty scene there, though, and some see a leg. Of points in pale trousers' shanks (recipe `pale`) .28 lie in the tolerant hull, .94
    in this one.

    Parameters
    ----------
    tables : CarvingTables
    masks, doubtful
        As for `complete_masks`.
    min_views : int
        Cameras whose silhouettes must hold a voxel.

    Returns
    -------
    ndarray of bool, shape (nx, ny, nz)
    """
    possible = [mask if mask is None or doubt is None else mask | doubt for mask, doubt in zip(masks, doubtful, strict=True)]
    hull = carve(tables, possible)
    flat = np.flatnonzero(hull)
    pixels = pixels_at(tables, np.stack(np.unravel_index(flat, hull.shape), axis=-1))
    votes = _votes({c: mask for c, mask in enumerate(masks) if mask is not None}, pixels)
    hull.ravel()[flat[votes < min_views]] = False
    return hull


def floor_shadows(tables: CompletionTables, masks: Sequence[np.ndarray | None], doubtful: Sequence[np.ndarray | None]) -> np.ndarray:
    """Shadows on the floor with their rims: what most cameras doubt (`doubted_floor`), without its holes, and a little around it.

    Parameters
    ----------
    tables, masks, doubtful
        As for `complete_masks`.

    Returns
    -------
    ndarray of bool, shape `tables.cells`
    """
    seeds = doubted_floor(tables, masks, doubtful).view(np.uint8)
    shadow = cv2.morphologyEx(seeds, cv2.MORPH_CLOSE, np.ones((SHADOW_CLOSE,) * 2, np.uint8))
    return cv2.dilate(shadow, np.ones((SHADOW_RIM,) * 2, np.uint8)).view(bool)


def doubted_floor(tables: CompletionTables, masks: Sequence[np.ndarray | None], doubtful: Sequence[np.ndarray | None]) -> np.ndarray:
    """Spots of the floor that most cameras doubt that see them, and two at least.

    Cameras before which a person hides it do not count.

    Parameters
    ----------
    tables, masks, doubtful
        As for `complete_masks`.

    Returns
    -------
    ndarray of bool, shape `tables.cells`
    """
    n_cells = tables.cells[0] * tables.cells[1]
    doubting, bare = np.zeros(n_cells, np.uint8), np.zeros(n_cells, np.uint8)
    for pixels, mask, doubt in zip(tables.cell_pixels, masks, doubtful, strict=True):
        if mask is None or doubt is None:
            continue
        hidden, doubted = np.append(mask, True).take(pixels), np.append(doubt, False).take(pixels)  # beyond the image nothing is seen
        doubting += doubted > hidden
        bare += ~(doubted | hidden)
    return ((doubting >= 2) & (doubting > bare)).reshape(tables.cells)


def _votes(masks: dict[int, np.ndarray], pixels: np.ndarray) -> np.ndarray:
    """How many cameras' masks hold each voxel, by the pixels on which it falls."""
    votes = np.zeros(pixels.shape[1], np.uint8)
    for c, mask in masks.items():
        votes += mask.ravel().take(pixels[c], mode="clip") & (pixels[c] < mask.size)
    return votes


def _possible(mask: np.ndarray, doubt: np.ndarray | None, shadow: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The mask with its doubts, but for shadows on the floor."""
    if doubt is None:
        return mask
    out = mask.copy()
    doubts = np.flatnonzero(doubt > mask)
    out.ravel()[doubts] = ~shadow.take(cells.ravel().take(doubts))
    return out


def shown(camera: Camera, points: np.ndarray, pixels: np.ndarray) -> tuple[np.ndarray, float]:
    """Image of voxels, 1 or 0, by the pixels on which they fall; and how many pixels a metre is there."""
    width, height = camera.size
    image: np.ndarray = np.zeros((height, width), np.uint8)
    seen = pixels < width * height
    if not seen.all():
        points, pixels = points[seen], pixels[seen]
    image.ravel()[pixels] = 1
    n = max(1, len(points))
    depth = float(camera.rotation[2] @ (np.ones(len(points)) @ points / n) + camera.translation[2])
    return image, float(camera.matrix[0, 0]) / depth


def _doubted_beside(shape: np.ndarray, scale: float, mask: np.ndarray, possible: np.ndarray) -> float:
    """The share of the image around people, but not near them, that is possibly a person."""
    people, near = shape | mask, _square(NEAR_M * scale)
    left, top, width, height = cv2.boundingRect(people)
    if not width:
        return 0.0
    margin = len(near) // 2
    box = slice(max(0, top - margin), top + height + margin), slice(max(0, left - margin), left + width + margin)
    beside = 1 - cv2.dilate(people[box], near)
    return cv2.countNonZero(beside & possible[box].view(np.uint8)) / max(1, cv2.countNonZero(beside))


@dataclass(frozen=True)
class _Gap:
    """Where a mask may be completed: a box of the image, and in it the agreed voxels' image, closed, the mask, and what is free to join."""

    box: tuple[slice, slice]
    shape: np.ndarray
    old: np.ndarray
    free: np.ndarray


def _gap(shape: np.ndarray, scale: float, mask: np.ndarray, possible: np.ndarray, voxel_m: float) -> _Gap | None:
    """What the image of agreed voxels leaves to a mask, at so many pixels a metre; None where it shows none of them."""
    left, top, columns, rows = cv2.boundingRect(shape)
    if not rows:
        return None
    margin = round((voxel_m + NEAR_M) * scale) + 4
    box = slice(max(0, top - margin), top + rows - 1 + margin), slice(max(0, left - margin), left + columns - 1 + margin)
    shape = cv2.morphologyEx(shape[box], cv2.MORPH_CLOSE, np.ones((round(voxel_m * scale) + 3,) * 2, np.uint8))
    old = np.ascontiguousarray(mask[box])
    return _Gap(box, shape, old, shape & possible[box].view(np.uint8) & (1 - old))


def _join(gap: _Gap | None, scale: float, mask: np.ndarray, pieces: Pieces) -> tuple[np.ndarray, float]:
    """A mask with the possible pixels that lie deep in the agreed voxels' image, and their neighbours; the share of it that they are.

    The very mask and 0 where there is nothing to join.
    """
    if gap is None:
        return mask, 0.0
    deep = gap.free & cv2.erode(gap.shape, _square(pieces.deep_m * scale))
    sure = cv2.morphologyEx(deep, cv2.MORPH_OPEN, _square(max(1.0, pieces.solid_m * scale)))
    if not sure.any():
        return mask, 0.0
    grown = cv2.dilate(sure, _square(NEAR_M * scale)) & gap.free | gap.old
    grown = cv2.morphologyEx(grown, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) | gap.old
    out = mask.copy()
    out[gap.box] |= cv2.morphologyEx(grown, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5)))
    return out, cv2.countNonZero(sure) / max(1, cv2.countNonZero(gap.old))


def _square(reach: float) -> np.ndarray:
    """A square that reaches so many pixels to each side."""
    return np.ones((2 * round(reach) + 1,) * 2, np.uint8)
