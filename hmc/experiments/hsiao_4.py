"""Nine actions by the whole method. Hsiao (2008), chapter 4.

The thesis shows pictures of its sequences s1 to s9 and no figures; here mean error, MMTA and the frames that were started anew, on rendered
actions like them, matched within 100 mm: the swarm in the house's company (`default`), which recovers in another way than by starting anew,
and the thesis's system alone (`hsiao2008`). A frame without a fit counts as wrong in all landmarks. Quick: about ten minutes.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.style import COLORS
from hmc.experiments.hsiao_runs import pose_cell, sequences
from hmc.experiments.nine_actions import NINE_ACTIONS, QUICK_SUFFIX
from hmc.experiments.truth import estimates
from hmc.metrics.landmarks import landmark_errors

__all__ = ["EXPERIMENT"]

#: Sequences in which limbs are mostly apart.
EASY = ("s1_wave", "s2_throw_ball", "s3_throw_item", "s8_walk")
LEAST_MMTA = 0.85
#: Of the method `pso`, and how they are drawn.
PRESETS = {"default": COLORS["sparse"], "hsiao2008": COLORS["paper"]}


def grid(plan: Plan) -> list[dict]:
    """One cell a sequence and preset."""
    return [{"recording": source.label, "preset": preset} for source in sequences(plan) for preset in PRESETS]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a sequence and preset, and the errors over time."""
    rows = []
    figure, axes = plt.subplots(3, 3, figsize=(9, 6), sharey=True, squeeze=False)
    panels = dict(zip(dict.fromkeys(one.parameters["recording"] for one in cells), axes.ravel(), strict=False))
    for one in cells:
        ax, preset = panels.get(one.parameters["recording"]), one.parameters["preset"]
        name = one.parameters["recording"].rpartition("@")[0].removesuffix(QUICK_SUFFIX)
        errors = 1000 * landmark_errors(*estimates(one))
        fitted = np.isfinite(errors)
        rows.append(
            {
                "sequence": name,
                "preset": preset,
                "what": NINE_ACTIONS[name][0] if name in NINE_ACTIONS else "",
                "frames": one.results["frames"],
                "mean_mm": float(errors[fitted].mean()) if fitted.any() else None,
                "MMTP_mm": float(errors[errors < 100].mean()) if (errors < 100).any() else None,
                "MMTA": float(np.mean(errors < 100)),
                "MMTA_50": float(np.mean(errors < 50)),
                "restarts": one.results["restarts"],
                "without_fit": one.results["without_fit"],
            }
        )
        if ax is not None:
            ax.plot(np.where(fitted.all(1), np.where(fitted, errors, 0).mean(1), np.nan), color=PRESETS[preset], label=preset)
            ax.set(title=name, ylim=(0, 300))
    axes[0, 0].legend()
    axes[-1, 0].set(xlabel="frame", ylabel="mean error (mm)")
    found = {row["sequence"]: row["MMTA"] for row in rows if row["preset"] == "default"}
    claims = (
        Claim(
            f"MMTA at least {LEAST_MMTA} in the waving, throwing and walking sequences",
            all(found.get(name, 0.0) >= LEAST_MMTA for name in EASY),
            ", ".join(f"{name} {found[name]:.3f}" for name in EASY if name in found),
        ),
    )
    return Report((Table("hsiao-4", "Nine actions by spectral skeletons and swarms.", rows),), {"hsiao-4": figure}, claims)


EXPERIMENT = Experiment("hsiao-4", "nine actions by the whole method", "Hsiao, chapter 4", grid, pose_cell, report, version=3)
