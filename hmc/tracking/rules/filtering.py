"""Prediction at constant velocity, and what the filter makes of it.

Shown by all tests of the trackers; filters by `test_two_who_meet_are_followed`.
"""

from __future__ import annotations

from dataclasses import replace
from time import thread_time

import numpy as np

from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import Track
from hmc.tracking.update import FilterEstimate, FrameUpdate

__all__ = ["filter_at", "filter_tracks", "predict"]


def filter_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with predicted positions and the filter's estimate."""
    return filter_at(update, predict(update.state.tracks, update.state.fps))


def filter_at(update: FrameUpdate, predicted: np.ndarray) -> FrameUpdate:
    """The update with the filter's estimate of persons who should be at the given places, shape (k, 3)."""
    begun, state = thread_time(), update.state
    if update.filter is None:
        estimate = FilterEstimate(predicted, np.zeros(len(predicted), bool))
    else:
        estimate = update.filter(replace(state, memories=update.memories), predicted, update.observation)
    memories = estimate.memories or update.memories
    filter_s = thread_time() - begun - estimate.color_s
    return replace(update, predicted=predicted, estimate=estimate, memories=memories, begun_s=begun, filter_s=filter_s)


def predict(tracks: tuple[Track, ...], fps: float) -> np.ndarray:
    """Where people should be in the next frame: they go on as fast as they went, and stay as high as they were.

    Parameters
    ----------
    tracks : tuple of Track
    fps : float
        Frames a second.

    Returns
    -------
    ndarray, shape (k, 3)
        World, metres.
    """
    return np.array([track.position + track.velocity * (1.0, 1.0, 0.0) / fps for track in tracks]).reshape(-1, 3)
