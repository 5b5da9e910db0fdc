"""What one frame's hulls say of a person, in the form the symmetric cost reads: a distance field and surface points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hmc.pose.views.near_distance import distances_of_squares, look_up, near_squares
from hmc.voxels.grid import VoxelGrid, voxels_of
from hmc.voxels.surface import surface

__all__ = ["FAR_M", "HullTarget", "distance_at", "distance_gradient", "make_target", "sample_points", "sound_hull"]

#: Room left around a person's voxels in the distance field, metres: limbs of wrong guesses still see the way back.
MARGIN_M = 0.35
#: Distances are told as far as this, metres: what lies farther off counts no more than what the symmetric cost's cap allows.
FAR_M = 0.25
#: A strict hull smaller than this share of the tolerant one says that a camera lost the person: the tolerant one stands for it.
LEAST_STRICT_SHARE = 0.1
#: Between the strict and the tolerant hull a body may be, but had better not: this share of the distance to the strict hull,
#: up to a bound, is added. With few cameras the tolerant hull is so fat that it hardly holds a body.
STRICT_SHARE = np.float32(0.3)
STRICT_CAP_M = np.float32(0.08)
#: Distance that a place in the loose hull alone counts as, metres.
LOOSE_M = np.float32(0.02)
#: The same of a place that nothing is known of, metres.
UNSEEN_M = np.float32(0.01)


@dataclass(frozen=True)
class HullTarget:
    """One person's hulls in one frame.

    Parameters
    ----------
    distance : ndarray of float32, shape (nx, ny, nz)
        How far a body's surface is from where it may be, metres: the distance to the tolerant hull plus a bounded share of that
        to the strict one, each as far as `FAR_M`; 0 inside both. Below the floor as right above it. A crop around the person.
    strict, tolerant : ndarray of bool, shape (nx, ny, nz)
        The strict and the tolerant hull in the same crop; the tolerant one holds the strict one.
    loose : ndarray of bool, shape (nx, ny, nz)
        Where else the person may be, in the same crop.
    origin : ndarray, shape (3,)
        Centre of the crop's first voxel, world, metres.
    voxel_size_m : float
    surface : ndarray, shape (n, 3)
        Centres of the strict hull's surface voxels, world, metres.
    volume_m3 : float
        Of the strict hull.
    floor_z : float or None
        Height of the floor, metres, where people stand on one.
    rays : ndarray, shape (m, 6), or None
        Rays of the silhouettes that show the person (`hmc.pose.views.rays`), where these are known.
    standing : tuple of bool
        Whether heel and ball of the left foot, and of the right one, are known to be on the floor (`hmc.pose.contacts`).
    """

    distance: np.ndarray
    strict: np.ndarray
    tolerant: np.ndarray
    loose: np.ndarray
    origin: np.ndarray
    voxel_size_m: float
    surface: np.ndarray
    volume_m3: float
    floor_z: float | None = None
    rays: np.ndarray | None = None
    standing: tuple[bool, ...] = (False,) * 4


def sound_hull(strict: np.ndarray, tolerant: np.ndarray) -> np.ndarray:
    """A person's voxels in the strict hull, or in the tolerant one where the strict one is nearly empty: there a camera lost the person.

    Of few cameras the strict hull is less than half of the tolerant one, and whole.

    Parameters
    ----------
    strict, tolerant : ndarray of int, shape (n, 3) and (m, 3)
        The person's voxels (i, j, k).
    """
    return tolerant if len(strict) < LEAST_STRICT_SHARE * len(tolerant) else strict


def make_target(
    grid: VoxelGrid,
    strict: np.ndarray,
    tolerant: np.ndarray,
    loose: np.ndarray | None = None,
    floor_z: float | None = None,
    new: Callable[[np.ndarray], np.ndarray] | None = None,
    unseen: np.ndarray | None = None,
) -> HullTarget | None:
    """Prepare one person's hulls.

    Parameters
    ----------
    grid : VoxelGrid
    strict, tolerant : ndarray of int, shape (n, 3) and (m, 3)
        The person's voxels (i, j, k) in the strict hull and in the tolerant one. Where the strict one is
        nearly empty the tolerant one stands for it.
    loose : ndarray of bool, shape (nx, ny, nz), optional
        Voxels of the whole grid where the person might be though more cameras speak against it than the tolerant hull allows:
        behind furniture, say. A body may be there at a small price.
    floor_z : float, optional
        Height of the floor, metres.
    new : callable, optional
        Which of some points, shape (n, 3), world, metres, show on silhouettes where the strict hull does not
        (`hmc.pose.views.uncovered`). What else is in the tolerant and in the loose hull is no place for a body then.
    unseen : ndarray of int, shape (k, 3), optional
        Voxels (i, j, k) of which all cameras that do not show the person there know nothing: something hides them (`hmc.pose.occluders`),
        or it may be a person (`HullStep.doubted`). A body may be there at a small price.

    Returns
    -------
    HullTarget or None
        None where the person has no voxels at all.
    """
    if not len(tolerant):
        tolerant = strict
    strict = sound_hull(strict, tolerant)
    if not len(strict):
        return None
    pad = int(np.ceil(MARGIN_M / grid.voxel_size_m))
    low = np.minimum(strict.min(0), tolerant.min(0)) - pad
    if floor_z is not None:
        # Hidden legs reach from what is left of the hull down to the floor.
        ground = int(grid.index_of(np.array([0.0, 0.0, floor_z + 0.5 * grid.voxel_size_m]))[2])
        low[2] = min(low[2], ground - 1)
    shape = np.maximum(strict.max(0), tolerant.max(0)) + pad + 1 - low
    occupied = np.zeros(shape, bool)
    occupied[tuple((tolerant - low).T)] = True
    occupied[tuple((strict - low).T)] = True
    core = np.zeros(shape, bool)
    core[tuple((strict - low).T)] = True
    maybe = np.zeros(shape, bool) if loose is None else _crop(loose, low, shape)
    needed = np.ones(shape, bool)
    if new is not None:
        needed[:] = core
        beyond = voxels_of((occupied | maybe) & ~core)
        needed[tuple(beyond[new(grid.centres(beyond + low))].T)] = True
    reach = int(np.ceil(FAR_M / grid.voxel_size_m))
    far = _surface_distances(reach, grid.voxel_size_m)
    distance = look_up(far, near_squares(occupied & needed, reach))
    distance += look_up(STRICT_SHARE * np.minimum(far, STRICT_CAP_M), near_squares(core, reach))
    if loose is not None:
        np.minimum(distance, look_up(far + LOOSE_M, near_squares(maybe & needed, reach)), out=distance)
    if unseen is not None and len(unseen):
        hidden = np.zeros(shape, bool)
        inside = unseen[np.all((unseen >= low) & (unseen < low + shape), axis=1)] - low
        hidden[tuple(inside.T)] = True
        np.minimum(distance, look_up(far + UNSEEN_M, near_squares(hidden, reach)), out=distance)
    if floor_z is not None:
        # Hulls end at the floor because voxels do. A sole is not outside of them for that; how
        # deep a sole may sink is for `hmc.body.floor`.
        layer = ground - int(low[2])
        distance[..., :layer] = distance[..., layer : layer + 1]
    shell = grid.centres(surface(core) + low)
    volume_m3 = len(strict) * grid.voxel_size_m**3
    return HullTarget(distance, core, occupied, maybe, grid.centres(low), grid.voxel_size_m, shell, volume_m3, floor_z)


def _crop(volume: np.ndarray, low: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """A box of a volume, empty where it stands out of it."""
    out = np.zeros(shape, bool)
    first, last = np.maximum(low, 0), np.minimum(low + shape, volume.shape)
    if np.all(first < last):
        out[tuple(slice(a, b) for a, b in zip(first - low, last - low, strict=True))] = volume[
            tuple(slice(a, b) for a, b in zip(first, last, strict=True))
        ]
    return out


def _surface_distances(reach: int, voxel_size_m: float) -> np.ndarray:
    """Distances to a hull's surface, metres, float32, by the square of those to its voxels' centres (`near_squares`)."""
    # The hull's surface is half a voxel nearer than its voxels' centres.
    return np.maximum((distances_of_squares(reach) - np.float32(0.5)) * np.float32(voxel_size_m), np.float32(0))


def sample_points(rng: np.random.Generator, points: np.ndarray, n: int) -> np.ndarray:
    """About ``n`` of the points, evenly spread: one from each run of neighbours in scan order.

    Parameters
    ----------
    rng : numpy.random.Generator
    points : ndarray, shape (m, ...)
    n : int

    Returns
    -------
    ndarray, shape (min(m, n), ...)
    """
    if len(points) <= n:
        return points
    edges = np.linspace(0, len(points), n + 1)
    return points[(edges[:-1] + rng.random(n) * np.diff(edges)).astype(int)]


def distance_at(target: HullTarget, points: np.ndarray) -> np.ndarray:
    """`HullTarget.distance` at points, metres; 0 in the strict hull alone. Beyond the crop the distance to its border is added.

    Parameters
    ----------
    target : HullTarget
    points : ndarray, shape (..., 3)
        World, metres.

    Returns
    -------
    ndarray of float32, shape (...)
        Of the voxel in which the point lies.
    """
    inner, beyond, strides = _place(target, points)
    index = (inner + points.dtype.type(0.5)).astype(np.int32) @ strides
    return target.distance.ravel().take(index, mode="clip") + beyond


def distance_gradient(target: HullTarget, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the hull (`distance_at`), interpolated between voxels, and its gradient.

    Parameters
    ----------
    target : HullTarget
    points : ndarray, shape (n, 3)
        World, metres.

    Returns
    -------
    distance : ndarray, shape (n,)
        Metres.
    gradient : ndarray, shape (n, 3)
        Of the interpolation.
    """
    inner, beyond, strides = _place(target, points)
    base = np.minimum(inner.astype(np.int32), np.array(target.distance.shape, np.int32) - 2)
    x, y, z = (inner - base).T
    corners = (base @ strides)[:, None] + _CORNERS @ strides
    v = target.distance.ravel().take(corners, mode="clip").astype(float).T.reshape(2, 2, 2, -1)
    along_z = v[:, :, 0] + z * (v[:, :, 1] - v[:, :, 0])
    along_y = along_z[:, 0] + y * (along_z[:, 1] - along_z[:, 0])
    value = along_y[0] + x * (along_y[1] - along_y[0])
    by_z = v[:, :, 1] - v[:, :, 0]
    by_z = by_z[:, 0] + y * (by_z[:, 1] - by_z[:, 0])
    by_y = along_z[:, 1] - along_z[:, 0]
    slope = np.stack([along_y[1] - along_y[0], by_y[0] + x * (by_y[1] - by_y[0]), by_z[0] + x * (by_z[1] - by_z[0])], axis=1)
    return value + beyond, slope / target.voxel_size_m


_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.int32)


def _place(target: HullTarget, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points in voxels, held inside the crop; how far outside they were, metres; strides of the flat crop."""
    shape = target.distance.shape
    kind = points.dtype.type
    place = (points - target.origin.astype(points.dtype)) * kind(1 / target.voxel_size_m)
    inner = np.clip(place, kind(0), np.array(shape, points.dtype) - kind(1))
    off = place - inner
    beyond = np.sqrt(np.einsum("...i,...i->...", off, off)) * kind(target.voxel_size_m)
    return inner, beyond, np.array([shape[1] * shape[2], shape[2], 1], np.int32)
