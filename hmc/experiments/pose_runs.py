"""Poses estimated by several methods, which the figures of chapter 5 of Canton (2009) measure: one cell is one method on one recording.

The thesis compares two markerless algorithms and a marker-based one on HumanEva-I, which is not public. Here the markerless filter with the
thesis's parameters and with our own, and the marker-based filter behind the synthetic detector (detection rate .9, 20 false
positives a view, variance 4; and none, beside it), on whole actions of 6 seconds (quick: 1.6), rendered, or on the user's. Only the first
person of a recording counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmc.body.proportions import default_body
from hmc.camera.model import Rig
from hmc.experiments.engine.experiment import Cell, Parameters, Plan, Results
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.markerless_runs import VOXEL_M, action_sources, pose_results, run_method, tracked
from hmc.experiments.pose_intervals import is_followed
from hmc.experiments.truth import HEIGHT_M, estimates, first_truth, standing_state, stature_m, truth_track
from hmc.io.detections import DetectionTable
from hmc.io.recording import Recording
from hmc.io.results import PoseTable
from hmc.metrics.landmarks import landmark_errors
from hmc.pose.follow import FollowOptions, follow
from hmc.pose.registry import pose_method
from hmc.synthetic.marker_detector import SyntheticDetector, detect_synthetic, seen_by_ideal_detector

__all__ = [
    "FAMILY", "METHODS", "PAPER_THRESHOLD_MM", "VERSION", "as_detected", "cell", "errors_mm", "followed", "grid", "pooled_errors_mm",
    "synthetic_detections",
]  # fmt: skip

FAMILY = "pose"
#: Of these cells.
VERSION = 4
#: Methods and what figures call them.
METHODS = {
    "canton2009": "markerless, the thesis's parameters",
    "default": "markerless, default",
    "markers": "marker based",
    "clean markers": "marker based, none false",
}
#: Detectors: what the thesis's Table 6.3 has, and one that finds nothing but markers.
_DETECTORS = {"markers": SyntheticDetector(0.9, 20.0, 4.0), "clean markers": SyntheticDetector(0.9, 0.0, 4.0)}
PAPER_THRESHOLD_MM = 50.0
#: Actions, by the actors in turn, and seeds: in full and quick.
_ACTIONS = {False: ("walk", "jog", "throw_catch", "gesture", "box"), True: ("walk", "jog", "box")}
_REPEATS = {False: 3, True: 2}
#: Detections are in images of this width, about that of HumanEva-I's, whatever the recording's; pixels.
_WIDTH_PX = 640


def grid(plan: Plan) -> list[dict]:
    """Every method on every recording, with every seed."""
    sources = action_sources(plan, _ACTIONS[plan.quick], in_turn=True)
    return [
        {"recording": source.label, "method": method, "repeat": repeat}
        for source in sources
        for method in METHODS
        for repeat in range(_REPEATS[plan.quick])
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres."""
    recording = inputs.recording(parameters["recording"])
    options = FollowOptions(VOXEL_M, int(rng.integers(2**31)), stature_m(recording))
    if parameters["method"] not in _DETECTORS:
        seen = tracked(inputs, parameters["recording"], 0)
        return pose_results(recording, run_method(seen, pose_method("apf", parameters["method"]), options))
    recording, truth = as_detected(recording), first_truth(recording)
    options = replace(options, detections=synthetic_detections(recording, truth, _DETECTORS[parameters["method"]], rng))
    return pose_results(recording, follow(recording, truth_track(truth), pose_method("marker-apf", skin=False), options))


def as_detected(recording: Recording) -> Recording:
    """A recording with its cameras at the width for which detectors are told: errors are in pixels, and one must be worth the same."""
    return replace(recording, rig=Rig(tuple(camera.scaled(_WIDTH_PX / camera.size[0]) for camera in recording.rig)))


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


def errors_mm(one: Cell) -> np.ndarray:
    """Errors of one cell, (n, 15), millimetres; infinite where nothing was estimated."""
    return 1000 * landmark_errors(*estimates(one))


def followed(cells: Sequence[Cell]) -> list[str]:
    """The methods that follow people at all (`is_followed`): of what is lost altogether, metrics have nothing to tell apart."""
    groups = {method: [one for one in cells if one.parameters["method"] == method] for method in METHODS}
    return [method for method, own in groups.items() if own and is_followed(own)]


def pooled_errors_mm(cells: Sequence[Cell], method: str) -> np.ndarray:
    """Errors of all recordings of a method, (n, 15), millimetres."""
    return np.concatenate([errors_mm(one) for one in cells if one.parameters["method"] == method])
