"""True poses of a recording, and what estimates are compared with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.model import BodyModel, neutral_state
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell
from hmc.io.recording import Recording
from hmc.io.results import PoseTable, TrackTable, read_joints
from hmc.landmarks import LANDMARKS
from hmc.metrics.persons import match_persons

__all__ = [
    "HEIGHT_M", "all_truth", "estimate_of", "estimates", "first_truth", "nearest_states", "standing_state", "stature_m", "truth_path",
    "truth_track",
]  # fmt: skip

#: Stature where a recording does not say it, metres.
HEIGHT_M = 1.75


def truth_path(recording: Recording) -> Path:
    """The file of a recording's true joints; of one that has another system's in their place, as real ones do, that of these.

    Raises
    ------
    InputError
        When the recording has neither.
    """
    paths = [recording.path / folder / "joints.csv" for folder in ("truth", "reference")]
    for path in paths:
        if path.is_file():
            return path
    raise InputError(f"{recording.path}: has no truth/joints.csv and no reference/joints.csv; this experiment scores poses against it")


def all_truth(recording: Recording) -> PoseTable:
    """True joints of everybody in a recording; `truth_path` says what is refused."""
    return read_joints(truth_path(recording))


def first_truth(recording: Recording) -> PoseTable:
    """True joints of a recording's first person; `all_truth` says what is refused."""
    truth = all_truth(recording)
    return truth.of(int(truth.persons[0]))


def estimate_of(truth: PoseTable, poses: PoseTable) -> np.ndarray:
    """Where the estimated poses have one true person's landmarks, (n, 15, 3), metres; NaN in frames without a pose."""
    names = match_persons(truth.frames, truth.persons, truth.positions, poses.frames, poses.persons, poses.positions)
    estimate = np.full(truth.positions.shape, np.nan)
    for name in names:
        own = poses.of(name)
        _, a, b = np.intersect1d(truth.frames, own.frames, return_indices=True)
        estimate[a] = own.positions[b]
    return estimate


def estimates(one: Cell) -> tuple[np.ndarray, np.ndarray]:
    """Estimated and true landmarks of a cell, (n, 15, 3), metres; NaN where missing."""
    estimate, truth = (np.array(one.results[name], float).reshape(-1, len(LANDMARKS), 3) for name in ("estimate_m", "truth_m"))
    return estimate, truth


def standing_state(body: BodyModel, points: np.ndarray) -> np.ndarray:
    """The neutral pose where a person's hips are and as they face, from landmarks (15, 3), metres: a start for inverse kinematics."""
    state = neutral_state("down", body.limits)
    state[:3] = points[LANDMARKS.index("pelvis")]
    across = points[LANDMARKS.index("l_hip")] - points[LANDMARKS.index("r_hip")]
    state[3] = np.arctan2(-across[0], across[1])
    return state


def nearest_states(body: BodyModel, positions: np.ndarray) -> np.ndarray:
    """The poses of a body that are nearest to true landmarks, each sought from the one before.

    Parameters
    ----------
    body : BodyModel
    positions : ndarray, shape (n, 15, 3)
        In frames that follow one another, metres.

    Returns
    -------
    ndarray, shape (n, 37)
    """
    state, states = standing_state(body, positions[0]), []
    for points in positions:
        state, _ = fit_landmarks(body, points, state)
        states.append(state)
    return np.array(states)


def stature_m(recording: Recording) -> float | None:
    """The first person's stature, if the recording says it, metres."""
    return float(recording.subject_height_m[0]) if recording.subject_height_m else None


def truth_track(truth: PoseTable) -> TrackTable:
    """A track where one true person's joints are, as person 0."""
    return TrackTable(truth.frames, np.zeros(len(truth.frames), int), truth.positions.mean(axis=1))
