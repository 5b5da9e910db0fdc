"""Two people in one set of voxels: those who hold each other when they are first seen.

Beyond Canton (2009), whose tracker makes one track of them until they part. A set that is too large for one person and has two heads is
cut in two between them.
"""

from __future__ import annotations

import numpy as np

__all__ = ["cut_between"]

#: Both heads are at least so high, metres: furniture and people who sit at it are not taken apart.
LEAST_TOP_M = 1.4
#: The smaller one's height, as a share of the taller one's.
LEAST_SHARE = 0.8
#: Trunks, and heads, of two people are at least so far apart, metres.
LEAST_TRUNKS_M, LEAST_HEADS_M = 0.22, 0.18
#: Seen from above, the highest so many metres of each cover so many square metres: a head, not a raised hand.
CROWN_M, LEAST_CROWN_M2 = 0.2, 0.025
ROUNDS = 10


def cut_between(points: np.ndarray, voxel_size_m: float) -> tuple[np.ndarray, float] | None:
    """Where a set of voxels is cut so that each side is one person.

    The upper half of the set is parted into two clusters along its longer axis; each side must have a head of its own.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Centres of voxels of the strict hull, at least one; world, metres.
    voxel_size_m : float

    Returns
    -------
    axis : ndarray, shape (2,)
        Horizontal, of unit length.
    limit : float
        The points of which the product with the axis is at most this are on the first side. None where there is one person only.
    """
    top = points[:, 2].max()
    upper = points[points[:, 2] > top / 2, :2]
    if top < LEAST_TOP_M or len(upper) < 2:
        return None
    axis = np.linalg.eigh(np.cov(upper.T))[1][:, -1]
    along = upper @ axis
    low, high = np.percentile(along, (10, 90))
    for _ in range(ROUNDS):
        first = along <= (low + high) / 2
        low, high = along[first].mean(), along[~first].mean() if not first.all() else high
    limit = (low + high) / 2
    sides = [points[beside] for beside in (points[:, :2] @ axis <= limit, points[:, :2] @ axis > limit)]
    if high - low < LEAST_TRUNKS_M or min(len(side) and side[:, 2].max() for side in sides) < max(LEAST_TOP_M, LEAST_SHARE * top):
        return None
    if min(_area(side[side[:, 2] > side[:, 2].max() - CROWN_M, :2], voxel_size_m) for side in sides) < LEAST_CROWN_M2:
        return None
    heads = [side[side[:, 2] > side[:, 2].max() - CROWN_M / 2, :2].mean(axis=0) for side in sides]
    return (axis, float(limit)) if np.hypot(*(heads[0] - heads[1])) >= LEAST_HEADS_M else None


def _area(places: np.ndarray, voxel_size_m: float) -> float:
    """What voxels cover seen from above, square metres."""
    return len(np.unique(np.rint((places - places[0]) / voxel_size_m), axis=0)) * voxel_size_m**2
