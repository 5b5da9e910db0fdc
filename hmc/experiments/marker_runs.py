"""Poses from what a marker detector of a given quality would see of true joints: one cell is one recording, one detector, one filter.

Source: Canton (2009), section 6.6.1. Only the recording's calibration and true joints are used, as the thesis has its markers from the
motion capture of HumanEva-I. Its variance of the detector's error is taken in square pixels, as the error is added to places in images.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import landmarks
from hmc.body.proportions import canton_body, default_body
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Parameters, Results
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.exploratory import action_drift, measured_truth
from hmc.experiments.pose_runs import as_detected, synthetic_detections
from hmc.experiments.truth import HEIGHT_M, estimate_of, standing_state, stature_m, truth_track
from hmc.io.detections import DetectionTable
from hmc.io.recording import Recording
from hmc.io.results import PoseTable
from hmc.pose.follow import FollowOptions, follow
from hmc.pose.method import Capture, begin_tracking, make_subject
from hmc.pose.methods.marker_apf import marker_method
from hmc.pose.steps.marker_filter import MARKER_PRESETS, MarkerPreset, marker_frame
from hmc.pose.views.markers import marker_views, seen_in_frame
from hmc.synthetic.marker_detector import SyntheticDetector

__all__ = ["FAMILY", "VERSION", "cell"]

FAMILY = "markers"
#: Of these cells.
VERSION = 3


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``frames`` (0: all), ``start`` (``found`` from the markers, or ``true``), ``detection_rate``, ``false_positives``,
        ``variance_px2``, ``preset``, ``reprojection`` (share of that score; 0 is the thesis's likelihood), ``layers``, ``particles``,
        ``repeat``; and, where they differ from the preset's, ``drift_scale`` and ``spread``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    recording = as_detected(inputs.unseen_recording(parameters["recording"]))
    truth = measured_truth(recording, parameters["recording"])
    if parameters["frames"]:
        truth = truth.where(truth.frames < truth.frames[0] + parameters["frames"])
    detector = SyntheticDetector(parameters["detection_rate"], parameters["false_positives"], parameters["variance_px2"])
    table = synthetic_detections(recording, truth, detector, rng)
    seed, preset, problem = int(rng.integers(2**31)), _preset(parameters), ""
    if parameters["start"] == "true":
        estimate = _from_the_truth(recording, truth, table, preset, action_drift(recording, parameters["recording"]), rng)
        # The first frame is given.
        truth, estimate = truth.where(np.arange(1, len(truth.frames))), estimate[1:]
    else:
        estimate = np.full(truth.positions.shape, np.nan)
        options = FollowOptions(seed=seed, height_m=stature_m(recording), detections=table)
        try:
            people = follow(recording, truth_track(truth), marker_method(preset, skin=False), options)
            estimate = estimate_of(truth, people.poses)
            problem = "" if "fitted" in people.status else "; ".join(people.notes)
        except InputError as error:  # so many false positives that they look like other people: such a detector is worth no pose
            problem = str(error)
    return {"frames": truth.frames, "fps": recording.fps, "estimate_m": estimate, "truth_m": truth.positions, "problem": problem}


def _from_the_truth(
    recording: Recording, truth: PoseTable, table: DetectionTable, preset: MarkerPreset, drift: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Landmarks of every frame, by the filter alone from the true pose of the first with the action's P0; (n, 15, 3), metres."""
    height = stature_m(recording) or HEIGHT_M
    body = canton_body(height) if preset.body == "canton" else default_body(height)
    subject, views = make_subject(body, Capture(recording.fps, drift=drift)), marker_views(recording.rig)
    state, _ = fit_landmarks(body, truth.positions[0], standing_state(body, truth.positions[0]))
    pose, estimate = begin_tracking(subject, state), [landmarks(body, state)]
    for frame in truth.frames[1:].tolist():
        seen = seen_in_frame(recording.rig, views, table.in_frame(frame, recording.rig.names), preset.likelihood.gate_px)
        pose, _ = marker_frame(rng, pose, seen, preset)
        estimate.append(landmarks(body, pose.state))
    return np.array(estimate)


def _preset(parameters: Parameters) -> MarkerPreset:
    preset = MARKER_PRESETS[parameters["preset"]]
    annealed, chosen = preset.annealed, {name: parameters[name] for name in ("layers", "particles")}
    return replace(
        preset,
        likelihood=replace(preset.likelihood, reprojection=parameters["reprojection"]),
        annealed=replace(annealed, spread=parameters.get("spread", annealed.spread), **chosen),
        drift_scale=parameters.get("drift_scale", preset.drift_scale),
    )
