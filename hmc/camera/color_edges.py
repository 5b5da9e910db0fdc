"""Edges of color images: where colors differ, not where brightness does. Kehl (2006), section 4.2.

The distance of two colors is Euclidean where they are dark and the sine of the angle between them where both are bright (Wesolkowski and
Jernigan 1999); so shadows and folds, which change brightness and hardly the direction of a color, leave little. The gradient is that of
the difference-vector operator (Trahanias and Venetsanopoulos 1993; Yang 1995): the largest of the distances across a pixel, between the
four pairs of its neighbours that lie opposite.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from hmc.errors import InputError

__all__ = ["ColorEdgeSettings", "ColorEdges", "color_edges", "color_gradient"]

#: From the first to the second neighbour of each pair (rows down, columns right), and the direction it tells of, radians from x to y.
PAIRS = (((0, -1), (0, 1)), ((-1, -1), (1, 1)), ((-1, 0), (1, 0)), ((1, -1), (-1, 1)))
DIRECTIONS = np.radians([0.0, 45.0, 90.0, 135.0])
_MOST = 255 * np.sqrt(3)


@dataclass(frozen=True)
class ColorEdgeSettings:
    """Parameters of the edges.

    Parameters
    ----------
    bright : float
        Intensity (mean of the channels, 0 to 255) at which a color counts half as bright.
    slope : float
        How sharply, in one over grey levels.
    sigma_px : float
        Smoothing before; 0: none.
    threshold : float
        Least gradient of an edge, of at most 1.
    """

    bright: float = 50.0
    slope: float = 0.08
    sigma_px: float = 1.0
    threshold: float = 0.05


@dataclass(frozen=True)
class ColorEdges:
    """Edges one pixel wide.

    Parameters
    ----------
    strength : ndarray of float32, shape (h, w)
        Gradient on edges, 0 elsewhere.
    direction : ndarray of float32, shape (h, w, 2)
        Unit vector (u, v) across the edge, of either sign, 0 off edges.
    """

    strength: np.ndarray
    direction: np.ndarray


def color_gradient(image: np.ndarray, settings: ColorEdgeSettings | None = None) -> np.ndarray:
    """The difference-vector operator's four distances.

    Parameters
    ----------
    image : ndarray of uint8, shape (h, w, 3)
    settings : ColorEdgeSettings, optional

    Returns
    -------
    ndarray of float32, shape (4, h, w)
        Across each pixel along `DIRECTIONS`; 0 on the image's border. The gradient is the largest.

    Raises
    ------
    InputError
        When the image has no three channels.
    """
    settings = settings or ColorEdgeSettings()
    if image.ndim != 3 or image.shape[2] != 3:
        raise InputError(f"`image` must be (height, width, 3); got {image.shape}")
    smooth = cv2.GaussianBlur(image, (0, 0), settings.sigma_px) if settings.sigma_px > 0 else image
    planes = [np.ascontiguousarray(plane) for plane in np.moveaxis(smooth.astype(np.float32), -1, 0)]
    blue, green, red = planes
    square = blue * blue + green * green + red * red
    bright = _brightness((blue + green + red) / np.float32(3), settings)
    height, width = image.shape[:2]
    out = np.zeros((4, height, width), np.float32)
    if height < 3 or width < 3:
        return out
    for k, places in enumerate(PAIRS):
        a, b = (_shifted(height, width, *place) for place in places)
        dot = blue[a] * blue[b] + green[a] * green[b] + red[a] * red[b]
        out[k, 1:-1, 1:-1] = _distance(dot, square[a], square[b], bright[a], bright[b])
    return out


def color_edges(image: np.ndarray, settings: ColorEdgeSettings | None = None) -> ColorEdges:
    """Edges, thinned: what is a maximum across itself, and above the threshold.

    Parameters
    ----------
    image : ndarray of uint8, shape (h, w, 3)
    settings : ColorEdgeSettings, optional

    Returns
    -------
    ColorEdges
    """
    settings = settings or ColorEdgeSettings()
    distances = color_gradient(image, settings)
    height, width = image.shape[:2]
    strength, direction = np.zeros((height, width), np.float32), np.zeros((height, width, 2), np.float32)
    if height < 3 or width < 3:
        return ColorEdges(strength, direction)
    gradient = distances.max(axis=0)
    # Only pixels above the threshold, few of all, are looked at further.
    rows, columns = np.nonzero(gradient[1:-1, 1:-1] >= settings.threshold)
    rows, columns = rows + 1, columns + 1
    found = distances[:, rows, columns]
    along = found.argmax(axis=0)
    step = np.array([pair[1] for pair in PAIRS])[along]
    here = gradient[rows, columns]
    before, after = gradient[rows - step[:, 0], columns - step[:, 1]], gradient[rows + step[:, 0], columns + step[:, 1]]
    thin = (here >= before) & (here > after)
    rows, columns, found = rows[thin], columns[thin], found[:, thin]
    # A direction and its opposite are one, so angles are doubled to be averaged.
    angle = 0.5 * np.arctan2(found[1] - found[3], found[0] - found[2])
    strength[rows, columns] = here[thin]
    direction[rows, columns] = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return ColorEdges(strength, direction)


def _brightness(intensity: np.ndarray, settings: ColorEdgeSettings) -> np.ndarray:
    """Square root of how bright a color counts, 0 to 1, so that the product of two says how bright both are."""
    return 1 / np.sqrt(1 + np.exp(np.float32(settings.slope) * (np.float32(settings.bright) - intensity)))


def _distance(dot, square_a, square_b, bright_a, bright_b) -> np.ndarray:
    both = bright_a * bright_b
    sine = np.sqrt(np.maximum(1 - dot * dot / np.maximum(square_a * square_b, np.float32(1e-6)), 0))
    euclidean = np.sqrt(np.maximum(square_a + square_b - 2 * dot, 0)) / np.float32(_MOST)
    return both * sine + (1 - both) * euclidean


def _shifted(height: int, width: int, down: int, right: int) -> tuple[slice, slice]:
    """Every inner pixel's neighbour."""
    return slice(1 + down, height - 1 + down), slice(1 + right, width - 1 + right)
