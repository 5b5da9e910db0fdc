"""Silhouettes completed by what other cameras see: a camera's doubts are decided by the rest of the rig.

A pale sleeve before a pale wall looks to one camera exactly as a shadow on that wall would: the wall's color, a little darker. To the
camera alone the two are the same, to a rig they are not:

- A shadow lies on a surface. Where the ray of a doubtful pixel meets the floor, other cameras look at the same spot: if it is a shadow,
  they see it as one too; if it was a leg before the floor, they see the bare floor there.
- A sleeve fills room. Somewhere along the ray lie voxels at which every camera sees a person or doubts, and several see one.

So doubtful pixels become part of the silhouette where they are no shadow on the floor and look at such voxels. A miss on weak evidence
is thereby no miss, while a camera that surely sees the empty scene, or furniture before the person, carves as ever.

Where several people are about, there are also places at which each camera sees another of them. Nobody needs to be there: the people
themselves explain every silhouette. So a place counts only where some silhouette asks for it: a part of it, wider than a voxel, is not
covered by the hull of what all cameras see. Somebody is on that ray, and is in no hull yet. What nobody asks for stays a doubt: an arm
between people may be there, and a camera that lost it among them does not deny it.

Measured by ``python -m hmc.experiments run repairs``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from hmc.camera.coverage import floor_points
from hmc.camera.model import Camera, Rig
from hmc.voxels.carving import CarvingTables, carve, make_tables, pixel_of_voxel, pixels_at
from hmc.voxels.grid import VoxelGrid, voxels_of

__all__ = [
    "Completion",
    "CompletionTables",
    "complete_masks",
    "doubted_floor",
    "doubtful_hulls",
    "floor_shadows",
    "make_completion_tables",
    "shown",
]

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
#: How deep in the image of what the rig agrees upon a doubt must lie to be added: rims of coarse voxels make people fat. Metres there.
DEEP_M = 0.02
#: Much was lost where so many cameras gain this share of their silhouettes.
MUCH_SHARE, MUCH_CAMERAS = 0.06, 2
#: A piece is added where this share of it looks at places that some silhouette asks for. Without that the tracks of `meeting_unseen`, five
#: people, were 42 mm off, with it 31, without any completion 28.
LEAST_ASKED = 0.5
#: Rows of an image whose rays are cast at once.
BAND_PX = 128
#: Rounds: what is completed in one camera lets others complete more.
ROUNDS = 2


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


@dataclass(frozen=True)
class Completion:
    """One frame's silhouettes after the cameras completed one another's.

    Parameters
    ----------
    masks : tuple of ndarray of bool, shape (height, width), or None
        Each holds the mask it came from, and is that very mask where it lost nothing.
    left : tuple of ndarray of bool, shape (height, width), or None
        Where the rig may see somebody whom no silhouette asks for; beside the masks. None where there is no such place.
    much : bool
        Whether several cameras lost much: the people look like what is around them.
    """

    masks: tuple[np.ndarray | None, ...]
    left: tuple[np.ndarray | None, ...]
    much: bool


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


def complete_masks(tables: CompletionTables, masks: Sequence[np.ndarray | None], doubtful: Sequence[np.ndarray | None]) -> Completion:
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
    Completion
        With fewer than four masks the masks as they are.
    """
    given = {c: mask for c, mask in enumerate(masks) if mask is not None}
    if len(given) < LEAST_MASKS or all(doubtful[c] is None for c in given):
        return Completion(tuple(masks), (None,) * len(masks), False)
    shadow = np.append(floor_shadows(tables, masks, doubtful), False)
    possible = {c: _possible(mask, doubtful[c], shadow, tables.pixel_cells[c]) for c, mask in given.items()}
    grid = tables.carving.grid
    voxels = voxels_of(carve(tables.carving, [possible.get(c) for c in range(len(masks))]))
    points, pixels = grid.centres(voxels), pixels_at(tables.carving, voxels).astype(np.int64)  # as gathers want them
    before = {c: np.ascontiguousarray(mask).view(np.uint8) for c, mask in given.items()}
    seeing = _votes({c: np.ones_like(mask) for c, mask in before.items()}, pixels)
    done, gaps, much, telling = before, dict[int, _Gap](), False, [c for c in given if doubtful[c] is not None]
    for turn in range(ROUNDS):
        votes = _votes(done, pixels)
        agreed = np.flatnonzero(votes >= LEAST_VIEWS)
        shapes = _images(tables, telling, points, pixels, agreed)
        maybe = {c: _gap(*shapes[c], done[c], possible[c], grid.voxel_size_m) for c in telling}
        gaps = {c: gap for c, gap in maybe.items() if gap is not None}
        if not gaps:
            break
        hull = _images(tables, done, points, pixels, agreed[votes[agreed] == seeing[agreed]])
        bare = {c: _bare(mask, *hull[c], grid.voxel_size_m) for c, mask in done.items()}
        asked = _images(tables, gaps, points, pixels, agreed[_votes(bare, pixels[:, agreed]) > 0])
        wanted = {c: _wanted(gap, asked[c][0], shapes[c][1], grid.voxel_size_m) for c, gap in gaps.items()}
        joined = {c: _join(gap, wanted[c], done[c]) for c, gap in gaps.items() if wanted[c].any()}
        gaps = {c: replace(gap, pieces=gap.pieces - wanted[c]) for c, gap in gaps.items()}
        if turn == 0:
            much = sum(share > MUCH_SHARE for _, share in joined.values()) >= MUCH_CAMERAS
        done = done | {c: mask for c, (mask, _) in joined.items()}
        if not joined:  # another round would find the same
            break
    completed = tuple(mask if mask is None or done[c] is before[c] else done[c].view(bool) for c, mask in enumerate(masks))
    return Completion(completed, tuple(_left(gaps[c], done[c]) if c in gaps else None for c in range(len(masks))), much)


