"""Filters from the true first pose, which figures 6.16 to 6.18, 7.13 and 8.1 and tables 6.4, 7.1, 8.1 and 8.2 compare: a cell is one run.

Source: Canton (2009), sections 6.5, 6.7, 7.3 to 7.5 and 8.1. A filter starts from the first frame's true pose, read as a pose of the
thesis's body, and the hull is that around the true person, so that neither the tracker nor the start is measured. P0 is the action's, from
data on which nothing is measured (`hmc.experiments.exploratory`).

Three ways of annealing: ``printed``, all as in the preset `canton2009`; ``variances``, the same with the factors of spreads read as those
of variances; and ``strong``, with the schedules and scalable models of the preset `default`, which concentrate 27 dimensions in few layers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import thread_time
from typing import Any, Literal

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import landmark_masks, landmarks
from hmc.body.model import BodyModel
from hmc.body.proportions import canton_body, stiff_body
from hmc.experiments import marker_runs
from hmc.experiments.engine.experiment import Parameters, Plan, Results
from hmc.experiments.engine.inputs import Inputs, once, read_hulls, write_hulls
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.exploratory import action_drift, measured_truth
from hmc.experiments.five_actions import ACTIONS
from hmc.experiments.markerless_runs import (
    FRONTEND,
    MASKS_KEY,
    VOXEL_M,
    TrackedRecording,
    action_sources,
    pose_results,
    run_method,
    tracked,
)  # fmt: skip
from hmc.experiments.removal import remover
from hmc.experiments.truth import HEIGHT_M, first_truth, standing_state, stature_m, truth_track
from hmc.io.masks import MaskStep, kept_masks
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.follow import FollowOptions
from hmc.pose.method import Capture, Tracked, begin_tracking, particles_of, with_particles
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.methods.scalable import method_preset
from hmc.pose.registry import pose_method
from hmc.pose.steps.annealed import annealed_subject
from hmc.pose.steps.presets import PRESETS, PosePreset
from hmc.pose.views.person_view import PersonView, views_of
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import stream_hulls, stream_masks

__all__ = [
    "ANNEALING", "APF", "BASE", "CHAINS", "FAMILY", "MARKERS", "METHODS", "QUICK_ACTIONS", "SHBM", "STUDY_FRAMES", "VERSION", "cell",
    "evaluations", "followed", "others_grid", "study_body", "study_grid", "study_preset",
]  # fmt: skip

FAMILY = "filters"
VERSION = 1
_PRINTED = PRESETS["canton2009"]
#: Ways of annealing. The thesis calls P0 of Eq. 3.22 a covariance matrix and the factors of section 7.5.1 rates of variance: read so,
#: deviations shrink by the square roots.
ANNEALING: dict[str, PosePreset] = {
    "printed": _PRINTED,
    "variances": replace(
        _PRINTED,
        annealed=replace(_PRINTED.annealed, spread="variance"),
        structural=replace(_PRINTED.structural, inner=_PRINTED.structural.inner**0.5, structural=_PRINTED.structural.structural**0.5),
    ),
    "strong": replace(PRESETS["default"], sparing=None),
}
APF = "APF"
#: Methods, and what they are on the command line.
METHODS: dict[str, tuple[str, tuple[str, ...]]] = {
    APF: ("apf", ()),
    "SHBM-APF, model 1": ("shbm-apf", ("1",)),
    "SHBM-APF, model 2": ("shbm-apf", ("2",)),
    "SHBM-APF, chosen": ("shbm-apf", ("auto",)),
    "DDM-APF": ("ddm-apf", ()),
    "SHBM-DDM-APF": ("shbm-ddm-apf", ("1",)),
}
#: The thesis's models 1 and 2, and ours, which takes the one that suits the last pose.
SHBM = tuple(name for name in METHODS if name.startswith("SHBM-APF"))
#: Frames of the studies of parameters, of recordings of ten seconds; tables are of whole recordings.
STUDY_FRAMES = 180
#: What a study leaves as it is.
BASE: dict[str, Any] = {
    "cameras": 0, "frames": 0, "voxel_mm": 20, "annealing": "printed", "method": APF, "layers": 6, "particles": 600, "gamma": 50.0,
    "likelihood": "factorised", "density": 1.0, "removed": "", "removed_percent": 0,
}  # fmt: skip
#: The same in the quick mode: recordings of 1.6 seconds, half of the particles.
QUICK_BASE = BASE | {"voxel_mm": 30, "particles": 300, "gamma": 25.0}
QUICK_ACTIONS = ("walk", "gesture", "box")
REPEATS = 3
#: Bodies of the same degrees of freedom: of Table 6.1, and with the lengths and the flesh of `default`.
BODIES = {"printed": canton_body, "people's": stiff_body}
#: How far hulls reach beyond a person's joints, metres.
REACH_M = 0.7
#: Beside the filters stand the marker-based filter behind the detector of Table 6.3 ...
_DETECTOR = {"detection_rate": 0.9, "false_positives": 20.0, "variance_px2": 4.0, "layers": 3, "particles": 700, "frames": 0}
MARKERS: dict[str, dict[str, Any]] = {
    "marker-based APF": _DETECTOR | {"preset": "canton2009", "start": "true", "reprojection": 0.0},
    "marker-based APF, default": _DETECTOR | {"preset": "default", "start": "found", "reprojection": 0.5},
}
#: ... and whole chains from videos alone: method and preset.
CHAINS = {"default, APF": ("apf", "default"), "default, SHBM-APF": ("shbm-apf", "default"), "canton2009, APF": ("apf", "canton2009")}


def study_grid(
    plan: Plan,
    settings: Sequence[Mapping[str, Any]],
    frames: int = 0,
    actions: Sequence[str] = tuple(ACTIONS),
    share: Literal["all", "third", "sixth"] = "all",
) -> list[dict[str, Any]]:
    """Every setting on every action by both actors with three seeds, or a balanced share of these; quick: three actions, actors in turn.

    Parameters
    ----------
    plan : Plan
    settings : sequence of mapping
        What differs from `BASE`.
    frames : int
        In full; 0: all. Quick recordings are followed to their end.
    actions : sequence of str
    share : {"all", "third", "sixth"}
        Of the runs in full, the same for all settings: on each recording one of the seeds, in turn; or that on each action, the actors in
        turn.
    """
    shown = [action for action in actions if not plan.quick or action in QUICK_ACTIONS]
    sources = action_sources(plan, shown, in_turn=plan.quick or share == "sixth")
    base = QUICK_BASE if plan.quick else BASE | {"frames": frames}
    return [
        {"recording": source.label} | base | dict(setting) | {REPEAT: repeat}
        for place, source in enumerate(sources)
        for setting in settings
        for repeat in (range(REPEATS) if plan.quick or share == "all" else (place % REPEATS,))
    ]


def others_grid(plan: Plan, methods: Sequence[str]) -> list[dict[str, Any]]:
    """Some of `MARKERS`, with three seeds, and of `CHAINS`, with one a recording, in turn; recordings as in `study_grid`."""
    sources = dict.fromkeys(cell["recording"] for cell in study_grid(plan, [{}]))
    return [
        {"recording": label, "method": method, REPEAT: repeat}
        for method in methods
        for place, label in enumerate(sources)
        for repeat in (range(REPEATS) if method in MARKERS else (place % REPEATS,))
    ]


def study_preset(parameters: Parameters) -> PosePreset:
    """The filter of a cell: the preset `canton2009` with a cell's settings; strong annealing has schedules and models of `default`."""
    annealing = ANNEALING[parameters["annealing"]]
    preset = replace(
        _PRINTED,
        likelihood=parameters["likelihood"],
        density=parameters["density"],
        annealed=replace(annealing.annealed, layers=parameters["layers"], particles=parameters["particles"]),
        structural=replace(annealing.structural, gamma=parameters["gamma"]),
        hull=parameters.get("hull", _PRINTED.hull),
        motion=parameters.get("motion", _PRINTED.motion),
        drift_scale=parameters.get("drift_scale", _PRINTED.drift_scale),
        hierarchies=annealing.hierarchies,
        hidden_limbs=annealing.hidden_limbs,
    )
    return method_preset(preset, *METHODS[parameters["method"]])


