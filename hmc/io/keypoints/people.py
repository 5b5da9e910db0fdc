"""Raw points of a detector, checked and brought to pixels of the recording's images and to one order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hmc.io.keypoints.layouts import KEYPOINTS

__all__ = ["NOBODY", "RawPeople", "as_people", "confidence_outside", "is_normalised", "to_pixels"]

#: Confidences may lie this far outside of 0 to 1, as heat maps and bins give them; they are clipped.
LEAST_CONFIDENCE, MOST_CONFIDENCE = -0.1, 1.5
#: Points further outside of the image than this share of its size are no observations.
MARGIN = 0.25
#: Coordinates that are all below this are shares of the image's size: no person is 1.5 px large.
MOST_SHARE = 1.5
#: Points that must be given before coordinates can be told to be shares.
LEAST_SHARES = 3
#: Beyond, a number would overflow on the way, and is far outside of any image anyhow.
FAR_PX = 1e9

NOBODY = np.empty((0, len(KEYPOINTS), 3))
NOBODY.setflags(write=False)


class RawPeople(NamedTuple):
    """People as a file has them: ``points`` (n, 26, 3) in the order of `KEYPOINTS`, and the ``size`` (width, height) that the detector saw.

    A size of None is that of the recording's images.
    """

    points: np.ndarray
    size: tuple[float, float] | None = None


def as_people(points: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Points of one layout in the order of `KEYPOINTS`.

    Parameters
    ----------
    points : ndarray, shape (n, k, 3)
        x, y, confidence; NaN coordinates where a point is not given.
    order : ndarray of int, shape (k,)
        From `hmc.io.keypoints.layouts.places`.

    Returns
    -------
    ndarray, shape (n, 26, 3)
        Confidences clipped to 0..1; NaN with confidence 0 where a point is not given: no coordinates, no confidence, or exactly at
        (0, 0), which is how detectors leave a point out.

    Raises
    ------
    ValueError
        When a number is infinite, a confidence is far outside of 0..1, or one is NaN where there are coordinates.
    """
    people = np.full((len(points), len(KEYPOINTS), 3), (np.nan, np.nan, 0.0))
    used = order >= 0
    people[:, order[used]] = points[:, used]
    xy, confidence = people[..., :2], people[..., 2]
    given = ~np.isnan(xy).any(axis=-1)
    if np.isinf(people).any() or np.isnan(confidence[given]).any():
        raise ValueError("holds a number that is not finite; leave out what was not detected")
    bad = given & ~((confidence >= LEAST_CONFIDENCE) & (confidence <= MOST_CONFIDENCE))
    if bad.any():
        raise ValueError(f"has a confidence of {confidence[bad][0]:g}; they must lie between 0 and 1")
    given &= (confidence > 0) & xy.any(axis=-1)
    people[..., 2] = np.clip(confidence, 0, 1)
    people[~given] = (np.nan, np.nan, 0.0)
    return people


def is_normalised(people: np.ndarray) -> bool:
    """Whether coordinates, (..., 26, 3), are shares of the image's size, as MediaPipe gives them, and no pixels."""
    known = np.abs(people[people[..., 2] > 0][:, :2])
    return len(known) >= LEAST_SHARES and float(np.quantile(known, 0.9)) <= MOST_SHARE


def to_pixels(raw: RawPeople, size: tuple[int, int], normalised: bool) -> np.ndarray:
    """People in pixels of the recording's images.

    Parameters
    ----------
    raw : RawPeople
    size : tuple of int
        (width, height) of the recording's images.
    normalised : bool
        Coordinates are shares of the image, 0 at its left or upper border and 1 at the other.

    Returns
    -------
    ndarray, shape (n, 26, 3)
        Without points far outside of the image, and without people of whom no point is left.
    """
    people = _in_pixels(raw, size, normalised)
    inside = _inside(people, size)
    people[~inside] = (np.nan, np.nan, 0.0)
    return people[inside.any(axis=1)]


def confidence_outside(raw: RawPeople, size: tuple[int, int], normalised: bool) -> tuple[float, float]:
    """Confidence of the points that `to_pixels` leaves out as far outside of the image, and of all that are given; sums. Arguments as
    there."""
    people = _in_pixels(raw, size, normalised)
    return float(people[..., 2][~_inside(people, size)].sum()), float(people[..., 2].sum())


def _in_pixels(raw: RawPeople, size: tuple[int, int], normalised: bool) -> np.ndarray:
    people = raw.points.copy()
    xy = np.clip(people[..., :2], -FAR_PX, FAR_PX)
    if normalised:
        xy = xy * size - 0.5
    elif raw.size is not None and raw.size != size:
        # The border stays the border: the first pixel's centre is half a pixel inside.
        xy = (xy + 0.5) * (np.array(size) / raw.size) - 0.5
    people[..., :2] = xy
    return people


def _inside(people: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        within = (people[..., :2] >= -MARGIN * np.array(size)) & (people[..., :2] <= (1 + MARGIN) * np.array(size))
    return np.all(within, axis=-1)
