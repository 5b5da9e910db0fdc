"""Which pixels look like the people of a recording and not like what surrounds them there.

A person's color is rarely unique in a whole image: skin before a beige wall, black trousers before a black door. But a limb that stands
before a mat differs from the mat, and has the colors that the same people show elsewhere. So a pixel's color is compared with all the
people's colors on the one hand, and on the other with those of the pixels on rings around it that are wider than a limb: a ratio of
kernel density estimates (Elgammal et al. (2000), "Non-parametric model for background subtraction", take the same over time).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

__all__ = ["Palette", "learn_palette", "looks_like_people", "looks_like_surroundings"]

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


def looks_like_people(image: np.ndarray, people: np.ndarray, palette: Palette, log_ratio: float = 1.0) -> np.ndarray:
    """Where a pixel has the color of people rather than that of its surroundings.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
    people : ndarray of bool, shape (height, width)
        Where people may be, as far as is known: these pixels are no person's surroundings.
    palette : Palette
    log_ratio : float
        Natural logarithm of the likelihood ratio from which a pixel counts.

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    theirs, here = _densities(image, people, palette, *LIMB_RINGS)
    return theirs > np.exp(log_ratio) * here


def looks_like_surroundings(image: np.ndarray, people: np.ndarray, palette: Palette, log_ratio: float = 1.5) -> np.ndarray:
    """Where a pixel has the color of what surrounds the people, further away, rather than that of people.

    Parameters
    ----------
    image, people, palette, log_ratio
        As of `looks_like_people`.

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    theirs, here = _densities(image, people, palette, *PERSON_RINGS)
    return here > np.exp(log_ratio) * theirs


def _densities(image: np.ndarray, people: np.ndarray, palette: Palette, radii: tuple[int, ...], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Density of each pixel's color among people's, and among what is on rings around it and no person."""
    picture = image.astype(np.float32)
    theirs = sum(share * _kernel(picture - color.astype(np.float32)) for share, color in zip(palette.shares, palette.colors, strict=True))
    return theirs + ANY_COLOR, _surroundings(picture, (~people).astype(np.float32), radii, n) + ANY_COLOR


def _surroundings(picture: np.ndarray, free: np.ndarray, radii: tuple[int, ...], n: int) -> np.ndarray:
    """Density of each pixel's color among those pixels of rings around it, `n` on each, that are free of people."""
    height, width = free.shape
    density, weight = np.zeros_like(free), np.zeros_like(free)
    reach = max(height, width) / 320
    for turn, radius in enumerate(radii):
        for angle in 2 * np.pi * (np.arange(n) + turn / len(radii)) / n:
            right, down = round(radius * reach * np.cos(angle)), round(radius * reach * np.sin(angle))
            # What a pixel has to its left and above is the picture moved right and down.
            here = np.s_[max(0, down) : height + min(0, down), max(0, right) : width + min(0, right)]
            there = np.s_[max(0, -down) : height + min(0, -down), max(0, -right) : width + min(0, -right)]
            density[here] += free[there] * _kernel(picture[here] - picture[there])
            weight[here] += free[there]
    return density / np.maximum(weight, 1)


def _kernel(difference: np.ndarray) -> np.ndarray:
    """Gaussian of a difference of colors, 1 at none."""
    return cv2.exp(cv2.transform(cv2.multiply(difference, difference), np.full((1, 3), -0.5 / SPREAD**2)))
