"""Person or shadow, told by the floor: how dark the other cameras see the spot behind a pixel.

A pixel that is darker than the empty scene and of its color is a person's or a shadow's, and one camera can only guess
(`hmc.camera.shade`). Where it looks at the floor, the others know: a shadow darkens the spot for whoever looks at it, and by as much,
as a floor scatters light all ways; behind a trouser leg they see the bare floor, brighter by all that this camera has lost of it. So the
guess is multiplied by the ratio of two likelihoods, of the light that the others see if it is a shadow and if it is a person. A pixel that
has lost next to no light tells nothing by that, and the guess stands.

Two cameras look at the same spot only where the empty scene has the same color there in both, but for what the one sees all of the floor
brighter or in another tint than the other. Else one of them sees a table before it, or a seat, or the wall behind.

Measured by ``python -m hmc.experiments run repairs``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.voxels.completion import CompletionTables
from hmc.voxels.floor_shadows import OTHER_COLOR, LitView, channels_at, darkness

__all__ = ["FloorEvidence", "floor_balance", "floor_evidence", "person_by_floor", "tell_shades"]

#: Two cameras see the same spot where the empty scene's luma differs by less than this factor (logarithm) and chroma by less than so many
#: grey levels, once their balance is taken off.
SAME_LUMA, SAME_CHROMA = 0.09, 5.0
#: Lights (logarithms of shares of the empty scene's) tell within these bounds.
LIGHT = (-0.7, 0.1)
#: The guess is no surer than this, as a logit.
MOST_LOGIT = 4.0
#: Deviation of what the others see (logarithms of shares of light), and the likelihood, against that of no deviation, of what is neither:
#: a spot that a third person shades, or that is hidden, or is on a seat and not on the floor. Between what drawn rooms ask for and what
#: furnished ones do (``python -m hmc.voxels.train_floor``; docs/accuracy.md).
SPREAD, UNLIKE = 0.055, 0.04
#: From this chance on it stays, as of the guess (`SegmentationSettings.least_chance`): a shadow of one camera is in no hull, but a leg that
#: it lost is out of the hull too.
LEAST_CHANCE = 0.4
#: The floor is asked of every so manieth pixel of each row and column.
EVERY_PX = 2
#: Spots of the floor by which cameras' colors are compared, about, and how often their balance is made better.
BALANCE_SPOTS, BALANCE_ROUNDS = 400, 3
#: Side of the squares that pieces hold which come or go, pixels.
SOLID_PX = 5


@dataclass(frozen=True)
class FloorEvidence:
    """What the floor tells of one camera's pixels.

    Attributes
    ----------
    pixels : ndarray of int, shape (n,)
        Flat; shades behind which some other camera sees the floor.
    guess : ndarray of float32, shape (n,)
        Logits of the chances.
    light, others : ndarray of float32, shape (n,)
        Logarithms of the shares of the empty scene's light that this camera sees in the pixel, and the others at the spot behind it, mean
        over those that see it.
    """

    pixels: np.ndarray
    guess: np.ndarray
    light: np.ndarray
    others: np.ndarray


def floor_balance(tables: CompletionTables, scenes: Mapping[int, np.ndarray]) -> dict[int, np.ndarray]:
    """How much more light and tint each camera sees of the empty floor than the rig does.

    Parameters
    ----------
    tables : CompletionTables
        Of the room and the rig.
    scenes : mapping of int to ndarray of float32, shape (height, width, 3)
        Luma and chroma of the empty scene, by camera.

    Returns
    -------
    dict of int to ndarray of float32, shape (3, 1)
        Luma (logarithm) and chroma (grey levels), by camera; zeros of one that sees no floor which another sees. In the median over spots,
        so it tells nothing of those of which one camera sees a table. The rig sees each spot in the median of cameras.
    """
    n_cells = tables.cells[0] * tables.cells[1]
    spots = np.arange(0, n_cells, max(1, n_cells // BALANCE_SPOTS))
    seen = np.full((len(scenes), 3, len(spots)), np.nan, np.float32)
    for colors, (c, scene) in zip(seen, scenes.items(), strict=True):
        pixels = tables.cell_pixels[c].take(spots)
        inside = pixels < scene.shape[0] * scene.shape[1]
        colors[:, inside] = _colors(scene, pixels[inside])
    shared = np.isfinite(seen[:, 0]).sum(axis=0) > 1
    has = np.isfinite(seen[:, 0, shared]).any(axis=1)
    seen = seen[has][..., shared]
    balance, more = np.zeros((len(scenes), 3, 1), np.float32), np.zeros((1, 3, 1), np.float32)
    for _ in range(BALANCE_ROUNDS if has.any() else 0):
        more = _median(seen - _median(seen - more, axis=0), axis=-1)
    balance[has] = more
    return dict(zip(scenes, balance, strict=True))


def _median(values: np.ndarray, axis: int) -> np.ndarray:
    """`numpy.nanmedian` along an axis that is kept and has a number everywhere; a quarter of its time, as nothing is looked at twice."""
    values = np.sort(values, axis=axis)  # with NaN last
    n = np.isfinite(values).sum(axis=axis, keepdims=True)
    middle = (np.take_along_axis(values, place, axis) for place in ((n - 1) // 2, n // 2))
    return np.asarray(sum(middle) / 2, values.dtype)


def floor_evidence(
    tables: CompletionTables,
    views: Sequence[LitView | None],
    chances: Sequence[np.ndarray | None],
    masks: Sequence[np.ndarray | None],
) -> dict[int, FloorEvidence]:
    """What the floor tells of all cameras' shades, by camera.

    Parameters
    ----------
    tables : CompletionTables
        Of the room and the rig.
    views : sequence of LitView or None
        One a camera (`hmc.voxels.floor_shadows.lit_views`).
    chances : sequence of ndarray of uint8, shape (height, width), or None
        Of each pixel that is a shade, how likely it is a person, of 255; 0 of all others. None of a camera that does not ask.
    masks : sequence of ndarray of bool, shape (height, width), or None
        Silhouettes so far: behind them nobody sees the floor.
    """
    known = {
        c: (view, np.zeros_like(mask, np.uint8) if chance is None else chance, mask)
        for c, (view, chance, mask) in enumerate(zip(views, chances, masks, strict=True))
        if view is not None and mask is not None
    }
    n_cells = tables.cells[0] * tables.cells[1]
    asked, near = {}, np.zeros(n_cells + 1, bool)
    for c, (_, chance, _) in known.items():
        few = chance[::EVERY_PX, ::EVERY_PX] > 0
        rows, columns = np.divmod(np.flatnonzero(few), few.shape[1])  # `numpy.nonzero` of an image takes several times as long
        pixels = EVERY_PX * (rows * chance.shape[1] + columns)
        cells = tables.pixel_cells[c].ravel().take(pixels)
        asked[c] = pixels[cells < n_cells], cells[cells < n_cells]
        near[asked[c][1]] = True
    spots = np.flatnonzero(near[:n_cells])
    place = np.zeros(n_cells, np.intp)
    place[spots] = np.arange(len(spots))
    balance = floor_balance(tables, {c: view.scene.mean for c, (view, _, _) in known.items()})
    floors = {c: _floor(view, mask, tables.cell_pixels[c].take(spots), asked[c][0], balance[c]) for c, (view, _, mask) in known.items()}
    found = {}
    for c, (pixels, cells) in asked.items():
        others = [floor for other, floor in floors.items() if other != c]
        light, n = _seen_by(others, place.take(cells), floors[c].shade_scene)
        told = np.flatnonzero((n > 0) & np.isfinite(floors[c].shade_light))
        chance = np.clip(known[c][1].ravel().take(pixels[told]) / np.float32(255), 1e-3, 1 - 1e-3)
        guess = np.clip(np.log(chance / (1 - chance)), -MOST_LOGIT, MOST_LOGIT)
        found[c] = FloorEvidence(pixels[told], guess, floors[c].shade_light[told], light[told] / n[told])
    return found


@dataclass(frozen=True)
class _Floor:
    """One camera's sight of some spots of the floor, and of its own shades.

    Attributes
    ----------
    light, shade_light : ndarray of float32, shapes (n_spots,) and (n_shades,)
        Logarithms of shares of the empty scene's light; NaN where a person hides the spot, the camera does not see it, or it has another
        color.
    scene, shade_scene : ndarray of float32, shapes (3, n_spots) and (3, n_shades)
        Luma's logarithm and chroma of the empty scene there, in the colors of the whole rig.
    """

    light: np.ndarray
    scene: np.ndarray
    shade_light: np.ndarray
    shade_scene: np.ndarray


def _colors(scene: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Luma's logarithm and chroma of the empty scene at flat pixels, shape (3, n)."""
    colors = channels_at(scene, pixels)
    np.log(np.maximum(colors[0], 1), out=colors[0])  # a black scene has no logarithm
    return colors


