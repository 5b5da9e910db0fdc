"""The markerless filter of Canton (2009) by itself: one cell is one recording, some cameras and voxels, and one setting of the filter.

Source: sections 6.5 and 6.7.1. The filter starts from the first frame's true pose, read as a pose of the thesis's body, and the hull is
that around the true person, so that what is measured is neither the tracker's nor the start's. Two ways of annealing: ``printed``, a
survival rate of .5 with the spread following it, and ``strong``, that of the preset `default`, which concentrates 27 dimensions in a few
layers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from time import thread_time

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmark_masks, landmarks
from hmc.body.model import BodyModel
from hmc.body.proportions import canton_body
from hmc.camera.model import Rig
from hmc.experiments.engine.experiment import Parameters, Results
from hmc.experiments.engine.inputs import Inputs, once, read_hulls, write_hulls
from hmc.experiments.markerless_runs import FRONTEND, MASKS_KEY, tracked
from hmc.experiments.truth import HEIGHT_M, first_truth, standing_state, stature_m, truth_track
from hmc.io.masks import MaskStep, kept_masks
from hmc.pose.method import Capture, begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.steps.annealed import DRIFT, annealed_subject
from hmc.pose.steps.presets import PRESETS, PosePreset
from hmc.pose.views.person_view import PersonView, views_of
from hmc.tracking.resumable import person_grid
from hmc.voxels.hulls import HullStep, stream_hulls, stream_masks

__all__ = ["ANNEALING", "FAMILY", "VERSION", "action_drift", "cell", "filter_preset", "follow_from_truth"]

FAMILY = "markerless-filter"
#: Ways of annealing, and the presets that they are taken from.
ANNEALING = {"printed": "canton2009", "strong": "default"}
#: Of the cells that follow from the true first pose.
VERSION = 2
#: The largest variation is that which so many frames do not exceed: inverse kinematics now and then jumps.
USUAL_SHARE = 0.95
#: Of what hardly moves, so much is expected nevertheless, metres and radians.
LEAST_VARIATION = np.r_[np.full(3, 0.02), np.full(N_DOF - 3, np.radians(2))]


def filter_preset(parameters: Parameters) -> PosePreset:
    """The thesis's preset with a cell's likelihood, layers, particles, density and way of annealing."""
    base, annealing = PRESETS["canton2009"], PRESETS[ANNEALING[parameters["annealing"]]]
    return replace(
        base,
        likelihood=parameters["likelihood"],
        density=parameters["density"],
        annealed=replace(annealing.annealed, layers=parameters["layers"], particles=parameters["particles"]),
    )


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the first person from the true first pose; landmarks and truth of the frames after it, metres, and the filter's seconds.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``frames`` (0: all), ``voxel_mm``, ``likelihood``, ``annealing``, ``layers``, ``particles``,
        ``density``, ``repeat``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    return follow_from_truth(filter_preset(parameters), parameters, inputs, rng)


def action_drift(body: BodyModel, positions: np.ndarray) -> np.ndarray:
    """P0 of an action: half of the largest variation of each variable in one frame (Canton 2009, section 3.2.2).

    Parameters
    ----------
    body : BodyModel
    positions : ndarray, shape (n, 15, 3)
        True landmarks in frames that follow one another, metres.

    Returns
    -------
    ndarray, shape (27,)
        Metres and radians.
    """
    state, states = standing_state(body, positions[0]), []
    for one in positions:
        state, _ = fit_landmarks(body, one, state)
        states.append(state)
    if len(states) < 2:
        return 0.5 * LEAST_VARIATION
    change = np.diff(states, axis=0)
    change[:, 3:] = (change[:, 3:] + np.pi) % (2 * np.pi) - np.pi
    return 0.5 * np.maximum(np.quantile(np.abs(change), USUAL_SHARE, axis=0), LEAST_VARIATION)


def follow_from_truth(
    preset: PosePreset,
    parameters: Parameters,
    inputs: Inputs,
    rng: np.random.Generator,
    change: Callable[[MaskStep, Rig, np.ndarray], MaskStep] | None = None,
) -> Results:
    """Follow the first person from the true first pose by a preset's filter.

    Parameters
    ----------
    preset : PosePreset
    parameters : mapping
        ``recording``, ``cameras``, ``frames`` and ``voxel_mm`` as in `cell`.
    inputs : Inputs
    rng : numpy.random.Generator
    change : callable, optional
        Takes a frame's silhouettes, the rig and the true joints (15, 3), and gives the silhouettes that are used.

    Returns
    -------
    Results
        As of `cell`; an estimate is NaN where its limb is missing.
    """
    kept = tracked(inputs, parameters["recording"], parameters["cameras"])
    recording, masks = kept.recording, kept.masks
    truth = every_frame = first_truth(recording)
    if parameters["frames"]:
        truth = truth.where(truth.frames < truth.frames[0] + parameters["frames"])
    voxel_m = parameters["voxel_mm"] / 1000
    grid = person_grid(recording, voxel_m)
    body = canton_body(stature_m(recording) or HEIGHT_M)
    subject = annealed_subject(body, Capture(recording.fps, voxel_m, recording.room, recording.rig), preset)
    subject = replace(subject, extras={DRIFT: action_drift(body, every_frame.positions)})
    state, _ = fit_landmarks(body, truth.positions[0], standing_state(body, truth.positions[0]))
    pose, where = begin_tracking(subject, state), truth_track(truth)
    first, last = int(truth.frames[0]), int(truth.frames[-1]) + 1
    silhouettes = kept_masks(masks, MASKS_KEY, first, last)

    def hulls(steps: Iterable[MaskStep] | None) -> Iterator[HullStep]:
        return stream_hulls(recording, grid, FRONTEND, first=first, last=last, masks=steps, on_problem=lambda line: None)

    if change is None:  # the same for every cell, and dearer than the filter
        name = f"hulls-{len(recording.rig)}-cameras-{parameters['voxel_mm']:g}mm-{first}-{last}"
        seen = read_hulls(once(masks.with_name(name), lambda part: write_hulls(part, hulls(silhouettes))), grid, recording)
    else:
        steps = silhouettes or stream_masks(recording, FRONTEND, first=first, last=last, on_problem=lambda line: None)
        joints = dict(zip(truth.frames.tolist(), truth.positions, strict=True))
        seen = hulls(change(one, recording.rig, joints[one.index]) for one in steps if one.index in joints)
    step, movers = annealed_pose_step(preset), landmark_masks(body)
    estimates, seconds = {}, 0.0
    for hull in seen:
        view = views_of(recording, grid, where, hull).get(0, PersonView(hull.index))
        before = thread_time()
        if hull.index > first:
            pose, info = step(rng, pose, view)
        seconds += thread_time() - before
        estimates[hull.index] = landmarks(body, pose.state)
        if hull.index > first and info.missing is not None:
            estimates[hull.index][movers[:, info.missing].any(axis=1)] = np.nan
    missing = np.full_like(truth.positions[0], np.nan)
    estimate = np.array([estimates.get(frame, missing) for frame in truth.frames.tolist()])
    return {
        "frames": truth.frames[1:],
        "fps": recording.fps,
        "estimate_m": estimate[1:],
        "truth_m": truth.positions[1:],
        "filter_s_per_frame": seconds / max(1, len(truth.frames) - 1),
    }
