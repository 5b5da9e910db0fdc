"""What a filter remembers of a person between two frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

__all__ = ["Cloud", "Departed"]


@dataclass(frozen=True)
class Cloud:
    """What a filter remembers of one person.

    Attributes
    ----------
    person : int
    points : ndarray, shape (n, 3)
        Particles (positions, metres) or samples (voxels); none where the filter has to begin anew.
    weights : ndarray, shape (n,)
        Sum to 1.
    histogram : ndarray, shape (n_colors,)
        Reference histogram of the person's colours, sums to 1; empty as long as nothing is known.
    """

    person: int
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    weights: np.ndarray = field(default_factory=lambda: np.zeros(0))
    histogram: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Departed:
    """Someone who left: the number, the last reference histogram, and the last frame in which they were seen."""

    person: int
    histogram: np.ndarray
    last_frame: int
