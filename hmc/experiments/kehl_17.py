"""Figures 7 and 17: holding an object. Source: Kehl (2006), sections 6.1.3 and 7.5: a green cube prolongs the arm, and the colors of the
arm's patches keep the cube's voxels out of it. Takes about 5 minutes.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import kehl_runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

CUES = {"SMD": "with colors", "surface, edges": "without colors"}
ARM = [LANDMARKS.index(name) for name in ("r_elbow", "r_wrist")]
SHOWN_S = (1.3, 2.0, 4.3)


def grid(plan: Plan) -> list[dict]:
    """With colors and without, three times each."""
    return kehl_runs.cell_grid(plan.quick, plan.recordings, "play_cube", list(CUES), 3, SHOWN_S)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Errors of the arm that holds the cube, and some frames."""
    groups = {name: [one for one in cells if one.parameters["variant"] == name] for name in CUES}
    columns = max(len(groups["SMD"][0].results["pictures"]), 1)
    figure, panels = plt.subplots(len(CUES), columns, figsize=(3 * columns, 6), squeeze=False)
    rows, arm = [], {}
    for line, (name, own) in zip(panels, groups.items(), strict=True):
        for panel, picture in zip(line, own[0].results["pictures"], strict=False):
            kehl_runs.shown(panel, picture, f"{CUES[name]}, frame {picture['frame']}")
        errors = [kehl_runs.errors_mm(one) for one in own]
        arm[name] = float(np.mean([e[:, ARM].mean() for e in errors]))
        rows.append({
            "cues": CUES[name], "runs": len(own), "mean_error_mm": float(np.mean(errors)), "holding_arm_mm": arm[name],
            "holding_arm_within_50mm": float(np.mean([(e[:, ARM] <= 50).mean() for e in errors])),
        })  # fmt: skip
    detail = ", ".join(f"{CUES[name]} {value:.1f} mm" for name, value in arm.items())
    claims = (Claim("colors bring the arm that holds the cube nearer", arm["SMD"] < arm["surface, edges"], detail),)
    caption = "A cube in the right hand; holding arm: right elbow and wrist. The paper shows pictures only: Kehl, Figure 17."
    return Report((Table("kehl-17", caption, rows),), {"kehl-17": figure}, claims)


EXPERIMENT = Experiment(
    "kehl-17", "holding an object", "Kehl, Figures 7 and 17", grid, kehl_runs.cell, report, kehl_runs.FAMILY, kehl_runs.VERSION
)
