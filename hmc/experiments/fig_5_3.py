"""Figure 5.3: what the metrics say of a good and of a poor estimate.

Source: Canton (2009), section 5.3.1. Of all estimated frames, the one of the largest mean error of which every landmark is still within
50 mm, and the one whose MMTA comes nearest to the thesis's poor example among those with whole limbs lost.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import pose_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS
from hmc.landmarks import BONES, LANDMARKS
from hmc.metrics.landmarks import landmark_errors, score

__all__ = ["EXPERIMENT"]

#: Mean, deviation, MMTP (mm) and MMTA.
PAPER = {"good": (48.91, 16.21, 48.91, 1.0), "poor": (51.22, 24.37, 46.35, 0.77)}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The two frames, and their scores one frame at a time."""
    frames = [(one, k) for one in cells for k in range(len(one.results["frames"]))]
    errors = 1000 * np.concatenate([landmark_errors(*runs.estimates(one)) for one in cells])
    scores = score(errors, runs.PAPER_THRESHOLD_MM, by="frame")
    whole = np.isfinite(errors).all(axis=1)
    good = int(np.argmax(np.where(whole & (scores.mmta == 1), scores.mean, -np.inf)))
    off = np.where(whole & (scores.mmta < 1), np.abs(scores.mmta - PAPER["poor"][3]) - 1e-4 * scores.mean, np.inf)
    poor = int(np.argmin(off))
    figure, panels = plt.subplots(1, 2, figsize=(7, 3.6))
    rows = []
    for axes, (name, k) in zip(panels, {"good": good, "poor": poor}.items(), strict=True):
        one, frame = frames[k]
        estimate, truth = (points[frame] for points in runs.estimates(one))
        _draw(axes, estimate, truth, errors[k])
        ours = [float(value[k]) for value in (scores.mean, scores.deviation, scores.mmtp, scores.mmta)]
        axes.set(title=f"{name}: mean {ours[0]:.1f}, deviation {ours[1]:.1f}\nMMTP {ours[2]:.1f}, MMTA {ours[3]:.2f}")
        columns = ("mean_mm", "deviation_mm", "MMTP_mm", "MMTA")
        row = {"estimate": name, "recording": one.parameters["recording"], "method": one.parameters["method"]}
        row |= {"frame": int(np.array(one.results["frames"])[frame]), "sigma_MMTP_mm": float(scores.sigma_mmtp[k])}
        for column, own, printed in zip(columns, ours, PAPER[name], strict=True):
            row |= {column: own, f"{column}_paper": printed}
        rows.append(row)
    claims = (
        Claim(
            "of the good estimate MMTP is the mean error, and MMTA 1", rows[0]["MMTP_mm"] == rows[0]["mean_mm"] and rows[0]["MMTA"] == 1.0
        ),
        Claim(
            "of the poor one MMTP is free of what is lost, and the mean is not",
            rows[1]["MMTP_mm"] < rows[1]["mean_mm"] and rows[1]["MMTA"] < 1,
            f"MMTP {rows[1]['MMTP_mm']:.1f} mm, mean {rows[1]['mean_mm']:.1f} mm, MMTA {rows[1]['MMTA']:.2f}",
        ),
    )
    caption = f"Scores of single frames; matched within {runs.PAPER_THRESHOLD_MM:g} mm. The paper: Canton, Figure 5.3, on HumanEva-I."
    return Report((Table("fig-5.3", caption, rows),), {"fig-5.3": figure}, claims)


def _draw(axes, estimate: np.ndarray, truth: np.ndarray, errors: np.ndarray) -> None:
    """Both stick figures, seen from the side on which they are broadest; landmarks that are not matched in red."""
    centred = truth[:, :2] - truth[:, :2].mean(axis=0)
    across = np.linalg.svd(centred)[2][0]
    for points, color in ((truth, COLORS["paper"]), (estimate, COLORS["particle"])):
        flat = np.stack([points[:, :2] @ across, points[:, 2]], axis=1)
        for bone in BONES:
            ends = flat[[LANDMARKS.index(name) for name in bone]]
            axes.plot(ends[:, 0], ends[:, 1], color=color, linewidth=1.5)
        if points is estimate:
            lost = errors > runs.PAPER_THRESHOLD_MM
            axes.plot(*flat[~lost].T, "o", color=COLORS["person"], linestyle="none", label="matched")
            axes.plot(*flat[lost].T, "o", color=COLORS["other"], linestyle="none", label="not matched")
    axes.set(aspect="equal", xlabel="metres")
    axes.legend()


EXPERIMENT = Experiment(
    "fig-5.3", "metrics on a good and on a poor estimate", "Canton, Figure 5.3", runs.grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
