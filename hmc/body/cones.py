"""Distances to truncated cones with elliptic cross-sections: of points, and of rays that pass by.

Places come as (m, 3), or with directions as (m, 6): a ray goes through its place in a unit direction; a direction of zero is a point.
"""

from __future__ import annotations

import numpy as np

from hmc.body.model import Cones

__all__ = ["cone_shapes", "places_and_directions", "slide_to_axis", "squared_distance"]


def places_and_directions(points: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """What is to be explained, shape (m, 3) or (m, 6), as places and, where there are rays, directions; each of shape (m, 3)."""
    return points[:, :3], points[:, 3:] if points.shape[1] > 3 else None


def slide_to_axis(local: np.ndarray, directions: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Move points along their rays to where these pass a cone's axis most closely.

    Parameters
    ----------
    local : ndarray, shape (3, ...)
        Places in the cones' coordinates, metres; written over.
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


def cone_shapes(cones: Cones) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lengths, shape (n_cones, 1), metres, radii at the start, shape (n_cones, 2, 1), metres, and their change a metre; float32."""
    first, last = cones.radii[:, 0, :, None], cones.radii[:, 1, :, None]
    slope = (last - first) / cones.lengths[:, None, None]
    return cones.lengths[:, None].astype(np.float32), first.astype(np.float32), slope.astype(np.float32)


def squared_distance(local: np.ndarray, length: np.ndarray, first: np.ndarray, slope: np.ndarray, out: np.ndarray) -> None:
    """Squared distance of points to a cone a row, as in `hmc.body.flesh.cone_distance` but in single precision.

    Parameters
    ----------
    local : ndarray of float32, shape (3, m, n)
        Points in the cones' coordinates, metres; written over.
    length, first, slope : ndarray of float32, shapes (m, 1), (m, 2, 1) and (m, 2, 1)
        The cones, as from `cone_shapes`.
    out : ndarray of float32, shape (m, n)
        Where the result goes, square metres; 0 inside.
    """
    x, y, along = local
    clipped = np.maximum(along, 0)  # `numpy.clip` takes twice as long
    np.minimum(clipped, length, out=clipped)
    along -= clipped
    along *= along
    x *= x
    np.add(x, np.multiply(y, y, out=y), out=out)
    for squares, axis in ((x, 0), (y, 1)):
        radius = clipped * slope[:, axis]
        radius += first[:, axis]
        radius *= radius
        squares /= radius
    x += y
    # lateral * (1 - 1 / level), squared
    np.maximum(x, 1, out=x)
    np.sqrt(x, out=x)
    np.divide(-1, x, out=x)
    x += 1
    x *= x
    out *= x
    out += along
