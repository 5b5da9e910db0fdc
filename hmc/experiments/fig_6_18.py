"""Figure 6.18: the density of the flesh table: MMTA and frames a second.

Source: Canton (2009), section 6.7.1.3, Eq. 6.26: the spacing of the flesh over the voxel size. Frames a second are the filter's processor
time alone, measured when the cell was computed.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt

from hmc.experiments import filter_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS
from hmc.experiments.filter_grids import filter_grid, grouped_rows
from hmc.experiments.pose_intervals import is_followed, score_difference, score_interval

__all__ = ["EXPERIMENT"]

DENSITIES = {False: (0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0), True: (1.0, 2.0, 4.0)}
#: A loss of MMTA below this is none, percent, and a table that is quicker is so by more than this factor.
NO_LOSS, QUICKER = 5.0, 1.5


def grid(plan: Plan) -> list[dict]:
    """Every density with 6 layers of 600 particles."""
    return filter_grid(plan, [{"density": density} for density in DENSITIES[plan.quick]], quick_repeats=3)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA and speed against density."""
    rows = grouped_rows(cells, ("annealing", "density"))
    figure, panels = plt.subplots(1, 2, figsize=(7.5, 3))
    claims = []
    for annealing, color in zip(runs.ANNEALING, (COLORS["particle"], COLORS["sparse"]), strict=True):
        own = [row for row in rows if row["annealing"] == annealing]
        densities = [row["density"] for row in own]
        mmta, spread = [row["MMTA_percent"] for row in own], [row["MMTA_deviation_percent"] for row in own]
        panels[0].errorbar(densities, mmta, spread, marker="o", capsize=2, color=color, label=annealing)
        panels[1].plot(densities, [row["filter_frames_per_s"] for row in own], "o-", color=color, label=annealing)
        dense, twice, most = (
            [one for one in cells if (one.parameters["annealing"], one.parameters["density"]) == (annealing, density)]
            for density in (1.0, 2.0, max(densities))
        )
        faster, costs = _speed(most) / _speed(dense), score_difference(dense, twice, "MMTA_percent", ("density",))
        claims += [
            Claim(
                f"{annealing} annealing: a sparser table is quicker",
                faster > QUICKER,
                f"{_speed(dense):.2f} frames a second at density 1, {_speed(most):.2f} at {max(densities):g}",
            ),
            Claim(
                f"{annealing} annealing: people are followed, and at density 2 little accuracy is lost",
                is_followed(dense) and costs.high < NO_LOSS,
                f"MMTA {score_interval(dense, 'MMTA_percent')} % at density 1; {costs} % are lost at 2",
            ),
        ]
    panels[0].set(xlabel="density factor", ylabel="MMTA (%)", ylim=(0, 100))
    panels[1].set(xlabel="density factor", ylabel="frames a second, filter alone", ylim=(0, None))
    panels[0].legend(title="annealing")
    caption = (
        "MMTA at 100 mm and speed by density of the flesh table. The paper: Canton, Figure 6.18, a curve without numbers; .15 frames a "
        "second at density 1 and 2 cm."
    )
    return Report((Table("fig-6.18", caption, rows),), {"fig-6.18": figure}, tuple(claims))


def _speed(cells: Sequence[Cell]) -> float:
    """Frames a second of the filter alone."""
    return len(cells) / max(sum(one.results["filter_s_per_frame"] for one in cells), 1e-9)


EXPERIMENT = Experiment("fig-6.18", "density of the flesh table", "Canton, Figure 6.18", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
