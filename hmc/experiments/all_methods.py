"""All pose methods side by side on the five actions, from videos alone: accuracy, frames a second, and what each method draws a frame.

Ours, not a paper's: the table of the README. Every method has the same tracks and silhouettes. Frames a second are those of one
processor, hulls of the frame included; the median frame counts, so that neither the start nor a rescue does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.style import COLOURS
from hmc.experiments.five_actions import action_title
from hmc.experiments.markerless_runs import FRONTEND, MASKS_KEY, action_sources, tracked
from hmc.experiments.pose_runs import VOXEL_M, estimate_of, first_truth
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.methods.pso import SwarmTask, pose_by_swarm, swarm_preset
from hmc.pose.methods.scalable import method_preset
from hmc.pose.methods.smd import smd_preset
from hmc.pose.methods.smd_sequence import SmdTask, pose_by_descent
from hmc.pose.sequence import PosedPeople, pose_recording
from hmc.pose.steps.presets import PosePreset, pose_preset
from hmc.voxels.hulls import HullStep

__all__ = ["EXPERIMENT", "METHODS", "effort"]

#: Names, the command line's method and preset.
METHODS = {
    "APF": ("apf", "default"),
    "APF, canton2009": ("apf", "canton2009"),
    "SHBM-APF": ("shbm-apf", "default"),
    "SHBM-DDM-APF": ("shbm-ddm-apf", "default"),
    "PSO": ("pso", "default"),
    "SMD": ("smd", "default"),
}


def grid(plan: Plan) -> list[dict]:
    """Every method on every action, by the actors in turn (in full: by both)."""
    sources = action_sources(plan)
    if not plan.recordings and plan.quick:
        sources = [source for k, source in enumerate(sources) if k % 4 in (0, 3)]
    return [{"recording": source.label, "method": method} for method in METHODS for source in sources]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres, and processor seconds of the median frame.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``method`` (a key of `METHODS`).
    inputs : Inputs
    rng : numpy.random.Generator
    """
    recording, tracks, masks = tracked(inputs, parameters["recording"], 0)
    truth, ticks = first_truth(recording), []

    def timed(steps: Iterable[HullStep], total: int) -> Iterator[HullStep]:
        for step in steps:
            ticks.append(time.process_time())
            yield step

    run = _way(parameters["method"], recording, tracks, int(rng.integers(2**31)))
    people = run(frontend=FRONTEND, masks=masks, key=MASKS_KEY, on_problem=lambda line: None, progress=timed)
    return {
        "frames": truth.frames,
        "fps": recording.fps,
        "estimate_m": estimate_of(truth, people.poses),
        "truth_m": truth.positions,
        "frame_s": float(np.median(np.diff(ticks))) if len(ticks) > 1 else None,
    }


def _way(name: str, recording: Recording, tracks: TrackTable, seed: int) -> Callable[..., PosedPeople]:
    """What runs a method."""
    method, preset = METHODS[name]
    height = float(recording.subject_height_m[0]) if recording.subject_height_m else None
    if method == "pso":
        swarm = SwarmTask(recording, swarm_preset(preset), seed, height)
        return lambda **passed: pose_by_swarm(swarm, tracks, VOXEL_M, **passed)[0]
    if method == "smd":
        descent = SmdTask(recording, smd_preset(preset), seed, height)
        return lambda **passed: pose_by_descent(descent, tracks, VOXEL_M, **passed)
    filtered = method_preset(pose_preset(preset), method)
    return lambda **passed: pose_recording(recording, tracks, VOXEL_M, filtered, seed, height_m=height, **passed)


def effort(name: str) -> str:
    """What a method draws a frame, in words."""
    method, preset = METHODS[name]
    if method == "pso":
        swarm = swarm_preset(preset).swarm
        return f"{swarm.particles} particles, {swarm.iterations} iterations"
    if method == "smd":
        cues = smd_preset(preset).cues
        return f"{sum(cues.surface_points)} surface points, {cues.voxel_points} voxels, contours in {cues.views} views"
    filtered: PosePreset = method_preset(pose_preset(preset), method)
    if filtered.models:
        return f"{filtered.structural.gamma:g} particles an angle, {filtered.structural.layers} inner layers"
    return f"{filtered.annealed.layers} layers of {filtered.annealed.particles} particles"


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a method, and one for each action."""
    rows, each = [], []
    for name in METHODS:
        own = [one for one in cells if one.parameters["method"] == name]
        rows.append({"method": name} | _scores(own) | {"a frame": effort(name)})
        for action in dict.fromkeys(action_title(one.parameters["recording"]) for one in own):
            part = [one for one in own if action_title(one.parameters["recording"]) == action]
            each.append({"method": name, "action": action} | _scores(part))
    least = min(rows, key=lambda row: row["mean_mm"])
    claims = (
        Claim(
            "the command line's default method is the most accurate, to a millimetre",
            rows[0]["mean_mm"] <= least["mean_mm"] + 1,
            ", ".join(f"{row['method']} {row['mean_mm']:.1f} mm" for row in rows),
        ),
    )
    caption = (
        "All pose methods on the five actions, from videos alone: frames without a pose count as misses; frames a second of one processor, "
        "hulls included."
    )
    tables = (Table("all-methods", caption, rows), Table("all-methods-actions", f"{caption} Action by action.", each))
    return Report(tables, {"all-methods": _draw(each)}, claims)


def _scores(cells: Sequence[Cell]) -> dict[str, Any]:
    scores = pose_scores(cells)
    seconds = [one.results["frame_s"] for one in cells if one.results["frame_s"]]
    return {
        "mean_mm": scores["mean_mm"],
        "MMTP_mm": scores["MMTP_mm"],
        "MMTA_percent": scores["MMTA_percent"],
        "MMTA_50_percent": scores["MMTA_50_percent"],
        "frames_per_s": float(1 / np.mean(seconds)) if seconds else None,
    }


def _draw(rows: Sequence[dict[str, Any]]) -> plt.Figure:
    """Mean error and frames a second, a mark an action."""
    figure, axes = plt.subplots(figsize=(5.2, 3.4))
    colours = list(dict.fromkeys(COLOURS.values()))
    for k, name in enumerate(METHODS):
        own = [row for row in rows if row["method"] == name and row["frames_per_s"]]
        speed, error = [row["frames_per_s"] for row in own], [row["mean_mm"] for row in own]
        axes.scatter(speed, error, s=18, color=colours[k % len(colours)], label=name)
    axes.set(xlabel="frames a second", ylabel="mean error (mm)", xscale="log", yscale="log")
    axes.legend(fontsize=7)
    return figure


EXPERIMENT = Experiment("all-methods", "all pose methods side by side", "ours; README.md", grid, cell, report, version=2)
