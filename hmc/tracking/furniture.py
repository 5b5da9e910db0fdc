"""Voxels that are nobody: what stood there while nobody was near is furniture that was moved, as long as it stands there.

Beyond Canton (2009), whose room is empty when the background is learnt. A chair that somebody moves is foreground from then on, in both
places; left with the people's voxels it draws their filters on, joins people to one another and takes their numbers over.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from hmc.tracking.blobs import Observation, observe

__all__ = ["Furniture", "learn_furniture", "part_of_furniture", "without_furniture"]

#: Nobody whose centroid is further away than this, seen from above, fills a voxel for long: the reach of Sparse Sampling and a little.
AWAY_M = 0.5
#: Nor than this where somebody lies or sits on the floor, whose head is lower than `LEGS_M`.
LYING_AWAY_M = 1.0
#: A voxel that was filled for so long while nobody was near is furniture; seconds.
STANDING_S = 0.6
#: Somebody whose head's centre is so high stands, metres.
UPRIGHT_M = 1.35
#: What somebody who stands fills for long below the first height is within the second of the head, seen from above: arms may be stretched
#: out, legs are not; metres.
LEGS_M, STANCE_M = 1.0, 0.35
#: And is none after it was empty for so long.
EMPTY_S = 0.2
#: What touches furniture and is hardly higher than where it does is more of it; somebody who sits on it is higher by this, metres.
HIGHER_M = 0.2


@dataclass(frozen=True)
class Furniture:
    """What is known of the voxels that were filled while nobody was near.

    Attributes
    ----------
    voxels : ndarray of int, shape (n,)
        Places in the flattened grid, ascending.
    frames : ndarray of int, shape (n,)
        In how many frames each was filled so, less those in which it was empty; counted up to what makes it furniture and a little more.
    """

    voxels: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    frames: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))


def without_furniture(observation: Observation, furniture: Furniture, fps: float) -> tuple[Observation, np.ndarray]:
    """The observation without the voxels that are furniture.

    Parameters
    ----------
    observation : Observation
    furniture : Furniture
    fps : float
        Frames a second.

    Returns
    -------
    observation : Observation
    kept : ndarray of bool, shape (n,)
        Which voxels of the whole observation it has.
    """
    standing = _standing(furniture, fps)
    kept = ~np.isin(_places(observation), standing, assume_unique=True) if standing.size else np.ones(len(observation.points), bool)
    if kept.all():
        return observation, kept
    grid = observation.grid
    occupied, certain = np.zeros((2, *grid.shape), bool)
    occupied[tuple(observation.indices[kept].T)] = True
    certain[tuple(observation.indices[kept & observation.certain].T)] = True
    return observe(grid, occupied, certain, observation.views), kept


def part_of_furniture(points: np.ndarray, observation: Observation, furniture: Furniture, fps: float) -> bool:
    """Whether voxels that look like a person are but more of the furniture that they touch, whose rest is known.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Centres of the voxels, at least one, world, metres.
    observation : Observation
    furniture : Furniture
    fps : float
        Frames a second.
    """
    standing = _standing(furniture, fps)
    if standing.size == 0:
        return False
    places = observation.grid.centres(np.column_stack(np.unravel_index(standing, observation.grid.shape)))
    touched = places[cKDTree(points).query(places, distance_upper_bound=2 * observation.voxel_size_m)[0] < np.inf]
    return bool(len(touched) and points[:, 2].max() <= touched[:, 2].max() + HIGHER_M)


def learn_furniture(
    furniture: Furniture, observation: Observation, people: np.ndarray, heads: np.ndarray, like_people: np.ndarray, fps: float
) -> Furniture:
    """Carry on what is known with this frame.

    Whoever stands is where their head is: their centroid may be between them and a chair that they touch.

    Parameters
    ----------
    furniture : Furniture
    observation : Observation
        The whole one.
    people, heads : ndarray, shape (k, 3)
        Centroids of tracks and candidates, and the centres of their heads, world, metres.
    like_people : ndarray of bool, shape (n,)
        Voxels of the observation that look like somebody who has no track.
    fps : float
        Frames a second.

    Returns
    -------
    Furniture
    """
    if observation.points.size == 0 and furniture.voxels.size == 0:
        return furniture
    low = observation.points[:, 2, None] < LEGS_M
    near = np.where(
        low & (heads[:, 2] >= UPRIGHT_M),
        _beside(observation.points, heads, STANCE_M),
        _beside(observation.points, people, np.where(heads[:, 2] < LEGS_M, LYING_AWAY_M, AWAY_M)),
    )
    away = ~near.any(axis=1) & ~like_people
    places = _places(observation)
    filled = np.isin(furniture.voxels, places, assume_unique=True)
    voxels = np.union1d(furniture.voxels, places[away])
    frames = np.zeros(len(voxels), np.int64)
    frames[np.searchsorted(voxels, furniture.voxels)] = furniture.frames - ~filled
    frames[np.searchsorted(voxels, places[away])] += 1
    known = frames > 0
    return Furniture(voxels[known], np.minimum(frames[known], round((STANDING_S + EMPTY_S) * fps)))


def _beside(points: np.ndarray, people: np.ndarray, reach_m: float | np.ndarray) -> np.ndarray:
    """Which points (n,) are within reach of which places (k,), seen from above."""
    across = points[:, None, :2] - people[None, :, :2]
    return np.einsum("nkc,nkc->nk", across, across) <= reach_m**2


def _places(observation: Observation) -> np.ndarray:
    """Places of the observation's voxels in the flattened grid, ascending."""
    return np.ravel_multi_index(tuple(observation.indices.T), observation.grid.shape)


def _standing(furniture: Furniture, fps: float) -> np.ndarray:
    return furniture.voxels[furniture.frames >= STANDING_S * fps]
