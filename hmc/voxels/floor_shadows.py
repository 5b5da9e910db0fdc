"""Shadows on the floor, told from people by all cameras: a spot of the floor is as dark to whoever looks at it.

A deep shadow before a person's feet looks to one camera as dark trousers would: the floor's color, much darker. It is in all silhouettes,
so it is in the hull, and joins people who stand together. To a rig the two are not the same:

- A shadow lies on the floor. Most cameras that look at the same spot see it darkened, and by as much, as a floor scatters light all ways;
  of the spot behind a leg they see the bare floor, or something of another darkness.
- A shadow fills no room. The line of sight to it meets no place, a quarter of a metre and more above the floor, at which all cameras see
  people.

Pixels of which both hold leave the silhouettes (`cut_floor_shadows`). What a camera filled for its darkness alone, by rules, needs less to
leave (`cut_filled_shadows`): that most cameras doubt the spot on which it lies, as they do under a chair, where the line of sight meets
legs. Where a network guesses what is a shade, `hmc.voxels.floor_light` decides that.
Measured by ``python -m hmc.experiments run repairs``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from hmc.camera.light import brought_back
from hmc.voxels.carving import carve, pixels_at
from hmc.voxels.completion import CompletionTables, doubted_floor, shown
from hmc.voxels.grid import voxels_of

__all__ = ["OTHER_COLOR", "LitView", "Scene", "channels_at", "cut_filled_shadows", "cut_floor_shadows", "darkness", "lit_views"]

#: Shares of the empty floor's light: from the first on a spot is bare, below the second it is no shadow but something dark.
BARE, DARKEST = 0.93, 0.5
#: Two cameras see one shadow where the logarithms of these shares differ by less; of the other cameras that see the spot darkened, so many
#: must see the same.
AGREE, AGREE_SHARE = 0.18, 0.34
#: A shadow has the floor's color: chroma this near to it, grey levels.
MOST_CHROMA = 6.0
#: Places at which people are told from shadows lie this high above the floor at least, metres: lower down the hull holds shadows.
ABOVE_M = 0.25
#: Sides, in cells and in pixels, of what is opened and closed.
SPOT, SPECK, AROUND = 3, 3, 5

#: Of a pixel that tells nothing of the floor: no image, another color than the floor's.
_UNKNOWN, OTHER_COLOR = np.float32(np.nan), np.float32(9)


@dataclass(frozen=True)
class Scene:
    """The light of the empty scene, as one camera knows it.

    Parameters
    ----------
    mean : ndarray of float32, shape (height, width, 3)
        Luma and chroma (`hmc.camera.segmentation.BackgroundModel`), quickest in planes (`hmc.camera.silhouettes.in_planes`).
    unseen : ndarray of bool, shape (height, width), or None
        Where it was never seen.
    """

    mean: np.ndarray
    unseen: np.ndarray | None = None


@dataclass(frozen=True)
class LitView:
    """What a camera tells of the floor's light: its image, in the light of the empty scene, and that scene.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        BGR.
    scene : Scene
    """

    image: np.ndarray
    scene: Scene

    @cached_property
    def colors(self) -> np.ndarray:
        """Luma and chroma of the smoothed image, uint8, shape (height * width, 3): asked of other pixels again and again."""
        return cv2.GaussianBlur(cv2.cvtColor(self.image, cv2.COLOR_BGR2YCrCb), (3, 3), 0).reshape(-1, 3)


def lit_views(
    images: Sequence[np.ndarray | None], scenes: Sequence[Scene | None], gains: Sequence[np.ndarray | None]
) -> tuple[LitView | None, ...]:
    """What each camera tells of the floor's light.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width, 3), or None
        BGR, one a camera.
    scenes : sequence of Scene or None
        What is known of the empty scene; None of a camera that has other silhouettes.
    gains : sequence of ndarray of float32, shape (rows, columns, 3), or None
        By which factors the images are brighter than the empty scene (`hmc.camera.light.light_gains`); None where they are not.

    Returns
    -------
    tuple of LitView or None
        None where there is no image, or nothing is known of the scene.
    """
    return tuple(
        None if image is None or scene is None else LitView(brought_back(image, scene.mean, gain), scene)
        for image, scene, gain in zip(images, scenes, gains, strict=True)
    )


def cut_filled_shadows(
    tables: CompletionTables,
    masks: Sequence[np.ndarray | None],
    filled: Sequence[np.ndarray | None],
    doubtful: Sequence[np.ndarray | None],
) -> tuple[np.ndarray | None, ...]:
    """Silhouettes without what was filled for its darkness alone and lies on a shadow on the floor.

    Parameters
    ----------
    tables : CompletionTables
        Of the room and the rig.
    masks : sequence of ndarray of bool, shape (height, width), or None
        One a camera.
    filled, doubtful : sequences of ndarray of bool, shape (height, width), or None
        As `hmc.camera.segmentation.BackgroundModel` has them; None of a camera that has other silhouettes.

    Returns
    -------
    tuple of ndarray of bool, shape (height, width), or None
        Each within the mask it came from.
    """
    if not any(mask is not None and fill is not None and fill.any() for mask, fill in zip(masks, filled, strict=True)):
        return tuple(masks)
    sure = [mask if mask is None or fill is None else mask > fill for mask, fill in zip(masks, filled, strict=True)]
    shadow = np.append(doubted_floor(tables, sure, doubtful), False)
    cut = list(masks)
    for c, (mask, fill) in enumerate(zip(masks, filled, strict=True)):
        if mask is not None and fill is not None:
            pixels = np.flatnonzero(mask & fill)
            pixels = pixels[shadow.take(tables.pixel_cells[c].ravel().take(pixels))]
            if len(pixels):
                left = mask.copy()
                left.ravel()[pixels] = False
                cut[c] = left
    return tuple(cut)


def cut_floor_shadows(
    tables: CompletionTables, views: Sequence[LitView | None], masks: Sequence[np.ndarray | None]
) -> tuple[np.ndarray | None, ...]:
    """Silhouettes without the shadows on the floor.

    Parameters
    ----------
    tables : CompletionTables
        Of the room and the rig.
    views : sequence of LitView or None
        One a camera (`lit_views`).
    masks : sequence of ndarray of bool, shape (height, width), or None

    Returns
    -------
    tuple of ndarray of bool, shape (height, width), or None
        Each within the mask it came from. With fewer than two cameras that know the empty floor, the masks as they are.
    """
    floors = {c: view for c, (view, mask) in enumerate(zip(views, masks, strict=True)) if view is not None and mask is not None}
    if len(floors) < 2:
        return tuple(masks)
    n_cells = tables.cells[0] * tables.cells[1]
    dark = {c: _dark_pixels(floor, np.asarray(masks[c]), tables.pixel_cells[c], n_cells) for c, floor in floors.items()}
    spots = _shadowed(tables, floors, {c: cells for c, (_, cells) in dark.items()})
    cut_out = {c: pixels[spots[c].take(cells)] for c, (pixels, cells) in dark.items()}
    cut_out = {c: pixels for c, pixels in cut_out.items() if len(pixels)}
    if not cut_out:
        return tuple(masks)
    cut = list(masks)
    for c, pixels in _beside_people(tables, masks, cut_out).items():
        if len(pixels):
            cut[c] = _without(np.asarray(masks[c]), pixels)
    return tuple(cut)


def channels_at(scene: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Luma and chroma of the empty scene at some pixels.

    Parameters
    ----------
    scene : ndarray of float32, shape (height, width, 3)
        As `Scene.mean`; where its channels do not lie in one piece each, the whole of it is copied first.
    pixels : ndarray of int, shape (n,)
        Flat.

    Returns
    -------
    ndarray of float32, shape (3, n)
    """
    return np.moveaxis(scene, -1, 0).reshape(3, -1).take(pixels, axis=1)


