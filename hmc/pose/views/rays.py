"""Rays of silhouettes: every pixel that shows the person asks for some part of the body somewhere along its line of sight.

A hull of few cameras is much fatter than its person, and some of it is no person at all: its surface asks for a body that is not there. The
silhouettes from which it was carved do not: what they show is the person's, only the distance is not known.

What a body has to cover is an array of points (m, 3), or of points and directions (m, 6): a ray goes through its point in a unit
direction and is covered where any point of it is; a point of the hull's surface has direction zero, and is covered there only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmc.camera.model import Camera, Rig
from hmc.pose.views.hull_target import HullTarget, sample_points
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.surface import surface

__all__ = ["points_to_cover", "silhouette_rays", "with_rays"]


def with_rays(target: HullTarget, rig: Rig, masks: Sequence[np.ndarray | None], others: np.ndarray | None = None) -> HullTarget:
    """The same hulls, with the rays of the silhouettes that show them.

    Parameters
    ----------
    target : HullTarget
    rig : Rig
    masks : sequence of ndarray of bool, shape (height, width), or None
        Silhouettes, one a camera; None where a camera has none.
    others : ndarray, shape (m, 3), optional
        Voxel centres of other people, metres: a pixel that may be theirs asks nothing of this person.

    Returns
    -------
    HullTarget
    """
    # The loose hull too: a leg that furniture hides from all cameras but one or two is in no other, and plain to see in these.
    possible = target.tolerant | target.loose
    points = np.concatenate([target.surface, target.origin + target.voxel_size_m * surface(possible)])
    return replace(target, rays=silhouette_rays(rig, masks, points, target.voxel_size_m, others))


def silhouette_rays(
    rig: Rig, masks: Sequence[np.ndarray | None], points: np.ndarray, spacing_m: float, others: np.ndarray | None = None
) -> np.ndarray:
    """One ray for every patch of a silhouette that some of the points fall on.

    Parameters
    ----------
    rig, masks, others
        As for `with_rays`.
    points : ndarray, shape (n, 3)
        World, metres: a hull's surface.
    spacing_m : float
        Size of the patches at the points' median distance, metres.

    Returns
    -------
    ndarray, shape (m, 6)
        A place on each ray, one of the points, and the unit direction from the camera; camera by camera.
    """
    rays = [np.zeros((0, 6))]
    # Which of a patch's points stands for its ray must not depend on the scan: points where a lost limb may be are drawn from them.
    order = np.random.default_rng(0).permutation(len(points))
    points = points[order]
    for camera, mask in zip(rig, masks, strict=True):
        if mask is None:
            continue
        column, row, in_image = pixel_of_voxel(camera, points)
        seen = np.flatnonzero(in_image & mask.ravel().take(row * camera.size[0] + column))
        if not len(seen):
            continue
        here = points.take(seen, axis=0)
        placed = _in_camera(camera, here)
        per_patch = _median(placed[:, 2]) / spacing_m
        before = np.zeros((0, 3))
        if others is not None and len(others):
            before = _in_camera(camera, others)
            before = before[before[:, 2] > spacing_m]
        pick = _first_of_patches(_patches(placed, per_patch), _patches(before, per_patch))
        directions = here[pick] - camera.centre
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        rays.append(np.concatenate([here[pick], directions], axis=1))
    return np.concatenate(rays)


def _in_camera(camera: Camera, points: np.ndarray) -> np.ndarray:
    return points @ camera.rotation.T + camera.translation


def _median(values: np.ndarray) -> float:
    """`numpy.median` of finite values, at least one, for a fraction of its time."""
    half = len(values) // 2
    parted = np.partition(values, half)
    return float(parted[half] if len(values) % 2 else (parted[:half].max() + parted[half]) / 2)


def _patches(placed: np.ndarray, per_unit: float) -> np.ndarray:
    """Column and row of the patch of the image, without distortion, on which each point in the camera's frame (n, 3) falls: (2, n)."""
    x, y, depth = placed.T
    return np.floor(np.stack([x / depth, y / depth]) * per_unit).astype(np.int64)


def _first_of_patches(patches: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """The first point of every patch, column by column, without those that are taken.

    Parameters
    ----------
    patches, taken : ndarray of int, shape (2, n) and (2, m)
        Column and row, n at least 1.

    Returns
    -------
    ndarray of int, shape (k,)
    """
    n, low = patches.shape[1], patches.min(axis=1)
    shape = patches.max(axis=1) - low + 1
    first = np.full(shape.prod(), n)
    np.minimum.at(first, np.ravel_multi_index(tuple(patches - low[:, None]), shape), np.arange(n))
    taken = taken - low[:, None]
    inside = ((taken >= 0) & (taken < shape[:, None])).all(axis=0)
    first[np.ravel_multi_index(tuple(taken[:, inside]), shape)] = n
    return first[first < n]


def points_to_cover(rng: np.random.Generator, target: HullTarget, n: int, ray_share: float) -> np.ndarray:
    """About ``n`` points of a person that a body has to cover, evenly spread: rays of the silhouettes, and points of the strict hull.

    Parameters
    ----------
    rng : numpy.random.Generator
    target : HullTarget
    n : int
    ray_share : float
        Share of rays, where the target has any.

    Returns
    -------
    ndarray, shape (m, 3) or (m, 6)
    """
    if target.rays is None or not len(target.rays):
        return sample_points(rng, target.surface, n)
    n_rays = round(ray_share * n)
    chosen = sample_points(rng, target.surface, n - n_rays)
    fixed = np.concatenate([chosen, np.zeros_like(chosen)], axis=1)
    return np.concatenate([sample_points(rng, target.rays, n_rays), fixed])
