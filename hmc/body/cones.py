"""Distances to truncated cones with elliptic cross-sections: of points, and of rays that pass by; and depths in them.

Points come as (m, 3), or with directions as (m, 6): a ray goes through its point in a unit direction; a direction of zero is a point.
A cone's coordinates are two across it and one along its axis, from its start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike

from hmc.body.model import Cones

__all__ = [
    "cone_depth", "cone_distance", "cone_shapes", "ellipses_at", "places_and_directions", "slide_to_axis", "squared_distance",
    "way_out",
]  # fmt: skip


def places_and_directions(points: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """What is to be covered, shape (m, 3) or (m, 6), as points and, where there are rays, directions; each of shape (m, 3)."""
    return points[:, :3], points[:, 3:] if points.shape[1] > 3 else None


def slide_to_axis(local: np.ndarray, directions: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Move points along their rays to where these pass a cone's axis most closely.

    Parameters
    ----------
    local : ndarray, shape (3, ...)
        Points in the cones' coordinates, metres; written over.
    directions : ndarray, shape (3, ...)
        In the same coordinates, of unit length; zero for points that stay.
    lengths : ndarray
        Of the axes, metres; broadcast against the rest.

    Returns
    -------
    ndarray, shape (...)
        How far each point moved, metres.
    """
    x, y, along = local
    u, v, w = directions
    towards = x * u
    towards += y * v
    across = w * w
    np.subtract(1, across, out=across)  # directions are unit vectors; where they are zero, so is what is divided
    # A ray along the axis passes it everywhere: any point will do.
    np.maximum(across, 1e-6, out=across)
    nearest = towards * w
    nearest /= across
    np.subtract(along, nearest, out=nearest)
    np.maximum(nearest, 0, out=nearest)
    np.minimum(nearest, lengths, out=nearest)
    # From the point of the axis to the nearest one of the ray.
    nearest -= along
    nearest *= w
    nearest -= towards
    local += nearest * directions
    return nearest


def cone_shapes(cones: Cones, dtype: DTypeLike = np.float32) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`Cones.shapes` with one axis more, for points along the last: shapes (n_cones, 1), (n_cones, 2, 1) and (n_cones, 2, 1)."""
    length, first, slope = (values[..., None].astype(dtype) for values in cones.shapes)
    return length, first, slope


def ellipses_at(along: np.ndarray, length: np.ndarray, first: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared semi-axes of the cones' cross-sections beside points: all that distances and depths have in common.

    Parameters
    ----------
    along : ndarray, shape (m, ...)
        Of points, along the axis of a cone a row, metres; written over with how far they are beyond its ends, 0 between them.
    length, first, slope : ndarray, shapes (m, ...), (m, 2, ...) and (m, 2, ...)
        The cones, as from `cone_shapes`; they broadcast against the points. A single row stands for all.

    Returns
    -------
    ndarray, ndarray, shape (m, ...)
        Square metres, of the type of `along`.
    """
    clipped = np.maximum(along, 0)  # `numpy.clip` takes twice as long
    np.minimum(clipped, length, out=clipped)
    along -= clipped
    across, third = clipped * slope[:, 0], clipped * slope[:, 1]
    across += first[:, 0]
    third += first[:, 1]
    across *= across
    third *= third
    return across, third


def squared_distance(local: np.ndarray, length: np.ndarray, first: np.ndarray, slope: np.ndarray, out: np.ndarray) -> None:
    """Squared distance of points to a cone a row, as of `way_out`, where speed matters: every step is in place.

    Parameters
    ----------
    local : ndarray, shape (3, m, n)
        Points in the cones' coordinates, metres; written over.
    length, first, slope : ndarray
        The cones, as for `ellipses_at`.
    out : ndarray, shape (m, n)
        Where the result goes, square metres; 0 inside.
    """
    x, y, along = local
    a, b = ellipses_at(along, length, first, slope)
    along *= along
    x *= x
    np.add(x, np.multiply(y, y, out=y), out=out)
    x /= a
    y /= b
    x += y
    # lateral * (1 - 1 / level), squared
    np.maximum(x, 1, out=x)
    np.sqrt(x, out=x)
    np.divide(-1, x, out=x)
    x += 1
    x *= x
    out *= x
    out += along


def way_out(local: np.ndarray, length: np.ndarray, first: np.ndarray, slope: np.ndarray) -> None:
    """Turn points into the way to them from the cone, zero inside: its length is their distance.

    Radially it is measured along the ray from the axis, which for a circular cross-section is the distance to the cylinder of the cone's
    radius there; the ends are flat.

    Parameters
    ----------
    local : ndarray, shape (3, m, ...)
        Points in the coordinates of a cone a row, metres; written over.
    length, first, slope : ndarray
        The cones, as for `ellipses_at`.
    """
    x, y, along = local
    a, b = ellipses_at(along, length, first, slope)
    local[:2] *= 1 - 1 / np.sqrt(np.maximum(x * x / a + y * y / b, 1))


def cone_depth(local: np.ndarray, length: np.ndarray, first: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """How deep points are in a cone a row, shape (m, ...), metres: by the narrower radius there; 0 outside.

    Parameters
    ----------
    local : ndarray, shape (3, m, ...)
        Points in the cones' coordinates, metres; written over.
    length, first, slope : ndarray
        The cones, as for `ellipses_at`.
    """
    x, y, along = local
    between = (along > 0) & (along < length)
    a, b = ellipses_at(along, length, first, slope)
    x *= x
    y *= y
    x /= a
    y /= b
    x += y
    level = np.sqrt(x, out=x)
    depth = np.minimum(a, b, out=a)
    np.sqrt(depth, out=depth)
    depth *= np.subtract(1, level, out=level)
    depth *= between
    return np.maximum(depth, 0, out=depth)


def cone_distance(cones: Cones, index: int | np.integer, points: np.ndarray) -> np.ndarray:
    """Distance of points (segment's frame) to one cone, shape (...), metres: 0 on it and inside it, else the length of the `way_out`.

    Parameters
    ----------
    cones : Cones
    index : int
    points : ndarray, shape (..., 3)
    """
    local = cones.bases[index] @ (points - cones.start[index]).reshape(-1, 3).T
    way_out(local, *(values[None, index] for values in cones.shapes))
    return np.sqrt(np.einsum("ik,ik->k", local, local)).reshape(points.shape[:-1])