def darkness(view: LitView, pixels: np.ndarray) -> np.ndarray:
    """How dark some pixels are against the empty scene.

    Parameters
    ----------
    view : LitView
    pixels : ndarray of int, shape (n,)
        Flat.

    Returns
    -------
    ndarray of float32, shape (n,)
        Logarithms of the shares of that scene's light; `OTHER_COLOR` of pixels that have another color as well, or whose scene was never
        seen.
    """
    scene, color, mean = view.scene, view.colors.take(pixels, axis=0).astype(np.float32), channels_at(view.scene.mean, pixels)
    share = np.maximum(color[:, 0], 1) / mean[0]
    lit = np.minimum(share, 1)  # chroma shrinks with the light
    tint = np.maximum(*(np.abs(color[:, k] - 128 - lit * (mean[k] - 128)) for k in (1, 2)))
    dark = np.where(tint < MOST_CHROMA, np.log(share), OTHER_COLOR)
    return dark if scene.unseen is None else np.where(scene.unseen.ravel().take(pixels), OTHER_COLOR, dark)


def _dark_pixels(floor: LitView, mask: np.ndarray, pixel_cells: np.ndarray, n_cells: int) -> tuple[np.ndarray, np.ndarray]:
    """A silhouette's flat pixels that may be floor in a shadow, and the cells on which they look."""
    pixels = np.flatnonzero(mask)
    cells = pixel_cells.ravel().take(pixels)
    inside = cells < n_cells
    pixels, cells = pixels[inside], cells[inside]
    share = darkness(floor, pixels)
    some = (share > np.log(DARKEST)) & (share < 0)
    return pixels[some], cells[some]


