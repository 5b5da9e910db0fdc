"""Exponential maps of twists: turns about axes that need not pass the origin, and chains of them. Canton (2009), appendix A.

`hmc.body.kinematics` places the whole body by the same products, written out for its own axes; here they are in general, for any chain.
"""

from __future__ import annotations

import numpy as np

__all__ = ["chain_map", "cross_matrices", "exponential_maps", "moved", "rotations_about", "twists"]


def cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """Matrices whose product with any p is the cross product of a vector with p, (..., 3) to (..., 3, 3) (Canton, Eq. A.4).

    The thesis prints the signs of its last column otherwise; these are those of a skew-symmetric matrix.
    """
    x, y, z = np.moveaxis(np.asarray(vectors, float), -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)


def twists(axes: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Twists of turns about axes through centres (Canton, Eq. A.5): a homogeneous point p moves by ``twist @ p`` a radian (Eq. A.2, A.3).

    Parameters
    ----------
    axes : ndarray, shape (..., 3)
        Unit vectors.
    centres : ndarray, shape (..., 3)
        A point of each axis, metres.

    Returns
    -------
    ndarray, shape (..., 4, 4)
    """
    axes, centres = np.broadcast_arrays(np.asarray(axes, float), np.asarray(centres, float))
    out = np.zeros((*axes.shape[:-1], 4, 4))
    out[..., :3, :3] = cross_matrices(axes)
    out[..., :3, 3] = -np.cross(axes, centres)
    return out


def rotations_about(axes: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Rotations about unit axes (..., 3) by angles (...), shape (..., 3, 3): Rodrigues' formula (Canton, Eq. A.8)."""
    cross, angles = cross_matrices(axes), np.asarray(angles, float)[..., None, None]
    return np.eye(3) + np.sin(angles) * cross + (1 - np.cos(angles)) * cross @ cross


def exponential_maps(axes: np.ndarray, centres: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Exponential maps of twists (Canton, Eq. A.6, A.7 and A.9): turns by angles about axes through centres.

    About an axis of the world it is Eq. A.11, A.12 or A.13.

    Parameters
    ----------
    axes : ndarray, shape (..., 3)
        Unit vectors.
    centres : ndarray, shape (..., 3)
        A point of each axis, metres.
    angles : ndarray, shape (...)
        Radians.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Rotation and translation, homogeneous.
    """
    rotations = rotations_about(axes, angles)
    centres = np.broadcast_to(np.asarray(centres, float), rotations.shape[:-1])
    out = np.zeros((*rotations.shape[:-2], 4, 4))
    out[..., :3, :3] = rotations
    # (I - R)(omega x v) + omega omega^T v theta of Eq. A.7: v is -omega x q, so the second term is 0 and the first (I - R) q.
    out[..., :3, 3] = centres - np.einsum("...ij,...j->...i", rotations, centres)
    out[..., 3, 3] = 1
    return out


def chain_map(axes: np.ndarray, centres: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Where an open chain of axes takes its last link: the product of their exponential maps, the root first (Canton, Eq. A.10).

    The order counts, though the thesis says otherwise.

    Parameters
    ----------
    axes, centres : ndarray, shape (k, 3)
        In the pose in which all angles are 0; axes are unit vectors.
    angles : ndarray, shape (..., k)
        Radians.

    Returns
    -------
    ndarray, shape (..., 4, 4)
    """
    maps = exponential_maps(axes, centres, angles)
    out = np.broadcast_to(np.eye(4), (*maps.shape[:-3], 4, 4))
    for k in range(maps.shape[-3]):
        out = out @ maps[..., k, :, :]
    return out


def moved(maps: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points where maps take them (Canton, Eq. A.14): maps (..., 4, 4) of points (..., 3), both broadcast, shape (..., 3)."""
    return np.einsum("...ij,...j->...i", maps[..., :3, :3], np.asarray(points, float)) + maps[..., :3, 3]
