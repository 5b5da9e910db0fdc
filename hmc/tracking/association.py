"""Data association: which person each occupied voxel belongs to. Source: Canton (2009), section 4.3.1."""

from __future__ import annotations

import numpy as np

from hmc.tracking.blobs import Observation
from hmc.tracking.likeness import looks_like_person
from hmc.tracking.region import person_radii, region_distance
from hmc.tracking.settings import FollowingSettings

__all__ = ["assign_voxels", "head_centre", "locating_voxels"]


def assign_voxels(
    observation: Observation, positions: np.ndarray, settings: FollowingSettings | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Which person each occupied voxel belongs to.

    Each person claims the component that fills most of their region of influence, further pieces of which half lies inside, and
    fragments that touch it. A voxel of a component goes to the nearest of its claimants.

    Parameters
    ----------
    observation : Observation
    positions : ndarray, shape (k, 3)
        Where the persons should be: centroids, world, metres.
    settings : FollowingSettings, optional

    Returns
    -------
    owners : ndarray of int, shape (n,)
        Row of `positions`, or -1.
    shared : ndarray of bool, shape (k,)
        The person's main component is another's too.
    """
    settings = FollowingSettings() if settings is None else settings
    n, k = len(observation.points), len(positions)
    if n == 0 or k == 0:
        return np.full(n, -1), np.zeros(k, bool)
    distance = region_distance(observation.points, positions, person_radii(positions, settings.enlarge_xy, settings.enlarge_z))
    inside = distance <= 1
    counts = np.stack([np.bincount(observation.labels[inside[:, j]], minlength=len(observation.blobs)) for j in range(k)], axis=1)
    person_like = looks_like_person(observation.blobs, settings.lifecycle)
    claims = (counts * 2 >= observation.blobs.counts[:, None]) | ((counts > 0) & ~person_like[:, None])
    main = counts.argmax(axis=0)
    found = counts.max(axis=0) > 0
    claims[main[found], np.flatnonzero(found)] = True
    shared = np.array([found[j] and np.any(found & (main == main[j]) & (np.arange(k) != j)) for j in range(k)])
    distance = np.where(claims[observation.labels], distance, np.inf)
    owners = distance.argmin(axis=1)
    owners[distance.min(axis=1) > settings.reach**2] = -1
    return owners, shared


def locating_voxels(observation: Observation, owners: np.ndarray, n_persons: int, settings: FollowingSettings) -> np.ndarray:
    """Voxels from which each person's position is taken: the certain ones, or all of a person who has too few of those.

    Parameters
    ----------
    observation : Observation
    owners : ndarray of int, shape (n,)
        Person of each voxel, or -1.
    n_persons : int
    settings : FollowingSettings

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    held = np.bincount(owners[observation.certain & (owners >= 0)], minlength=n_persons) * observation.voxel_size_m**3
    enough = np.append(held >= settings.least_certain_m3, False)
    return np.where(enough[owners], observation.certain, owners >= 0)


def head_centre(points: np.ndarray) -> np.ndarray:
    """Centre of a person's head: the voxels in the top 20 cm, within 15 cm of the axis on which the highest ones stand.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        The person's voxels, at least one; world, metres.

    Returns
    -------
    ndarray, shape (3,)
        Of meaning for people with the head up.
    """
    top = points[:, 2].max()
    crown = points[points[:, 2] >= top - 0.1].mean(axis=0)
    near = (points[:, 2] >= top - 0.2) & (np.hypot(*(points - crown)[:, :2].T) <= 0.15)
    return points[near].mean(axis=0) if near.any() else crown
