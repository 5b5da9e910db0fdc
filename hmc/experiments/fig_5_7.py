"""Figure 5.7: the angles of an elbow and of a knee over a walk, truth and estimate read as poses of one reference body.

Source: Canton (2009), section 5.3.2, Eq. 5.9. The estimate is that of the markerless filter with the thesis's body, whose lengths and axes
are not the reference body's; the true joints are the rendered actor's.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import pose_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS
from hmc.metrics.angles import REFERENCE_ANGLES, angular_errors, reference_angles, score_angles

__all__ = ["EXPERIMENT"]

SHOWN = ("l_elbow_flexion", "l_knee_flexion")
#: Both landmarks of an angle must be this near to the truth, metres.
MATCHED_M = 0.1


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Curves on the first recording, and the angular scores of every method."""
    names = list(REFERENCE_ANGLES)
    figure, panels = plt.subplots(len(SHOWN), 1, figsize=(7, 4.2), sharex=True)
    first = next(one for one in cells if one.parameters["method"] == "canton2009")
    estimate, truth = runs.estimates(first)
    seconds = np.array(first.results["frames"]) / first.results["fps"]
    for axes, name in zip(panels, SHOWN, strict=True):
        k = names.index(name)
        true, ours = (np.degrees(reference_angles(points)[:, k]) for points in (truth, estimate))
        axes.plot(seconds, true, color=COLORS["paper"], label="truth")
        axes.plot(seconds, ours, color=COLORS["particle"], label="estimate")
        axes.plot(seconds, np.degrees(angular_errors(estimate, truth)[:, k]), color=COLORS["other"], label="error")
        axes.set(ylabel=f"{name.replace('_', ' ')}\n(degrees)")
    panels[0].legend(ncols=3)
    panels[-1].set_xlabel("seconds")
    rows: list[dict] = []
    for method, title in runs.METHODS.items():
        own = [runs.estimates(one) for one in cells if one.parameters["method"] == method]
        free, matched = (np.degrees(np.concatenate([angular_errors(*pair, threshold) for pair in own])) for threshold in (None, MATCHED_M))
        every, counted = score_angles(free), score_angles(matched)
        by_angle = score_angles(matched, "angle")
        rows.append({"method": title, "mean_deg": float(counted.mean), "deviation_deg": float(counted.deviation),
                     "mean_of_all_deg": float(every.mean), "angles_counted": float(counted.counted / every.counted)}
                    | {f"{name}_deg": float(by_angle.mean[names.index(name)]) for name in SHOWN})  # fmt: skip
    means = {row["method"]: row["mean_deg"] for row in rows}
    claim = Claim(
        "matched landmarks alone give smaller angular errors than all",
        all(float(row["mean_deg"]) <= float(row["mean_of_all_deg"]) for row in rows),
        ", ".join(f"{name} {value:.1f} degrees" for name, value in means.items()),
    )
    caption = (
        f"Angular errors on the reference body; the first two columns count angles with both landmarks within {1000 * MATCHED_M:g} mm. "
        "The paper: Canton, Figure 5.7, without figures; its table 6.3 has 7.09 and 4.21 degrees for the marker-based filter."
    )
    return Report((Table("fig-5.7", caption, rows),), {"fig-5.7": figure}, (claim,))


EXPERIMENT = Experiment(
    "fig-5.7", "angles on one reference body: elbow and knee", "Canton, Figure 5.7", runs.grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