def evaluations(parameters: Parameters) -> int:
    """Evaluations of the likelihood a frame: the thesis's number of effective particles."""
    preset = study_preset(parameters)
    if preset.models:
        return preset.structural.layers * int(preset.structural.particles(preset.models[0].added).sum())
    return preset.annealed.layers * preset.annealed.layer_particles(0)


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the first person from the true first pose; landmarks and truth of the frames after it, metres, and the filter's seconds.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``method`` (of `METHODS`; or one of `MARKERS` or `CHAINS`, which have no other settings), ``repeat``, and as in
        `BASE`: ``cameras`` and ``frames`` (0: all), ``voxel_mm``, ``annealing``, ``layers`` and ``particles`` (of the plain filter),
        ``gamma`` (particles a dimension, of models of rising detail), ``likelihood``, ``density``, ``removed_percent`` of the silhouettes
        and ``removed`` (`hmc.experiments.removal`); and, where they differ from the preset's, ``hull``, ``motion`` and ``drift_scale``;
        ``body`` (of `BODIES`); and ``led``, whether the root of all particles is moved on with the person's true centroid.
    inputs : Inputs
    rng : numpy.random.Generator

    Returns
    -------
    Results
        An estimate is NaN where its limb is missing.
    """
    if parameters["method"] in MARKERS:
        return marker_runs.cell({**parameters, **MARKERS[parameters["method"]]}, inputs, rng)
    if parameters["method"] in CHAINS:
        kept, options = tracked(inputs, parameters["recording"], 0), FollowOptions(VOXEL_M, int(rng.integers(2**31)))
        return pose_results(kept.recording, run_method(kept, pose_method(*CHAINS[parameters["method"]]), options))
    kept = tracked(inputs, parameters["recording"], parameters["cameras"])
    return followed(rng, parameters, kept.recording, lambda grid: _hulls(parameters, kept, grid))


def followed(rng: np.random.Generator, parameters: Parameters, recording: Recording, hulls: Callable[[VoxelGrid], Path]) -> Results:
    """Follow the first person from the true first pose in hulls that are there already; parameters and results as of `cell`.

    Parameters
    ----------
    rng : numpy.random.Generator
    parameters : mapping
    recording : Recording
    hulls : callable
        ``hulls(grid)`` is the folder in which `hmc.experiments.engine.inputs.write_hulls` kept those of a grid.
    """
    truth = measured_truth(recording, parameters["recording"])
    if parameters["frames"]:
        truth = truth.where(truth.frames < truth.frames[0] + parameters["frames"])
    voxel_m, preset = parameters["voxel_mm"] / 1000, study_preset(parameters)
    grid = _around(recording, voxel_m)
    body = study_body(parameters, recording)
    capture = Capture(recording.fps, voxel_m, recording.room, recording.rig, action_drift(recording, parameters["recording"]))
    state, _ = fit_landmarks(body, truth.positions[0], standing_state(body, truth.positions[0]))
    pose, where = begin_tracking(annealed_subject(body, capture, preset), state), truth_track(truth)
    first, last = int(truth.frames[0]), int(truth.frames[-1]) + 1
    seen = read_hulls(hulls(grid), grid, recording, first, last)
    step, movers = annealed_pose_step(preset), landmark_masks(body)
    estimates, seconds = {}, 0.0
    for hull in seen:
        view = views_of(recording, grid, where, hull).get(0, PersonView(hull.index))
        before = thread_time()
        if hull.index > first:
            pose, info = step(rng, _led(pose, where, hull.index) if parameters.get("led") else pose, view)
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


def study_body(parameters: Parameters, recording: Recording) -> BodyModel:
    """The body of a cell, of the first person's stature: the thesis's, or one of people's lengths."""
    return BODIES[parameters.get("body", "printed")](stature_m(recording) or HEIGHT_M)


