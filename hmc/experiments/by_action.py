"""Scores of poses action by action, as Canton's Tables 6.3, 6.4 and those of chapters 7 and 8 have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hmc.experiments.engine.experiment import Cell
from hmc.experiments.five_actions import action_title
from hmc.experiments.truth import estimates
from hmc.metrics.angles import angular_errors, score_angles
from hmc.metrics.landmarks import landmark_errors, score

__all__ = ["AVERAGE", "COLUMNS", "action_cells", "action_rows", "pose_scores", "scores_by_repeat", "spread"]

AVERAGE = "Average"
#: What the thesis prints, in its order.
COLUMNS = ("mean_mm", "deviation_mm", "MMTP_mm", "MMTA_percent", "angle_deg", "angle_deviation_deg")
MATCHED_MM, STRICT_MM, NEAR_MM = 100.0, 70.0, 50.0


def pose_scores(cells: Sequence[Cell]) -> dict[str, float]:
    """Scores of all frames of some cells together: those of `COLUMNS`, and MMTA and MMTP at 70 mm (as section 8.1 has them) and 50 mm.

    Angles count where both of their landmarks are matched.
    """
    pairs = [estimates(one) for one in cells]
    errors = 1000 * np.concatenate([landmark_errors(*pair) for pair in pairs])
    far, strict, near = (score(errors, within) for within in (MATCHED_MM, STRICT_MM, NEAR_MM))
    angles = score_angles(np.degrees(np.concatenate([angular_errors(*pair, MATCHED_MM / 1000) for pair in pairs])))
    values = (far.mean, far.deviation, far.mmtp, 100 * far.mmta, angles.mean, angles.deviation)
    scores = {name: float(value) for name, value in zip(COLUMNS, values, strict=True)}
    for within, own in ((STRICT_MM, strict), (NEAR_MM, near)):
        scores |= {f"MMTP_{within:.0f}_mm": float(own.mmtp), f"MMTA_{within:.0f}_percent": float(100 * own.mmta)}
    return scores


def scores_by_repeat(cells: Sequence[Cell]) -> list[dict[str, float]]:
    """`pose_scores` of the cells of each repeat that there is."""
    repeats = sorted({one.parameters["repeat"] for one in cells})
    return [pose_scores([one for one in cells if one.parameters["repeat"] == repeat]) for repeat in repeats]


def spread(values: Sequence[float]) -> float | None:
    """The deviation of several repeats' values; None of a single one."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else None


def action_cells(cells: Sequence[Cell], title: str) -> list[Cell]:
    """Those of one action, by what the thesis calls it."""
    return [one for one in cells if action_title(one.parameters["recording"]) == title]


def action_rows(cells: Sequence[Cell], method: str, paper: Mapping[str, Sequence[float]]) -> list[dict[str, Any]]:
    """One row an action, one a recording where there are several of an action, and one for all: ours, and the paper's beside.

    Parameters
    ----------
    cells : sequence of Cell
        Of one method.
    method : str
        What the rows call it.
    paper : mapping of str to sequence of float
        The thesis's figures by action, in the order of `COLUMNS`.
    """
    actions: dict[str, list[Cell]] = {}
    for one in cells:
        actions.setdefault(action_title(one.parameters["recording"]), []).append(one)
    rows = []
    for action, own in (*actions.items(), (AVERAGE, list(cells))):
        rows.append({"method": method, "action": action, "recording": "all"} | _columns(pose_scores(own), paper.get(action)))
        labels = dict.fromkeys(one.parameters["recording"] for one in own)
        if action != AVERAGE and len(labels) > 1:
            for label in labels:
                scores = pose_scores([one for one in own if one.parameters["recording"] == label])
                rows.append({"method": method, "action": action, "recording": label.rpartition("@")[0]} | _columns(scores, None))
    return rows


def _columns(scores: Mapping[str, float], printed: Sequence[float] | None) -> dict[str, float | None]:
    columns: dict[str, float | None] = {}
    for k, name in enumerate(COLUMNS):
        columns |= {name: scores[name], f"{name}_paper": printed[k] if printed else None}
    return columns | {name: value for name, value in scores.items() if name not in COLUMNS}
