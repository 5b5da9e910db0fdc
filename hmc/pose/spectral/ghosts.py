"""Ghost legs: with few cameras a hull has more legs than a person. Told by silhouettes, removed by colors where these differ.

A piece of the hull that no silhouette needs may be a ghost; which of several it is, silhouettes cannot say (Hsiao 2008, section 3.1.3,
Figure 3-9). A real surface has one color in all cameras that see it; a ghost's has those of whatever is behind it in each. Where both
legs and what is behind are alike, that does not help either, and nothing is removed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from hmc.camera.model import Camera
from hmc.tracking.views import FrameViews as Views
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.color import visibility
from hmc.voxels.components import components
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

__all__ = ["GhostReport", "GhostSettings", "check_ghosts", "remove_ghosts"]


@dataclass(frozen=True)
class GhostSettings:
    """When a piece of a hull counts as a ghost.

    Parameters
    ----------
    lowest_share, highest_share : float
        Legs are looked at between these shares of the hull's height.
    least_m3 : float
        Smaller pieces are noise.
    needed_share : float
        A piece is needed where so much of what it covers in some silhouette is covered by nothing else.
    color_ratio : float
        A piece that is not needed is removed where its colors differ between cameras by so many times those of the best piece.
    """

    lowest_share: float = 0.04
    highest_share: float = 0.28
    least_m3: float = 4e-4
    needed_share: float = 0.12
    color_ratio: float = 1.5


@dataclass(frozen=True)
class GhostReport:
    """Legs of a hull.

    Parameters
    ----------
    pieces : tuple of ndarray of int, shape (n, 3)
        Voxels of each piece at the height of the shanks, the largest first.
    ghosts : ndarray of bool, shape (n_pieces,)
        Pieces that can be removed.
    text : str
        What a user should know; empty where there is no doubt.
    """

    pieces: tuple[np.ndarray, ...]
    ghosts: np.ndarray
    text: str


def check_ghosts(voxels: np.ndarray, grid: VoxelGrid, views: Views, settings: GhostSettings | None = None) -> GhostReport:
    """Look for ghost legs in a person's hull.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
        Of one person.
    grid : VoxelGrid
    views : Views
        Silhouettes and, for colors, images.
    settings : GhostSettings, optional
    """
    settings = settings or GhostSettings()
    if len(voxels) == 0:
        return GhostReport((), np.zeros(0, bool), "")
    low, high = voxels[:, 2].min(), voxels[:, 2].max() + 1
    first, last = low + settings.lowest_share * (high - low), low + settings.highest_share * (high - low)
    occupied = np.zeros(grid.shape, bool)
    occupied[tuple(voxels.T)] = True
    legs = occupied.copy()
    legs[:, :, : int(np.ceil(first))] = False
    legs[:, :, int(np.ceil(last)) :] = False
    blobs = components(legs, grid, max(1, int(settings.least_m3 / grid.voxel_size_m**3)))
    pieces = tuple(blobs.of(k) for k in range(len(blobs)))
    if len(pieces) <= 2:
        return GhostReport(pieces, np.zeros(len(pieces), bool), "")
    needed = np.array([_is_needed(piece, voxels, grid, views, settings) for piece in pieces])
    spread = np.array([_color_spread(piece, occupied, grid, views) for piece in pieces])
    best = np.nanmin(spread) if np.isfinite(spread).any() else np.nan
    ghosts = ~needed & (spread > settings.color_ratio * best)
    # Never more than leaves two legs.
    excess = len(pieces) - 2
    if ghosts.sum() > excess:
        worst = np.argsort(-np.where(ghosts, spread, -np.inf))[:excess]
        ghosts = np.isin(np.arange(len(pieces)), worst)
    left = len(pieces) - int(ghosts.sum())
    text = f"{len(pieces)} legs in the hull"
    text += f"; {int(ghosts.sum())} removed by their colors" if ghosts.any() else ""
    text += "; which of them are real, colors do not tell: use more cameras" if left > 2 else ""
    return GhostReport(pieces, ghosts, text)


def remove_ghosts(voxels: np.ndarray, grid: VoxelGrid, report: GhostReport) -> np.ndarray:
    """A person's voxels without the ghosts of a report, and without what hangs on the rest by ghosts alone.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
    grid : VoxelGrid
    report : GhostReport
    """
    if not report.ghosts.any():
        return voxels
    occupied = np.zeros(grid.shape, bool)
    occupied[tuple(voxels.T)] = True
    for piece, ghost in zip(report.pieces, report.ghosts, strict=True):
        if ghost:
            occupied[tuple(piece.T)] = False
    return components(occupied, grid).of(0)


def _is_needed(piece: np.ndarray, voxels: np.ndarray, grid: VoxelGrid, views: Views, settings: GhostSettings) -> bool:
    """Whether a silhouette has pixels that this piece covers and the other voxels do not."""
    number = np.ravel_multi_index(tuple(voxels.T), grid.shape)
    others = voxels[~np.isin(number, np.ravel_multi_index(tuple(piece.T), grid.shape))]
    for camera, mask in zip(views.rig, views.masks, strict=True):
        if mask is None:
            continue
        away = max(float(np.linalg.norm(camera.centre - grid.centres(piece).mean(0))), 1.0)
        own, rest = (_pixels(camera, grid.centres(part)) for part in (piece, others))
        if not len(own) or not len(rest):
            continue
        # A voxel and a half as pixels: what is nearer than that to a pixel of others is covered by them.
        reach = 1.5 * grid.voxel_size_m * camera.matrix[0, 0] / away
        alone = np.isinf(cKDTree(rest).query(own, distance_upper_bound=reach)[0])
        if alone.mean() >= settings.needed_share:
            return True
    return False


def _pixels(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Pixels in which some points are, (k, 2), each once."""
    column, row, inside = pixel_of_voxel(camera, points)
    return np.unique(np.stack([column[inside], row[inside]], axis=1), axis=0)


def _color_spread(piece: np.ndarray, occupied: np.ndarray, grid: VoxelGrid, views: Views) -> float:
    """Median over a piece's surface of the standard deviation of its colors between the cameras that see it."""
    shell = surface(occupied)
    number = np.ravel_multi_index(tuple(shell.T), grid.shape)
    shell = shell[np.isin(number, np.ravel_multi_index(tuple(piece.T), grid.shape))]
    if len(shell) == 0 or not views.images:
        return np.nan
    seen = visibility(occupied, grid, views.rig, shell, "quick")
    colors = np.full((len(views.rig), len(shell), 3), np.nan)
    for c, (camera, image) in enumerate(zip(views.rig, views.images, strict=True)):
        if image is None:
            continue
        column, row, inside = pixel_of_voxel(camera, grid.centres(shell))
        here = inside & seen[c]
        colors[c, here] = image[row[here], column[here]]
    several = np.isfinite(colors[..., 0]).sum(0) >= 2
    if not several.any():
        return np.nan
    return float(np.median(np.linalg.norm(np.nanstd(colors[:, several], axis=0), axis=1)))