def _led(pose: Tracked, where: TrackTable, frame: int) -> Tracked:
    """The pose and its particles with their root moved on over the floor as the person's centroid moved since the last frame."""
    shift, centres = np.zeros(len(pose.state)), dict(zip(where.frames.tolist(), where.positions, strict=True))
    if frame in centres and frame - 1 in centres:
        shift[:2] = (centres[frame] - centres[frame - 1])[:2]
    last = particles_of(pose)
    moved = with_particles(replace(last, particles=last.particles + shift))
    return replace(pose, state=pose.state + shift, memory={**pose.memory, **moved})


def _around(recording: Recording, voxel_m: float) -> VoxelGrid:
    """Voxels of the part of the room in which the first person ever is: hulls of the rest say nothing of them."""
    joints, room = first_truth(recording).positions.reshape(-1, 3), np.asarray(recording.room, float)
    low, high = joints.min(axis=0) - REACH_M, joints.max(axis=0) + REACH_M
    return VoxelGrid.from_room(np.clip([low, high], *room), voxel_m, len(recording.rig))


def _hulls(parameters: Parameters, kept: TrackedRecording, grid: VoxelGrid) -> Path:
    """The folder of a whole recording's hulls, which all methods share; what is removed must not depend on the method either."""
    recording = kept.recording
    first, last = recording.start, recording.start + recording.n_frames
    name, change = f"hulls-{len(recording.rig)}-cameras-{parameters['voxel_mm']:g}mm", None
    if parameters["removed"]:
        seed = parameters[REPEAT]
        change = remover(parameters["removed"], parameters["removed_percent"] / 100, seed)
        name += f"-{parameters['removed']}-{parameters['removed_percent']:g}-{seed}"

    def make(part: Path) -> None:
        steps: Iterable[MaskStep] | None = kept_masks(kept.masks, MASKS_KEY, first, last)
        if change is not None:
            whole = first_truth(recording)
            joints = dict(zip(whole.frames.tolist(), whole.positions, strict=True))
            steps = steps or stream_masks(recording, FRONTEND, first=first, last=last, on_problem=_quiet)
            steps = (change(one, recording.rig, joints[one.index]) if one.index in joints else one for one in steps)
        write_hulls(part, stream_hulls(recording, grid, FRONTEND, first=first, last=last, masks=steps, on_problem=_quiet))

    return once(kept.masks.with_name(name), make)


def _quiet(line: str) -> None:
    """Problems of a recording were told when it was tracked."""
