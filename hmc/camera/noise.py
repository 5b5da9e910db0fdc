"""What is known of a camera's noise, and what follows from it for its segmentation.

A sensor's noise is rough: a small blur takes most of it away and little of a person. A video codec's is not: it shows the same value
for many frames and then another one for a whole block of 8 x 8 pixels, so that most pixels seem to have no noise at all and a few have
much. The deviation learnt at one pixel is then too small for what comes, and only the camera as a whole tells how large differences get.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

__all__ = ["Floor", "blur_for", "blurred", "is_grey", "left_of_noise", "noise_floor"]

#: Noise in grey levels of a channel from which on images are blurred, and by squares of which side.
BLURS = ((8.0, 5), (3.0, 3))
#: Share of a camera's pixels whose deviation is below the floor's measure, and share of that measure that every pixel has at least:
#: noise depends on brightness, and dark pixels may indeed have less.
COMMON, FLOOR_SHARE = 0.95, 0.8
#: Deviation of luma up to which the mixture is left to itself; beyond, its floor rises by so much for each grey level.
USUAL_DEVIATION, FLOOR_RISE = 2.0, 2.0
#: Least variance of the mixture, all three channels together: OpenCV's, and where a typical pixel shows less noise than any sensor has, so
#: that a codec or an averaging hides it. In between, of typical deviations between these, a mixture of both.
LEAST_VARIANCE, LEAST_HIDDEN_VARIANCE = 4.0, 12.0
HIDDEN_BELOW, SEEN_ABOVE = 1.6, 1.9
#: Variance of blue, green and red together for one of luma, and for one of chroma (both axes alike).
OF_LUMA, OF_CHROMA = 3.0, 5.7
#: Share of a deviation that averaging leaves at least: what is left of a codec's noise is not known for large squares.
LEAST_LEFT = 0.7
#: Each row and column of which one in so many tells; a pixel is colored if its channels differ by more than so many grey levels; an
#: image is, if more than this share of it is.
STEP = 8
LEAST_COLOR, MOST_COLORED = 8, 0.001


@dataclass(frozen=True)
class Floor:
    """The least noise that every pixel of one camera is taken to have.

    Attributes
    ----------
    deviation : ndarray of float32, shape (2,)
        Standard deviations of luma and of chroma.
    variance : float
        Blue, green and red together, for the mixture of Gaussians.
    """

    deviation: np.ndarray
    variance: float


def blur_for(frames: Sequence[np.ndarray]) -> int:
    """How far a camera's images are to be blurred.

    Parameters
    ----------
    frames : sequence of ndarray of uint8, shape (height, width, 3)
        A few in a row, without people.

    Returns
    -------
    int
        Side of the Gaussian, pixels; 0 where the noise asks for none, or where fewer than two frames of one size tell of any.
    """
    few = [frame[::2, ::2] for frame in frames]
    if len(few) < 2 or any(frame.shape != few[0].shape for frame in few):
        return 0
    squares = [np.mean(np.square(np.subtract(a, b, dtype=np.float32))) for a, b in pairwise(few)]
    noise = float(np.sqrt(np.mean(squares) / 2))
    return next((side for least, side in BLURS if noise >= least), 0)


def blurred(image: np.ndarray, side: int) -> np.ndarray:
    """The image, smoothed by a Gaussian of that side; the very image for 0."""
    return cv2.GaussianBlur(image, (side, side), 0) if side else image


def left_of_noise(factor: int) -> float:
    """Of a deviation, the share that is left where squares of so many pixels a side are averaged.

    White noise would leave 1 / factor, and a codec's, of whole blocks, all of it; of recordings by H.264 it was .62 to .9 at a factor of 2.
    """
    return max(float(factor**-0.5), LEAST_LEFT)


def noise_floor(deviation: np.ndarray, factor: int = 1) -> Floor:
    """The least noise of a camera, from what its pixels showed.

    Parameters
    ----------
    deviation : ndarray, shape (height, width, 2)
        Standard deviations of luma and chroma, each over frames of the empty scene and a few neighbours.
    factor : int
        How many times smaller the images are than the camera's.

    Returns
    -------
    Floor
    """
    sample = deviation[::4, ::4].reshape(-1, 2)
    common = np.quantile(sample, COMMON, axis=0)
    recorded = float(np.median(sample[:, 0])) / left_of_noise(factor)
    hidden = float(np.clip((SEEN_ABOVE - recorded) / (SEEN_ABOVE - HIDDEN_BELOW), 0, 1))
    share = min(1.0, FLOOR_RISE * max(0.0, 1 - USUAL_DEVIATION / max(float(common[0]), 1e-6)))
    luma, chroma = (share * common) ** 2
    least = LEAST_VARIANCE + hidden * (LEAST_HIDDEN_VARIANCE - LEAST_VARIANCE)
    return Floor((FLOOR_SHARE * common).astype(np.float32), max(least, float(OF_LUMA * luma + OF_CHROMA * chroma)))


def is_grey(image: np.ndarray) -> bool:
    """Whether a BGR image has no color, as from a monochrome camera."""
    few = image[::STEP, ::STEP].astype(np.int16)
    colored = np.ptp(few, axis=-1) > LEAST_COLOR
    return bool(colored.mean() <= MOST_COLORED)
