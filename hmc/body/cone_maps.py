"""The body's truncated cones in many particles at once, particles along the last axis: where they are, and what is near them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.model import Cones

__all__ = ["ConeMaps", "cone_maps", "cones_near", "spread", "to_cones"]


@dataclass(frozen=True)
class ConeMaps:
    """Cones in ``n`` particles; of the type of the placed segments.

    Parameters
    ----------
    to_cone : ndarray, shape (n_cones, 3, 4, n)
        From homogeneous world points to a cone's coordinates: two across, the third along the axis from its start, metres.
    start, axis : ndarray, shape (n_cones, 3, n)
        Start and direction of the axis, world.
    """

    to_cone: np.ndarray
    start: np.ndarray
    axis: np.ndarray


def cone_maps(cones: Cones, placed: np.ndarray) -> ConeMaps:
    """Carry the cones into the world.

    Parameters
    ----------
    cones : Cones
    placed : ndarray, shape (16, 3, 4, n)
        As from `hmc.body.kinematics.place_segments`.
    """
    local = np.zeros((len(cones.part), 4, 4), placed.dtype)
    local[:, :3, :3], local[:, 3, :3], local[:, 3, 3] = cones.bases, cones.start, 1
    frames = local[:, None] @ placed[cones.segment]  # (n_cones, 3 of the world, three directions and start, n)
    to_cone = np.empty((len(local), 3, 4, placed.shape[-1]), placed.dtype)
    to_cone[:, :, :3] = frames[:, :, :3].swapaxes(1, 2)
    shift = frames[:, :, :3] * frames[:, :, 3:]
    to_cone[:, :, 3] = -shift[:, 0]
    to_cone[:, :, 3] -= shift[:, 1]
    to_cone[:, :, 3] -= shift[:, 2]
    return ConeMaps(to_cone, frames[:, :, 3], frames[:, :, 2])


def to_cones(maps: ConeMaps, points: np.ndarray) -> np.ndarray:
    """Points in the coordinates of all cones of one state, shape (n_cones, 3, m).

    Parameters
    ----------
    maps : ConeMaps
        Of one state.
    points : ndarray, shape (m, 3)
        World, metres.
    """
    matrices = maps.to_cone.reshape(-1, 4)
    local = matrices[:, :3] @ points.T
    local += matrices[:, 3:]
    return local.reshape(-1, 3, len(points))


def spread(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean position of points in all particles, shape (m, 3), and how far they go from there, shape (m,).

    Parameters
    ----------
    points : ndarray, shape (m, 3, n)
    """
    middle = points.mean(axis=2)
    off = points - middle[:, :, None]
    off *= off
    return middle, np.sqrt(off.sum(axis=1).max(axis=1))


def cones_near(
    cones: Cones, maps: ConeMaps, points: np.ndarray, reach: np.ndarray | float, directions: np.ndarray | None = None, slack: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Which cones may come within `reach` of which points, or of the rays through them, in some particle, and what some cone holds in all.

    The axis of every particle's cone lies as near to the mean axis as its ends do.

    Parameters
    ----------
    cones : Cones
    maps : ConeMaps
    points : ndarray, shape (m, 3)
    reach : float or ndarray, shape (m,)
        Metres.
    directions : ndarray, shape (m, 3), optional
        Of the rays, of unit length; zero for points that are none.
    slack : float
        The ends of the axes may go this much farther, metres.

    Returns
    -------
    near : ndarray of bool, shape (n_cones, m)
    held : ndarray of bool, shape (m,)
        Points in some cone, or rays that meet it, in every particle.
    """
    start, far_start = spread(maps.start)
    end, far_end = spread(maps.start + maps.axis * cones.lengths.astype(maps.axis.dtype)[:, None, None])
    far = np.maximum(far_start, far_end)[:, None] + slack + 1e-4
    # In single precision, counted from the points' middle.
    origin = points.mean(axis=0)
    points, start, axis = ((points - origin).astype(np.float32), (start - origin).astype(np.float32), (end - start).astype(np.float32))
    # Scalar products of the way from the start to the point, of the axis and of the ray: matrix products, unlike the vectors themselves.
    along = axis @ points.T
    along -= np.einsum("ci,ci->c", axis, start)[:, None]
    apart = start @ points.T
    apart *= -2
    apart += np.einsum("mi,mi->m", points, points)
    apart += np.einsum("ci,ci->c", start, start)[:, None]
    squared = np.einsum("ci,ci->c", axis, axis)[:, None]
    if directions is not None:
        # Seen along the ray, both get shorter by what lies along it.
        directions = directions.astype(np.float32)
        shift = start @ directions.T
        np.subtract(np.einsum("mi,mi->m", points, directions), shift, out=shift)
        axis_along = axis @ directions.T
        along -= shift * axis_along
        shift *= shift
        apart -= shift
        axis_along *= axis_along
        squared = squared - axis_along
    squared = np.maximum(squared, np.float32(1e-9))
    at = along / squared
    np.maximum(at, 0, out=at)
    np.minimum(at, 1, out=at)
    along *= 2
    along -= at * squared
    along *= at
    apart -= along
    near = apart < ((far + cones.radii.max(axis=(1, 2))[:, None] + reach) ** 2).astype(np.float32)
    # Well inside the thinnest end, and too far from either end for any particle's axis to be passed beyond it.
    thinnest, length = np.maximum(cones.radii.min(axis=(1, 2))[:, None] - far, 0), cones.lengths[:, None]
    some = np.flatnonzero((thinnest > 0) & (8 * far < length))
    held = np.zeros(len(points), bool)
    if len(some):
        apart, at, seen = apart[some], at[some], np.broadcast_to(np.sqrt(squared), apart.shape)[some]
        inside = (apart < thinnest[some] ** 2) & (apart < 0.25 * seen**2)
        held = (inside & (np.minimum(at, 1 - at) * seen > 4 * far[some])).any(axis=0)
    return near, held