def doubtful_hulls(
    tables: CarvingTables, masks: Sequence[np.ndarray | None], doubtful: Sequence[np.ndarray | None], min_views: Sequence[int] = (2, 3)
) -> list[np.ndarray]:
    """Where people may be though some cameras only doubt it: shadows and people before them.

    Legs in their own shadow stay out of the completed silhouettes, as nothing tells them from it in one image. No camera sees the
    empty scene there, though, and some see a leg. Of points in pale trousers' shanks (recipe `pale`) .28 lie in the tolerant hull, .94
    in what two cameras see.

    Parameters
    ----------
    tables : CarvingTables
    masks, doubtful
        As for `complete_masks`.
    min_views : sequence of int
        Cameras whose silhouettes must hold a voxel.

    Returns
    -------
    list of ndarray of bool, shape (nx, ny, nz)
        One of each of `min_views`.
    """
    possible = [mask if mask is None or doubt is None else mask | doubt for mask, doubt in zip(masks, doubtful, strict=True)]
    hull = carve(tables, possible)
    flat = np.flatnonzero(hull)
    pixels = pixels_at(tables, np.stack(np.unravel_index(flat, hull.shape), axis=-1))
    votes = _votes({c: mask for c, mask in enumerate(masks) if mask is not None}, pixels)
    hulls = []
    for least in min_views:
        hulls.append(np.zeros(hull.shape, bool))
        hulls[-1].ravel()[flat[votes >= least]] = True
    return hulls


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


def _images(
    tables: CompletionTables, cameras: Iterable[int], points: np.ndarray, pixels: np.ndarray, which: np.ndarray
) -> dict[int, tuple[np.ndarray, float]]:
    """What cameras show of those voxels, as `shown`."""
    return {c: shown(tables.carving.rig[c], points[which], pixels[c].take(which)) for c in cameras}


