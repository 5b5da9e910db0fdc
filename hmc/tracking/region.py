"""The region of influence: the upright ellipsoid in which a person's voxels are looked for.

Source: Canton (2009), section 4.2.3, Eq. 4.2, and section 4.3.1, Eq. 4.4 and the text after Eq. 4.5.
"""

from __future__ import annotations

import numpy as np

from hmc.errors import InputError

__all__ = ["least_radius", "person_radii", "region_distance"]

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


def least_radius(speed_m_s: float | np.ndarray, fps: float | np.ndarray) -> np.ndarray:
    """Least radius across of a region that does not lose who moves so fast (Canton, Eq. 4.6).

    From frame to frame a person moves by no more than the region's width: region and person, who is as wide, still touch.

    Parameters
    ----------
    speed_m_s : float or ndarray
        Largest speed of a person, metres a second, 0 or more.
    fps : float or ndarray
        Frames a second, above 0.

    Returns
    -------
    ndarray
        ``v_max / (2 f_R)``, metres, broadcast.

    Raises
    ------
    InputError
        When a speed is negative or a number of frames a second is not positive.
    """
    speed, rate = np.asarray(speed_m_s, float), np.asarray(fps, float)
    if not (np.all(speed >= 0) and np.all(rate > 0)):
        raise InputError(f"`speed_m_s` must be 0 or more and `fps` above 0; got {speed_m_s} and {fps}")
    return speed / (2 * rate)


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
