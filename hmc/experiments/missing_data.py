"""Accuracy against the share of silhouette pixels removed: APF, SHBM-APF, DDM-APF and both. Ours, not a paper's.

Whole limbs go in all cameras, or random patches, others in every frame and camera (`hmc.experiments.removal`). A method that leaves a limb
out has no estimate of it: the mean is over what is estimated, MMTA over all.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import scalable_runs as runs
from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.truth import estimates

__all__ = ["EXPERIMENT"]

METHODS = (runs.APF, "SHBM-APF, model 1", "DDM-APF", "SHBM-DDM-APF")
SHARES = {False: (0, 10, 20, 30, 40, 50, 60), True: (0, 20, 40, 60)}
HOW = ("limbs", "patches")
ACTIONS = {False: ("walk", "gesture", "box"), True: ("walk",)}


def grid(plan: Plan) -> list[dict]:
    """Every method at every share, limbs and patches; nothing removed is the same for both."""
    settings = [
        {"method": method, "evaluations": 1200, "removed_percent": share, "removed": how if share else ""}
        for method in METHODS
        for share in SHARES[plan.quick]
        for how in (HOW if share else HOW[:1])
    ]
    return runs.method_grid(plan, ACTIONS[plan.quick], settings, quick_repeats=3)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Mean of what is estimated, MMTA, and the share that is estimated, by share removed."""
    rows = []
    figure, panels = plt.subplots(len(HOW), 3, figsize=(9, 2.6 * len(HOW)), sharex=True)
    columns = {"mean_mm": "mean of what is estimated (mm)", "MMTA_percent": "MMTA at 100 mm (%)", "estimated_percent": "estimated (%)"}
    for how, line in zip(HOW, panels, strict=True):
        for method in METHODS:
            own = []
            for share in SHARES[plan.quick]:
                chosen = runs.by_method(cells, removed_percent=share, removed=how if share else "")[method]
                there = np.concatenate([np.isfinite(estimates(one)[0]).all(axis=-1).ravel() for one in chosen])
                own.append(
                    {"removed": how, "removed_percent": share, "method": method, "estimated_percent": 100 * float(there.mean())}
                    | pose_scores(chosen)
                )
            rows += own
            for axes, column in zip(line, columns, strict=True):
                axes.plot([row["removed_percent"] for row in own], [row[column] for row in own], "o-", label=method)
        for axes, label in zip(line, columns.values(), strict=True):
            axes.set(title=how, xlabel="silhouettes removed (%)", ylabel=label)
    panels[0, 0].legend(fontsize=7)

    lost = runs.by_method([one for one in cells if one.parameters["removed"] == "limbs"])
    claim = ahead(
        "where limbs are removed, what DDM-APF estimates is nearer to the truth than what APF does",
        lost["DDM-APF"],
        lost[runs.APF],
        "mean_mm",
    )
    return Report((Table("missing-data", "Errors by share of silhouette pixels removed.", rows),), {"missing-data": figure}, (claim,))


EXPERIMENT = Experiment("missing-data", "accuracy against silhouettes removed", "ours", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
