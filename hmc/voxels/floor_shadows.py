"""Shadows on the floor, told from people by all cameras: a spot of the floor is as dark to whoever looks at it.

A deep shadow before a person's feet looks to one camera as dark trousers would: the floor's color, much darker. It is in all silhouettes,
so it is in the hull, and joins people who stand together. To a rig the two are not the same:

- A shadow lies on the floor. Most cameras that look at the same spot see it darkened, and by as much, as a floor scatters light all ways;
  of the spot behind a leg they see the bare floor, or something of another darkness.
- A shadow fills no room. The line of sight to it meets no place, a quarter of a metre and more above the floor, at which all cameras see
  people.

Pixels of which both hold leave the silhouettes (`cut_floor_shadows`). What a camera filled for its darkness alone needs less to leave
(`cut_filled_shadows`): that most cameras doubt the spot on which it lies, as they do under a chair, where the line of sight meets legs.
Measured by ``python -m hmc.experiments run repairs``.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from hmc.camera.segmentation import BackgroundModel, light_gain
from hmc.voxels.carving import carve, pixels_at
from hmc.voxels.completion import CompletionTables, doubted_floor, shown

__all__ = ["cut_filled_shadows", "cut_floor_shadows", "floor_darkness"]

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
_UNKNOWN, _OTHER = np.float32(np.nan), np.float32(9)


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
    sure = [mask if mask is None or fill is None else mask & ~fill for mask, fill in zip(masks, filled, strict=True)]
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
    tables: CompletionTables, darkness: Sequence[np.ndarray | None], masks: Sequence[np.ndarray | None]
) -> tuple[np.ndarray | None, ...]:
    """Silhouettes without the shadows on the floor.

    Parameters
    ----------
    tables : CompletionTables
        Of the room and the rig.
    darkness : sequence of ndarray of float32, shape (height, width), or None
        As from `floor_darkness`, one a camera; None of a camera that does not know the empty scene.
    masks : sequence of ndarray of bool, shape (height, width), or None

    Returns
    -------
    tuple of ndarray of bool, shape (height, width), or None
        Each within the mask it came from. With fewer than two cameras that know the empty floor, the masks as they are.
    """
    told = {c: values for c, values in enumerate(darkness) if values is not None and masks[c] is not None}
    if len(told) < 2:
        return tuple(masks)
    spots, dark = _shadowed(tables, told), {}
    for c, values in told.items():
        pixels = np.flatnonzero(np.asarray(masks[c]))
        pixels = pixels[spots[c].take(tables.pixel_cells[c].ravel().take(pixels))]
        share = values.ravel().take(pixels)
        dark[c] = pixels[(share > np.log(DARKEST)) & (share < 0)]
    if not any(map(len, dark.values())):
        return tuple(masks)
    cut = list(masks)
    standing = _standing(tables, masks)
    for c, pixels in dark.items():
        pixels = pixels[standing[c].ravel().take(pixels) == 0]
        if len(pixels):
            cut[c] = _without(np.asarray(masks[c]), pixels)
    return tuple(cut)


def floor_darkness(image: np.ndarray, model: BackgroundModel, mask: np.ndarray) -> np.ndarray:
    """How dark each pixel is against the empty scene.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        BGR.
    model : BackgroundModel
    mask : ndarray of bool, shape (height, width)
        The silhouette: how bright the whole image is, is told beside it.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Logarithm of the share of the empty scene's light; 9 where the pixel has another color as well.
    """
    color = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb), (3, 3), 0).astype(np.float32)
    share = np.maximum(color[..., 0], 1) / model.mean[..., 0]
    share /= light_gain(image, model.mean, mask)  # exposure, flicker
    lit = np.minimum(share, 1)  # chroma shrinks with the light
    tint = np.maximum(*(np.abs(color[..., k] - 128 - lit * (model.mean[..., k] - 128)) for k in (1, 2)))
    dark = np.where(tint < MOST_CHROMA, np.log(share), _OTHER)
    return dark if model.unseen is None else np.where(model.unseen, _OTHER, dark)


def _shadowed(tables: CompletionTables, darkness: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
    """By camera, the floor's cells that are in a shadow as it sees them; one more, beyond the floor, is not."""
    seen = np.stack([np.append(dark.ravel(), _UNKNOWN).take(tables.cell_pixels[c]) for c, dark in darkness.items()])
    bare = ((seen > np.log(BARE)) & (seen < _OTHER)).sum(axis=0)
    dark = (seen <= np.log(BARE)) & (seen >= np.log(DARKEST))
    most = dark.sum(axis=0) > bare
    square = np.ones((SPOT, SPOT), np.uint8)
    spots = {}
    for k, c in enumerate(darkness):
        others = dark.copy()
        others[k] = False
        agree = (others & (np.abs(seen - seen[k]) < AGREE)).sum(axis=0)
        found = most & dark[k] & (agree >= np.maximum(1, AGREE_SHARE * others.sum(axis=0)))
        cells = cv2.morphologyEx(found.view(np.uint8).reshape(tables.cells), cv2.MORPH_OPEN, square)
        cells = cv2.morphologyEx(cells, cv2.MORPH_CLOSE, square)
        spots[c] = np.append(cells.ravel() > 0, False)
    return spots


def _standing(tables: CompletionTables, masks: Sequence[np.ndarray | None]) -> dict[int, np.ndarray]:
    """By camera, where it looks at places above the floor at which all cameras see people, 1 or 0."""
    grid = tables.carving.grid
    hull = carve(tables.carving, masks)
    hull[..., : int(np.ceil(ABOVE_M / grid.voxel_size_m))] = False
    voxels = np.argwhere(hull)
    points, pixels = grid.centres(voxels), pixels_at(tables.carving, voxels).astype(np.int64)
    standing = {}
    for c, mask in enumerate(masks):
        if mask is not None:
            image, scale = shown(tables.carving.rig[c], points, pixels[c])
            side = max(1, int(np.ceil(grid.voxel_size_m * scale)))
            standing[c] = cv2.dilate(image, np.ones((side, side), np.uint8))
    return standing


def _without(mask: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """A mask without some pixels, and without the specks that are left around them."""
    left = mask.copy()
    left.ravel()[pixels] = False
    opened = cv2.morphologyEx(left.view(np.uint8), cv2.MORPH_OPEN, np.ones((SPECK, SPECK), np.uint8))
    changed = cv2.dilate((mask & ~left).view(np.uint8), np.ones((AROUND, AROUND), np.uint8))
    return np.where(changed > 0, opened > 0, left)
