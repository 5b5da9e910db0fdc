"""All pose methods side by side on the five actions, from videos alone: accuracy, frames a second, and what each method draws a frame.

Ours, not a paper's: the table of the README. Every method of the registry that needs no markers takes part, a stranger's too (`--plugin`):
each with its default preset, and each paper's preset with the first method that has it. All have the same tracks and silhouettes. Frames a
second are those of one processor, hulls of the frame included; the median frame counts, so that neither the start nor a rescue does.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator

from hmc.experiments.by_action import scores_by_repeat, spread
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.five_actions import action_title
from hmc.experiments.markerless_runs import VOXEL_M, action_sources, pose_results, run_method, tracked
from hmc.experiments.truth import stature_m
from hmc.plugins import load_plugins, plugins_version
from hmc.pose.follow import FollowOptions
from hmc.pose.method import PoseMethod
from hmc.pose.registry import BUILT_IN, METHODS, pose_method
from hmc.pose.steps.descent.tracker import SmdPreset
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.swarm.step import SwarmPreset

__all__ = ["DEFAULT", "EXPERIMENT", "effort", "title", "ways"]

DEFAULT = "default"
#: Seeds of every method by `plan.quick`, and of the papers' presets.
SEEDS, PAPER_SEEDS = {False: 3, True: 1}, 1


def ways() -> list[tuple[str, str]]:
    """Methods and presets that take part: each method's default, and each paper's preset with the first method that has it."""
    load_plugins()
    found: list[tuple[str, str]] = []
    for name, entry in METHODS.items():
        if not pose_method(name).needs_hulls:
            continue
        papers = {preset for _, preset in found}
        found += [(name, preset) for preset in entry.presets if preset == DEFAULT or preset not in papers]
    return found


def title(parameters: Parameters) -> str:
    """What tables call a cell's method."""
    name, preset = parameters["method"], parameters["preset"]
    return name if preset == DEFAULT else f"{name} {preset}"


def grid(plan: Plan) -> list[dict]:
    """Every method with every seed on every action, by both actors (quick: by the actors in turn).

    Seed after seed, so that a run that is stopped holds all methods.
    """
    sources = action_sources(plan, in_turn=plan.quick)
    return [
        {"recording": source.label, "method": name, "preset": preset, "repeat": repeat} | _version_of(name)
        for repeat in range(SEEDS[plan.quick])
        for name, preset in ways()
        if repeat < PAPER_SEEDS or preset == DEFAULT
        for source in sources
    ]


def _version_of(name: str) -> dict[str, str]:
    """Of a stranger's method, a digest of the files that it may be in: after a change it is computed again."""
    return {} if name in BUILT_IN else {"plugins": plugins_version()}


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres, and processor seconds of the median frame.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``method`` (of the registry), ``preset``, ``repeat``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    seen, ticks = tracked(inputs, parameters["recording"], 0), []

    def timed(steps: Iterable, total: int) -> Iterator:
        for step in steps:
            ticks.append(time.process_time())
            yield step

    options = FollowOptions(VOXEL_M, int(rng.integers(2**31)), stature_m(seen.recording))
    people = run_method(seen, pose_method(parameters["method"], parameters["preset"]), options, timed)
    return pose_results(seen.recording, people) | {"frame_s": float(np.median(np.diff(ticks))) if len(ticks) > 1 else None}


def effort(method: PoseMethod) -> str:
    """What a method draws a frame, in words; empty where its settings do not tell."""
    told = method.settings if isinstance(method.settings, dict) else {"": method.settings}
    for settings in told.values():
        if isinstance(settings, SwarmPreset):
            return f"{settings.swarm.particles} particles, {settings.swarm.iterations} iterations"
        if isinstance(settings, SmdPreset):
            cues = settings.cues
            return f"{sum(cues.surface_points)} surface points, {cues.voxel_points} voxels, contours in {cues.views} views"
        if isinstance(settings, PosePreset) and settings.models:
            return f"{settings.structural.gamma:g} particles an angle, {settings.structural.layers} inner layers"
        if isinstance(settings, PosePreset):
            return f"{settings.annealed.layers} layers of {settings.annealed.particles} particles"
    return ""


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a method, and one for each action."""
    methods: dict[str, list[Cell]] = {}
    for one in cells:
        methods.setdefault(title(one.parameters), []).append(one)
    rows: list[dict[str, Any]] = []
    each: list[dict[str, Any]] = []
    for name, own in methods.items():
        method = pose_method(own[0].parameters["method"], own[0].parameters["preset"])
        rows.append({"method": name} | _scores(own) | {"a frame": effort(method)})
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
        "All pose methods on the five actions, from videos alone, and the spread over seeds; the papers' presets have one seed. Frames "
        "without a pose count as misses; frames a second of one processor, hulls included."
    )
    tables = (Table("all-methods", caption, rows), Table("all-methods-actions", f"{caption} Action by action.", each))
    return Report(tables, {"all-methods": _draw(each)}, claims)


def _scores(cells: Sequence[Cell]) -> dict[str, Any]:
    """Means over the seeds, their spread where there are several, and frames a second."""
    scores = scores_by_repeat(cells)
    seconds = [one.results["frame_s"] for one in cells if one.results["frame_s"]]
    columns: dict[str, Any] = {}
    for name, name_of_spread in (
        ("mean_mm", "mean_spread_mm"),
        ("MMTP_mm", ""),
        ("MMTA_percent", "MMTA_spread_percent"),
        ("MMTA_50_percent", "MMTA_50_spread_percent"),
    ):
        values = [score[name] for score in scores]
        columns[name] = float(np.mean(values))
        if name_of_spread:
            columns[name_of_spread] = spread(values)
    return columns | {"seeds": len(scores), "frames_per_s": float(1 / np.mean(seconds)) if seconds else None}


def _draw(rows: Sequence[dict[str, Any]]) -> plt.Figure:
    """Mean error and frames a second, a mark an action: a color a method, crosses for the papers' presets."""
    figure, axes = plt.subplots(figsize=(6.4, 3.4))
    colors: dict[str, Any] = {}
    for name in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == name and row["frames_per_s"]]
        method, _, preset = name.partition(" ")
        color = colors.setdefault(method, plt.get_cmap("tab10")(len(colors)))
        speed, error = [row["frames_per_s"] for row in own], [row["mean_mm"] for row in own]
        axes.scatter(speed, error, s=18, marker="x" if preset else "o", color=color, label=name)
    axes.set(xlabel="frames a second", ylabel="mean error (mm)", yscale="log", xlim=(0, None))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.minorticks_off()
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1, 0.5))
    return figure


EXPERIMENT = Experiment("all-methods", "all pose methods side by side", "ours; README.md", grid, cell, report, version=4)
