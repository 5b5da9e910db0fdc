"""OpenCV's mixture of Gaussians, asked only where an image is not plainly the empty scene."""

from __future__ import annotations

import cv2
import numpy as np

__all__ = ["FOREGROUND", "SHADOW", "ask_mixture", "coarse", "same"]

#: What the mixture answers a pixel.
SHADOW, FOREGROUND = 127, 255
#: Where the image is the empty scene to within so many grey levels of each channel, on the mean over squares of this side (pixels of a
#: 640 x 480 image) and those around, the mixture is not asked: it sees no foreground there but specks (its least variance asks for a
#: difference of six levels over the three channels).
SAME_LEVELS, SAME_PX = 3, 4
#: OpenCV's mixture can be told where not to look, in newer versions.
_LOOKS_AWAY = "knownForegroundMask" in (cv2.BackgroundSubtractorMOG2.apply.__doc__ or "")


def ask_mixture(mixture: cv2.BackgroundSubtractorMOG2, image: np.ndarray, scene: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the mixture says of an image, and where that is foreground, 1 or 0; nothing is learnt.

    Parameters
    ----------
    mixture : cv2.BackgroundSubtractorMOG2
    image : ndarray of uint8, shape (height, width, 3)
        BGR.
    scene : ndarray of uint8
        `coarse` of the empty scene.

    Returns
    -------
    answer, found : ndarray of uint8, shape (height, width)
    """
    skipped = same(image, scene)
    if _LOOKS_AWAY:
        answer = mixture.apply(image, knownForegroundMask=skipped, learningRate=0)
    else:
        answer = mixture.apply(image, learningRate=0)
    answer = cv2.subtract(answer, skipped, dst=answer)
    return answer, cv2.threshold(answer, FOREGROUND - 1, 1, cv2.THRESH_BINARY)[1]


def same(image: np.ndarray, scene: np.ndarray) -> np.ndarray:
    """Where an image is the empty scene at a `coarse` look, 255, or not, 0; uint8, shape (height, width)."""
    levels = (SAME_LEVELS,) * 3
    alike = cv2.erode(cv2.inRange(cv2.absdiff(coarse(image), scene), (0, 0, 0), levels), np.ones((3, 3), np.uint8))
    return np.asarray(cv2.resize(alike, image.shape[1::-1], interpolation=cv2.INTER_NEAREST))


def coarse(image: np.ndarray) -> np.ndarray:
    """An image, uint8, (height, width, 3), in squares of their mean."""
    for _ in range(max(1, round(np.log2(SAME_PX * max(image.shape[:2]) / 640)))):  # halving twice is quicker than a quarter at once
        image = cv2.resize(image, (max(1, image.shape[1] // 2), max(1, image.shape[0] // 2)), interpolation=cv2.INTER_AREA)
    return image
