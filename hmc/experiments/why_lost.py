"""Why the printed filter loses who walks, and not who boxes: single changes of it. Ours, not a paper's.

Source of what is changed: Canton (2009), sections 2.2.4 (tolerance of the hull), 3.1.2.2 (motion), 3.2.2 (P0, Eq. 3.22), 6.7.2 (particles).
The symmetric likelihood and strong annealing are those of `default`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.study import change_of, runs_of, score_table, table_of

__all__ = ["CHANGES", "EXPERIMENT"]

ACTIONS = ("walk", "jog", "box")
AS_PRINTED = "as printed"
#: What is changed, and how (`filter_study.BASE`).
CHANGES: dict[str, Mapping[str, Any]] = {
    AS_PRINTED: {},
    "spreads' factors as variances": {"annealing": "variances"},
    "P0 twice as wide": {"drift_scale": 2.0},
    "both": {"annealing": "variances", "drift_scale": 2.0},
    "root led by the true centroid": {"led": True},
    "constant velocity": {"motion": "smooth"},
    "tolerant hull": {"hull": "tolerant"},
    "four times the particles": {"particles": 2400},
    "the symmetric likelihood": {"likelihood": "symmetric"},
    "strong annealing": {"annealing": "strong"},
    "strong annealing, root led": {"annealing": "strong", "led": True},
    "strong annealing, eight times the particles": {"annealing": "strong", "particles": 4800},
}


def grid(plan: Plan) -> list[dict]:
    """Every change on actions with and without a step."""
    return runs.study_grid(plan, list(CHANGES.values()), runs.STUDY_FRAMES, ACTIONS, share="third")


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by action and change; of who walks and jogs, what each change adds."""
    frame = runs_of(cells)
    frame["change"] = [change_of(one, CHANGES) for one in cells]
    table = score_table(frame, ("action", "change"))
    figure, axes = plt.subplots(figsize=(7.5, 0.34 * len(CHANGES) + 0.9))
    for action, own in table.groupby("action", sort=False):
        axes.plot(own.MMTA_percent, own.change, "o", label=action)
    axes.set(xlabel="MMTA at 100 mm (%)", xlim=(0, 105))
    axes.invert_yaxis()
    axes.legend()
    steps = frame[frame.action != "Box"]
    plain = list(steps[steps.change == AS_PRINTED].run)
    claims = tuple(
        ahead(f"who walks and jogs is followed better: {name}", list(steps[steps.change == name].run), plain, but=tuple(changed))
        for name, changed in CHANGES.items()
        if changed
    )
    caption = "The thesis's filter with single changes, from the true first pose: MMTA at 100 mm by action."
    return Report((table_of("why-lost", caption, table),), {"why-lost": figure}, claims)


EXPERIMENT = Experiment("why-lost", "why the printed filter loses who walks", "ours", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
