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

__all__ = ["EXPERIMENT"]

DENSITIES = {False: (0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0), True: (1.0, 2.0, 4.0)}
#: A loss of MMTA below this is none, percent.
NO_LOSS = 5.0


def grid(plan: Plan) -> list[dict]:
    """Every density with 6 layers of 600 particles."""
    return filter_grid(plan, [{"density": density} for density in DENSITIES[plan.quick]])


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
        one, twice, most = (next(row for row in own if row["density"] == density) for density in (1.0, 2.0, max(densities)))
        claims += [
            Claim(
                f"{annealing} annealing: a sparser table is quicker",
                most["filter_frames_per_s"] > one["filter_frames_per_s"],
                f"{one['filter_frames_per_s']:.2f} frames a second at density 1, {most['filter_frames_per_s']:.2f} at {most['density']:g}",
            ),
            Claim(
                f"{annealing} annealing: at density 2 little accuracy is lost",
                one["MMTA_percent"] - twice["MMTA_percent"] < NO_LOSS,
                f"MMTA {one['MMTA_percent']:.1f} % at density 1, {twice['MMTA_percent']:.1f} % at 2",
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


EXPERIMENT = Experiment("fig-6.18", "density of the flesh table", "Canton, Figure 6.18", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
