"""Scores of tracks against truth: CLEAR MOT over the frames in which the truth says where everybody is."""

from __future__ import annotations

import numpy as np

from hmc.io.results import PoseTable, TrackTable
from hmc.landmarks import landmark_index
from hmc.metrics.mot import MotScores, clear_mot
from hmc.metrics.persons import frames_in_words

__all__ = ["comparable_tracks", "evaluate_tracks", "pelvis_tracks"]


def evaluate_tracks(estimate: TrackTable, truth: TrackTable) -> MotScores:
    """CLEAR MOT of tracks in the xy plane (`hmc.metrics.mot.clear_mot`), over the frames of `comparable_tracks`."""
    estimate, truth, _ = comparable_tracks(estimate, truth)
    return clear_mot(truth, estimate)


def comparable_tracks(estimate: TrackTable, truth: TrackTable) -> tuple[TrackTable, TrackTable, tuple[str, ...]]:
    """Estimate and truth of the frames in which they can be compared.

    Left out are frames in which the truth has somebody without saying where, since an estimate may stand for them; and, where all frames of
    the truth are a multiple of some frames apart, those between, of which it says nothing.

    Parameters
    ----------
    estimate, truth : TrackTable
        A position that is NaN: not known.

    Returns
    -------
    estimate, truth : TrackTable
    notes : tuple of str
        What was left out, one line each.
    """
    notes = []
    true_frames = np.unique(truth.frames)
    every = int(np.gcd.reduce(np.diff(true_frames))) if len(true_frames) > 1 else 1
    if every > 1:
        notes.append(f"the truth is of one frame in {every}; tracks are compared in these frames alone")
        estimate = estimate.where((estimate.frames - true_frames[0]) % every == 0)
    somewhere = np.unique(truth.frames[np.isnan(truth.positions).any(axis=1)])
    if len(somewhere):
        notes.append(f"tracks are not compared in {frames_in_words(somewhere)}: the truth does not say where everybody is")
        truth, estimate = (table.where(~np.isin(table.frames, somewhere)) for table in (truth, estimate))
    return estimate, truth, tuple(notes)


def pelvis_tracks(poses: PoseTable) -> TrackTable:
    """The pelvis of every pose as a track, for truth that has joints and no centroids.

    Without a pelvis it is the middle of the hips, and without these NaN. A row without any landmark is as good as none.
    """
    poses = poses.where(np.isfinite(poses.positions).any(axis=(1, 2)))
    pelvis, left, right = (poses.positions[:, landmark_index(name)] for name in ("pelvis", "l_hip", "r_hip"))
    points = np.where(np.isnan(pelvis).any(axis=1)[:, None], (left + right) / 2, pelvis)
    return TrackTable(poses.frames, poses.persons, points)
