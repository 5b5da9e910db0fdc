"""Poses from videos alone, by the whole chain from silhouettes to poses: one cell is one recording, some of its cameras, one way to do it.

Tracks and silhouettes are made once for all cells of a recording and its cameras. Only the first person of a recording counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from hmc.experiments.engine.experiment import Parameters, Plan, Results, Source
from hmc.experiments.engine.inputs import Inputs, once, rendered
from hmc.experiments.five_actions import ACTIONS, ACTORS, action_name
from hmc.experiments.pose_runs import TRACK_VOXEL_M, VOXEL_M, estimate_of, first_truth
from hmc.io.recording import Recording, open_recording
from hmc.io.results import TrackTable, read_tracks, write_tracks
from hmc.pose.person import FollowSettings
from hmc.pose.sequence import pose_recording
from hmc.pose.steps.presets import PosePreset, pose_preset
from hmc.pose.steps.refine import RefineSettings
from hmc.tracking.resumable import track_recording
from hmc.voxels.hulls import FrontendSettings, HullStep

__all__ = [
    "EVERYTHING", "FAMILY", "FRONTEND", "MASKS_KEY", "SWITCHES", "Way", "action_sources", "cell", "opened", "pose_results",
    "tracked",
]  # fmt: skip

FAMILY = "markerless"
#: One thread: workers share the cores.
FRONTEND = FrontendSettings(threads=1)
MASKS_KEY = "experiments"
EVERYTHING = ""
#: A preset, settings, and a change of every frame's hulls.
Way = tuple[PosePreset, FollowSettings, Callable[[HullStep], HullStep]]


def _same(step: HullStep) -> HullStep:
    return step


def _preset(**changes) -> Callable[[PosePreset], Way]:
    return lambda preset: (replace(preset, **changes), FollowSettings(), _same)


#: What can be switched off, and how: to a preset, settings and a change of every frame's hulls.
SWITCHES: dict[str, Callable[[PosePreset], Way]] = {
    EVERYTHING: _preset(),
    "silhouette rays": lambda preset: _preset(symmetric=replace(preset.symmetric, ray_share=0.0))(preset),
    "tolerant hull": lambda preset: (preset, FollowSettings(), lambda step: replace(step, tolerant=step.strict, loose=step.strict)),
    "strict hull": lambda preset: (preset, FollowSettings(), lambda step: replace(step, strict=step.tolerant, loose=step.tolerant)),
    "refinement": _preset(refine=RefineSettings(iterations=0)),
    "limb search": _preset(search=None),
    "body fit": _preset(fit_body=None),
    "several starts": _preset(start="neutral"),
    "legs told apart": lambda preset: (preset, FollowSettings(legs=None), _same),
}


def action_sources(plan: Plan, actions: Iterable[str] = ACTIONS, actors: Iterable[str] = ACTORS) -> list[Source]:
    """The user's recordings, or the rendered ones of these actions and actors."""
    names = [action_name(action, actor, plan.quick) for action in actions for actor in actors]
    return list(plan.recordings) or [rendered(name) for name in names]


def opened(inputs: Inputs, label: str, cameras: int) -> Recording:
    """A recording with so many of its cameras, evenly spread over the order of their names; 0: all."""
    folder = inputs.recording_folder(label)
    names = open_recording(folder).rig.names
    if not 0 < cameras < len(names):
        return open_recording(folder)
    return open_recording(folder, [names[k * len(names) // cameras] for k in range(cameras)])


def tracked(inputs: Inputs, label: str, cameras: int) -> tuple[Recording, TrackTable, Path]:
    """A recording with so many cameras, its tracks, and the file in which its silhouettes are kept under `MASKS_KEY`."""
    recording = opened(inputs, label, cameras)

    def make(part: Path) -> None:
        part.mkdir()
        tracks = track_recording(
            recording, TRACK_VOXEL_M, frontend=FRONTEND, masks=part / "masks", key=MASKS_KEY, on_problem=lambda line: None
        )
        write_tracks(part / "tracks.csv", tracks)

    folder = once(inputs.folder / label / f"tracks-{len(recording.rig)}-cameras", make)
    return recording, read_tracks(folder / "tracks.csv"), folder / "masks"


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``preset``, ``without`` (a key of `SWITCHES`), ``repeat``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    way = SWITCHES[parameters["without"]](pose_preset(parameters["preset"]))
    return pose_results(tracked(inputs, parameters["recording"], parameters["cameras"]), way, rng)


def pose_results(seen: tuple[Recording, TrackTable, Path], way: Way, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses in one way; landmarks and truth, metres.

    Parameters
    ----------
    seen : tuple
        As from `tracked`.
    way : Way
    rng : numpy.random.Generator
    """
    recording, tracks, masks = seen
    truth = first_truth(recording)
    preset, settings, change = way

    def changed(steps: Iterable[HullStep], total: int) -> Iterator[HullStep]:
        return map(change, steps)

    poses = pose_recording(
        recording, tracks, VOXEL_M, preset, int(rng.integers(2**31)), settings=settings, frontend=FRONTEND, masks=masks, key=MASKS_KEY,
        on_problem=lambda line: None, progress=changed,
    ).poses  # fmt: skip
    return {"frames": truth.frames, "fps": recording.fps, "estimate_m": estimate_of(truth, poses), "truth_m": truth.positions}
