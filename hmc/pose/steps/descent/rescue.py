"""A limb that got lost: where voxels lie far from the whole body, random poses of each limb are asked whether they cover them.

The paper has nothing of the kind; a descent does not find back to a limb whose voxels are nearer to something else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.kinematics import segment_transforms
from hmc.body.solid_samples import SurfaceGrid
from hmc.body.solids import CHAINS, FREE, GROUPS, SolidBody
from hmc.pose.objectives.surface_cue import VoxelCloud

__all__ = ["RescueSettings", "propose_limb", "uncovered"]

#: Distances beyond this count as this, metres.
_CAP_M = 0.15


@dataclass(frozen=True)
class RescueSettings:
    """When and how limbs are looked for.

    Parameters
    ----------
    far_m : float
        A voxel farther from the body than this is not covered.
    share : float
        A limb is looked for when so large a share of the voxels is not.
    poses : int
        Random poses of each limb.
    deviation_deg : float
        Of their angles from the present ones.
    points : int
        Points of a limb, and voxels that are not covered, at most.
    gain : float
        A pose is tried when its score is below this share of the present one's, and kept when so large a share of the voxels at most
        stays uncovered.
    """

    far_m: float = 0.07
    share: float = 0.03
    poses: int = 48
    deviation_deg: float = 45.0
    points: int = 24
    gain: float = 0.8


def uncovered(points: np.ndarray, cloud: VoxelCloud, far_m: float) -> np.ndarray:
    """Voxels of a cloud, by number, that lie farther than `far_m` from all of these points of the body (n, 3)."""
    return np.flatnonzero(_nearest_squared(cloud.points, points, cloud.middle) > far_m**2)


def propose_limb(
    rng: np.random.Generator,
    body: SolidBody,
    grid: SurfaceGrid,
    cloud: VoxelCloud,
    parameters: np.ndarray,
    lost: np.ndarray,
    settings: RescueSettings,
) -> tuple[int, np.ndarray] | None:
    """The limb that covers the lost voxels best in some random pose, if any does.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : SolidBody
    grid : SurfaceGrid
    cloud : VoxelCloud
    parameters : ndarray, shape (24,)
    lost : ndarray of int
        Voxels of the cloud that are not covered.
    settings : RescueSettings

    Returns
    -------
    chain : int
        Place in `hmc.body.solids.CHAINS`.
    parameters : ndarray, shape (24,)
        With that limb's new angles.
    """
    limits = body.skeleton.limits
    some = cloud.points[rng.permutation(lost)[: settings.points]]
    best, choice = settings.gain, None
    for number, chain in enumerate(CHAINS):
        group = number + 1
        if GROUPS[group] == "head":
            continue
        trials = np.tile(parameters, (settings.poses, 1))
        trials[1:, chain] += np.radians(settings.deviation_deg) * rng.normal(size=(settings.poses - 1, len(chain)))
        trials = np.clip(trials, limits.low[FREE], limits.high[FREE])
        states = np.zeros((settings.poses, len(limits.low)))
        states[:, FREE] = trials
        rotations, positions = segment_transforms(body.skeleton, states)
        rows = np.linspace(grid.starts[group], grid.starts[group + 1] - 1, settings.points).astype(int)
        segment = grid.segment[rows]
        points = (rotations[:, segment] @ grid.points[rows][..., None])[..., 0] + positions[:, segment]
        flat = points.reshape(-1, 3)
        to_hull = _nearest_squared(flat, cloud.points[::2], cloud.middle).reshape(settings.poses, -1)
        gaps = ((some[None, :, None] - points[:, None]) ** 2).sum(axis=-1).min(axis=2)
        score = np.minimum(to_hull, _CAP_M**2).mean(axis=1) + np.minimum(gaps, _CAP_M**2).mean(axis=1)
        winner = int(score.argmin())
        if score[winner] < best * score[0]:
            best, choice = score[winner] / score[0], (number, trials[winner])
    return choice


def _nearest_squared(points: np.ndarray, others: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Squared distance of each point to the nearest of the others."""
    a, b = (points - middle).astype(np.float32), (others - middle).astype(np.float32)
    table = a @ (-2 * b.T)
    table += np.einsum("ij,ij->i", b, b)
    return np.maximum(table.min(axis=1) + np.einsum("ij,ij->i", a, a), 0)
