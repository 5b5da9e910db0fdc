"""What the particle filter and Sparse Sampling ask of the room around each person.

Source: Canton (2009), section 4.3.2: exclusion zones (Eq. 4.12 and 4.13) and the reference histogram's voxels (Eq. 4.11).
"""

from __future__ import annotations

from dataclasses import dataclass
from time import thread_time

import numpy as np

from hmc.tracking.appearance import color_surface, histogram
from hmc.tracking.blobs import Observation
from hmc.tracking.region import person_radii, region_distance
from hmc.tracking.settings import FollowingSettings

__all__ = ["Surroundings", "blocking", "look_around", "looks_of"]

#: Color of a voxel inside the hull, and of a surface voxel that no camera sees.
INNER, UNSEEN = -2, -1


@dataclass(frozen=True)
class Surroundings:
    """The voxels near each person.

    Attributes
    ----------
    rows : tuple of ndarray of int
        The observation's voxels near each person: those of the strict hull where it has enough of them, else all.
    colors : ndarray of int, shape (n,)
        Of every voxel of the observation: bin of its color (`hmc.tracking.appearance.color_bins`), `UNSEEN` or `INNER`. All are
        `INNER` where no colors are asked for.
    color_s : float
        Processor seconds spent on the colors.
    """

    rows: tuple[np.ndarray, ...]
    colors: np.ndarray
    color_s: float = 0.0


def look_around(observation: Observation, centres: np.ndarray, reach_m: float, least_certain_m3: float, color: bool) -> Surroundings:
    """The voxels near each person and, where asked for, the colors of the surface there and nowhere else.

    Parameters
    ----------
    observation : Observation
    centres : ndarray, shape (k, 3)
        Where people should be, world, metres.
    reach_m : float
        Horizontal distance up to which voxels are near.
    least_certain_m3 : float
        Enough of the strict hull.
    color : bool

    Returns
    -------
    Surroundings
    """
    rows = []
    x, y = observation.points[:, 0].copy(), observation.points[:, 1].copy()
    for centre in centres:
        near = np.flatnonzero((x - centre[0]) ** 2 + (y - centre[1]) ** 2 <= reach_m**2)
        certain = near[observation.certain[near]]
        rows.append(certain if len(certain) * observation.voxel_size_m**3 >= least_certain_m3 else near)
    begun = thread_time()
    colors = np.full(len(observation.points), INNER)
    if color and rows:
        asked = np.zeros(len(observation.points), bool)
        asked[np.concatenate(rows)] = True
        skin, bins = color_surface(observation, np.flatnonzero(asked))
        colors[skin] = bins
    return Surroundings(tuple(rows), colors, thread_time() - begun)


def blocking(points: np.ndarray, person: np.ndarray, centres: np.ndarray, sharpness: float) -> np.ndarray:
    """How little the other persons' exclusion zones hinder each point (Canton, Eq. 4.12 and 4.13), in the xy plane.

    Parameters
    ----------
    points : ndarray, shape (n, 2) or (n, 3)
        World, metres.
    person : ndarray of int, shape (n,)
        Whose each point is: a row of `centres`.
    centres : ndarray, shape (k, 3)
        The persons' positions.
    sharpness : float
        ``k``, for metres; 0 or less: there are no zones.

    Returns
    -------
    ndarray, shape (n,)
        Product over the others, 0 to 1.
    """
    x, y = points[:, 0], points[:, 1]
    free = np.ones(len(x))
    if sharpness > 0 and len(centres) > 1:
        for k, centre in enumerate(centres):
            zone = -np.expm1(-sharpness * ((x - centre[0]) ** 2 + (y - centre[1]) ** 2))
            free *= np.where(person == k, 1.0, zone)
    return free


def looks_of(
    observation: Observation, surroundings: Surroundings, positions: np.ndarray, settings: FollowingSettings
) -> tuple[np.ndarray, ...]:
    """What each person looks like in this frame: the histogram of the colored voxels in their ellipsoid (Canton, Eq. 4.11).

    By default a voxel in several ellipsoids does not count, so that people who stand together do not take on one another's colors.

    Parameters
    ----------
    observation : Observation
    surroundings : Surroundings
    positions : ndarray, shape (k, 3)
        The new estimates.
    settings : FollowingSettings
        Of which `shared_looks` and `least_colored` count.

    Returns
    -------
    tuple of ndarray, shape (n_colors,) or (0,)
        Empty where fewer voxels than `least_colored` have a color.
    """
    colored = np.flatnonzero(surroundings.colors >= 0)
    inside = region_distance(observation.points[colored], positions, person_radii(positions, 1.0, 1.0)) <= 1
    if not settings.shared_looks:
        inside &= inside.sum(axis=1, keepdims=True) == 1
    bins = surroundings.colors[colored]
    enough = inside.sum(axis=0) >= settings.least_colored
    return tuple(histogram(bins[mine] if many else bins[:0]) for mine, many in zip(inside.T, enough, strict=True))
