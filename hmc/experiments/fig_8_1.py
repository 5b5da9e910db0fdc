"""Figure 8.1: APF and SHBM-APF by evaluations a frame: SHBM better at every count.

Source: Canton (2009), section 8.1; at 2,200 the thesis has 58 % better MMTP and 51 % better MMTA. Both ways of annealing are there
(`filter_runs`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt

from hmc.experiments import scalable_runs as runs
from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.filter_grids import STUDIED
from hmc.experiments.filter_runs import ANNEALING
from hmc.experiments.pose_intervals import ahead

__all__ = ["EXPERIMENT"]

COUNTS = {False: (600, 1200, 1800, 2400, 3600), True: (600, 1200, 3600)}
METHODS = (runs.APF, *runs.SHBM)
#: The quick mode has the strong annealing alone.
WAYS = {False: tuple(ANNEALING), True: ("strong",)}
ACTIONS = {False: STUDIED[False], True: ("walk", "box")}


def grid(plan: Plan) -> list[dict]:
    """Every method with every count and both ways of annealing, with three seeds even in the quick mode."""
    settings = [
        {"method": method, "evaluations": count, "annealing": annealing}
        for annealing in WAYS[plan.quick]
        for method in METHODS
        for count in COUNTS[plan.quick]
    ]
    return runs.method_grid(plan, ACTIONS[plan.quick], settings, quick_repeats=3)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTP and MMTA by evaluations, a row of panels a way of annealing."""
    rows: list[dict[str, Any]] = []
    claims, ways = [], WAYS[plan.quick]
    figure, panels = plt.subplots(len(ways), 2, figsize=(7.5, 2.8 * len(ways)), sharex=True, squeeze=False)
    for annealing, line in zip(ways, panels, strict=True):
        for method in METHODS:
            own = []
            for count in COUNTS[plan.quick]:
                chosen = runs.by_method(cells, evaluations=count, annealing=annealing)[method]
                fps = len(chosen) / max(sum(one.results["filter_s_per_frame"] for one in chosen), 1e-9)
                own.append(
                    {"annealing": annealing, "method": method, "evaluations": count} | pose_scores(chosen) | {"filter_frames_per_s": fps}
                )
            rows += own
            for axes, column in zip(line, ("MMTP_mm", "MMTA_percent"), strict=True):
                axes.plot([row["evaluations"] for row in own], [row[column] for row in own], "o-", label=method)
        for axes, label in zip(line, ("MMTP (mm)", "MMTA at 100 mm (%)"), strict=True):
            axes.set(title=f"{annealing} annealing", xlabel="evaluations a frame", ylabel=label)
        for method in METHODS[1:]:
            for count in COUNTS[plan.quick]:
                groups = runs.by_method(cells, evaluations=count, annealing=annealing)
                for score in ("MMTA_percent", "MMTP_mm"):
                    text = f"{annealing} annealing, {count} evaluations: {method} better than APF in {score.partition('_')[0]}"
                    claims.append(ahead(text, groups[method], groups[runs.APF], score))
    panels[0, 1].legend()
    caption = "APF and SHBM-APF by evaluations of the likelihood a frame (Canton, Figure 8.1, drawn without numbers)."
    return Report((Table("fig-8.1", caption, rows),), {"fig-8.1": figure}, tuple(claims))


EXPERIMENT = Experiment(
    "fig-8.1", "APF and SHBM-APF by evaluations", "Canton, Figure 8.1", grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
