"""The surface cue: points of the body matched with the nearest surface voxels, of their own color where colors are known. Kehl (2006),
sections 6.1.1 and 6.1.3."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.solid_samples import SurfaceGrid
from hmc.body.solids import GROUPS, SolidBody
from hmc.pose.objectives.cue_rows import Matches, PosedBody, point_wrenches

__all__ = ["VoxelCloud", "match_surface", "match_voxels", "nearest_voxels", "place", "voxel_cloud"]

#: Added to the squared distance of a voxel whose color does not fit, square metres: more than any room.
BARRED = np.float32(1e6)


@dataclass(frozen=True)
class VoxelCloud:
    """Surface voxels of one person in one frame.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Centres, world, metres.
    middle : ndarray, shape (3,)
        Around which coordinates are small, so that single precision will do.
    system : ndarray of float32, shape (4, n)
        Rows x, y, z from `middle`, times -2, and their squared length: the product with (x, y, z, 1) is the squared distance to a
        point, less the point's own squared length.
    barred : ndarray of float32, shape (n_patches, n), or None
        0 where a voxel's color fits a patch, else `BARRED`; None: colors do not count.
    """

    points: np.ndarray
    middle: np.ndarray
    system: np.ndarray
    barred: np.ndarray | None = None


def voxel_cloud(points: np.ndarray, fits: np.ndarray | None = None) -> VoxelCloud:
    """Prepare surface voxels (n, 3), metres, with the table of which fit which patch's color (n_patches, n)."""
    middle = points.mean(axis=0)
    near = (points - middle).T.astype(np.float32)
    system = np.concatenate([-2 * near, np.einsum("ij,ij->j", near, near)[None]])
    barred = None if fits is None else np.where(fits, np.float32(0), BARRED)
    return VoxelCloud(points, middle, system, barred)


def nearest_voxels(cloud: VoxelCloud, points: np.ndarray, patches: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The nearest voxel of each point among those that fit its patch.

    Parameters
    ----------
    cloud : VoxelCloud
    points : ndarray, shape (n, 3)
        World, metres.
    patches : ndarray of int, shape (n,), optional
        Needed where the cloud has colors.

    Returns
    -------
    index : ndarray of int, shape (n,)
    found : ndarray of bool, shape (n,)
        Whether any voxel fits.
    """
    shifted = np.ones((len(points), 4), np.float32)
    shifted[:, :3] = points - cloud.middle
    table = shifted @ cloud.system
    if cloud.barred is None or patches is None:
        return table.argmin(axis=1), np.ones(len(points), bool)
    table += cloud.barred.take(patches, axis=0)
    index = table.argmin(axis=1)
    return index, table[np.arange(len(points)), index] < BARRED / 2


def place(posed: PosedBody, points: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Points of segments (n, 3) in the world."""
    return (posed.rotations[segment] @ points[..., None])[..., 0] + posed.positions[segment]


def match_surface(body: SolidBody, grid: SurfaceGrid, chosen: np.ndarray, posed: PosedBody, cloud: VoxelCloud, weight: float) -> Matches:
    """Match samples of the surface, Eq. 10.

    Parameters
    ----------
    body : SolidBody
    grid : SurfaceGrid
    chosen : ndarray of int, shape (n,)
        Rows of the grid (`hmc.body.solid_samples.draw_samples`).
    posed : PosedBody
    cloud : VoxelCloud
    weight : float
        Of all of them together.

    Returns
    -------
    Matches
        A point without a voxel of its color is missing.
    """
    segment, group = grid.segment[chosen], grid.group[chosen]
    points = place(posed, grid.points[chosen], segment)
    index, found = nearest_voxels(cloud, points, grid.patch[chosen])
    share = weight / max(len(chosen), 1)
    scale = found / body.diameter[grid.solid[chosen]]
    residuals = (points - cloud.points[index]) * scale[:, None]
    missing = share * np.bincount(group[~found], minlength=len(GROUPS))
    return Matches(residuals, point_wrenches(points) * scale[:, None, None], segment, group, share * found, missing)


def match_voxels(
    body: SolidBody, grid: SurfaceGrid, candidates: np.ndarray, posed: PosedBody, cloud: VoxelCloud, voxels: np.ndarray, weight: float
) -> Matches:
    """Match voxels with the body, the other way round: what no part of the body covers pulls the nearest part towards itself.

    The paper has no such term; without it a limb that lies within another's voxels is content there.

    Parameters
    ----------
    body, grid, posed, cloud
        As for `match_surface`.
    candidates : ndarray of int, shape (m,)
        Rows of the grid among which the nearest is looked for.
    voxels : ndarray of int, shape (n,)
        Of the cloud.
    weight : float
        Of all of them together.

    Returns
    -------
    Matches
        A voxel whose color fits no candidate is left out.
    """
    points = place(posed, grid.points[candidates], grid.segment[candidates])
    near = (points - cloud.middle).astype(np.float32)
    system = np.concatenate([-2 * near.T, np.einsum("ij,ij->i", near, near)[None]])
    observed = np.ones((len(voxels), 4), np.float32)
    observed[:, :3] = cloud.points[voxels] - cloud.middle
    table = observed @ system
    if cloud.barred is not None:
        table += cloud.barred.take(voxels, axis=1).take(grid.patch[candidates], axis=0).T
    index = table.argmin(axis=1)
    found = table[np.arange(len(voxels)), index] < BARRED / 2
    chosen, points = candidates[index], points[index]
    scale = found / body.diameter[grid.solid[chosen]]
    residuals = (points - cloud.points[voxels]) * scale[:, None]
    wrenches = point_wrenches(points) * scale[:, None, None]
    weights = weight / max(len(voxels), 1) * found
    return Matches(residuals, wrenches, grid.segment[chosen], grid.group[chosen], weights, np.zeros(len(GROUPS)))
