"""Figure 11: single cues against several, with the arms close to the body.

Source: Kehl (2006), section 7.2: with the surface alone an arm gets stuck to the body; with edges the whole sequence is followed. Here
colors and all cues besides; shirt and skin are alike, as there. Takes about 10 minutes.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import kehl_runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

CUES = ("surface", "surface, edges", "surface, color", "SMD")
TITLES = {"SMD": "all cues"}
ARMS = [LANDMARKS.index(name) for name in ("l_elbow", "l_wrist", "r_elbow", "r_wrist")]
SHOWN_S = (1.9, 3.2, 6.2)


def grid(plan: Plan) -> list[dict]:
    """Four combinations of cues, three times each."""
    return kehl_runs.cell_grid(plan.quick, plan.recordings, "pedal_arms", CUES, 3, SHOWN_S)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Errors of the arms, and some frames."""
    groups = {name: [one for one in cells if one.parameters["variant"] == name] for name in CUES}
    columns = max(len(groups[CUES[0]][0].results["pictures"]), 1)
    figure, panels = plt.subplots(len(CUES), columns, figsize=(2.6 * columns, 10), squeeze=False)
    rows, arms = [], {}
    for line, (name, own) in zip(panels, groups.items(), strict=True):
        for panel, picture in zip(line, own[0].results["pictures"], strict=False):
            kehl_runs.shown(panel, picture, f"{TITLES.get(name, name)}, frame {picture['frame']}")
        errors = [kehl_runs.errors_mm(one) for one in own]
        arms[name] = float(np.mean([e[:, ARMS].mean() for e in errors]))
        rows.append({
            "cues": TITLES.get(name, name), "runs": len(own), "mean_error_mm": float(np.mean(errors)), "arms_mm": arms[name],
            "arms_within_50mm": float(np.mean([(e[:, ARMS] <= 50).mean() for e in errors])),
            "frames_per_s": 1 / float(np.mean([np.mean(one.results["seconds"]) for one in own])),
        })  # fmt: skip
    detail = ", ".join(f"{TITLES.get(name, name)} {value:.1f} mm" for name, value in arms.items())
    claims = (Claim("edges bring elbows and wrists nearer than the surface alone", arms["surface, edges"] < arms["surface"], detail),)
    caption = "Cues with the arms close to the body; arms: elbows and wrists. The paper shows pictures only: Kehl, Figure 11."
    return Report((Table("kehl-11", caption, rows),), {"kehl-11": figure}, claims)


EXPERIMENT = Experiment(
    "kehl-11", "single against several cues", "Kehl, Figure 11", grid, kehl_runs.cell, report, kehl_runs.FAMILY, kehl_runs.VERSION
)
