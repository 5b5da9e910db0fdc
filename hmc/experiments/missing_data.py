"""Accuracy against the share of silhouette pixels removed: APF, SHBM-APF, DDM-APF and both. Ours, not a paper's.

Whole limbs go in all cameras, or random patches, others in every frame and camera (`hmc.experiments.removal`). A method that leaves a limb
out has no estimate of it: the mean is over what is estimated, MMTA over all.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report
from hmc.experiments.fig_8_1 import settings_of
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.study import draw_lines, runs_of, score_table, table_of
from hmc.experiments.truth import estimates

__all__ = ["EXPERIMENT"]

METHODS = (runs.APF, "SHBM-APF, model 1", "DDM-APF", "SHBM-DDM-APF")
SHARES = {False: (0, 20, 40, 60), True: (0, 40)}
HOW = ("limbs", "patches")
ACTIONS = ("walk", "gesture", "box")
EVALUATIONS = 1200
COLUMNS = {"mean_mm": "mean of what is estimated (mm)", "MMTA_percent": "MMTA at 100 mm (%)", "estimated_percent": "estimated (%)"}


def grid(plan: Plan) -> list[dict]:
    """Every method at every share, limbs and patches; nothing removed is the same for both."""
    settings = [
        settings_of("APF" if "SHBM" not in method else method, "strong", EVALUATIONS)
        | {"method": method, "removed_percent": share, "removed": how if share else ""}
        for share in SHARES[plan.quick]
        for how in (HOW if share else HOW[:1])
        for method in METHODS
    ]
    return runs.study_grid(plan, settings, runs.STUDY_FRAMES, ACTIONS, share="third")


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Mean of what is estimated, MMTA, and the share that is estimated, by share removed."""
    frame = runs_of(cells)
    table = score_table(frame, ("removed", "removed_percent", "method"))
    there = [100 * np.isfinite(estimates(one)[0]).all(axis=-1).mean() for one in cells]
    share = frame.assign(there=there).groupby(["removed", "removed_percent", "method"], sort=False).there.mean()
    table["estimated_percent"] = share.to_numpy()
    figure, panels = plt.subplots(len(HOW), len(COLUMNS), figsize=(9, 2.6 * len(HOW)), sharex=True)
    for how, line in zip(HOW, panels, strict=True):
        own = table[(table.removed == how) | (table.removed == "")]
        for axes, (column, label) in zip(line, COLUMNS.items(), strict=True):
            draw_lines(axes, own, "removed_percent", column, "method", title=how, xlabel="silhouettes removed (%)", ylabel=label)
    panels[0, 0].legend(fontsize=7)
    lost = frame[frame.removed == "limbs"]
    left_out, plain = (list(lost[lost.method == name].run) for name in ("DDM-APF", runs.APF))
    text = "where limbs are removed, what DDM-APF estimates is nearer to the truth than what APF does"
    claim = ahead(text, left_out, plain, "mean_mm", ("method", "gamma"))
    return Report((table_of("missing-data", "Errors by share of silhouette pixels removed.", table),), {"missing-data": figure}, (claim,))


EXPERIMENT = Experiment("missing-data", "accuracy against silhouettes removed", "ours", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
