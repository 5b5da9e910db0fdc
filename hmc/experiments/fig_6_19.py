"""Figure 6.19: positions of the main joints over time, estimate against truth.

Source: Canton (2009), section 6.7.2. The cells are those of table-6.4, of one action.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS
from hmc.experiments.table_6_4 import READINGS
from hmc.experiments.table_6_4 import grid as table_grid
from hmc.experiments.truth import estimates
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

#: What "follow" means, of one coordinate.
FOLLOWED_MM = 30.0
SHOWN = ("pelvis", "l_elbow", "l_wrist", "r_wrist", "l_knee", "r_ankle")


def grid(plan: Plan) -> list[dict]:
    """The first recording of table-6.4, one run of every method."""
    cells = table_grid(plan)
    own = [parameters for parameters in cells if parameters["recording"] == cells[0]["recording"]]
    return list({(parameters["method"], parameters.get("annealing")): parameters for parameters in reversed(own)}.values())[::-1]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Curves of every method, and the error a joint and coordinate."""
    rows, figures, medians = [], {}, {}
    for one in cells:
        method = READINGS.get(one.parameters.get("annealing", ""), str(one.parameters["method"]))
        estimate, truth = estimates(one)
        figures[f"fig-6.19-{method.replace(', ', '-').replace(' ', '-')}"] = _draw(
            estimate, truth, np.array(one.results["frames"]) / one.results["fps"]
        )
        off = 1000 * np.abs(estimate - truth)
        for name in SHOWN:
            values = np.nanmean(off[:, LANDMARKS.index(name)], axis=0) if np.isfinite(off).any() else np.full(3, np.nan)
            rows.append({"method": method, "joint": name} | {f"{axis}_mm": float(v) for axis, v in zip("xyz", values, strict=True)})
        medians[method] = float(np.nanmedian(off)) if np.isfinite(off).any() else np.inf
    claims = [
        Claim(
            f"{method}: the curves follow the truth: half of all coordinates within {FOLLOWED_MM:g} mm",
            value <= FOLLOWED_MM,
            f"{value:.1f} mm",
        )
        for method, value in medians.items()
    ]
    caption = "Mean absolute error of joint coordinates over a recording. The paper: Canton, Figure 6.19, curves without numbers."
    return Report((Table("fig-6.19", caption, rows),), figures, tuple(claims))


def _draw(estimate: np.ndarray, truth: np.ndarray, seconds: np.ndarray) -> plt.Figure:
    figure, panels = plt.subplots(len(SHOWN), 3, figsize=(8, 1.25 * len(SHOWN)), sharex=True)
    for line, name in zip(panels, SHOWN, strict=True):
        place = LANDMARKS.index(name)
        for k, axes in enumerate(line):
            axes.plot(seconds, truth[:, place, k], color=COLORS["paper"], label="truth")
            axes.plot(seconds, estimate[:, place, k], color=COLORS["other"], linewidth=1, label="estimate")
        line[0].set_ylabel(f"{name.replace('_', ' ')}\n(m)")
    for axes, name in zip(panels[0], "xyz", strict=True):
        axes.set_title(name)
    for axes in panels[-1]:
        axes.set_xlabel("seconds")
    panels[0, 0].legend()
    return figure


EXPERIMENT = Experiment("fig-6.19", "joint curves against truth", "Canton, Figure 6.19", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
