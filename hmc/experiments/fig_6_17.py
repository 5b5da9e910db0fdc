"""Figure 6.17: the global against the factorised likelihood, by layers and particles.

Source: Canton (2009), section 6.7.1.2: the factorised one "has proved to be a more effective choice"; the global one asks for more layers.
"""

from __future__ import annotations

from collections.abc import Sequence

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report
from hmc.experiments.fig_6_16 import LAYERS, PARTICLES
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.study import draw_maps, runs_of, score_table, table_of

__all__ = ["EXPERIMENT"]

LIKELIHOODS = ("global", "factorised")


def grid(plan: Plan) -> list[dict]:
    """Both likelihoods with every number of layers and particles."""
    settings = [
        {"likelihood": likelihood, "layers": layers, "particles": particles}
        for likelihood in LIKELIHOODS
        for layers in LAYERS[plan.quick]
        for particles in PARTICLES[plan.quick]
    ]
    return runs.study_grid(plan, settings, runs.STUDY_FRAMES, share="sixth")


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by layers and particles for both, and by action."""
    frame = runs_of(cells)
    table = score_table(frame, ("likelihood", "layers", "particles"))
    whole, factorised = (list(frame[frame.likelihood == name].run) for name in LIKELIHOODS)
    claim = ahead("the factorised likelihood is ahead of the global one", factorised, whole, but=("likelihood",))
    caption = "MMTA at 100 mm by likelihood, layers and particles. The paper: Canton, Figure 6.17, in color without numbers."
    figure = draw_maps([(name, table[table.likelihood == name]) for name in LIKELIHOODS], 2)
    actions = score_table(frame, ("action", "likelihood"))
    tables = (table_of("fig-6.17", caption, table), table_of("fig-6.17-actions", f"{caption} By action, over the grid.", actions))
    return Report(tables, {"fig-6.17": figure}, (claim,))


EXPERIMENT = Experiment(
    "fig-6.17", "global against factorised likelihood", "Canton, Figure 6.17", grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
