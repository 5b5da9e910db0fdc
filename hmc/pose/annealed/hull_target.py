"""What one frame's hulls say of a person, in the form the symmetric cost reads: a distance field and surface points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from hmc.voxels.grid import VoxelGrid

__all__ = ["HullTarget", "distance_at", "make_target", "sample_points"]

#: Room left around a person's voxels in the distance field, metres: limbs of wrong guesses still see the way back.
MARGIN_M = 0.35


@dataclass(frozen=True)
class HullTarget:
    """One person's hulls in one frame.

    Parameters
    ----------
    distance : ndarray of float32, shape (nx, ny, nz)
        Distance to the tolerant hull, metres; 0 inside it. A crop around the person.
    origin : ndarray, shape (3,)
        Centre of the crop's first voxel, world, metres.
    voxel_size_m : float
    surface : ndarray, shape (n, 3)
        Centres of the strict hull's surface voxels, world, metres.
    volume_m3 : float
        Of the strict hull.
    """

    distance: np.ndarray
    origin: np.ndarray
    voxel_size_m: float
    surface: np.ndarray
    volume_m3: float


def make_target(grid: VoxelGrid, strict: np.ndarray, tolerant: np.ndarray) -> HullTarget | None:
    """Prepare one person's hulls.

    Parameters
    ----------
    grid : VoxelGrid
    strict, tolerant : ndarray of int, shape (n, 3) and (m, 3)
        The person's voxels (i, j, k) in the strict hull and in the tolerant one. Where the strict one is empty the tolerant
        one stands for it.

    Returns
    -------
    HullTarget or None
        None where the person has no voxels at all.
    """
    if not len(tolerant):
        tolerant = strict
    if not len(strict):
        strict = tolerant
    if not len(strict):
        return None
    pad = int(np.ceil(MARGIN_M / grid.voxel_size_m))
    low = np.minimum(strict.min(0), tolerant.min(0)) - pad
    shape = np.maximum(strict.max(0), tolerant.max(0)) + pad + 1 - low
    occupied = np.zeros(shape, bool)
    occupied[tuple((tolerant - low).T)] = True
    occupied[tuple((strict - low).T)] = True
    distance = ndimage.distance_transform_edt(~occupied).astype(np.float32) * np.float32(grid.voxel_size_m)
    # The transform measures to voxel centres; the hull's surface is half a voxel nearer.
    distance = np.maximum(distance - np.float32(0.5 * grid.voxel_size_m), 0)
    core = np.zeros(shape, bool)
    core[tuple((strict - low).T)] = True
    surface = np.argwhere(core & ~ndimage.binary_erosion(core))
    return HullTarget(distance, grid.centres(low), grid.voxel_size_m, grid.centres(surface + low), len(strict) * grid.voxel_size_m**3)


def sample_points(rng: np.random.Generator, points: np.ndarray, n: int) -> np.ndarray:
    """About ``n`` of the points, evenly spread: one from each run of neighbours in scan order.

    Parameters
    ----------
    rng : numpy.random.Generator
    points : ndarray, shape (m, 3)
    n : int

    Returns
    -------
    ndarray, shape (min(m, n), 3)
    """
    if len(points) <= n:
        return points
    edges = np.linspace(0, len(points), n + 1)
    return points[(edges[:-1] + rng.random(n) * np.diff(edges)).astype(int)]


def distance_at(target: HullTarget, points: np.ndarray, smooth: bool = False) -> np.ndarray:
    """Distance of points to the tolerant hull, metres; 0 inside. Beyond the crop the distance to its border is added.

    Parameters
    ----------
    target : HullTarget
    points : ndarray, shape (..., 3)
        World, metres.
    smooth : bool
        Interpolate between voxels (eight reads a point in place of one).

    Returns
    -------
    ndarray of float32, shape (...)
    """
    shape = np.array(target.distance.shape)
    place = (points - target.origin.astype(points.dtype)) * points.dtype.type(1 / target.voxel_size_m)
    inner = np.clip(place, 0, (shape - 1).astype(points.dtype))
    beyond = np.sqrt(np.einsum("...i,...i->...", place - inner, place - inner)) * points.dtype.type(target.voxel_size_m)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    flat = target.distance.ravel()
    if not smooth:
        index = (inner + points.dtype.type(0.5)).astype(np.int64)
        return flat.take(index @ strides, mode="clip") + beyond
    base = np.minimum(inner.astype(np.int64), shape - 2)
    part = inner - base
    index = base @ strides
    value = np.zeros(index.shape, np.float32)
    for corner in range(8):
        bits = np.array([corner >> 2 & 1, corner >> 1 & 1, corner & 1])
        weight = np.prod(np.where(bits == 1, part, 1 - part), axis=-1)
        value += (weight * flat.take(index + bits @ strides, mode="clip")).astype(np.float32)
    return value + beyond.astype(np.float32)