def _bare(mask: np.ndarray, hull: np.ndarray, scale: float, voxel_m: float) -> np.ndarray:
    """What of a mask the hull's image leaves bare, at so many pixels a metre; the hull reaches half a voxel beyond its voxels' centres."""
    left, top, columns, rows = cv2.boundingRect(mask)
    margin = round(voxel_m * scale) + 3  # of the kernel that closes, so that a border of the box is none
    box = slice(max(0, top - margin), top + rows + margin), slice(max(0, left - margin), left + columns + margin)
    out = np.zeros_like(mask)
    if rows:
        bare = mask[box] & (1 - _closed(hull[box], scale, voxel_m))
        out[box] = cv2.morphologyEx(bare, cv2.MORPH_OPEN, _square(voxel_m / 2 * scale))
    return out


def _closed(image: np.ndarray, scale: float, voxel_m: float) -> np.ndarray:
    """An image of voxels without the gaps between their centres."""
    return cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((round(voxel_m * scale) + 3,) * 2, np.uint8))


@dataclass(frozen=True)
class _Gap:
    """What the agreed voxels' image leaves to a mask, in a box of the image.

    Parameters
    ----------
    box : tuple of slice
    old, free : ndarray of uint8
        The mask, and where it is free to grow: possible, and in that image.
    pieces : ndarray of uint8
        What of that lies deep in the image.
    near : ndarray of uint8
        A square: what is free goes with a piece as near to it.
    """

    box: tuple[slice, slice]
    old: np.ndarray
    free: np.ndarray
    pieces: np.ndarray
    near: np.ndarray


def _gap(shape: np.ndarray, scale: float, mask: np.ndarray, possible: np.ndarray, voxel_m: float) -> _Gap | None:
    """What the image of agreed voxels leaves to a mask, at so many pixels a metre; None where no piece of that lies deep in it."""
    left, top, columns, rows = cv2.boundingRect(shape)
    if not rows:
        return None
    margin = round((voxel_m + NEAR_M) * scale) + 4
    box = slice(max(0, top - margin), top + rows - 1 + margin), slice(max(0, left - margin), left + columns - 1 + margin)
    shape = _closed(shape[box], scale, voxel_m)
    old = np.ascontiguousarray(mask[box])
    free = shape & possible[box].view(np.uint8) & (1 - old)
    pieces = cv2.morphologyEx(free & cv2.erode(shape, _square(DEEP_M * scale)), cv2.MORPH_OPEN, _square(1))
    return _Gap(box, old, free, pieces, _square(NEAR_M * scale)) if cv2.countNonZero(pieces) else None


def _wanted(gap: _Gap, asked: np.ndarray, scale: float, voxel_m: float) -> np.ndarray:
    """The pieces of a gap that lie in the image of voxels that some silhouette asks for, at so many pixels a metre."""
    asked = _closed(asked[gap.box], scale, voxel_m)
    n, label = cv2.connectedComponents(gap.pieces)
    inside = np.flatnonzero(gap.pieces)
    own: np.ndarray = label.ravel().take(inside)
    share = np.bincount(own, asked.ravel().take(inside), n) / np.maximum(1, np.bincount(own, minlength=n))
    out = np.zeros_like(gap.pieces)
    out.ravel()[inside] = share.take(own) >= LEAST_ASKED
    return out


def _join(gap: _Gap, wanted: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, float]:
    """A mask with the pieces that are asked for and what is near, and the share of it that they are."""
    grown = cv2.dilate(wanted, gap.near) & gap.free | gap.old
    grown = cv2.morphologyEx(grown, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) | gap.old
    out = mask.copy()
    out[gap.box] |= cv2.morphologyEx(grown, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5)))
    return out, cv2.countNonZero(wanted) / max(1, cv2.countNonZero(gap.old))


def _left(gap: _Gap, mask: np.ndarray) -> np.ndarray | None:
    """The pieces that nobody asks for and what is near them, beside a mask; None without any."""
    if not cv2.countNonZero(gap.pieces):
        return None
    out = np.zeros(mask.shape, bool)
    out[gap.box] = cv2.dilate(gap.pieces, gap.near) & gap.free
    return out & ~mask.view(bool)


def _square(reach: float) -> np.ndarray:
    """A square that reaches so many pixels to each side."""
    return np.ones((2 * round(reach) + 1,) * 2, np.uint8)
