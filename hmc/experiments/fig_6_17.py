"""Figure 6.17: the global against the factorised likelihood, 7 cameras and voxels of 2 cm.

Source: Canton (2009), section 6.7.1.2, Eq. 6.17-6.25 and Table 6.2. Which of the two is ahead depends on what moves: in the global
likelihood every part counts by its voxels, so half of it is the trunk; in the factorised one the trunk is one part of ten. Hence one
action with the whole body on its way and one with the arms alone even in the quick mode, and claims action by action.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import filter_runs as runs
from hmc.experiments.by_action import pose_scores
from hmc.experiments.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.filter_grids import LAYERS, PARTICLES, STUDIED, filter_grid, grouped_rows, layer_map, matrix, mmta_bar
from hmc.experiments.five_actions import action_title

__all__ = ["EXPERIMENT"]

LIKELIHOODS = ("global", "factorised")
ACTIONS = {False: STUDIED[False], True: ("walk", "box")}


def grid(plan: Plan) -> list[dict]:
    """Both likelihoods with every number of layers and particles."""
    return filter_grid(
        plan,
        [
            {"likelihood": likelihood, "layers": layers, "particles": particles}
            for likelihood in LIKELIHOODS
            for layers in LAYERS[plan.quick]
            for particles in PARTICLES[plan.quick]
        ],
        ACTIONS,
    )


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by layers and particles for both."""
    layers, particles = LAYERS[plan.quick], PARTICLES[plan.quick]
    rows = grouped_rows(cells, ("annealing", "likelihood", "layers", "particles"))
    each = grouped_rows(cells, ("recording", "annealing", "likelihood", "layers", "particles"))
    figure, panels = plt.subplots(len(runs.ANNEALING), 2, figsize=(6.4, 2.6 * len(runs.ANNEALING)), sharex=True, sharey=True)
    claims = []
    for annealing, line in zip(runs.ANNEALING, panels, strict=True):
        values = {}
        for likelihood, axes in zip(LIKELIHOODS, line, strict=True):
            own = [row for row in rows if (row["annealing"], row["likelihood"]) == (annealing, likelihood)]
            values[likelihood] = matrix(own, layers, particles)
            layer_map(axes, values[likelihood], layers, particles)
            axes.set(title=f"{likelihood}, {annealing} annealing", xlabel="particles a layer", ylabel="layers")
        for action, means in _by_action(cells, annealing).items():
            claims.append(
                Claim(
                    f"{annealing} annealing, {action}: the factorised likelihood is ahead of the global one",
                    means["factorised"] > means["global"],
                    f"MMTA over the grid {means['factorised']:.1f} % against {means['global']:.1f} %",
                )
            )
    mmta_bar(figure, panels)
    caption = "MMTA at 100 mm by likelihood, layers and particles. The paper: Canton, Figure 6.17, in colour without numbers."
    tables = (Table("fig-6.17", caption, rows), Table("fig-6.17-actions", f"{caption} Recording by recording.", each))
    return Report(tables, {"fig-6.17": figure}, tuple(claims))


def _by_action(cells: Sequence[Cell], annealing: str) -> dict[str, dict[str, float]]:
    """Mean MMTA over the grid by action, then likelihood, percent; all together last, where there are several."""
    own = [one for one in cells if one.parameters["annealing"] == annealing]
    groups: dict[str, list[Cell]] = {}
    for one in own:
        groups.setdefault(action_title(one.parameters["recording"]), []).append(one)
    if len(groups) > 1:
        groups["all actions"] = own
    return {
        action: {
            likelihood: float(np.mean([pose_scores([one])["MMTA_percent"] for one in part if one.parameters["likelihood"] == likelihood]))
            for likelihood in LIKELIHOODS
        }
        for action, part in groups.items()
    }


EXPERIMENT = Experiment("fig-6.17", "global against factorised likelihood", "Canton, Figure 6.17", grid, runs.cell, report, runs.FAMILY)
