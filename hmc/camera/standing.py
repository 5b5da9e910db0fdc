"""A person who stands: where, how tall, and how wide at each height, as a body of revolution that looks the same from all sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["APART_M", "PROFILE", "Standing", "half_width"]

#: Half width of a standing person over the height above the floor, both in statures.
PROFILE = np.array([[0.0, 0.08], [0.25, 0.07], [0.45, 0.09], [0.55, 0.10], [0.80, 0.115], [0.84, 0.07], [1.0, 0.055]])
#: Two people are not nearer to each other, metres.
APART_M = 0.4


@dataclass(frozen=True)
class Standing:
    """A place at which a person may stand.

    Attributes
    ----------
    x, y : float
        World, metres.
    stature_m : float
    """

    x: float
    y: float
    stature_m: float


def half_width(height: np.ndarray, stature_m: float) -> np.ndarray:
    """Half width of a standing person at heights above the floor, all in metres; 0 above the head."""
    share = np.asarray(height) / stature_m
    return np.where(share <= 1, np.interp(share, *PROFILE.T) * stature_m, 0.0)
