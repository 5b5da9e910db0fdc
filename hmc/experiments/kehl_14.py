"""Figures 14 and 16: fast motion. Source: Kehl (2006), section 7.4: the shoulder's pitch changes by up to 31 degrees between frames, and
the person is followed through all of the sequence, less exactly. Takes about 5 minutes.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import kehl_runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

PAPER_DEG = 31.0
#: Whoever is farther off than this at the end has been lost, millimetres.
LOST_MM = 100.0


def grid(plan: Plan) -> list[dict]:
    """Three runs."""
    return kehl_runs.cell_grid(plan.quick, plan.recordings, "dance", ["SMD"], 3)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The direction of the right upper arm, true and estimated, and the errors."""
    figure, (above, below) = plt.subplots(2, 1, figsize=(7, 5), sharex=True)
    rows = []
    for k, one in enumerate(cells):
        errors = kehl_runs.errors_mm(one).mean(axis=1)
        true, found = (_elevation_deg(np.array(one.results[name], float)) for name in ("truth_m", "estimate_m"))
        steps = _turns_deg(np.array(one.results["truth_m"], float))
        last = errors[-max(1, len(errors) // 10) :].mean()
        rows.append({
            "run": k, "recording": one.parameters["recording"].rpartition("@")[0], "mean_error_mm": float(errors.mean()),
            "last_tenth_mm": float(last), "worst_frame_mm": float(errors.max()), "largest_turn_deg_per_frame": float(steps.max()),
            "mean_turn_deg_per_frame": float(steps.mean()), "frames_per_s": 1 / float(np.mean(one.results["seconds"])),
            "paper_largest_turn_deg": PAPER_DEG,
        })  # fmt: skip
        if k == 0:
            above.plot(one.results["frames"], true, color=COLORS["paper"], linewidth=1, label="true")
            above.plot(one.results["frames"], found, color=COLORS["sparse"], label="estimated")
        below.plot(one.results["frames"], errors, color=COLORS["sparse"], alpha=0.6)
    above.set(ylabel="right upper arm\nabove the level, degrees")
    above.legend()
    below.set(ylabel="mean joint error, mm", xlabel="frame")
    detail = ", ".join(f"{row['last_tenth_mm']:.0f} mm in the last tenth" for row in rows)
    fastest = max(row["largest_turn_deg_per_frame"] for row in rows)
    claims = (
        Claim(f"turns of {PAPER_DEG:.0f} degrees and more between frames", fastest >= PAPER_DEG, f"{fastest:.0f} degrees"),
        Claim("the dancer is still followed at the end", max(row["last_tenth_mm"] for row in rows) < LOST_MM, detail),
    )
    caption = "Fast motion; the turn is that of the right upper arm. The paper: Kehl, Figure 14."
    return Report((Table("kehl-14", caption, rows),), {"kehl-14": figure}, claims)


def _upper_arm(points: np.ndarray) -> np.ndarray:
    arm = points[:, LANDMARKS.index("r_elbow")] - points[:, LANDMARKS.index("r_shoulder")]
    return arm / np.linalg.norm(arm, axis=1, keepdims=True)


def _elevation_deg(points: np.ndarray) -> np.ndarray:
    return np.degrees(np.arcsin(np.clip(_upper_arm(points)[:, 2], -1, 1)))


def _turns_deg(points: np.ndarray) -> np.ndarray:
    """By how much the upper arm turns from frame to frame."""
    arm = _upper_arm(points)
    return np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", arm[1:], arm[:-1]), -1, 1)))


EXPERIMENT = Experiment(
    "kehl-14", "fast motion", "Kehl, Figures 14 and 16", grid, kehl_runs.cell, report, kehl_runs.FAMILY, kehl_runs.VERSION
)
