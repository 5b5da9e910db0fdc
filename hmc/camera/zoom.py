"""Small images enlarged before silhouettes are completed, and what is found in them reduced again: there limbs are as thin as specks."""

from __future__ import annotations

import cv2
import numpy as np

__all__ = ["enlarged", "enlarged_mask", "reduced_mask"]


def enlarged(array: np.ndarray, zoom: int) -> np.ndarray:
    """An image or a map of the same values, so many times as wide and high."""
    if zoom == 1:
        return array
    large = cv2.resize(array, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC)
    return np.maximum(large, array.min())  # cubic curves swing beyond what they join


def enlarged_mask(mask: np.ndarray, zoom: int) -> np.ndarray:
    """A mask of 0 and 1 with smooth outlines, so many times as wide and high."""
    return mask if zoom == 1 else cv2.resize(mask * 255, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_LINEAR) // 128


def reduced_mask(mask: np.ndarray, zoom: int) -> np.ndarray:
    """The mask as it was before it was enlarged: 1 where half of a pixel is."""
    return mask if zoom == 1 else cv2.resize(mask * 255, None, fx=1 / zoom, fy=1 / zoom, interpolation=cv2.INTER_AREA) // 128
