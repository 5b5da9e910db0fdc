"""Poses from videos alone, by the whole chain from silhouettes to poses: one cell is one recording, some of its cameras, one way to do it.

Tracks and silhouettes are made once for all cells of a recording and its cameras. Only the first person of a recording counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hmc.experiments.engine.experiment import Parameters, Plan, Results, Source
from hmc.experiments.engine.inputs import Inputs, once, rendered
from hmc.experiments.five_actions import ACTIONS, ACTORS, action_name
from hmc.experiments.humaneva import color_cameras
from hmc.experiments.truth import estimate_of, first_truth
from hmc.io.recording import Recording, open_recording
from hmc.io.results import TrackTable, read_tracks, write_tracks
from hmc.pose.follow import FollowOptions, PosedPeople, follow
from hmc.pose.method import PoseMethod
from hmc.pose.methods.annealed import annealed_method
from hmc.pose.steps.presets import PRESETS, PosePreset
from hmc.pose.steps.refine import RefineSettings
from hmc.tracking.resumable import track_recording
from hmc.voxels.hulls import FrontendSettings, HullStep
from hmc.voxels.run_options import RunOptions

__all__ = [
    "EVERYTHING", "FAMILY", "FRONTEND", "MASKS_KEY", "SWITCHES", "TRACK_VOXEL_M", "VERSION", "VOXEL_M", "TrackedRecording",
    "Way", "action_sources", "cell", "chosen_cameras", "opened", "pose_results", "run_method", "tracked",
]  # fmt: skip

FAMILY = "markerless"
#: Of the cells; 2: hulls say nothing below the floor.
VERSION = 2
#: Of poses, and of tracks, metres.
VOXEL_M, TRACK_VOXEL_M = 0.03, 0.05
#: One thread: workers share the cores.
FRONTEND = FrontendSettings(threads=1)
MASKS_KEY = "experiments"
EVERYTHING = ""
#: Passes the frames of a run on.
Progress = Callable[[Iterable, int], Iterable]


@dataclass(frozen=True)
class TrackedRecording:
    """A recording, the tracks of its people, and the file in which its silhouettes are kept under `MASKS_KEY`."""

    recording: Recording
    tracks: TrackTable
    masks: Path


@dataclass(frozen=True)
class Way:
    """One way to do it.

    Parameters
    ----------
    method : PoseMethod
    change : callable, optional
        Changes every frame's hulls.
    """

    method: PoseMethod
    change: Callable[[HullStep], HullStep] | None = None


def _preset(**changes) -> Callable[[PosePreset], Way]:
    return lambda preset: Way(annealed_method(replace(preset, **changes)))


def _method(**changes) -> Callable[[PosePreset], Way]:
    return lambda preset: Way(replace(annealed_method(preset), **changes))


def _hulls(change: Callable[[HullStep], HullStep]) -> Callable[[PosePreset], Way]:
    return lambda preset: Way(annealed_method(preset), change)


#: What can be switched off, and how: in a preset, in the method made of it, or in every frame's hulls.
SWITCHES: dict[str, Callable[[PosePreset], Way]] = {
    EVERYTHING: _preset(),
    "silhouette rays": lambda preset: _preset(symmetric=replace(preset.symmetric, ray_share=0.0))(preset),
    "tolerant hull": _hulls(lambda step: replace(step, tolerant=step.strict, loose=step.strict)),
    "strict hull": _hulls(lambda step: replace(step, strict=step.tolerant, loose=step.tolerant)),
    "refinement": _preset(refine=RefineSettings(iterations=0)),
    "limb search": _preset(search=None),
    "body fit": _preset(fit_body=None),
    "several starts": _preset(start="neutral"),
    "legs told apart": _method(legs=None, alternatives=None),
}


def action_sources(plan: Plan, actions: Iterable[str] = ACTIONS, in_turn: bool = False) -> list[Source]:
    """The user's recordings, or the rendered ones of these actions: by every actor, or each by one, the actors in turn."""
    actors = tuple(ACTORS)
    shown = [(action, actor) for k, action in enumerate(actions) for actor in ((actors[k % len(actors)],) if in_turn else actors)]
    return list(plan.recordings) or [rendered(action_name(action, actor, plan.quick)) for action, actor in shown]


def opened(inputs: Inputs, label: str, cameras: int) -> Recording:
    """A recording with so many of its cameras; 0: all. See `chosen_cameras`."""
    folder = inputs.recording_folder(label)
    names = open_recording(folder).rig.names
    return open_recording(folder, chosen_cameras(names, cameras) if 0 < cameras < len(names) else None)


def chosen_cameras(names: Sequence[str], n: int) -> list[str]:
    """So many cameras: of HumanEva-I those in color first, as the thesis has it; else evenly spread over the order of their names."""
    color = color_cameras(names)
    if n < len(color):
        return [color[k * len(color) // n] for k in range(n)]
    rest, left = [name for name in names if name not in color], n - len(color)
    return [*color, *(rest[k * len(rest) // left] for k in range(left))]


def tracked(inputs: Inputs, label: str, cameras: int) -> TrackedRecording:
    """A recording with so many cameras (0: all), tracked once for all that ask for it."""
    recording = opened(inputs, label, cameras)

    def make(part: Path) -> None:
        part.mkdir()
        run = RunOptions(FRONTEND, masks=part / "masks", key=MASKS_KEY, on_problem=lambda line: None)
        tracks = track_recording(recording, TRACK_VOXEL_M, run=run)
        write_tracks(part / "tracks.csv", tracks)

    every = open_recording(inputs.recording_folder(label)).rig.names
    some_in_color = len(recording.rig) < len(every) and color_cameras(every)  # other cameras than those that are evenly spread
    folder = once(inputs.folder / label / f"tracks-{len(recording.rig)}-cameras{'-color-first' if some_in_color else ''}", make)
    return TrackedRecording(recording, read_tracks(folder / "tracks.csv"), folder / "masks")


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``preset``, ``without`` (a key of `SWITCHES`), ``repeat``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    way = SWITCHES[parameters["without"]](PRESETS[parameters["preset"]])
    seen = tracked(inputs, parameters["recording"], parameters["cameras"])
    options = FollowOptions(VOXEL_M, int(rng.integers(2**31)), change=way.change)
    return pose_results(seen.recording, run_method(seen, way.method, options))


def run_method(seen: TrackedRecording, method: PoseMethod, options: FollowOptions, progress: Progress | None = None) -> PosedPeople:
    """The poses of all persons in a tracked recording by any method.

    Parameters
    ----------
    seen : TrackedRecording
    method : PoseMethod
        As from `hmc.pose.registry.pose_method`, or a change of one.
    options : FollowOptions
    progress : callable, optional
        ``progress(steps, total)`` passes the frames on.
    """
    run = RunOptions(FRONTEND, masks=seen.masks, key=MASKS_KEY, on_problem=lambda line: None, progress=progress)
    return follow(seen.recording, seen.tracks, method, options, run)


def pose_results(recording: Recording, people: PosedPeople) -> Results:
    """Estimated landmarks of the first person and true ones, metres."""
    truth = first_truth(recording)
    return {"frames": truth.frames, "fps": recording.fps, "estimate_m": estimate_of(truth, people.poses), "truth_m": truth.positions}
