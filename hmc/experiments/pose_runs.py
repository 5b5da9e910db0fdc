"""Poses estimated by several methods, which the figures of chapter 5 of Canton (2009) measure: one cell is one method on one recording.

The thesis compares two markerless algorithms and a marker-based one on HumanEva-I, which is not public. Here the markerless filter with the
thesis's parameters and with our own, and the marker-based filter behind the synthetic detector (detection rate .9, 20 false
positives a view, variance 4), on rendered recordings or the user's. Only the first person of a recording counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import default_body
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Parameters, Plan, Results, Source
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.io.detections import DetectionTable
from hmc.io.recording import Recording
from hmc.io.results import PoseTable, read_joints
from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import landmark_errors
from hmc.metrics.persons import match_persons
from hmc.pose.methods.marker_apf import pose_from_markers
from hmc.pose.sequence import pose_recording
from hmc.pose.steps.marker_filter import marker_preset
from hmc.pose.steps.presets import pose_preset
from hmc.synthetic.marker_detector import SyntheticDetector, detect_synthetic, seen_by_ideal_detector
from hmc.tracking.resumable import track_recording

__all__ = [
    "FAMILY", "METHODS", "PAPER_THRESHOLD_MM", "cell", "estimate_of", "estimates", "first_truth", "grid", "pooled_errors_mm",
    "standing_state", "synthetic_detections",
]  # fmt: skip

FAMILY = "pose"
#: Methods and what figures call them.
METHODS = {
    "canton2009": "markerless, the thesis's parameters",
    "default": "markerless, default",
    "markers": "marker based",
}
PAPER_THRESHOLD_MM = 50.0
VOXEL_M, TRACK_VOXEL_M = 0.03, 0.05
_QUICK, _FULL = ("markers",), ("demo", "jog", "throw_catch", "gesture", "box")


def grid(plan: Plan) -> list[dict]:
    """Every method on every recording."""
    sources: tuple[Source, ...] = plan.recordings or tuple(rendered(name) for name in (_QUICK if plan.quick else _FULL))
    return [{"recording": source.label, "method": method} for source in sources for method in METHODS]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres."""
    recording = inputs.recording(parameters["recording"])
    truth = first_truth(recording)
    seed = int(rng.integers(2**31))
    height = float(recording.subject_height_m[0]) if recording.subject_height_m else None
    if parameters["method"] == "markers":
        table = synthetic_detections(recording, truth, SyntheticDetector(), rng)
        frames = truth.frames.tolist()
        poses = pose_from_markers(
            recording.rig, table, frames, recording.fps, marker_preset("default"), seed, height_m=height, skin=False
        ).poses
    else:
        tracks = track_recording(recording, TRACK_VOXEL_M, seed=seed, on_problem=lambda line: None)
        preset = pose_preset(parameters["method"])
        poses = pose_recording(recording, tracks, VOXEL_M, preset, seed, height_m=height, on_problem=lambda line: None).poses
    return {"frames": truth.frames, "fps": recording.fps, "estimate_m": estimate_of(truth, poses), "truth_m": truth.positions}


def first_truth(recording: Recording) -> PoseTable:
    """True joints of a recording's first person.

    Raises
    ------
    InputError
        When the recording has none.
    """
    path = recording.path / "truth" / "joints.csv"
    if not path.is_file():
        raise InputError(f"{recording.path}: has no truth/joints.csv; this experiment scores poses against it")
    truth = read_joints(path)
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


def standing_state(body: BodyModel, points: np.ndarray) -> np.ndarray:
    """The neutral pose where a person's hips are and as they face, from landmarks (15, 3), metres: a start for inverse kinematics."""
    state = neutral_state("down", body.limits)
    state[:3] = points[LANDMARKS.index("pelvis")]
    across = points[LANDMARKS.index("l_hip")] - points[LANDMARKS.index("r_hip")]
    state[3] = np.arctan2(-across[0], across[1])
    return state


def synthetic_detections(recording: Recording, truth: PoseTable, detector: SyntheticDetector, rng: np.random.Generator) -> DetectionTable:
    """What a marker detector would see of true joints.

    Parameters
    ----------
    recording : Recording
    truth : PoseTable
        Of one person.
    detector : SyntheticDetector
    rng : numpy.random.Generator
    """
    body = default_body(float(recording.subject_height_m[0]) if recording.subject_height_m else 1.75)
    state = standing_state(body, truth.positions[0])
    frames, cameras, uv = [], [], []
    for frame, points in zip(truth.frames, truth.positions, strict=True):
        ideal, state = seen_by_ideal_detector(body, recording.rig, points, state)
        for name, found in zip(recording.rig.names, detect_synthetic(rng, ideal, detector), strict=True):
            frames += [frame] * len(found)
            cameras += [name] * len(found)
            uv.append(found)
    return DetectionTable(np.array(frames, int), np.array(cameras, str), np.concatenate(uv))


def estimates(one: Cell) -> tuple[np.ndarray, np.ndarray]:
    """Estimated and true landmarks of a cell, (n, 15, 3), metres; NaN where missing."""
    estimate, truth = (np.array(one.results[name], float).reshape(-1, len(LANDMARKS), 3) for name in ("estimate_m", "truth_m"))
    return estimate, truth


def pooled_errors_mm(cells: Sequence[Cell], method: str) -> np.ndarray:
    """Errors of all recordings of a method, (n, 15), millimetres."""
    return 1000 * np.concatenate([landmark_errors(*estimates(one)) for one in cells if one.parameters["method"] == method])
