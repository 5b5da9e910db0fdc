"""Figure 4.7: how well a person's centroid is known from a fraction of the surface or of the interior voxels.

Source: Canton (2009), section 4.3.3, Eq. 4.14. Shown there as a curve without figures: the surface needs more voxels than the interior
for the same error, and both converge.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.ellipsoid import VOXEL_M, person_voxels
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.style import COLORS

__all__ = ["EXPERIMENT"]

FRACTIONS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0)
SETS = ("surface", "interior")


def grid(plan: Plan) -> list[dict]:
    """Both sets, by fraction; more draws in full."""
    draws = 200 if plan.quick else 2000
    return [{"voxels": name, "fraction": fraction, "draws": draws} for name in SETS for fraction in FRACTIONS]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Errors of the mean of randomly drawn voxels, without replacement."""
    occupied, shell, interior = person_voxels()
    chosen = shell if parameters["voxels"] == "surface" else interior
    count = max(1, round(parameters["fraction"] * len(chosen)))
    centre = (np.array(occupied.shape) - 1) / 2
    errors = [
        1000 * VOXEL_M * np.linalg.norm(chosen[rng.choice(len(chosen), count, replace=False)].mean(axis=0) - centre)
        for _ in range(parameters["draws"])
    ]
    return {"n_voxels": count, "mean_mm": np.mean(errors), "sd_mm": np.std(errors)}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The curves, and whether they lie as in the paper."""
    rows = [{**{key: one.parameters[key] for key in ("voxels", "fraction")}, **one.results} for one in cells]
    figure, (left, right) = plt.subplots(1, 2, figsize=(7, 3), sharey=True)
    means = {}
    for name, color in zip(SETS, (COLORS["sparse"], COLORS["particle"]), strict=True):
        part = [row for row in rows if row["voxels"] == name]
        means[name] = np.array([row["mean_mm"] for row in part])
        spread = np.array([row["sd_mm"] for row in part])
        shown = means[name] > 0.01  # with all voxels there is no error, and no place for it on these axes
        for axes, key in ((left, "fraction"), (right, "n_voxels")):
            at = np.array([row[key] for row in part])[shown]
            low, high = means[name] - spread, means[name] + spread
            axes.plot(at, means[name][shown], "o-", color=color, label=name)
            axes.fill_between(at, np.maximum(low, 0.01)[shown], high[shown], color=color, alpha=0.15, linewidth=0)
            axes.set(xscale="log", yscale="log")
    left.set(xlabel="fraction of the voxels", ylabel="error of the centroid (mm)", ylim=(0.1, None))
    right.set(xlabel="number of voxels")
    left.legend(title="mean; shaded: deviation")
    at_tenth = FRACTIONS.index(0.1)
    claims = (
        Claim(
            "the surface needs a larger fraction than the interior for the same error",
            bool((means["surface"][:-1] > means["interior"][:-1]).all()),
            f"at a tenth {means['surface'][at_tenth]:.2f} mm against {means['interior'][at_tenth]:.2f} mm",
        ),
        Claim(
            "both converge",
            all(bool((np.diff(values) < 0).all()) and values[-1] < 0.01 for values in means.values()),
            f"with all voxels {means['surface'][-1]:.4f} mm and {means['interior'][-1]:.4f} mm",
        ),
    )
    caption = (
        "Error of an ellipsoid's centroid (half axes .3, .3, 1.0 m; voxels of 2 cm) from randomly drawn voxels. The paper: Figure 4.7."
    )
    return Report((Table("fig-4.7", caption, rows),), {"fig-4.7": figure}, claims)


EXPERIMENT = Experiment(
    "fig-4.7", "centroid error against the fraction of surface or interior voxels", "Canton, Figure 4.7", grid, cell, report
)