def _shadowed(tables: CompletionTables, floors: dict[int, LitView], asked: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
    """By camera, the floor's cells that are in a shadow as it sees them; one more, beyond the floor, is not.

    Only told of the cells that are asked for, some of each camera's.
    """
    n_cells = tables.cells[0] * tables.cells[1]
    near = np.zeros(n_cells, np.uint8)
    for some in asked.values():
        near[some] = 1
    reach = np.ones((4 * (SPOT - 1) + 1,) * 2, np.uint8)  # as far as opening and closing look
    cells = np.flatnonzero(cv2.dilate(near.reshape(tables.cells), reach))
    seen = np.full((len(floors), len(cells)), _UNKNOWN)
    for row, (c, floor) in zip(seen, floors.items(), strict=True):
        pixels = tables.cell_pixels[c].take(cells)
        there = np.flatnonzero(pixels < floor.scene.mean[..., 0].size)
        row[there] = darkness(floor, pixels.take(there))
    bare = ((seen > np.log(BARE)) & (seen < OTHER_COLOR)).sum(axis=0)
    dark = (seen <= np.log(BARE)) & (seen >= np.log(DARKEST))
    most = dark.sum(axis=0) > bare
    square = np.ones((SPOT, SPOT), np.uint8)
    spots = {}
    for k, c in enumerate(floors):
        candidates = np.flatnonzero(most & dark[k])
        others = dark.take(candidates, axis=1)
        others[k] = False
        shares = seen.take(candidates, axis=1)
        agree = (others & (np.abs(shares - shares[k]) < AGREE)).sum(axis=0)
        found = np.zeros(n_cells, np.uint8)
        found[cells.take(candidates)] = agree >= np.maximum(1, AGREE_SHARE * others.sum(axis=0))
        spot = cv2.morphologyEx(found.reshape(tables.cells), cv2.MORPH_OPEN, square)
        spots[c] = np.append(cv2.morphologyEx(spot, cv2.MORPH_CLOSE, square).ravel() > 0, False)
    return spots


def _beside_people(tables: CompletionTables, masks: Sequence[np.ndarray | None], asked: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
    """By camera, those of some flat pixels that do not look at a place above the floor at which all cameras see people."""
    grid = tables.carving.grid
    voxels = voxels_of(carve(tables.carving, masks))
    voxels = voxels[voxels[:, 2] >= int(np.ceil(ABOVE_M / grid.voxel_size_m))]
    points, shown_at = grid.centres(voxels), pixels_at(tables.carving, voxels).astype(np.int64)
    beside = {}
    for c, pixels in asked.items():
        image, scale = shown(tables.carving.rig[c], points, shown_at[c])
        side = max(1, int(np.ceil(grid.voxel_size_m * scale)))
        box, places = _around(pixels, image.shape, side)
        beside[c] = pixels[cv2.dilate(image[box], np.ones((side, side), np.uint8)).ravel().take(places) == 0]
    return beside


def _around(pixels: np.ndarray, size: tuple[int, ...], margin: int) -> tuple[tuple[slice, slice], np.ndarray]:
    """The part of an image that holds some flat pixels and what is so near to them, and their flat places in it."""
    rows = pixels // size[1]
    columns = pixels - rows * size[1]  # much quicker than `divmod`
    top, left = max(0, int(rows.min()) - margin), max(0, int(columns.min()) - margin)
    right = min(size[1], int(columns.max()) + margin + 1)
    box = slice(top, int(rows.max()) + margin + 1), slice(left, right)
    return box, (rows - top) * (right - left) + columns - left


def _without(mask: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """A mask without some pixels, and without the specks that are left around them."""
    left = mask.copy()
    left.ravel()[pixels] = False
    box, _ = _around(pixels, mask.shape, AROUND // 2 + SPECK - 1)
    opened = cv2.morphologyEx(left[box].view(np.uint8), cv2.MORPH_OPEN, np.ones((SPECK, SPECK), np.uint8))
    changed = cv2.dilate((mask[box] & ~left[box]).view(np.uint8), np.ones((AROUND, AROUND), np.uint8))
    left[box] = np.where(changed > 0, opened > 0, left[box])
    return left
