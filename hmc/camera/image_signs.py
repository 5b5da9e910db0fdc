"""What an image alone tells of its camera: that nothing changes in it, that it is dark, that the camera points elsewhere than it did.

All is told of small grey images. What people do in them is a small part; where a camera was turned, the walls move, in all four quarters.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

__all__ = ["image_shift", "is_dark", "is_repeated", "small_gray"]

#: The longer side of small images, pixels.
SIDE_PX = 320
#: An image is repeated where no pixel of the small one differs by more grey levels: noise that is averaged over 2 x 2 pixels does.
SAME = 1
#: A dark image is no brighter than this share of the usual one, and shows no more of its contrast.
DARK, FLAT = 0.12, 0.25
#: A quarter has moved by so much at least, pixels of a small image, where the peak of the correlation is this high: of an empty scene
#: against itself it is .6 to .9, of what has nothing in common below .1.
LEAST_PX, PEAK = 0.5, 0.25
#: Quarters that must have moved.
LEAST_QUARTERS = 3


def small_gray(image: np.ndarray) -> np.ndarray:
    """A small grey image, uint8, (h, w), of a BGR one, (H, W, 3); its longer side is at most 320 pixels."""
    scale = min(1.0, SIDE_PX / max(image.shape[:2]))
    size = (max(2, round(image.shape[1] * scale)), max(2, round(image.shape[0] * scale)))
    return np.asarray(cv2.cvtColor(cv2.resize(image, size, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY))


def is_repeated(image: np.ndarray, before: np.ndarray) -> bool:
    """Whether a small image is the one before it, as a frozen camera sends it, or a video that repeats frames."""
    return cv2.norm(image, before, cv2.NORM_INF) <= SAME


def is_dark(image: np.ndarray, usual: np.ndarray) -> bool:
    """Whether an image shows nothing, compared with a usual one of the same camera.

    Parameters
    ----------
    image, usual : ndarray, any shape
        Brightness of the same pixels, grey levels.
    """
    return float(image.mean()) < DARK * float(usual.mean()) and float(image.std()) < FLAT * float(usual.std())


def image_shift(reference: np.ndarray, image: np.ndarray) -> float:
    """By how far a small image is moved against another of the same camera, pixels of small images.

    Each quarter's shift is where its phase correlation peaks. A camera that is turned about its line of sight moves quarters each its own
    way.

    Parameters
    ----------
    reference, image : ndarray of uint8, shape (h, w)

    Returns
    -------
    float
        The median over the quarters that moved; 0 where fewer than three did; NaN where too few quarters tell.
    """
    height, width = (side // 2 for side in reference.shape)
    found = []
    for top, left in ((0, 0), (0, 1), (1, 0), (1, 1)):
        part = slice(top * height, (top + 1) * height), slice(left * width, (left + 1) * width)
        found.append(_quarter_shift(reference[part].astype(np.float32), image[part].astype(np.float32)))
    known = np.array([one for one in found if not np.isnan(one)])
    if len(known) < LEAST_QUARTERS:
        return float("nan")
    moved = known[known >= LEAST_PX]
    return float(np.median(moved)) if len(moved) >= LEAST_QUARTERS else 0.0


def _quarter_shift(reference: np.ndarray, image: np.ndarray) -> float:
    """How far one quarter has moved, pixels; NaN where it does not tell."""
    (right, down), peak = cv2.phaseCorrelate(reference, image, _window(reference.shape))
    return float(np.hypot(right, down)) if peak >= PEAK else float("nan")


@cache
def _window(shape: tuple[int, int]) -> np.ndarray:
    return np.asarray(cv2.createHanningWindow(shape[::-1], cv2.CV_32F))
