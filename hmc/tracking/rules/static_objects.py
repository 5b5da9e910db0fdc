"""Static objects: what stood somewhere while no person was near is an object that was moved, as long as it stands there.

Beyond Canton (2009), whose room is empty when the background is learnt. A chair that was moved is foreground from then on, in both
places; left with the people's voxels it draws their filters on, joins people to one another and takes their numbers over. Shown by
`test_a_chair_that_was_pushed_and_left_takes_nobody_over`, `test_where_a_thing_was_taken_for_a_person_nothing_begins_while_it_stands_there`
and, of people who lie, `test_a_person_who_lies_down_and_gets_up_again_keeps_the_number`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from hmc.tracking.blobs import Observation, observe
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import StaticObjects, Track, TrackRow
from hmc.tracking.update import FrameUpdate

__all__ = ["hide_static_objects", "learn_static", "learn_static_objects", "reject_static_objects", "without_static"]

#: No person whose centroid is further away than this, seen from above, fills a voxel for long: the reach of Sparse Sampling and a little.
AWAY_M = 0.5
#: Nor than this where a person lies or sits on the floor, whose head is lower than `LEGS_M`.
LYING_AWAY_M = 1.0
#: A voxel that was filled for so long while no person was near is static; seconds.
STANDING_S = 0.6
#: A person whose head's centre is so high stands, metres.
UPRIGHT_M = 1.35
#: What a standing person fills for long below the first height is within the second of the head, seen from above: arms may be stretched
#: out, legs are not; metres.
LEGS_M, STANCE_M = 1.0, 0.35
#: And is not static after it was empty for so long.
EMPTY_S = 0.2
#: What touches a static object and is hardly higher than where it does is more of it; a person on it is higher by this, metres.
HIGHER_M = 0.2


def hide_static_objects(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update whose observation has no voxel of a static object."""
    observation, visible = without_static(update.whole, update.state.static, update.state.fps)
    free = np.full(len(observation.points), -1)
    return replace(update, observation=observation, visible=visible, owners=free, pushed=free)


def reject_static_objects(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update without detections that are but more of a static object that they touch."""
    standing = _standing(update.state.static, update.state.fps)
    if standing.size == 0:
        return update
    grid = update.observation.grid
    places = grid.centres(np.column_stack(np.unravel_index(standing, grid.shape)))
    return replace(update, detections=tuple(rows for rows in update.detections if not _is_more_of(update.observation, rows, places)))


def learn_static_objects(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with what is known of static objects after the frame."""
    people: list[Track | TrackRow] = [*update.tracks, *(candidate.rows[-1] for candidate in update.candidates)]
    return replace(update, static=learn_static(update.state.static, update.whole, people, update.state.fps))


def without_static(observation: Observation, static: StaticObjects, fps: float) -> tuple[Observation, np.ndarray]:
    """The observation without the voxels that are static.

    Parameters
    ----------
    observation : Observation
    static : StaticObjects
    fps : float
        Frames a second.

    Returns
    -------
    observation : Observation
    kept : ndarray of bool, shape (n,)
        Which voxels of the whole observation it has.
    """
    standing = _standing(static, fps)
    kept = ~np.isin(_places(observation), standing, assume_unique=True) if standing.size else np.ones(len(observation.points), bool)
    if kept.all():
        return observation, kept
    grid = observation.grid
    occupied, certain = np.zeros((2, *grid.shape), bool)
    occupied[tuple(observation.indices[kept].T)] = True
    certain[tuple(observation.indices[kept & observation.certain].T)] = True
    return observe(grid, occupied, certain, observation.views), kept


def learn_static(static: StaticObjects, observation: Observation, people: Iterable[Track | TrackRow], fps: float) -> StaticObjects:
    """What is known of static objects after a frame: only what all cameras see is one.

    The tolerant hull of four cameras fills places between people where nothing stands; hidden there, people who come by were lost.

    A standing person is where their head is: their centroid may be between them and a chair that they touch.

    Parameters
    ----------
    static : StaticObjects
    observation : Observation
        The whole one.
    people : iterable of Track or TrackRow
        Tracks and candidates.
    fps : float
        Frames a second.
    """
    if observation.points.size == 0 and static.voxels.size == 0:
        return static
    there = list(people)
    centroids = np.array([one.position for one in there]).reshape(-1, 3)
    heads = np.array([one.head for one in there]).reshape(-1, 3)
    low = observation.points[:, 2, None] < LEGS_M
    near = np.where(
        low & (heads[:, 2] >= UPRIGHT_M),
        _beside(observation.points, heads, STANCE_M),
        _beside(observation.points, centroids, np.where(heads[:, 2] < LEGS_M, LYING_AWAY_M, AWAY_M)),
    )
    away = ~near.any(axis=1) & observation.certain
    places = _places(observation)
    filled = np.isin(static.voxels, places, assume_unique=True)
    voxels = np.union1d(static.voxels, places[away])
    frames = np.zeros(len(voxels), np.int64)
    frames[np.searchsorted(voxels, static.voxels)] = static.frames - ~filled
    frames[np.searchsorted(voxels, places[away])] += 1
    known = frames > 0
    return StaticObjects(voxels[known], np.minimum(frames[known], round((STANDING_S + EMPTY_S) * fps)))


def _is_more_of(observation: Observation, rows: np.ndarray, places: np.ndarray) -> bool:
    """Whether the voxels in `rows` touch what stands at positions (m, 3) and are hardly higher."""
    points = observation.points[rows]
    touched = places[cKDTree(points).query(places, distance_upper_bound=2 * observation.voxel_size_m)[0] < np.inf]
    return bool(len(touched) and points[:, 2].max() <= touched[:, 2].max() + HIGHER_M)


def _beside(points: np.ndarray, people: np.ndarray, reach_m: float | np.ndarray) -> np.ndarray:
    """Which points (n,) are within reach of which places (k,), seen from above."""
    across = points[:, None, :2] - people[None, :, :2]
    return np.einsum("nkc,nkc->nk", across, across) <= reach_m**2


def _places(observation: Observation) -> np.ndarray:
    """Places of the observation's voxels in the flattened grid, ascending."""
    return np.ravel_multi_index(tuple(observation.indices.T), observation.grid.shape)


def _standing(static: StaticObjects, fps: float) -> np.ndarray:
    return static.voxels[static.frames >= STANDING_S * fps]
