"""Figure 11: single cues against several, with the arms close to the body.

Source: Kehl (2006), section 7.2: with the surface alone an arm gets stuck to the body; with edges the whole sequence is followed. Here
colors and all cues besides; shirt and skin are alike, as there. With nothing of ours ("as printed") and in the house's company.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import kehl_runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

CUES = ("surface, as printed", "surface, edges, as printed", "surface", "surface, edges", "surface, color", "SMD")
TITLES = {"SMD": "all cues"}
ARMS = [LANDMARKS.index(name) for name in ("l_elbow", "l_wrist", "r_elbow", "r_wrist")]
SHOWN_S = (1.9, 3.2, 6.2)


def grid(plan: Plan) -> list[dict]:
    """The combinations of cues, three times each on every clip."""
    return kehl_runs.cell_grid(plan, "pedal_arms", CUES, SHOWN_S)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Errors of the arms, and some frames."""
    groups = {name: kehl_runs.of_variant(cells, name) for name in CUES}
    columns = max(len(groups[CUES[0]][0].results["pictures"]), 1)
    figure, panels = plt.subplots(len(CUES), columns, figsize=(2.6 * columns, 15), squeeze=False)
    rows = []
    for line, (name, own) in zip(panels, groups.items(), strict=True):
        for panel, picture in zip(line, own[0].results["pictures"], strict=False):
            kehl_runs.shown(panel, picture, f"{TITLES.get(name, name)}, frame {picture['frame']}")
        errors = [kehl_runs.errors_mm(one) for one in own]
        arms = kehl_runs.error_interval(own, ARMS)
        rows.append({
            "cues": TITLES.get(name, name), "runs": len(own), "mean_error_mm": kehl_runs.error_interval(own).value,
            "arms_mm": arms.value, "arms_low_mm": arms.low, "arms_high_mm": arms.high,
            "arms_within_50mm": float(np.mean([(e[:, ARMS] <= 50).mean() for e in errors])),
            "frames_per_s": 1 / float(np.mean([np.mean(one.results["seconds"]) for one in own])),
        })  # fmt: skip
    claims = tuple(_edges_help(groups, ending) for ending in (", as printed", ""))
    caption = "Cues with the arms close to the body; arms: elbows and wrists. The paper shows pictures only: Kehl, Figure 11."
    return Report((Table("kehl-11", caption, rows),), {"kehl-11": figure}, claims)


def _edges_help(groups: dict[str, list[Cell]], ending: str) -> Claim:
    """The paper's: the surface alone loses an arm at the body, with edges the whole sequence is followed and nearer."""
    alone, edges = groups[f"surface{ending}"], groups[f"surface, edges{ending}"]
    text = f"with edges{ending} the sequence is followed, and elbows and wrists are nearer than with the surface alone"
    return kehl_runs.nearer(text, edges, alone, ARMS)


EXPERIMENT = Experiment(
    "kehl-11", "single against several cues", "Kehl, Figure 11", grid, kehl_runs.cell, report, family=kehl_runs.FAMILY,
    version=kehl_runs.VERSION,
)  # fmt: skip
