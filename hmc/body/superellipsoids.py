"""Superellipsoids truncated at their equator and rounded off by a cap. Kehl (2006), sections 5.1 and 5.2.

A solid is two halves that meet without a seam in the plane z = 0: above it half of a superellipsoid, below it a cap, which is half of a
superellipsoid too, and half of a sphere where its exponents are 1 and its axis is as long as the others. In its own frame z runs along the
limb. The surface is parametrised by the latitude eta in [-pi/2, pi/2] and the longitude omega in [-pi, pi] (Eq. 1, with signed powers).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Superellipsoids", "inside_outside", "normals_at", "points_at"]


@dataclass(frozen=True)
class Superellipsoids:
    """Several solids, each in its own frame.

    Parameters
    ----------
    across : ndarray, shape (n, 2)
        Half-axes a1, a2 along x and y, metres.
    along : ndarray, shape (n, 2)
        Half-axis a3 along z, metres: [of the cap below, of the superellipsoid above].
    eps1 : ndarray, shape (n, 2)
        First exponent, of the meridians: [below, above].
    eps2 : ndarray, shape (n,)
        Second exponent, of the circles of latitude.
    """

    across: np.ndarray
    along: np.ndarray
    eps1: np.ndarray
    eps2: np.ndarray

    def __len__(self) -> int:
        return len(self.eps2)


def points_at(solids: Superellipsoids, index: np.ndarray, eta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Points of the surface, Eq. 1.

    Parameters
    ----------
    solids : Superellipsoids
    index : ndarray of int, shape (...)
        Which solid.
    eta, omega : ndarray, shape (...)
        Latitude and longitude, radians.

    Returns
    -------
    ndarray, shape (..., 3)
        Metres, solid's frame.
    """
    (a1, a2), a3, eps1, eps2 = solids.across[index].T, *_half(solids, index, eta), solids.eps2[index]
    a1, a2 = a1.T, a2.T
    ring = _power(np.cos(eta), eps1)
    return np.stack([a1 * ring * _power(np.cos(omega), eps2), a2 * ring * _power(np.sin(omega), eps2), a3 * _power(np.sin(eta), eps1)], -1)


def normals_at(solids: Superellipsoids, index: np.ndarray, eta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Outward unit normals, Eq. 2; arguments as for `points_at`.

    Returns
    -------
    ndarray, shape (..., 3)
        Solid's frame.
    """
    (a1, a2), a3, eps1, eps2 = solids.across[index].T, *_half(solids, index, eta), solids.eps2[index]
    a1, a2 = a1.T, a2.T
    ring = _power(np.cos(eta), 2 - eps1)
    normal = np.stack(
        [ring * _power(np.cos(omega), 2 - eps2) / a1, ring * _power(np.sin(omega), 2 - eps2) / a2, _power(np.sin(eta), 2 - eps1) / a3], -1
    )
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def inside_outside(solids: Superellipsoids, index: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The inside-outside function: below 1 inside, 1 on the surface, above 1 outside. Kehl (2006), section 5.3.

    Parameters
    ----------
    solids : Superellipsoids
    index : ndarray of int, shape (...)
    points : ndarray, shape (..., 3)
        Metres, solid's frame.

    Returns
    -------
    ndarray, shape (...)
    """
    x, y = (np.abs(points[..., k]) / solids.across[index, k] for k in (0, 1))
    a3, eps1 = _half(solids, index, points[..., 2])
    z = np.abs(points[..., 2]) / a3
    eps2 = solids.eps2[index]
    return (x ** (2 / eps2) + y ** (2 / eps2)) ** (eps2 / eps1) + z ** (2 / eps1)


def _half(solids: Superellipsoids, index: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half-axis a3 and first exponent of the half in which something lies."""
    above = (side >= 0).astype(int)
    return solids.along[index, above], solids.eps1[index, above]


def _power(base: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Signed power; cosines that rounding has made negative at the poles count as zero there."""
    base = np.where(np.abs(base) < 1e-12, 0.0, base)
    return np.sign(base) * np.abs(base) ** exponent
