"""Figure 6.16: what cameras and voxels are worth: 3 cameras at 3 cm, 7 at 3 cm, 7 at 2 cm, by layers and particles.

Source: Canton (2009), section 6.7.1.1.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import filter_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.filter_grids import LAYERS, PARTICLES, filter_grid, grouped_rows, layer_map, matrix, mmta_bar

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
    )


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by layers and particles for every kind of data."""
    layers, particles = LAYERS[plan.quick], PARTICLES[plan.quick]
    rows = grouped_rows(cells, ("annealing", "cameras", "voxel_mm", "layers", "particles"))
    figure, panels = plt.subplots(len(runs.ANNEALING), len(DATA), figsize=(8.4, 2.6 * len(runs.ANNEALING)), sharex=True, sharey=True)
    claims = []
    for annealing, line in zip(runs.ANNEALING, panels, strict=True):
        means = []
        for (cameras, voxel), axes in zip(DATA, line, strict=True):
            own = [row for row in rows if (row["annealing"], row["cameras"], row["voxel_mm"]) == (annealing, cameras, voxel)]
            values = matrix(own, layers, particles)
            means.append(float(np.mean(values)))
            layer_map(axes, values, layers, particles)
            axes.set(
                title=f"{cameras or 'all'} cameras, {voxel / 10:g} cm\n{annealing} annealing", xlabel="particles a layer", ylabel="layers"
            )
        detail = ", ".join(f"{c or 'all'} cameras {v / 10:g} cm: {mean:.1f} %" for (c, v), mean in zip(DATA, means, strict=True))
        claims += [
            Claim(f"{annealing} annealing: more cameras are better", means[1] > means[0], detail),
            Claim(f"{annealing} annealing: smaller voxels are better", means[2] > means[1], detail),
        ]
    mmta_bar(figure, panels)
    caption = "MMTA at 100 mm by cameras, voxels, layers and particles. The paper: Canton, Figure 6.16, in color without numbers."
    return Report((Table("fig-6.16", caption, rows),), {"fig-6.16": figure}, tuple(claims))


EXPERIMENT = Experiment("fig-6.16", "cameras and voxel size", "Canton, Figure 6.16", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
