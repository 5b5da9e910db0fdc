"""Whole bodies among the people who were found in samples of a recording, and who was found in some of them only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import label

from hmc.camera.standing import APART_M, Standing
from hmc.voxels.agreement import bodies
from hmc.voxels.carving import CarvingTables, carve_levels
from hmc.voxels.grid import VoxelGrid, voxels_of

__all__ = ["LITRES", "LOWEST_M", "REACH_M", "TOP_M", "is_known", "judges", "known_hulls", "places_at_times", "within"]

#: Samples by which a place is judged.
JUDGES = 7
#: A person's voxels are no further than this from their axis, metres.
REACH_M = 0.5
#: Who has a whole hull about a place in more than this share of the samples is known already.
KNOWN = 0.5
#: Hulls of a person: litres, where they begin at most and where those of who sits end at least, metres above the floor.
LITRES = (25.0, 220.0)
LOWEST_M, TOP_M = 0.45, 1.05
#: Who reaches higher than this has arms raised, metres.
TALLEST_M = 1.85


def judges(samples: Sequence[Sequence[np.ndarray | None]]) -> list[int]:
    """Some samples, spread over all that have an image of every camera; none where there are too few."""
    whole = [k for k, frame in enumerate(samples) if all(image is not None for image in frame)]
    return [] if len(whole) < JUDGES else [whole[k] for k in np.linspace(0, len(whole) - 1, JUDGES).round().astype(int)]


def known_hulls(tables: CarvingTables, people: Sequence[Sequence[np.ndarray | None]]) -> list[np.ndarray]:
    """Hulls of the people who were found in samples, those of `judges`, bool, shape (nx, ny, nz) each."""
    return [bodies(carve_levels(tables, people[k], (0,))[0], tables) for k in judges(people)]


def places_at_times(grid: VoxelGrid, hulls: Sequence[np.ndarray]) -> list[Standing]:
    """Places at which two samples or more have a whole body, and most have none.

    Parameters
    ----------
    grid : VoxelGrid
    hulls : sequence of ndarray of bool, shape (nx, ny, nz)
        Of `known_hulls`.

    Returns
    -------
    list of Standing
        As tall as what was found there, if no arms were raised.
    """
    seen: list[Standing] = []
    for hull in hulls:
        parts, n = label(hull.any(axis=2), np.ones((3, 3)))
        for part in range(1, n + 1):
            points = grid.centres(voxels_of(hull & (parts == part)[..., None]))
            if _is_body(points, grid.voxel_size_m, LITRES[1]):
                x, y = points[:, :2].mean(axis=0).tolist()
                seen.append(Standing(x, y, min(float(points[:, 2].max()) + grid.voxel_size_m / 2, TALLEST_M)))
    known = [grid.centres(voxels_of(hull)) for hull in hulls]
    places: list[Standing] = []
    for place in seen:
        near = sum(np.hypot(place.x - one.x, place.y - one.y) <= APART_M / 2 for one in seen)
        alone = all(np.hypot(place.x - one.x, place.y - one.y) > APART_M for one in places)
        if near >= 2 and alone and not is_known(known, place, grid.voxel_size_m):
            places.append(place)
    return places


def is_known(hulls: Sequence[np.ndarray], place: Standing, voxel_size_m: float) -> bool:
    """Whether enough samples have the whole body of a known person about a place: one who steps from side to side is not still.

    `hulls` are points of those who are known, (n, 3) each.
    """
    return bool(np.mean([_is_body(hull[within(hull, place, REACH_M)], voxel_size_m) for hull in hulls]) > KNOWN)


def within(points: np.ndarray, place: Standing, radius_m: float) -> np.ndarray:
    """Which of some points, (n, 3), are no further from a place, seen from above."""
    return np.hypot(points[:, 0] - place.x, points[:, 1] - place.y) <= radius_m


def _is_body(points: np.ndarray, voxel_size_m: float, most_litres: float = np.inf) -> bool:
    """Whether voxels of a hull, (n, 3), are a whole person."""
    litres = 1000 * len(points) * voxel_size_m**3
    if not LITRES[0] <= litres <= most_litres:
        return False
    return bool(points[:, 2].min() <= LOWEST_M and points[:, 2].max() + voxel_size_m / 2 >= TOP_M)