def _floor(view: LitView, mask: np.ndarray, spots: np.ndarray, shades: np.ndarray, balance: np.ndarray) -> _Floor:
    """Of the flat pixels of spots, beyond the image where they are not seen, and of shades."""
    seen = spots < mask.size
    pixels = np.concatenate([spots[seen], shades])
    light = darkness(view, pixels)
    light = np.where(light == OTHER_COLOR, np.float32(np.nan), np.clip(light, *LIGHT))
    colors = _colors(view.scene.mean, pixels) - balance
    n = np.count_nonzero(seen)
    at_spots, there = np.full((4, len(spots)), np.nan, np.float32), light[:n]
    there[mask.ravel().take(pixels[:n])] = np.nan
    at_spots[0, seen], at_spots[1:, seen] = there, colors[:, :n]
    return _Floor(at_spots[0], at_spots[1:], light[n:], colors[:, n:])


def _seen_by(cameras: Sequence[_Floor], spots: np.ndarray, scene: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the light that other cameras see at spots whose empty scene is the same to them, and how many these are."""
    light, n = np.zeros((2, len(spots)), np.float32)
    for other in cameras:
        seen = other.light.take(spots)
        luma, *chroma = (np.abs(other.scene[k].take(spots) - scene[k]) for k in range(3))
        same = (luma < SAME_LUMA) & (chroma[0] < SAME_CHROMA) & (chroma[1] < SAME_CHROMA) & np.isfinite(seen)
        light += np.where(same, seen, 0)
        n += same
    return light, n


def person_by_floor(evidence: FloorEvidence, spread: float = SPREAD, unlike: float = UNLIKE) -> np.ndarray:
    """How likely each pixel is a person's: float32, shape (n,)."""

    def likelihood(expected: np.ndarray | float) -> np.ndarray:
        return np.asarray(np.exp(-np.square(evidence.others - expected) / (2 * spread**2)) + unlike)

    # What is brighter than the empty scene is as bright as a spot can be.
    shadow, person = likelihood(np.minimum(evidence.light, 0)), likelihood(0.0)
    return np.asarray(person / (person + shadow * np.exp(-evidence.guess)), np.float32)


def tell_shades(
    tables: CompletionTables,
    views: Sequence[LitView | None],
    chances: Sequence[np.ndarray | None],
    masks: Sequence[np.ndarray | None],
) -> tuple[np.ndarray | None, ...]:
    """Silhouettes in which shades are what guess and floor together say.

    Parameters
    ----------
    tables, views, chances, masks
        As for `floor_evidence`.

    Returns
    -------
    tuple of ndarray of bool, shape (height, width), or None
        The very masks where nothing is told.
    """
    told: list[np.ndarray | None] = list(masks)
    for c, evidence in floor_evidence(tables, views, chances, masks).items():
        if len(evidence.pixels):
            mask, shades = np.asarray(masks[c]), np.asarray(chances[c])
            rows, columns = np.divmod(evidence.pixels, mask.shape[1])
            box = _around(rows, mask.shape[0]), _around(columns, mask.shape[1])
            places = rows // EVERY_PX - box[0].start // EVERY_PX, columns // EVERY_PX - box[1].start // EVERY_PX
            part, shade = mask[box], shades[box] > 0
            person, asked = _spread(places, person_by_floor(evidence), part.shape)
            came = _solid(asked & person & shade & ~part)
            gone = _solid(asked & ~person & shade & part)
            after = mask.copy()
            after[box] = (part | came) & ~gone
            told[c] = after
    return tuple(told)


def _around(places: np.ndarray, size: int) -> slice:
    """From the first to the last of some rows or columns, with a margin; begins where pixels are asked."""
    margin = EVERY_PX * SOLID_PX
    return slice(max(0, int(places.min()) - margin) // EVERY_PX * EVERY_PX, min(size, int(places.max()) + margin + 1))


def _spread(places: tuple[np.ndarray, np.ndarray], chances: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """From chances at some of every few pixels to an image: where it is likely a person, and what is near enough to be told at all."""
    weight, chance = np.zeros((2, *(-(-side // EVERY_PX) for side in size)), np.float32)
    weight[places], chance[places] = 1, chances
    weight, chance = cv2.GaussianBlur(weight, (3, 3), 0), cv2.GaussianBlur(chance, (3, 3), 0)
    answers = (2 * (weight > 0) + (chance > LEAST_CHANCE * weight)).astype(np.uint8)
    whole = answers.repeat(EVERY_PX, axis=0).repeat(EVERY_PX, axis=1)[: size[0], : size[1]]
    return whole == 3, whole >= 2


def _solid(pixels: np.ndarray) -> np.ndarray:
    """Pixels of pieces that hold a square; rims, of which shades at outlines are, go."""
    square = np.ones((SOLID_PX, SOLID_PX), np.uint8)
    some = pixels.view(np.uint8)
    return cv2.bitwise_and(cv2.dilate(cv2.morphologyEx(some, cv2.MORPH_OPEN, square), square), some).view(bool)
