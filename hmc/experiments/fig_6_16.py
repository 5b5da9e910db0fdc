"""Figure 6.16: what cameras and voxels are worth: 3 cameras at 3 cm, 7 at 3 cm, 7 at 2 cm, by layers and particles.

Source: Canton (2009), section 6.7.1.1. The thesis's 3 cameras are those in color, as here on HumanEva-I; of rendered recordings, which are
all in color, they are evenly spread.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt

from hmc.experiments import filter_runs as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.filter_grids import LAYERS, PARTICLES, filter_grid, grouped_rows, layer_map, matrix, mmta_bar
from hmc.experiments.pose_intervals import ahead

__all__ = ["EXPERIMENT"]

#: Cameras (0: all seven) and voxels, mm.
DATA = ((3, 30), (0, 30), (0, 20))


def grid(plan: Plan) -> list[dict]:
    """Every number of layers and particles on all three kinds of data."""
    return filter_grid(
        plan,
        [
            {"cameras": cameras, "voxel_mm": voxel, "layers": layers, "particles": particles}
            for cameras, voxel in DATA
            for layers in LAYERS[plan.quick]
            for particles in PARTICLES[plan.quick]
        ],
        quick_repeats=3,
    )


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by layers and particles for every kind of data."""
    layers, particles = LAYERS[plan.quick], PARTICLES[plan.quick]
    rows = grouped_rows(cells, ("annealing", "cameras", "voxel_mm", "layers", "particles"))
    figure, panels = plt.subplots(len(runs.ANNEALING), len(DATA), figsize=(8.4, 2.6 * len(runs.ANNEALING)), sharex=True, sharey=True)
    claims = []
    for annealing, line in zip(runs.ANNEALING, panels, strict=True):
        for (cameras, voxel), axes in zip(DATA, line, strict=True):
            own = [row for row in rows if (row["annealing"], row["cameras"], row["voxel_mm"]) == (annealing, cameras, voxel)]
            values = matrix(own, layers, particles)
            layer_map(axes, values, layers, particles)
            axes.set(
                title=f"{cameras or 'all'} cameras, {voxel / 10:g} cm\n{annealing} annealing", xlabel="particles a layer", ylabel="layers"
            )
        few, coarse, fine = (_chosen(cells, annealing, *data) for data in DATA)
        claims += [
            ahead(f"{annealing} annealing: more cameras are better", coarse, few, but=("cameras", "voxel_mm")),
            ahead(f"{annealing} annealing: smaller voxels are better", fine, coarse, but=("cameras", "voxel_mm")),
        ]
    mmta_bar(figure, panels)
    caption = "MMTA at 100 mm by cameras, voxels, layers and particles. The paper: Canton, Figure 6.16, in color without numbers."
    return Report((Table("fig-6.16", caption, rows),), {"fig-6.16": figure}, tuple(claims))


def _chosen(cells: Sequence[Cell], annealing: str, cameras: int, voxel_mm: int) -> list[Cell]:
    wanted = {"annealing": annealing, "cameras": cameras, "voxel_mm": voxel_mm}
    return [one for one in cells if wanted.items() <= one.parameters.items()]


EXPERIMENT = Experiment("fig-6.16", "cameras and voxel size", "Canton, Figure 6.16", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
