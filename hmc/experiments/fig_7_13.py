"""Figure 7.13: SHBM-APF by particles a variable, models 1 and 2: walking asks for model 1, gestures for model 2.

Source: Canton (2009), section 7.5.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt

from hmc.body.joints import N_DOF
from hmc.experiments import scalable_runs as runs
from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.five_actions import action_title
from hmc.experiments.pose_intervals import ahead

__all__ = ["EXPERIMENT"]

ACTIONS = ("walk", "gesture")
#: Particles a variable.
GAMMAS = {False: (10, 20, 30, 40, 50, 60, 80), True: (10, 50)}
LAYERS = 2


def grid(plan: Plan) -> list[dict]:
    """Every model with every number of particles on both actions."""
    settings = [{"method": method, "evaluations": LAYERS * gamma * N_DOF} for method in runs.SHBM for gamma in GAMMAS[plan.quick]]
    return runs.method_grid(plan, ACTIONS, settings, quick_repeats=3)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by particles a variable, a panel an action."""
    actions = list(dict.fromkeys(action_title(one.parameters["recording"]) for one in cells))
    rows: list[dict[str, Any]] = []
    figure, panels = plt.subplots(1, len(actions), figsize=(3.6 * len(actions), 3), sharey=True, squeeze=False)
    for action, axes in zip(actions, panels[0], strict=True):
        here = [one for one in cells if action_title(one.parameters["recording"]) == action]
        for method in runs.SHBM:
            own: list[dict[str, Any]] = []
            for gamma in GAMMAS[plan.quick]:
                scores = pose_scores(runs.by_method(here, evaluations=LAYERS * gamma * N_DOF)[method])
                own.append({"action": action, "method": method, "particles_a_variable": gamma} | scores)
            axes.plot([row["particles_a_variable"] for row in own], [row["MMTA_percent"] for row in own], "o-", label=method)
            rows += own
        axes.set(title=action, xlabel="particles a variable", ylabel="MMTA at 100 mm (%)")
    panels[0, 0].legend()
    claims = [
        ahead(f"{action}: model {best} is ahead", groups[runs.SHBM[best - 1]], groups[runs.SHBM[2 - best]])
        for action, best in (("Walking", 1), ("Gesture", 2))
        if action in actions
        for groups in [runs.by_method([one for one in cells if action_title(one.parameters["recording"]) == action])]
    ]
    caption = "SHBM-APF by particles a variable (Canton, Figure 7.13, drawn without numbers)."
    return Report((Table("fig-7.13", caption, rows),), {"fig-7.13": figure}, tuple(claims))


EXPERIMENT = Experiment(
    "fig-7.13", "SHBM-APF by particles a variable", "Canton, Figure 7.13", grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
