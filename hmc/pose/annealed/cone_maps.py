"""The body's truncated cones in many particles at once, particles along the last axis: where they are, and what is near them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.body.model import Cones

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
    placed : ndarray, shape (11, 3, 4, n)
        As from `hmc.pose.annealed.placing.place_segments`.
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
    """Mean place of points in all particles, shape (m, 3), and how far they go from there, shape (m,).

    Parameters
    ----------
    points : ndarray, shape (m, 3, n)
    """
    middle = points.mean(axis=2)
    off = points - middle[:, :, None]
    off *= off
    return middle, np.sqrt(off.sum(axis=1).max(axis=1))


def cones_near(
    cones: Cones, maps: ConeMaps, points: np.ndarray, reach: np.ndarray | float, directions: np.ndarray | None = None
) -> np.ndarray:
    """Which cones may come within `reach` of which points, or of the rays through them, in some particle: bool, shape (n_cones, m).

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
    """
    start, far_start = spread(maps.start)
    end, far_end = spread(maps.start + maps.axis * cones.lengths.astype(maps.axis.dtype)[:, None, None])
    axis = end - start
    between = points - start[:, None]
    along, squared = np.einsum("cmi,ci->cm", between, axis), np.sum(axis**2, axis=1)[:, None]
    if directions is not None:
        # Seen along the ray, both get shorter by what lies along it.
        axis_along = axis @ directions.T
        along -= np.einsum("cmi,mi->cm", between, directions) * axis_along
        squared = squared - axis_along**2
    between -= np.clip(along / np.maximum(squared, 1e-12), 0, 1)[:, :, None] * axis[:, None]
    if directions is not None:
        between -= np.einsum("cmi,mi->cm", between, directions)[:, :, None] * directions
    margin = np.maximum(far_start, far_end) + cones.radii.max(axis=(1, 2)) + 1e-4
    return np.einsum("cmi,cmi->cm", between, between) < (margin[:, None] + reach) ** 2
