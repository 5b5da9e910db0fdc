"""What each part of the preset `default` adds: the whole, and the whole without one part, several seeds each.

Ours, not a paper's. A part that adds nothing on these recordings may still be what saves another: docs/accuracy.md names those. Without the
tolerant hull the strict one stands for both and the other way round.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import markerless_runs as runs
from hmc.experiments.by_action import scores_by_repeat, spread
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS
from hmc.experiments.pose_intervals import none_better, score_difference

__all__ = ["EXPERIMENT"]

#: Cameras (0: all seven); actions; seeds.
CAMERAS = {False: (0, 4), True: (4,)}
ACTIONS = {False: ("walk", "throw_catch", "box"), True: ("box",)}
SEEDS = 3


def grid(plan: Plan) -> list[dict]:
    """Every switch with every number of cameras and seed (quick: one action by one actor)."""
    sources = runs.action_sources(plan, ACTIONS[plan.quick])[: 1 if plan.quick else None]
    return [
        {"recording": source.label, "cameras": cameras, "preset": "default", "without": switch, "repeat": repeat}
        for cameras in CAMERAS[plan.quick]
        for switch in runs.SWITCHES
        for source in sources
        for repeat in range(SEEDS)
    ]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Mean over recordings and its spread over seeds, for every switch; the difference to the whole beside."""
    rows: list[dict[str, Any]] = []
    cameras = CAMERAS[plan.quick]
    for number in cameras:
        for switch in runs.SWITCHES:
            own = _over_seeds(cells, number, switch)
            cost = score_difference(_of(cells, number, switch), _of(cells, number, runs.EVERYTHING), "mean_mm", ("without",))
            rows.append(
                {
                    "cameras": number or "all",
                    "without": switch or "nothing (the whole)",
                    "mean_mm": float(np.mean(own["mean_mm"])),
                    "mean_spread_mm": spread(own["mean_mm"]),
                    "costs_mm": cost.value,
                    "costs_low_mm": cost.low,
                    "costs_high_mm": cost.high,
                    "MMTA_percent": float(np.mean(own["MMTA_percent"])),
                    "MMTA_50_percent": float(np.mean(own["MMTA_50_percent"])),
                    "MMTA_50_spread_percent": spread(own["MMTA_50_percent"]),
                }
            )
    parts = [switch for switch in runs.SWITCHES if switch != runs.EVERYTHING]
    claims = tuple(
        none_better(
            f"{number or 'all'} cameras: no part is better left out by a millimetre or more",
            _of(cells, number, runs.EVERYTHING),
            {switch: _of(cells, number, switch) for switch in parts},
            ("without",),
        )
        for number in cameras
    )
    caption = (
        "Mean joint error of `default` with one part switched off: mean, standard deviation over seeds, and what leaving "
        "the part out costs, with its interval of 95 % over clips and seeds."
    )
    return Report((Table("what-each-adds", caption, rows),), {"what-each-adds": _draw(rows, cameras)}, claims)


def _of(cells: Sequence[Cell], cameras: int, switch: str) -> list[Cell]:
    return [one for one in cells if (one.parameters["cameras"], one.parameters["without"]) == (cameras, switch)]


def _over_seeds(cells: Sequence[Cell], cameras: int, switch: str) -> dict[str, list[float]]:
    """Scores over all recordings, one value a seed."""
    own = _of(cells, cameras, switch)
    scores = scores_by_repeat(own)
    return {name: [score[name] for score in scores] for name in scores[0]}


def _draw(rows: Sequence[dict], cameras: Sequence[int]) -> plt.Figure:
    figure, panels = plt.subplots(1, len(cameras), figsize=(4.6 * len(cameras), 3.2), sharey=True, squeeze=False)
    for axes, number in zip(panels[0], cameras, strict=True):
        own = [row for row in rows if row["cameras"] == (number or "all")]
        places = np.arange(len(own))[::-1]
        colors = [COLORS["paper"] if row["without"] not in runs.SWITCHES else COLORS["particle"] for row in own]
        axes.barh(places, [row["mean_mm"] for row in own], xerr=[row["mean_spread_mm"] or 0.0 for row in own], color=colors, capsize=2)
        axes.axvline(own[0]["mean_mm"], color=COLORS["paper"], linewidth=0.8)
        axes.set_yticks(places, [row["without"] for row in own])
        axes.set(xlabel="mean error (mm)", title=f"{number or 'all'} cameras, without")
    return figure


EXPERIMENT = Experiment(
    "what-each-adds",
    "what each part of the default preset adds",
    "ours; docs/accuracy.md",
    grid,
    runs.cell,
    report,
    runs.FAMILY,
    runs.VERSION,
)
