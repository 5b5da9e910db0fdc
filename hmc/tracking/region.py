"""The region of influence: the upright ellipsoid in which a person's voxels are looked for.

Source: Canton (2009), section 4.2.3, Eq. 4.2, and section 4.3.1, Eq. 4.4 and the text after Eq. 4.5.
"""

from __future__ import annotations

import numpy as np

__all__ = ["person_radii", "region_distance"]

#: Radius of an average person across, metres (Canton, section 4.2.3).
PERSON_RADIUS_M = 0.30

#: A region's least half-height, metres: a person who kneels or whose legs are hidden keeps a region that reaches the head.
LEAST_HALF_HEIGHT_M = 0.6


def person_radii(centroids: np.ndarray, enlarge_xy: float = 1.5, enlarge_z: float = 1.2) -> np.ndarray:
    """Half axes of the persons' regions of influence, ``(alpha s_x, alpha s_y, beta x_z)``.

    Parameters
    ----------
    centroids : ndarray, shape (..., 3)
        World, metres; the floor at z = 0.
    enlarge_xy : float
        Canton's alpha, to reach a person who moves between two frames.
    enlarge_z : float
        Canton's beta, to follow changes of height.

    Returns
    -------
    ndarray, shape (..., 3)
        Metres.
    """
    centroids = np.asarray(centroids, float)
    radii = np.empty_like(centroids)
    radii[..., :2] = enlarge_xy * PERSON_RADIUS_M
    radii[..., 2] = np.maximum(enlarge_z * centroids[..., 2], LEAST_HALF_HEIGHT_M)
    return radii


def region_distance(points: np.ndarray, centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Left side of Eq. 4.2 for every point and every ellipsoid: at most 1 inside.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
    centres, radii : ndarray, shape (k, 3)
        Metres, as the points.

    Returns
    -------
    ndarray, shape (n, k)
        Square of the distance in units of the ellipsoid's radius.
    """
    points, centres, radii = (np.asarray(a, float) for a in (points, centres, radii))
    return sum((((points[:, d, None] - centres[:, d]) / radii[:, d]) ** 2 for d in range(3)), np.zeros((len(points), len(centres))))
