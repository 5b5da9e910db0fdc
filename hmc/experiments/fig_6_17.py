"""Figure 6.17: the global against the factorised likelihood, 7 cameras and voxels of 2 cm.

Source: Canton (2009), section 6.7.1.2, Eq. 6.17-6.25 and Table 6.2. Which of the two is ahead depends on what moves: in the global
likelihood every part counts by its voxels, so half of it is the trunk; in the factorised one the trunk is one part of ten. Hence one
action with the whole body on its way and one with the arms alone even in the quick mode, and claims action by action. Beside the map there
are all five actions with several seeds, in the cell where the thesis has its best.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import filter_runs as runs
from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.filter_grids import LAYERS, PARTICLES, REPEATS, STUDIED, filter_grid, grouped_rows, layer_map, matrix, mmta_bar
from hmc.experiments.five_actions import action_title
from hmc.experiments.pose_intervals import ahead

__all__ = ["EXPERIMENT"]

LIKELIHOODS = ("global", "factorised")
ACTIONS = {False: STUDIED[False], True: ("walk", "box")}
#: Where all actions are compared, seed by seed.
COMPARED: dict[str, Any] = {"annealing": "strong", "layers": 6, "particles": 600}


def grid(plan: Plan) -> list[dict]:
    """Both likelihoods with every number of layers and particles; and in one cell of these with all actions and seeds."""
    every = _settings(LAYERS[plan.quick], PARTICLES[plan.quick])
    cells = filter_grid(plan, every, ACTIONS, quick_repeats=REPEATS)
    return cells + [parameters for parameters in _compared(plan) if parameters not in cells]


def _compared(plan: Plan) -> list[dict]:
    one = _settings((COMPARED["layers"],), (COMPARED["particles"],))
    return filter_grid(plan, one, dict.fromkeys((False, True), STUDIED[False]), (COMPARED["annealing"],), REPEATS)


def _settings(layers: Sequence[int], particles: Sequence[int]) -> list[dict[str, Any]]:
    return [{"likelihood": likelihood, "layers": n, "particles": size} for likelihood in LIKELIHOODS for n in layers for size in particles]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by layers and particles for both, and by action."""
    layers, particles = LAYERS[plan.quick], PARTICLES[plan.quick]
    wanted = _compared(plan)
    compared = [one for one in cells if one.parameters in wanted]
    cells = cells[: len(filter_grid(plan, _settings(layers, particles), ACTIONS, quick_repeats=REPEATS))]
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
        chosen = [one for one in cells if one.parameters["annealing"] == annealing]
        for action in dict.fromkeys(action_title(one.parameters["recording"]) for one in chosen):
            part = [one for one in chosen if action_title(one.parameters["recording"]) == action]
            claims.append(_claim(f"{annealing} annealing, {action}: the factorised likelihood is ahead of the global one", part))
    mmta_bar(figure, panels)
    caption = "MMTA at 100 mm by likelihood, layers and particles. The paper: Canton, Figure 6.17, in color without numbers."
    seeds = _seed_rows(compared)
    claims.append(_claim("strong annealing, 6 layers of 600, all actions: the factorised likelihood is ahead of the global one", compared))
    tables = (
        Table("fig-6.17", caption, rows),
        Table("fig-6.17-actions", f"{caption} Recording by recording.", each),
        Table("fig-6.17-seeds", f"{caption} Strong annealing, 6 layers of 600, action by action, {REPEATS} seeds.", seeds),
    )
    return Report(tables, {"fig-6.17": figure}, tuple(claims))


def _seed_rows(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Scores by action and likelihood; the spread is over seeds."""
    groups: dict[tuple[str, str], list[Cell]] = {}
    for one in cells:
        groups.setdefault((action_title(one.parameters["recording"]), one.parameters["likelihood"]), []).append(one)
    return [
        {"action": action, "likelihood": likelihood}
        | {name: pose_scores(own)[name] for name in ("MMTA_percent", "mean_mm")}
        | {"MMTA_spread_percent": float(np.std([pose_scores([one])["MMTA_percent"] for one in own]))}
        for (action, likelihood), own in groups.items()
    ]


def _claim(text: str, cells: Sequence[Cell]) -> Claim:
    whole, factorised = ([one for one in cells if one.parameters["likelihood"] == name] for name in LIKELIHOODS)
    return ahead(text, factorised, whole, but=("likelihood",))


EXPERIMENT = Experiment(
    "fig-6.17", "global against factorised likelihood", "Canton, Figure 6.17", grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
