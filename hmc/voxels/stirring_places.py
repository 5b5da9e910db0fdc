"""Where people are who stay on one spot, by what stirs in all views.

They sway, and move their arms: along their outlines, and wherever a limb passed, the images stir (`hmc.camera.stirring`). What stirs in
all views is a hull, as of silhouettes: of all the places through which something of a person moved. People stand in the middle of it, and
they are as tall as all views stir above that place.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.ndimage import binary_fill_holes, gaussian_filter, maximum_filter

from hmc.camera.coverage import nearest_pixels
from hmc.camera.model import Camera
from hmc.camera.people_cut import disc
from hmc.camera.standing import APART_M, Standing
from hmc.voxels.carving import CarvingTables, carve_levels

__all__ = ["stirring_places"]

#: From this amount on an image stirs, 0 to 1. What is thinner than so many pixels of an image whose longer side is 320 does not count,
#: and such gaps are closed.
STIRS, THIN_PX, GAP_PX = 0.9, 3, 9
#: How far around a place the hull is looked at, as the deviation of a bell, metres, and how much of it must be there, litres.
AROUND_M, LEAST_LITRES = 0.25, 26.0
#: A view stirs at a height if it does by this amount so near to the axis, metres; looked at in such steps.
TOP_STIRS, NEAR_M, STEP_M = 0.5, 0.12, 0.03
#: Tops of people, metres: what stirs higher up is something else.
LOWEST_M, HIGHEST_M = 1.0, 2.1
#: Places count that so many views see, and more than this share of all: two that look past each other agree on much beside the room.
FEWEST_VIEWS, MORE_THAN = 3, 0.5


def stirring_places(tables: CarvingTables, amounts: Sequence[np.ndarray], known: Sequence[np.ndarray], most: int = 8) -> list[Standing]:
    """Places at which a person may stand, those first around which most stirs.

    Parameters
    ----------
    tables : CarvingTables
        Of coarse voxels, and of cameras as large as the images.
    amounts, known : sequences of ndarray, shape (height, width)
        What stirs in each view, and where that is known (`hmc.camera.stirring`).
    most : int
        No more places than this.

    Returns
    -------
    list of Standing
    """
    (hull,) = carve_levels(tables, [_solid((amount >= STIRS) & told) for amount, told in zip(amounts, known, strict=True)], (0,))
    size = tables.grid.voxel_size_m
    litres = 1000 * 2 * np.pi * AROUND_M**2 * gaussian_filter(hull.sum(axis=2) * size, AROUND_M / size, mode="constant")
    peak = (maximum_filter(litres, 2 * round(APART_M / size) + 1, mode="constant") == litres) & (litres >= LEAST_LITRES)
    cells = np.argwhere(peak)[np.argsort(-litres[peak], kind="stable")][:most]
    heights = np.arange(LOWEST_M, HIGHEST_M + STEP_M, STEP_M)
    places = []
    for x, y in (tables.grid.origin[:2] + (cells + 0.5) * size).tolist():
        views = [_beside(camera, amount, told, x, y, heights) for camera, amount, told in zip(tables.rig, amounts, known, strict=True)]
        told = np.isfinite(views)
        enough = (told.sum(axis=0) >= FEWEST_VIEWS) & (told.mean(axis=0) > MORE_THAN)
        stirs = heights[enough & (np.where(told, views, np.inf).min(axis=0) >= TOP_STIRS)]
        if len(stirs) and stirs[-1] < heights[-1]:
            places.append(Standing(x, y, float(stirs[-1])))
    return places


def _solid(stirs: np.ndarray) -> np.ndarray:
    """Without what is thin, with gaps closed and holes filled: a plain shirt stirs along its outline alone."""
    solid = cv2.morphologyEx(stirs.view(np.uint8), cv2.MORPH_OPEN, disc(stirs, THIN_PX))
    filled: np.ndarray = binary_fill_holes(cv2.morphologyEx(solid, cv2.MORPH_CLOSE, disc(stirs, GAP_PX)))
    return filled


def _beside(camera: Camera, amount: np.ndarray, known: np.ndarray, x: float, y: float, heights: np.ndarray) -> np.ndarray:
    """The most that a view stirs beside an axis, at heights (n,); NaN where that is not known."""
    dx, dy = x - camera.centre[0], y - camera.centre[1]
    across = np.array([dy, -dx]) / max(np.hypot(dx, dy), 1e-6)
    off = np.arange(-NEAR_M, NEAR_M + STEP_M / 2, STEP_M)
    points = np.empty((len(heights), len(off), 3))
    points[..., :2] = (x, y) + off[:, None] * across
    points[..., 2] = heights[:, None]
    pixels, seen = nearest_pixels(camera, points.reshape(-1, 3))
    u, v = pixels.T
    most = np.where(seen & known[v, u], amount[v, u], -1.0).reshape(points.shape[:2]).max(axis=1)
    return np.where(most < 0, np.nan, most)
