"""Background initialisation: the empty scene from a recording with people in all frames.

A median over time needs every place to be free of people half of the time. People who move about in place do not grant that. What is
behind them comes back with exactly the same value each time it is uncovered, while cloth and skin change with every fold: so the value
taken is that on which the samples agree most closely, even if only a part of them does (the shortest interval that holds a given share of
the samples; "shorth" in statistics, Andrews et al. (1972), "Robust estimates of location").
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from hmc.errors import InputError

__all__ = ["masked_median", "stable_background"]

#: Rows of an image that are worked on at a time: bounds the memory.
ROWS = 64
#: The scene counts as seen where the agreeing samples differ by no more than this many times what they do in a typical place, and
#: always where they differ by no more than so many grey levels.
WIDEST = 4.0
LEAST_WIDTH = 3.0


def stable_background(images: Sequence[np.ndarray], share: float = 0.25) -> tuple[np.ndarray, np.ndarray]:
    """Value of each pixel on which the images agree most closely.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width, 3)
        Samples spread over the recording; some 30 are enough.
    share : float
        Least share of the images in which a place is free of people, above 0 and below 1.

    Returns
    -------
    background : ndarray of uint8, shape (height, width, 3)
    unseen : ndarray of bool, shape (height, width)
        Where the images do not agree closely enough, so that a person may have been there all the time; small gaps are closed. A person
        of one even color who never moves is taken for background.

    Raises
    ------
    InputError
        When there is no image.
    """
    if len(images) == 0:
        raise InputError("there is no image to find the background in")
    if not 0 < share < 1:
        raise InputError(f"`share` must lie between 0 and 1; got {share}")
    shape = images[0].shape
    background = np.empty(shape, np.uint8)
    width = np.empty(shape[:2], np.uint8)
    agreeing = max(1, round(share * len(images)))
    for top in range(0, shape[0], ROWS):
        rows = slice(top, top + ROWS)
        values = np.sort(np.stack([image[rows] for image in images], axis=-1), axis=-1)
        spans = values[..., agreeing - 1 :] - values[..., : values.shape[-1] - agreeing + 1]
        first = spans.argmin(axis=-1)[..., None]
        background[rows] = np.take_along_axis(values, first + agreeing // 2, axis=-1)[..., 0]
        width[rows] = np.take_along_axis(spans, first, axis=-1)[..., 0].max(axis=-1)
    doubtful = (width > max(LEAST_WIDTH, WIDEST * float(np.median(width)))).astype(np.uint8)
    side = 2 * (max(shape[:2]) // 160) + 1
    closing, opening = (cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (n, n)) for n in (2 * side + 1, side))
    closed = cv2.morphologyEx(cv2.medianBlur(doubtful, 5), cv2.MORPH_CLOSE, closing)
    return background, cv2.morphologyEx(closed, cv2.MORPH_OPEN, opening).view(bool)


def masked_median(images: Sequence[np.ndarray], hidden: Sequence[np.ndarray]) -> np.ndarray:
    """Median over images of each pixel where it is not hidden; over all images where it always is.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width, 3)
    hidden : sequence of ndarray of bool, shape (height, width)
        One an image.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Of an even number of values, the lower of the two in the middle.
    """
    result = np.empty_like(images[0])
    for top in range(0, len(result), ROWS):
        rows = slice(top, top + ROWS)
        stack = np.stack([image[rows] for image in images])
        out = np.stack([mask[rows] for mask in hidden])
        out &= ~out.all(axis=0)
        stack[out] = 255  # sorts behind every grey level, and equal ones need not be told apart
        middle = ((~out).sum(axis=0) - 1) // 2
        stack.sort(axis=0)
        result[rows] = np.take_along_axis(stack, middle[None, ..., None], axis=0)[0]
    return result
