"""A detector of colored markers: blobs whose color is that of labelled points (Canton 2009, section 6.6.2)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.errors import InputError

__all__ = ["MarkerColor", "MarkerColorSettings", "detect_markers", "learn_marker_color"]


@dataclass(frozen=True)
class MarkerColorSettings:
    """Settings of the detector.

    Parameters
    ----------
    threshold : float
        Largest Mahalanobis distance of a marker's color.
    radius_px : int
        Half-width of the neighbourhood of a labelled point of which the color is learnt.
    least_px : int
        Smallest blob, pixels.
    most : int
        Most detections an image; the largest blobs stay.
    spread : float
        Least standard deviation of Cr and Cb, in grey levels: what the sensor and other light add to what was labelled.
    background_gap : float
        With images of the empty scene: a pixel is a marker's only if it differs from the scene by this much in Cr or Cb.

    Raises
    ------
    InputError
        When a number is out of its range.
    """

    threshold: float = 3.0
    radius_px: int = 2
    least_px: int = 3
    most: int = 60
    spread: float = 4.0
    background_gap: float = 12.0

    def __post_init__(self) -> None:
        if min(self.threshold, self.spread, self.background_gap) <= 0 or min(self.radius_px, self.least_px, self.most) < 1:
            raise InputError(f"settings of the marker detector must be above 0; got {self}")


@dataclass(frozen=True)
class MarkerColor:
    """The color of markers: a Gaussian over Cr and Cb.

    Parameters
    ----------
    mean : ndarray, shape (2,)
    inverse : ndarray, shape (2, 2)
        Inverse of the covariance.
    """

    mean: np.ndarray
    inverse: np.ndarray


def learn_marker_color(samples: Iterable[tuple[np.ndarray, np.ndarray]], settings: MarkerColorSettings | None = None) -> MarkerColor:
    """Learn the markers' color from labelled points.

    Of the pixels around each point those count that are about as colorful as the most colorful of them, so that a point beside the
    marker's middle and what shows around a small marker do no harm.

    Parameters
    ----------
    samples : iterable of (ndarray, ndarray)
        Images (h, w, 3), BGR, each with its points (n, 2), pixels.
    settings : MarkerColorSettings, optional

    Returns
    -------
    MarkerColor

    Raises
    ------
    InputError
        When there is no point inside an image.
    """
    settings = settings or MarkerColorSettings()
    radius, pixels = settings.radius_px, []
    for image, points in samples:
        chroma = _chroma(image)
        for u, v in np.rint(points).astype(int):
            patch = chroma[max(v - radius, 0) : v + radius + 1, max(u - radius, 0) : u + radius + 1].reshape(-1, 2)
            if 0 <= u < image.shape[1] and 0 <= v < image.shape[0]:
                colorful = np.linalg.norm(patch - 128.0, axis=1)
                pixels.append(patch[colorful >= 0.7 * colorful.max()])
    if not pixels:
        raise InputError("no labelled marker lies inside an image; give points (frame, camera, u, v) on markers")
    values = np.concatenate(pixels)
    # Labels that missed are few: the median, and the deviation of the half that is nearest to it.
    mean = np.median(values, axis=0)
    off = np.linalg.norm(values - mean, axis=1)
    values = values[off <= 2.5 * max(float(np.median(off)), 1.0)]
    covariance = np.atleast_2d(np.cov(values.T)) if len(values) > 2 else np.zeros((2, 2))
    return MarkerColor(values.mean(axis=0), np.linalg.inv(covariance + settings.spread**2 * np.eye(2)))


def detect_markers(
    image: np.ndarray, color: MarkerColor, settings: MarkerColorSettings | None = None, background: np.ndarray | None = None
) -> np.ndarray:
    """Find markers in an image.

    Parameters
    ----------
    image : ndarray, shape (h, w, 3)
        BGR, uint8.
    color : MarkerColor
    settings : MarkerColorSettings, optional
    background : ndarray, shape (h, w, 3), optional
        The empty scene: what has the markers' color there already is no marker.

    Returns
    -------
    ndarray, shape (n, 2)
        Centroids of the blobs, weighed by how near each pixel's color is; pixels.
    """
    settings = settings or MarkerColorSettings()
    chroma = _chroma(image)
    off = chroma - color.mean.astype(np.float32)
    (a, b), (_, c) = color.inverse.astype(np.float32)
    squared = a * off[..., 0] ** 2 + 2 * b * off[..., 0] * off[..., 1] + c * off[..., 1] ** 2
    mask = squared <= settings.threshold**2
    if background is not None:
        mask &= (np.abs(chroma - _chroma(background)) >= settings.background_gap).any(axis=-1)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    area = stats[1:, cv2.CC_STAT_AREA]
    kept = 1 + np.argsort(-area, kind="stable")[: settings.most]
    kept = np.sort(kept[area[kept - 1] >= settings.least_px])
    if not len(kept):
        return np.zeros((0, 2))
    v, u = np.nonzero(mask)
    label = labels[v, u]
    weight = 1 - squared[v, u] / (settings.threshold**2 + 1e-3)
    total, along, down = (np.bincount(label, weight * value, count) for value in (1.0, u, v))
    return np.stack([along[kept], down[kept]], axis=1) / total[kept, None]


def _chroma(image: np.ndarray) -> np.ndarray:
    """Cr and Cb of an image, (h, w, 2), float32, lightly smoothed, as video halves their resolution anyway."""
    return cv2.blur(cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)[..., 1:], (3, 3)).astype(np.float32)
