"""Figure 6.16: what cameras and voxels are worth: 3 cameras at 3 cm, 7 at 3 cm, 7 at 2 cm, by layers and particles.

Source: Canton (2009), section 6.7.1.1. The thesis has a sample of every action, each by another person; its three cameras are those in
color, of better silhouettes, as here on HumanEva-I; of rendered recordings, which are all in color, they are evenly spread.
"""

from __future__ import annotations

from collections.abc import Sequence

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report
from hmc.experiments.engine.intervals import decide
from hmc.experiments.pose_intervals import ahead, score_difference
from hmc.experiments.study import draw_maps, runs_of, score_table, table_of

__all__ = ["EXPERIMENT", "LAYERS", "PARTICLES"]

#: Cameras (0: all seven) and voxels, mm.
DATA = ((3, 30), (0, 30), (0, 20))
#: Layers and particles a layer, in full and quick; the thesis's best with all cameras is 6 of 600.
LAYERS = {False: (1, 2, 4, 6, 8), True: (2, 6)}
PARTICLES = {False: (100, 300, 600), True: (100, 300)}
BEST = {"layers": 6, "particles": 600}
#: "Best" may be missed by so much MMTA, percent.
MISSED_BY = 3.0


def grid(plan: Plan) -> list[dict]:
    """Every number of layers and particles on all three kinds of data."""
    settings = [
        {"cameras": cameras, "voxel_mm": voxel, "layers": layers, "particles": particles}
        for cameras, voxel in DATA
        for layers in LAYERS[plan.quick]
        for particles in PARTICLES[plan.quick]
    ]
    return runs.study_grid(plan, settings, runs.STUDY_FRAMES, share="sixth")


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by layers and particles for every kind of data."""
    frame = runs_of(cells)
    table = score_table(frame, ("cameras", "voxel_mm", "layers", "particles"))
    data = {(c, v): own for (c, v), own in frame.groupby(["cameras", "voxel_mm"])}
    maps = [(f"{c or 'all'} cameras, {v / 10:g} cm", table[(table.cameras == c) & (table.voxel_mm == v)]) for c, v in DATA]
    few, many, fine = (list(data[one].run) for one in DATA)
    claims = [
        ahead("more cameras are better", many, few, but=("cameras",)),
        ahead("smaller voxels are better", fine, many, but=("voxel_mm",)),
    ]
    if not plan.quick:
        claims.append(_best(data[DATA[-1]], table[(table.cameras == 0) & (table.voxel_mm == 20)]))
    caption = "MMTA at 100 mm by cameras, voxels, layers and particles. The paper: Canton, Figure 6.16, in color without numbers."
    return Report((table_of("fig-6.16", caption, table),), {"fig-6.16": draw_maps(maps, len(DATA))}, tuple(claims))


def _best(own, table) -> Claim:
    """Whether no other number of layers and particles is better than the thesis's by `MISSED_BY`, to the end of the interval."""
    top = table.loc[table.MMTA_percent.idxmax()]
    best, printed = (
        list(own[(own.layers == layers) & (own.particles == particles)].run)
        for layers, particles in ((top.layers, top.particles), (BEST["layers"], BEST["particles"]))
    )
    gain = score_difference(best, printed, "MMTA_percent", ("layers", "particles"))
    few = list(own[(own.layers == min(own.layers)) & (own.particles == min(own.particles))].run)
    above = score_difference(printed, few, "MMTA_percent", ("layers", "particles"))
    return decide(
        "7 cameras, 2 cm: 6 layers of 600 are as good as the best",
        (above, gain.under(MISSED_BY)),
        f"the best, {top.layers:g} layers of {top.particles:g}, is ahead by {gain} %; 6 of 600 of the least by {above} %",
    )


EXPERIMENT = Experiment("fig-6.16", "cameras and voxel size", "Canton, Figure 6.16", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
