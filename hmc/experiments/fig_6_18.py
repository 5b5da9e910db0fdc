"""Figure 6.18: the density of the flesh table: MMTA and frames a second.

Source: Canton (2009), section 6.7.1.3, Eq. 6.26: the spacing of the flesh over the voxel size. Frames a second are the filter's processor
time alone, measured when the cell was computed.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.ratios import Parts, ratio_gain
from hmc.experiments.pose_intervals import ahead, following, score_difference, score_interval
from hmc.experiments.study import draw_lines, runs_of, score_table, table_of

__all__ = ["EXPERIMENT"]

DENSITIES = {False: (0.75, 1.0, 1.5, 2.0, 3.0, 4.0), True: (1.0, 2.0, 4.0)}
#: A loss of MMTA below this is none, percent; a table that is quicker is so by more than this factor.
NO_LOSS, QUICKER = 5.0, 1.5


def grid(plan: Plan) -> list[dict]:
    """Every density with 6 layers of 600 particles."""
    return runs.study_grid(plan, [{"density": density} for density in DENSITIES[plan.quick]], runs.STUDY_FRAMES, share="third")


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA and speed against density."""
    frame = runs_of(cells)
    table = score_table(frame, ("annealing", "density"))
    figure, panels = plt.subplots(1, 2, figsize=(7.5, 3))
    draw_lines(panels[0], table, "density", "MMTA_percent", "annealing", xlabel="density factor", ylabel="MMTA at 100 mm (%)")
    draw_lines(
        panels[1], table, "density", "filter_frames_per_s", "annealing", xlabel="density factor", ylabel="frames a second, filter alone"
    )
    dense, twice, sparsest = (list(frame[frame.density == density].run) for density in (1.0, 2.0, max(frame.density)))
    speed = table.set_index("density").filter_frames_per_s
    costs = score_difference(dense, twice, "MMTA_percent", ("density",))
    claims = (
        decide(
            "a sparser table is quicker",
            ratio_gain(dense, sparsest, _seconds(1.0), smaller_parts=_seconds(QUICKER)),
            f"{speed[1.0]:.2f} frames a second at density 1, {speed.iloc[-1]:.2f} at {speed.index[-1]:g}",
        ),
        decide(
            "people are followed, and at density 2 little accuracy is lost",
            (following(dense), costs.under(NO_LOSS)),
            f"MMTA {score_interval(dense, 'MMTA_percent')} % at density 1; {costs} % are lost at 2",
        ),
        ahead(f"at density {speed.index[-1]:g} accuracy is lost", dense, sparsest, but=("density",)),
    )
    caption = (
        "MMTA at 100 mm and speed by density of the flesh table. The paper: Canton, Figure 6.18, a curve without numbers; .15 frames a "
        "second at density 1 and 2 cm."
    )
    return Report((table_of("fig-6.18", caption, table),), {"fig-6.18": figure}, claims)


def _seconds(times: float) -> Parts:
    """So many times the filter's seconds a frame, of one run."""
    return lambda one: (times * one.results["filter_s_per_frame"], 1.0)


EXPERIMENT = Experiment("fig-6.18", "density of the flesh table", "Canton, Figure 6.18", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
