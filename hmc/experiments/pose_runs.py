"""Poses estimated by several methods, which the figures of chapter 5 of Canton (2009) measure: one cell is one method on one recording.

The thesis compares two markerless algorithms and a marker-based one on HumanEva-I, which is not public. Here the markerless filter with the
thesis's parameters and with our own, and the marker-based filter behind the synthetic detector (detection rate .9, 20 false
positives a view, variance 4), on rendered recordings or the user's. Only the first person of a recording counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmc.body.proportions import default_body
from hmc.experiments.engine.experiment import Cell, Parameters, Plan, Results, Source
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.markerless_runs import VOXEL_M, pose_results, run_method, tracked
from hmc.experiments.truth import HEIGHT_M, estimates, first_truth, standing_state, stature_m, truth_track
from hmc.io.detections import DetectionTable
from hmc.io.recording import Recording
from hmc.io.results import PoseTable
from hmc.metrics.landmarks import landmark_errors
from hmc.pose.follow import FollowOptions, follow
from hmc.pose.registry import pose_method
from hmc.synthetic.marker_detector import SyntheticDetector, detect_synthetic, seen_by_ideal_detector

__all__ = ["FAMILY", "METHODS", "PAPER_THRESHOLD_MM", "VERSION", "cell", "grid", "pooled_errors_mm", "synthetic_detections"]

FAMILY = "pose"
#: Of these cells.
VERSION = 3
#: Methods and what figures call them.
METHODS = {
    "canton2009": "markerless, the thesis's parameters",
    "default": "markerless, default",
    "markers": "marker based",
}
PAPER_THRESHOLD_MM = 50.0
_QUICK, _FULL = ("markers",), ("demo", "jog", "throw_catch", "gesture", "box")


def grid(plan: Plan) -> list[dict]:
    """Every method on every recording."""
    sources: tuple[Source, ...] = plan.recordings or tuple(rendered(name) for name in (_QUICK if plan.quick else _FULL))
    return [{"recording": source.label, "method": method} for source in sources for method in METHODS]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres."""
    recording = inputs.recording(parameters["recording"])
    options = FollowOptions(VOXEL_M, int(rng.integers(2**31)), stature_m(recording))
    if parameters["method"] != "markers":
        seen = tracked(inputs, parameters["recording"], 0)
        return pose_results(recording, run_method(seen, pose_method("apf", parameters["method"]), options))
    truth = first_truth(recording)
    options = replace(options, detections=synthetic_detections(recording, truth, SyntheticDetector(), rng))
    return pose_results(recording, follow(recording, truth_track(truth), pose_method("marker-apf", skin=False), options))


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
    body = default_body(stature_m(recording) or HEIGHT_M)
    state = standing_state(body, truth.positions[0])
    frames, cameras, uv = [], [], []
    for frame, points in zip(truth.frames, truth.positions, strict=True):
        ideal, state = seen_by_ideal_detector(body, recording.rig, points, state)
        for name, found in zip(recording.rig.names, detect_synthetic(rng, ideal, detector), strict=True):
            frames += [frame] * len(found)
            cameras += [name] * len(found)
            uv.append(found)
    return DetectionTable(np.array(frames, int), np.array(cameras, str), np.concatenate(uv))


def pooled_errors_mm(cells: Sequence[Cell], method: str) -> np.ndarray:
    """Errors of all recordings of a method, (n, 15), millimetres."""
    return 1000 * np.concatenate([landmark_errors(*estimates(one)) for one in cells if one.parameters["method"] == method])
