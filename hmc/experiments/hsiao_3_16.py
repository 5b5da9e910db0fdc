"""Skeleton curves: one-dimensional eigenmaps part by part, and Sundaresan's from the branches' site values. Hsiao (2008), Figure 3-16.

How far true joints are from the curve of their limb, which the thesis did not measure. The cells are those of hsiao-3.15.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.hsiao_3_15 import COLORS_OF_PARTS, FAMILY, cell, grid
from hmc.landmarks import LANDMARKS
from hmc.pose.spectral.parts import PART_NAMES

__all__ = ["EXPERIMENT"]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Distances of elbows, wrists and knees from the nearest curve, of one frame a sequence."""
    rows, figures = [], {}
    shown = [(one.parameters["recording"].rpartition("@")[0], one.results["shown"]) for one in cells if one.results["shown"] is not None]
    for name, frame in shown:
        joints = np.array(frame["joints"])
        for what, key in (("modified", "curves"), ("sundaresan", "plain_curves")):
            limbs = [np.array(curve) for part, curve in frame[key].items() if part[:3] in ("arm", "leg")]
            distances = {
                kind: 1000 * np.mean([_nearest(limbs, joints[LANDMARKS.index(f"{side}_{kind}")]) for side in "lr"])
                for kind in ("elbow", "wrist", "knee", "ankle")
            }
            rows.append({"sequence": name, "curves": what, "parts": len(frame[key])} | {f"{kind}_mm": d for kind, d in distances.items()})
    ours = [row["knee_mm"] for row in rows if row["curves"] == "modified"] + [
        row["elbow_mm"] for row in rows if row["curves"] == "modified"
    ]
    claims = (
        Claim(
            "elbows and knees lie within 5 cm of their curves on average",
            bool(ours) and np.mean(ours) < 50,
            f"{np.mean(ours):.1f} mm" if ours else "",
        ),
        Claim("every part has a curve, the trunk too", all(row["parts"] == 6 for row in rows if row["curves"] == "modified")),
    )
    if shown:
        figures["hsiao-3.16"] = draw(shown)
    return Report((Table("hsiao-3.16", "Distance of true joints from the skeleton curves of the limbs.", rows),), figures, claims)


def _nearest(limbs: Sequence[np.ndarray], point: np.ndarray) -> float:
    return min((float(np.linalg.norm(curve - point, axis=1).min()) for curve in limbs), default=np.inf)


def draw(shown: Sequence) -> plt.Figure:
    """Curves over the voxels, a sequence a column."""
    figure = plt.figure(figsize=(2.4 * len(shown), 4))
    for k, (name, frame) in enumerate(shown):
        ax = figure.add_subplot(1, len(shown), k + 1, projection="3d")
        points = np.array(frame["points"])
        ax.scatter(*points[::4].T, s=1, c="0.8")
        for part, curve in frame["curves"].items():
            color = COLORS_OF_PARTS[PART_NAMES.index(part)] if part in PART_NAMES else "black"
            ax.plot(*np.array(curve).T, color=color, linewidth=2)
        ax.scatter(*np.array(frame["joints"]).T, s=12, c="black")
        ax.set_box_aspect(np.ptp(points, axis=0))
        ax.view_init(8, 20)
        ax.set_title(name)
    return figure


EXPERIMENT = Experiment("hsiao-3.16", "skeleton curves", "Hsiao, Figure 3-16", grid, cell, report, FAMILY)
