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
from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS

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
        whole = _over_seeds(cells, number, runs.EVERYTHING)
        for switch in runs.SWITCHES:
            own = _over_seeds(cells, number, switch)
            rows.append(
                {
                    "cameras": number or "all",
                    "without": switch or "nothing (the whole)",
                    "mean_mm": float(np.mean(own["mean_mm"])),
                    "mean_spread_mm": float(np.std(own["mean_mm"], ddof=1)),
                    "costs_mm": float(np.mean(own["mean_mm"]) - np.mean(whole["mean_mm"])),
                    "costs_error_mm": float(np.sqrt((np.var(own["mean_mm"], ddof=1) + np.var(whole["mean_mm"], ddof=1)) / SEEDS)),
                    "MMTA_percent": float(np.mean(own["MMTA_percent"])),
                    "MMTA_50_percent": float(np.mean(own["MMTA_50_percent"])),
                    "MMTA_50_spread_percent": float(np.std(own["MMTA_50_percent"], ddof=1)),
                }
            )
    parts = [row for row in rows if row["without"] in runs.SWITCHES]
    harmful = [row for row in parts if row["costs_mm"] < -2 * row["costs_error_mm"]]
    claim = Claim(
        "no part is better left out, beyond twice the error of its difference",
        not harmful,
        "; ".join(f"{row['cameras']} cameras without {row['without']}: {row['costs_mm']:+.1f} mm" for row in harmful or parts),
    )
    caption = (
        f"Mean joint error of `default` with one part switched off, {SEEDS} seeds: mean, standard deviation over seeds, and what leaving "
        "the part out costs, with the standard error of that difference."
    )
    return Report((Table("what-each-adds", caption, rows),), {"what-each-adds": _draw(rows, cameras)}, (claim,))


def _over_seeds(cells: Sequence[Cell], cameras: int, switch: str) -> dict[str, list[float]]:
    """Scores over all recordings, one value a seed."""
    own = [one for one in cells if (one.parameters["cameras"], one.parameters["without"]) == (cameras, switch)]
    scores = [pose_scores([one for one in own if one.parameters["repeat"] == seed]) for seed in range(SEEDS)]
    return {name: [score[name] for score in scores] for name in scores[0]}


def _draw(rows: Sequence[dict], cameras: Sequence[int]) -> plt.Figure:
    figure, panels = plt.subplots(1, len(cameras), figsize=(4.6 * len(cameras), 3.2), sharey=True, squeeze=False)
    for axes, number in zip(panels[0], cameras, strict=True):
        own = [row for row in rows if row["cameras"] == (number or "all")]
        places = np.arange(len(own))[::-1]
        colors = [COLORS["paper"] if row["without"] not in runs.SWITCHES else COLORS["particle"] for row in own]
        axes.barh(places, [row["mean_mm"] for row in own], xerr=[row["mean_spread_mm"] for row in own], color=colors, capsize=2)
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
