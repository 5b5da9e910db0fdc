"""Figure 7.13: SHBM-APF by particles a variable, models 1 and 2: walking asks for model 1, gestures for model 2; with many, neither.

Source: Canton (2009), section 7.5.1.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.study import draw_lines, runs_of, score_table, table_of

__all__ = ["EXPERIMENT"]

ACTIONS = ("walk", "gesture")
#: Particles a variable.
GAMMAS = {False: (10.0, 20.0, 30.0, 50.0, 80.0), True: (10.0, 25.0)}
#: The model that the thesis finds better for an action, as a place in `MODELS`.
BETTER = {"Walking": 0, "Gesture": 1}
MODELS = runs.SHBM[:2]


def grid(plan: Plan) -> list[dict]:
    """Both models with every number of particles on both actions."""
    settings = [{"method": method, "gamma": gamma} for method in MODELS for gamma in GAMMAS[plan.quick]]
    return runs.study_grid(plan, settings, runs.STUDY_FRAMES, ACTIONS)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by particles a variable, a panel an action."""
    frame = runs_of(cells)
    table = score_table(frame, ("action", "method", "gamma"))
    actions = list(dict.fromkeys(frame.action))
    figure, panels = plt.subplots(1, len(actions), figsize=(3.6 * len(actions), 3), sharey=True, squeeze=False)
    claims = []
    for action, axes in zip(actions, panels[0], strict=True):
        labels = {"title": action, "xlabel": "particles a variable", "ylabel": "MMTA at 100 mm (%)"}
        draw_lines(axes, table[table.action == action], "gamma", "MMTA_percent", "method", **labels)
        if action in BETTER:
            own = frame[frame.action == action]
            better, worse = (list(own[own.method == MODELS[place]].run) for place in (BETTER[action], 1 - BETTER[action]))
            claims.append(ahead(f"{action}: model {BETTER[action] + 1} is ahead", better, worse))
    panels[0, 0].legend()
    caption = "SHBM-APF by particles a variable (Canton, Figure 7.13, drawn without numbers)."
    return Report((table_of("fig-7.13", caption, table),), {"fig-7.13": figure}, tuple(claims))


EXPERIMENT = Experiment(
    "fig-7.13", "SHBM-APF by particles a variable", "Canton, Figure 7.13", grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
