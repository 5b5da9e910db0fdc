"""Figures 12 and 13: Stochastic Meta Descent against Levenberg-Marquardt, with equal points and with five times the points.

Source: Kehl (2006), section 7.3. There: SMD 2.89 cm at 1.3 frames a second; LM loses track with equal points and has 4.27 cm at .73 with
five times the points. Takes about 5 minutes of processor time.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import kehl_runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS

__all__ = ["EXPERIMENT"]

METHODS = {"SMD": COLORS["sparse"], "LM": COLORS["naive"], "LM, 5 times the points": COLORS["particle"]}
#: In the table alone: what the comparison owes to the stop of LM, and to the axes of the descent.
BESIDE = ("LM that stops early", "SMD along the parameters")
PAPER = {"SMD": (28.9, 1.3), "LM, 5 times the points": (42.7, 0.73)}


def grid(plan: Plan) -> list[dict]:
    """Every method, three times each."""
    return kehl_runs.cell_grid(plan.quick, plan.recordings, "kick_turn", [*METHODS, *BESIDE], 3)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Errors and times over the frames, and their means."""
    figure, (above, below) = plt.subplots(2, 1, figsize=(7, 5), sharex=True)
    rows, mean, speed = [], {}, {}
    for name in (*METHODS, *BESIDE):
        own = [one for one in cells if one.parameters["variant"] == name]
        errors = [kehl_runs.errors_mm(one) for one in own]
        seconds = np.concatenate([one.results["seconds"] for one in own])
        mean[name], speed[name] = float(np.mean(errors)), 1 / float(np.mean(seconds))
        if name in METHODS:
            first = own[0].results
            above.plot(first["frames"], 1000 * np.array(first["seconds"]), color=METHODS[name], label=name)
            below.plot(first["frames"], errors[0].mean(axis=1), color=METHODS[name])
        paper_mm, paper_fps = PAPER.get(name, (None, None))
        rows.append({
            "method": name, "runs": len(own), "mean_error_mm": mean[name], "worst_run_mm": float(max(e.mean() for e in errors)),
            "within_100mm": float(np.mean([(e <= 100).mean() for e in errors])), "frames_per_s": speed[name],
            "iterations_full": float(np.mean([np.array(one.results["iterations"])[:, 0].mean() for one in own])),
            "paper_mean_error_mm": paper_mm, "paper_frames_per_s": paper_fps,
        })  # fmt: skip
    above.set(ylabel="processor time, ms", yscale="log")
    above.legend()
    below.set(ylabel="mean joint error, mm", xlabel="frame")
    claims = (
        Claim("SMD's mean joint error is at most 40 mm", mean["SMD"] <= 40, f"{mean['SMD']:.1f} mm"),
        Claim("SMD is nearer than LM with equal points", mean["SMD"] < mean["LM"], f"{mean['SMD']:.1f} and {mean['LM']:.1f} mm"),
        Claim(
            "SMD is at least 1.5 times as fast as LM with equal points", speed["SMD"] >= 1.5 * speed["LM"],
            f"{speed['SMD']:.1f} and {speed['LM']:.1f} frames a second",
        ),
    )  # fmt: skip
    caption = (
        "Stochastic Meta Descent and Levenberg-Marquardt on kicks and a turn; the tracker's processor time. The paper: Kehl, Figure 13."
    )
    return Report((Table("kehl-13", caption, rows),), {"kehl-13": figure}, claims)


EXPERIMENT = Experiment(
    "kehl-13",
    "SMD against Levenberg-Marquardt",
    "Kehl, Figures 12 and 13",
    grid,
    kehl_runs.cell,
    report,
    kehl_runs.FAMILY,
    kehl_runs.VERSION,
)
