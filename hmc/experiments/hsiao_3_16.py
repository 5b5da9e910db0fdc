"""Skeleton curves: one-dimensional eigenmaps part by part, and Sundaresan's from the branches' site values. Hsiao (2008), Figure 3-16.

How far true joints are from the nearest curve, and the true line of the trunk, which the thesis did not measure. The cells are those of
hsiao-3.15.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.ratios import ratio_interval
from hmc.experiments.hsiao_3_15 import COLORS_OF_PARTS, FAMILY, MODIFIED, OURS, SUNDARESAN, VERSION, cell, grid, mean_of
from hmc.pose.spectral.parts import PART_NAMES

__all__ = ["EXPERIMENT"]

_WHAT = {"joints_m": "elbows and knees", "trunk_line_m": "the trunk's line"}
#: Half of what an upper arm or a shank measures across, hull and all: a curve that runs inside of its limb is nearer to the joints.
INSIDE_M = 0.05


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Distances by way, of frames with limbs apart, with intervals over clips."""
    found = {(way, score): ratio_interval(cells, mean_of(way, score)) for way in (MODIFIED, OURS, SUNDARESAN) for score in _WHAT}
    rows = [
        {"curves": way, "to": _WHAT[score]} | {f"{end}_mm": 1000 * getattr(one, end) for end in ("value", "low", "high")}
        for (way, score), one in found.items()
    ]
    claims = tuple(
        decide(
            text,
            found[MODIFIED, score].under(INSIDE_M),
            "{:.0f} [{:.0f}, {:.0f}] mm".format(*(1000 * getattr(found[MODIFIED, score], end) for end in ("value", "low", "high"))),
        )
        for text, score in (
            ("curves run inside their limbs: elbows and knees lie within 5 cm of the nearest", "joints_m"),
            ("the thick trunk has a curve too: its line lies within 5 cm of one", "trunk_line_m"),
        )
    )
    shown = [(one.parameters["recording"].rpartition("@")[0], one.results["shown"]) for one in cells if one.results["shown"] is not None]
    figures = {"hsiao-3.16": draw(shown)} if shown else {}
    return Report((Table("hsiao-3.16", "Distance of true joints and trunks from skeleton curves.", rows),), figures, claims)


def draw(shown: Sequence) -> plt.Figure:
    """Curves over the voxels, a sequence a column: as printed above, ours below."""
    figure = plt.figure(figsize=(2.4 * len(shown), 7))
    for row, way in enumerate((MODIFIED, OURS)):
        for k, (name, frame) in enumerate(shown):
            ax = figure.add_subplot(2, len(shown), row * len(shown) + k + 1, projection="3d")
            points = np.array(frame["points"])
            ax.scatter(*points[::4].T, s=1, c="0.8")
            for part, curve in frame["ways"][way]["curves"].items():
                color = COLORS_OF_PARTS[PART_NAMES.index(part)] if part in PART_NAMES else "black"
                ax.plot(*np.array(curve).T, color=color, linewidth=2)
            ax.scatter(*np.array(frame["joints"]).T, s=12, c="black")
            ax.set_box_aspect(np.ptp(points, axis=0))
            ax.view_init(8, 20)
            ax.set_title(f"{name}: {way.rpartition(' ')[2]}")
    return figure


EXPERIMENT = Experiment("hsiao-3.16", "skeleton curves", "Hsiao, Figure 3-16", grid, cell, report, FAMILY, VERSION)
