"""The light of an image against that of the empty scene: exposure, flicker, white balance, a lamp at one side.

An image may be brighter, darker or of another tinge than the frames of the empty scene, as a whole or more so towards one side. That is one
factor a channel that changes smoothly over the image, and it is told beside people. Ours; that a change of the light scales each channel by
itself is von Kries's model (1902).
"""

from __future__ import annotations

import functools

import cv2
import numpy as np

__all__ = ["FEW", "as_image", "brought_back", "gains_of", "in_light_of", "is_same_light", "light_gains", "luma_chroma"]

#: Every so manieth pixel of each row and column tells of a whole image.
FEW = (slice(None, None, 16),) * 2
#: By less than this factor in each channel the light is the same.
LEAST_GAIN = 1.01
#: Grey levels from which on a pixel may be brighter than it looks, and below which a channel tells of no factor.
OVEREXPOSED, TOO_DARK = 250, 20
#: So many pixels must tell of a factor that changes over the image, and leave no more than this share of what one factor leaves: soft
#: shadows and what people reflect change the light of a part as well, by less.
LEAST_TOLD, LEAST_BETTER = 100, 0.5
#: The fit is weighted anew so many times; what is off by more than so many deviations hardly counts (Geman and McClure 1987): people.
ROUNDS, DEVIATIONS = 6, 3.0


def light_gains(image: np.ndarray, mean: np.ndarray, people: np.ndarray) -> np.ndarray:
    """By which factor an image is brighter than the empty scene in each channel, and how that changes over the image.

    One factor, or a polynomial of second order of the logarithms where that leaves half as much unexplained; by iteratively reweighted
    least squares, within what the image itself shows.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        BGR.
    mean : ndarray of float32, shape (height, width, 3)
        The empty scene (`hmc.camera.segmentation.BackgroundModel.mean`).
    people : ndarray of bool, shape (height, width)
        Where nothing is told.

    Returns
    -------
    ndarray of float32, shape (rows, columns, 3)
        At the pixels `FEW`; blue, green, red; 1 where nothing tells.
    """
    return gains_of(image[FEW], mean[FEW], people[FEW])


def gains_of(seen: np.ndarray, mean: np.ndarray, people: np.ndarray | None = None) -> np.ndarray:
    """`light_gains` of what an image, the empty scene and people are at the pixels `FEW`; by default nobody is there."""
    empty = as_image(np.ascontiguousarray(mean))
    told = (seen < OVEREXPOSED) & (empty >= TOO_DARK)
    if people is not None:
        told &= ~people[..., None]
    ratios = np.log(np.maximum(seen, 1) / np.maximum(empty, 1))
    gains = np.ones(seen.shape, np.float32)
    for channel in np.flatnonzero(~_is_same(ratios, told)):
        terms = _terms(*seen.shape[:2])
        here = told[..., channel].ravel()
        values = ratios[..., channel].ravel()[here]
        one = _fitted(terms[here, :1], values)
        gains[..., channel] = np.exp(one[0])
        if len(values) >= LEAST_TOLD:
            at = _fitted(terms[here], values)
            if _left(terms[here], values, at) <= LEAST_BETTER * _left(terms[here, :1], values, one):
                low, high = np.percentile(terms[here] @ at, (2, 98))
                gains[..., channel] = np.exp(np.clip(terms @ at, low, high)).reshape(seen.shape[:2])
    return gains


@functools.lru_cache(maxsize=8)
def _terms(n_rows: int, n_columns: int) -> np.ndarray:
    """What a polynomial of second order over an image is a sum of, shape (n_rows * n_columns, 6)."""
    y, x = (axis.ravel() for axis in np.meshgrid(np.linspace(-1, 1, n_rows), np.linspace(-1, 1, n_columns), indexing="ij"))
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    terms.setflags(write=False)
    return terms


def _is_same(ratios: np.ndarray, told: np.ndarray) -> np.ndarray:
    """Of each channel, whether most logarithms of factors (h, w, 3) that tell something, if any, are of the same light, in each quarter."""
    least, (height, width) = np.log(LEAST_GAIN), ratios.shape[:2]
    up, down = told & (ratios < least), told & (ratios > -least)
    same = np.ones(3, bool)
    for rows in (slice(-(-height // 2)), slice(-(-height // 2), None)):
        for columns in (slice(-(-width // 2)), slice(-(-width // 2), None)):
            half = _counts(told[rows, columns]) / 2
            for side in (up, down):  # as of their median
                same &= (_counts(side[rows, columns]) > half) | (half == 0)
    return same


def _counts(marked: np.ndarray) -> np.ndarray:
    """How many pixels are marked in each channel: (h, w, 3) to (3,). NumPy takes more than twice as long along so short an axis."""
    return np.array(cv2.sumElems(marked.view(np.uint8))[:3])


def _fitted(terms: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients (k,) of terms (n, k), the first of which is 1, for values (n,), of which many may be off."""
    at = np.r_[np.median(values), np.zeros(terms.shape[1] - 1)]
    for _ in range(ROUNDS):
        spread = 1.4826 * _left(terms, values, at) + 1e-3
        weighted = terms / (1 + ((values - terms @ at) / (DEVIATIONS * spread)) ** 2)[:, None] ** 2
        at = np.linalg.lstsq(weighted.T @ terms, weighted.T @ values, rcond=None)[0]
    return at


def _left(terms: np.ndarray, values: np.ndarray, at: np.ndarray) -> float:
    """By how much values are off, in the median."""
    return float(np.median(np.abs(values - terms @ at)))


def in_light_of(image: np.ndarray, mean: np.ndarray, people: np.ndarray) -> np.ndarray:
    """An image brought to the light of the empty scene (`light_gains`); itself where that is its own."""
    return brought_back(image, mean, light_gains(image, mean, people))


def brought_back(image: np.ndarray, mean: np.ndarray, gains: np.ndarray | None) -> np.ndarray:
    """An image brought to the light of the empty scene by gains that are known; itself where they are None or nearly 1."""
    if gains is None or is_same_light(gains):
        return image
    level = cv2.multiply(image, cv2.resize(1 / gains, image.shape[1::-1]), dtype=cv2.CV_8U)
    # What is overexposed may have been as bright as the scene is.
    return np.maximum(level, as_image(mean), out=level, where=image >= OVEREXPOSED)


def is_same_light(gains: np.ndarray) -> bool:
    """Whether gains (`light_gains`) are nearly 1."""
    return bool(np.all((gains > 1 / LEAST_GAIN) & (gains < LEAST_GAIN)))


def luma_chroma(image: np.ndarray) -> np.ndarray:
    """A BGR image in YCrCb, with luma 1 at least so that one may divide by it."""
    color = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)
    np.maximum(color[..., 0], 1, out=color[..., 0])
    return color


def as_image(mean: np.ndarray) -> np.ndarray:
    """The background as a BGR image."""
    return cv2.cvtColor(cv2.convertScaleAbs(mean), cv2.COLOR_YCrCb2BGR)
