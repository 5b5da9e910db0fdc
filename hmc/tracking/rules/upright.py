"""Upright people, counted by all cameras: columns of the strict hull that explain the silhouettes, and whose track each is.

A column is matched with the track that should be there. It keeps that track alive and holds its voxels together, whoever stands beside;
one without a track is a newcomer. People who lie, crouch or are missed by a camera are left to the rules after this one. Shown by the
recipes `close_white`, `close_table`, `close_queue` and `close_pale`, and by `test_two_who_hold_each_other_from_the_first_frame_are_two`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.tracking.blobs import blob_features
from hmc.tracking.columns import BODY_M, Columns, explaining, find_columns, missed, nearest_column
from hmc.tracking.settings import FollowingSettings, LifecycleSettings
from hmc.tracking.update import FrameUpdate

__all__ = ["match_columns", "share_columns"]

#: A track's person is in a column no further away than this, seen from above; metres.
MATCH_M = 0.4
#: A track without a column, and that nothing supported in the frame before, has the nearest that no other has, up to this distance: the
#: person was lost for a moment. Metres.
LOST_M = 0.8
#: Lower ones are furniture as often as people; the rules after this one judge them by more than their height. Metres.
LEAST_TOP_M = 1.1
#: What one camera misses, and nobody is followed at, is a newcomer from this height on: a chair that was moved has a column as well
#: (`meeting_moved`, false positives 0 to 47). Metres.
STANDING_M = 1.4
#: So many per cent of a person's voxels may be noise below.
NOISE_PERCENT = 5


def match_columns(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the upright people of the frame, and the track of each."""
    observation = update.observation
    columns = find_columns(observation)
    columns, others = columns.take(_tall(update, columns, settings.lifecycle)), Columns()
    if observation.views is not None:
        places = observation.views, observation.points
        columns = columns.take(explaining(*places, columns, observation.voxel_size_m, update.state.most)) if len(columns) else columns
        others = find_columns(observation, strict=False)
        apart = (np.hypot(*(others.centres[:, None] - columns.centres).transpose(2, 0, 1)) > MATCH_M).all(axis=1)
        others = others.take(apart & _tall(update, others, settings.lifecycle))
        if len(others):
            others = others.take(missed(*places, columns, others, observation.voxel_size_m, update.state.most))
    stands = [observation.points[rows, 2].max() >= STANDING_M for rows in others.voxels]
    both = Columns(np.concatenate([columns.centres, others.centres]), columns.voxels + others.voxels)
    begins = np.array([True] * len(columns) + stands, bool)
    return replace(update, columns=both, matched=_match(update, both.centres), begins=begins)


def _match(update: FrameUpdate, centres: np.ndarray) -> np.ndarray:
    """Column of each track, or -1, shape (k,): the nearest, those within `MATCH_M` first."""
    across = update.predicted[:, None, :2] - centres
    distance = np.sqrt(np.einsum("kmc,kmc->km", across, across))
    matched = np.full(len(update.predicted), -1)
    lost = np.array([track.last_frame < update.frame - 1 for track in update.state.tracks], bool)
    for reach, may in ((MATCH_M, np.full(len(matched), True)), (LOST_M, lost)):
        tracks, free = np.flatnonzero(may & (matched < 0)), np.setdiff1d(np.arange(len(centres)), matched)
        rows, found = linear_sum_assignment(np.minimum(distance[np.ix_(tracks, free)], 2 * reach))
        rows, found = tracks[rows], free[found]
        near = distance[rows, found] <= reach
        matched[rows[near]] = found[near]
    return matched


def share_columns(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update in which the voxels of each column are its track's, and a newcomer's are nobody's; after all were shared out."""
    columns, observation = update.columns, update.observation
    if not len(columns):
        return update
    nearest, away = nearest_column(observation.points, columns.centres)
    whose = np.full(len(columns), -1)
    whose[update.matched[update.matched >= 0]] = np.flatnonzero(update.matched >= 0)
    return replace(update, owners=np.where(away <= BODY_M, whose[nearest], update.owners))


def _tall(update: FrameUpdate, columns: Columns, limits: LifecycleSettings) -> np.ndarray:
    """Which columns are as high, and reach as far down, as people do; shape (m,) bool."""
    observation = update.observation
    labels = np.concatenate([np.full(len(rows), j) for j, rows in enumerate(columns.voxels)] or [np.zeros(0, int)])
    rows = np.concatenate([*columns.voxels, np.zeros(0, int)]).astype(int)
    blobs = blob_features(observation.points[rows], labels, len(columns), observation.voxel_size_m)
    bottom = np.array([np.percentile(observation.points[one, 2], NOISE_PERCENT) for one in columns.voxels])
    return (
        (blobs.top_m >= LEAST_TOP_M)
        & (blobs.top_m <= limits.most_top_m)
        & (bottom <= limits.most_bottom_m)
        & (blobs.height_m >= limits.least_height_m)
        & (blobs.volume_m3 >= limits.least_volume_m3)
    )
