"""All cues together: what is observed of a person, which samples are drawn, and what they are matched with. Kehl (2006), section 6.1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.smd.body import SolidBody
from hmc.pose.smd.rows import Matches, Posed, joined
from hmc.pose.smd.samples import SurfaceGrid, draw_samples
from hmc.pose.smd.surface_cue import VoxelCloud, match_surface, match_voxels

__all__ = ["CueSettings", "Draw", "Observed", "draw_cues", "match_cues"]


@dataclass(frozen=True)
class CueSettings:
    """Which cues count, and by how much.

    Parameters
    ----------
    surface_points : tuple of int
        Samples of each group of `hmc.pose.smd.body.GROUPS` (section 7).
    surface_weight : float
        w_s of Eq. 8, over the number of samples.
    voxel_points : int
        Voxels that look for the nearest part of the body; 0: none, as in the paper.
    voxel_weight : float
        Of these together.
    width : float
        nu of the Leclerc potential, for squared distances in units of the limb's diameter.
    """

    surface_points: tuple[int, ...] = (60, 20, 20, 20, 20, 20)
    surface_weight: float = 1.0
    voxel_points: int = 120
    voxel_weight: float = 0.5
    width: float = 0.5


@dataclass(frozen=True)
class Observed:
    """What is seen of a person in a frame.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Surface voxels, world, metres.
    colors : ndarray, shape (n, 3), or None
        Theirs in YUV; NaN where unknown.
    """

    points: np.ndarray
    colors: np.ndarray | None = None


@dataclass(frozen=True)
class Draw:
    """Samples of one iteration.

    Parameters
    ----------
    surface : ndarray of int
        Rows of the surface grid.
    voxels : ndarray of int
        Of the cloud.
    """

    surface: np.ndarray
    voxels: np.ndarray


def draw_cues(rng: np.random.Generator, grid: SurfaceGrid, cloud: VoxelCloud, settings: CueSettings, times: int = 1) -> Draw:
    """Draw samples at random.

    Parameters
    ----------
    rng : numpy.random.Generator
    grid : SurfaceGrid
    cloud : VoxelCloud
    settings : CueSettings
    times : int
        So many times as many samples as the settings say.
    """
    surface = draw_samples(rng, grid, tuple(times * count for count in settings.surface_points))
    return Draw(surface, rng.integers(len(cloud.points), size=times * settings.voxel_points))


def match_cues(body: SolidBody, grid: SurfaceGrid, posed: Posed, cloud: VoxelCloud, draw: Draw, settings: CueSettings) -> Matches:
    """Match the drawn samples.

    Parameters
    ----------
    body : SolidBody
    grid : SurfaceGrid
    posed : Posed
    cloud : VoxelCloud
    draw : Draw
    settings : CueSettings
    """
    found = [match_surface(body, grid, draw.surface, posed, cloud, settings.surface_weight)]
    if len(draw.voxels):
        # A third of the grid is dense enough to say which part is nearest.
        candidates = np.arange(0, len(grid.points), 3)
        found.append(match_voxels(body, grid, candidates, posed, cloud, draw.voxels, settings.voxel_weight))
    return joined(found)
