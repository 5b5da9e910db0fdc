"""All cues together: what is observed of a person, which samples are drawn, and what they are matched with. Kehl (2006), section 6.1."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.body.solid_samples import SampledBody, draw_samples
from hmc.camera.color_edges import ColorEdgeSettings
from hmc.pose.objectives.color_cue import ColorSettings
from hmc.pose.objectives.cue_rows import Matches, PosedBody, joined
from hmc.pose.objectives.edge_cue import EdgeMaps, match_edges
from hmc.pose.objectives.surface_cue import VoxelCloud, match_surface, match_voxels

__all__ = ["CueSettings", "Draw", "draw_cues", "draw_of_groups", "match_cues"]


@dataclass(frozen=True)
class CueSettings:
    """Which cues count, and by how much.

    Parameters
    ----------
    surface_points : tuple of int
        Samples of each group of `hmc.body.solids.GROUPS` (section 7).
    surface_weight : float
        w_s of Eq. 8, over the number of samples.
    voxel_points : int
        Voxels that look for the nearest part of the body; 0: none, as in the paper.
    voxel_weight : float
        Of these together.
    circles, meridians : int
        Strips of either kind of each limb and view; each gives two contour points.
    edge_weight : float
        w_e of Eq. 8, over the number of contour points; 0: no edges.
    full_edges : bool
        Edges count from the start, as in the paper; otherwise only where the chains are refined.
    views : int
        The edge cue takes so many views, those with the fewest hidden contour points.
    reach_m : float
        How far from a contour point edges are looked for, metres at its depth.
    width : float
        nu of the Leclerc potential, for squared distances in units of the limb's diameter.
    edges : ColorEdgeSettings
    colors : ColorSettings or None
        None: a point may be matched with a voxel of any color.
    """

    surface_points: tuple[int, ...] = (60, 20, 20, 20, 20, 20)
    surface_weight: float = 1.0
    voxel_points: int = 120
    voxel_weight: float = 0.5
    circles: int = 4
    meridians: int = 1
    edge_weight: float = 0.5
    full_edges: bool = False
    views: int = 3
    reach_m: float = 0.06
    width: float = 1.0
    edges: ColorEdgeSettings = field(default_factory=ColorEdgeSettings)
    colors: ColorSettings | None = field(default_factory=ColorSettings)


@dataclass(frozen=True)
class Draw:
    """Samples of one iteration.

    Parameters
    ----------
    surface : ndarray of int
        Rows of the surface grid.
    voxels : ndarray of int
        Of the cloud.
    strips, view : ndarray of int
        Strips, and in which of the used views.
    surface_share, edge_share : float
        Of the surface samples and strips that were drawn so many are among these.
    """

    surface: np.ndarray
    voxels: np.ndarray
    strips: np.ndarray
    view: np.ndarray
    surface_share: float = 1.0
    edge_share: float = 1.0


def draw_cues(
    rng: np.random.Generator,
    sampled: SampledBody,
    cloud: VoxelCloud,
    n_views: int,
    settings: CueSettings,
    times: int = 1,
    trunk: bool = True,
) -> Draw:
    """Draw samples at random.

    Parameters
    ----------
    rng : numpy.random.Generator
    sampled : SampledBody
    cloud : VoxelCloud
    n_views : int
        Views that are used.
    settings : CueSettings
    times : int
        So many times as many samples as the settings say.
    trunk : bool
        False: none on the trunk.
    """
    counts = [times * count for count in settings.surface_points]
    surface = draw_samples(rng, sampled.grid, (counts[0] * trunk, *counts[1:]))
    voxels = rng.integers(len(cloud.points), size=times * settings.voxel_points)
    strips = sampled.strips
    chosen = [
        pool[rng.random((n_views, len(pool))).argsort(axis=1)[:, : times * count]]
        for pools, count in ((strips.circles, settings.circles), (strips.meridians, settings.meridians))
        for pool in pools
    ]
    lines = np.concatenate(chosen, axis=1)
    return Draw(surface, voxels, lines.ravel(), np.repeat(np.arange(n_views), lines.shape[1]))


def draw_of_groups(draw: Draw, sampled: SampledBody, wanted: np.ndarray) -> Draw:
    """Without the samples of groups that stay where they are; the others count as much as before.

    Parameters
    ----------
    draw : Draw
    sampled : SampledBody
    wanted : ndarray of bool, shape (6,)
        Of `hmc.body.solids.GROUPS`.
    """
    surface, lines = wanted[sampled.grid.group[draw.surface]], wanted[sampled.strips.group[draw.strips]]
    return Draw(
        draw.surface[surface], draw.voxels, draw.strips[lines], draw.view[lines],
        draw.surface_share * surface.mean() if len(surface) else 1.0, draw.edge_share * lines.mean() if len(lines) else 1.0,
    )  # fmt: skip


def match_cues(
    sampled: SampledBody, posed: PosedBody, cloud: VoxelCloud, maps: EdgeMaps | None, draw: Draw, settings: CueSettings
) -> Matches:
    """Match the drawn samples.

    Parameters
    ----------
    sampled : SampledBody
    posed : PosedBody
    cloud : VoxelCloud
    maps : EdgeMaps or None
        None: no edges.
    draw : Draw
    settings : CueSettings
    """
    body, grid = sampled.body, sampled.grid
    found = [match_surface(body, grid, draw.surface, posed, cloud, draw.surface_share * settings.surface_weight)]
    if len(draw.voxels):
        # A third of the grid is dense enough to say which part is nearest.
        candidates = np.arange(0, len(grid.points), 3)
        found.append(match_voxels(body, grid, candidates, posed, cloud, draw.voxels, settings.voxel_weight))
    if maps is not None and len(draw.strips):
        weight = draw.edge_share * settings.edge_weight
        found.append(match_edges(sampled, posed, maps, draw.strips, draw.view, settings.reach_m, weight))
    return joined(found)
