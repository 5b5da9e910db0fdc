"""Colors of the body's patches, which say with which voxels a point may be matched. Kehl (2006), section 6.1.3."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.body.solid_samples import SurfaceGrid
from hmc.pose.objectives.cue_rows import PosedBody
from hmc.pose.objectives.surface_cue import VoxelCloud, nearest_voxels, place

__all__ = ["ColorModel", "ColorSettings", "color_fits", "learn_colors", "update_colors"]


@dataclass(frozen=True)
class ColorSettings:
    """Parameters of the patches' colors.

    Parameters
    ----------
    rate : float
        alpha of Eq. 16.
    deviations : float
        A color fits within so many standard deviations in every channel.
    least_deviation : float
        A patch's deviations are this at least, grey levels.
    least_voxels : int
        A patch that fewer voxels fit takes any.
    """

    rate: float = 0.3
    deviations: float = 2.5
    least_deviation: float = 12.0
    least_voxels: int = 10


@dataclass(frozen=True)
class ColorModel:
    """One Gaussian a patch and channel.

    Parameters
    ----------
    mean, deviation : ndarray, shape (n_patches, 3)
        YUV; NaN where a patch's color is not known.
    """

    mean: np.ndarray
    deviation: np.ndarray


def learn_colors(grid: SurfaceGrid, posed: PosedBody, cloud: VoxelCloud, colors: np.ndarray, settings: ColorSettings) -> ColorModel:
    """Colors of the patches of a body that is in place: of all its points, the nearest voxel's.

    Parameters
    ----------
    grid : SurfaceGrid
    posed : PosedBody
    cloud : VoxelCloud
        Its own table of colors is not used.
    colors : ndarray, shape (n, 3)
        Of the cloud's voxels, YUV; NaN where unknown.
    settings : ColorSettings
    """
    found, known = _seen(grid, posed, cloud, colors)
    count = np.bincount(grid.patch, known, grid.n_patches)[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = _sums(grid, found, known) / count
        spread = np.sqrt(_sums(grid, (found - mean[grid.patch]) ** 2, known) / count)
    return ColorModel(mean, np.maximum(spread, settings.least_deviation))


def update_colors(
    model: ColorModel, grid: SurfaceGrid, posed: PosedBody, cloud: VoxelCloud, colors: np.ndarray, settings: ColorSettings
) -> ColorModel:
    """Move the means towards what is seen now, Eq. 16; arguments as for `learn_colors`."""
    now = learn_colors(grid, posed, cloud, colors, settings)
    mean = np.where(np.isfinite(now.mean), (1 - settings.rate) * model.mean + settings.rate * now.mean, model.mean)
    unknown = ~np.isfinite(model.mean)
    return replace(model, mean=np.where(unknown, now.mean, mean), deviation=np.where(unknown, now.deviation, model.deviation))


def color_fits(model: ColorModel, colors: np.ndarray, settings: ColorSettings) -> np.ndarray:
    """Which voxels fit which patch.

    Parameters
    ----------
    model : ColorModel
    colors : ndarray, shape (n, 3)
        YUV; a voxel without a color fits all.
    settings : ColorSettings

    Returns
    -------
    ndarray of bool, shape (n_patches, n)
    """
    low, high = (model.mean + sign * settings.deviations * model.deviation for sign in (-1, 1))
    # Written so that NaN on either side fits.
    misfit = np.zeros((len(model.mean), len(colors)), bool)
    for channel in range(3):
        value = colors[:, channel].astype(np.float32)
        misfit |= value < low[:, channel, None].astype(np.float32)
        misfit |= value > high[:, channel, None].astype(np.float32)
    fits = ~misfit
    fits[fits.sum(axis=1) < settings.least_voxels] = True
    return fits


def _seen(grid: SurfaceGrid, posed: PosedBody, cloud: VoxelCloud, colors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The color at every candidate of the surface, and whether it is known."""
    index, _ = nearest_voxels(replace(cloud, barred=None), place(posed, grid.points, grid.segment))
    found = colors[index]
    known = np.isfinite(found).all(axis=1)
    return np.where(known[:, None], found, 0.0), known


def _sums(grid: SurfaceGrid, values: np.ndarray, known: np.ndarray) -> np.ndarray:
    return np.stack([np.bincount(grid.patch, values[:, k] * known, grid.n_patches) for k in range(3)], axis=1)
