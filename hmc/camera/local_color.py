"""Which pixels look like the people of a recording and not like what surrounds them there.

A person's color is rarely unique in a whole image: skin before a beige wall, black trousers before a black door. But a limb that stands
before a mat differs from the mat, and has the colors that the same people show elsewhere. So a pixel's color is compared with all the
people's colors on the one hand, and on the other with those of the pixels on rings around it that are wider than a limb: a ratio of
kernel density estimates (Elgammal et al. (2000), "Non-parametric model for background subtraction", take the same over time).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

__all__ = ["Palette", "learn_palette", "looks_like_people", "looks_like_surroundings", "looks_unlike_surroundings"]

#: Spread of the kernels, grey levels, and the density that any color has.
SPREAD = 12.0
ANY_COLOR = 1e-3
#: Radii of the rings on which a limb's surroundings are looked at, pixels of an image whose longer side is 320, and points on each.
LIMB_RINGS = (12, 18, 26), 8
#: The same of a person's surroundings.
PERSON_RINGS = (18, 32, 48, 64, 80), 12
#: People's colors: so many cluster centres, of at most so many pixels.
COLORS = 16
MOST_PIXELS = 5000


@dataclass(frozen=True)
class Palette:
    """People's colors.

    Attributes
    ----------
    colors : ndarray, shape (k, 3)
    shares : ndarray, shape (k,)
        Of the pixels; they add up to 1.
    """

    colors: np.ndarray
    shares: np.ndarray


def learn_palette(pixels: Sequence[np.ndarray]) -> Palette | None:
    """People's colors.

    Parameters
    ----------
    pixels : sequence of ndarray of uint8, shape (n, 3)
        Of one camera's images.

    Returns
    -------
    Palette or None
        None for too few pixels.
    """
    # Imported here: it takes longer than all of hmc, and only a scene that was never seen empty needs it.
    from sklearn.cluster import KMeans

    colors = np.concatenate(pixels).astype(np.float32)
    if len(colors) < COLORS:
        return None
    if len(colors) > MOST_PIXELS:
        colors = colors[np.linspace(0, len(colors) - 1, MOST_PIXELS).astype(int)]
    clusters = KMeans(COLORS, n_init=1, random_state=0).fit(colors)
    return Palette(clusters.cluster_centers_, np.bincount(clusters.labels_, minlength=COLORS) / len(colors))


def looks_like_people(image: np.ndarray, people: np.ndarray, palette: Palette, where: np.ndarray, log_ratio: float = 1.0) -> np.ndarray:
    """Where a pixel has the color of people rather than that of its surroundings.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
    people : ndarray of bool, shape (height, width)
        Where people may be, as far as is known: these pixels are no person's surroundings.
    palette : Palette
    where : ndarray of bool, shape (height, width)
        The pixels that are asked.
    log_ratio : float
        Natural logarithm of the likelihood ratio from which a pixel counts.

    Returns
    -------
    ndarray of bool, shape (height, width)
        False of pixels that are not asked.
    """
    theirs, here = _densities(image, people, palette, where, LIMB_RINGS)
    return _at(where, theirs > np.exp(log_ratio) * here)


def looks_like_surroundings(
    image: np.ndarray, people: np.ndarray, palette: Palette, where: np.ndarray, log_ratio: float = 1.5
) -> np.ndarray:
    """Where a pixel has the color of what surrounds the people, further away, rather than that of people.

    Parameters
    ----------
    image, people, palette, where, log_ratio
        As of `looks_like_people`.

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    theirs, here = _densities(image, people, palette, where, PERSON_RINGS)
    return _at(where, here > np.exp(log_ratio) * theirs)


def looks_unlike_surroundings(image: np.ndarray, people: np.ndarray, where: np.ndarray, most: float = 0.05) -> np.ndarray:
    """Where a pixel has a color that hardly anything around the people has, whatever colors people have.

    Parameters
    ----------
    image, people, where
        As of `looks_like_people`; `people` holds all that may be a part of them.
    most : float
        Density of the pixel's color among its surroundings, 1 where all are of just this color, up to which it counts.

    Returns
    -------
    ndarray of bool, shape (height, width)
        False also where people hide all of the surroundings.
    """
    density, seen = _surroundings(image, people, where, PERSON_RINGS)
    return _at(where, (seen > 0) & (density < most))


def _at(where: np.ndarray, answers: np.ndarray) -> np.ndarray:
    mask = np.zeros(where.shape, bool)
    mask[where] = answers
    return mask


def _densities(
    image: np.ndarray, people: np.ndarray, palette: Palette, where: np.ndarray, rings: tuple[tuple[int, ...], int]
) -> tuple[np.ndarray, np.ndarray]:
    """Density of some pixels' colors among people's, and among what is on rings around each and no person; shapes (n,)."""
    own = _planes(image[where])
    theirs = np.zeros(own.shape[1], np.float32)
    for share, color in zip(palette.shares, palette.colors, strict=True):
        theirs += np.float32(share) * _kernel(own, _planes(color[None]))
    return theirs + ANY_COLOR, _surroundings(image, people, where, rings)[0] + ANY_COLOR


def _surroundings(
    image: np.ndarray, people: np.ndarray, where: np.ndarray, rings: tuple[tuple[int, ...], int]
) -> tuple[np.ndarray, np.ndarray]:
    """Density of some pixels' colors among those pixels of rings around each that are in the image and free of people, and their number;
    shapes (n,)."""
    radii, n = rings
    reach = max(where.shape) / 320
    # With nothing that counts all around the image, no ring needs a test of where it ends.
    margin = 4 * (round(max(radii) * reach),)
    picture = _planes(cv2.copyMakeBorder(image, *margin, cv2.BORDER_CONSTANT).reshape(-1, 3))
    free = cv2.copyMakeBorder((~people).astype(np.float32), *margin, cv2.BORDER_CONSTANT).ravel()
    rows, columns = np.nonzero(where)
    width = where.shape[1] + 2 * margin[0]
    pixels = (rows + margin[0]) * width + columns + margin[0]
    own = picture[:, pixels]
    density, weight = np.zeros((2, len(pixels)), np.float32)
    for turn, radius in enumerate(radii):
        for angle in 2 * np.pi * (np.arange(n) + turn / len(radii)) / n:
            there = pixels - (round(radius * reach * np.sin(angle)) * width + round(radius * reach * np.cos(angle)))
            counts = free.take(there)
            weight += counts
            counts *= _kernel(own, [plane.take(there) for plane in picture])
            density += counts
    return density / np.maximum(weight, 1), weight


def _planes(colors: np.ndarray) -> np.ndarray:
    """Colors (n, 3) channel by channel, (3, n), such that the kernel's exponent is their squared distance."""
    return np.ascontiguousarray(colors.T, np.float32) / np.float32(np.sqrt(2) * SPREAD)


def _kernel(one: Iterable[np.ndarray], other: Iterable[np.ndarray]) -> np.ndarray:
    """Gaussian of the difference of colors as of `_planes`, 1 at none; shape (n,)."""
    exponent = np.float32(0)
    for here, there in zip(one, other, strict=True):
        apart = here - there
        apart *= apart
        exponent = exponent - apart
    return np.exp(exponent)
