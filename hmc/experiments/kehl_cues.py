"""Cues compared on the same clips: what figures 11 and 17 of Kehl (2006) share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from hmc.experiments import kehl_runs
from hmc.experiments.engine.experiment import Cell

__all__ = ["compared_cues"]

NEAR_MM = 50.0


def compared_cues(
    cells: Sequence[Cell], titles: Mapping[str, str], joints: Sequence[int], what: str
) -> tuple[dict[str, list[Cell]], list[dict[str, Any]], Figure]:
    """Errors by combination of cues, of all joints and of some, and some frames of each.

    Parameters
    ----------
    cells : sequence of Cell
        Of `hmc.experiments.kehl_runs`.
    titles : mapping of variant to title
    joints : sequence of int
        Of `hmc.landmarks.LANDMARKS`.
    what : str
        What columns call these joints.

    Returns
    -------
    groups : dict of variant to list of Cell
    rows : list of dict
    figure : Figure
        A line a combination, the pictures of its first run.
    """
    groups = {name: kehl_runs.of_variant(cells, name) for name in titles}
    columns = max(*(len(own[0].results["pictures"]) for own in groups.values()), 1)
    figure, panels = plt.subplots(len(groups), columns, figsize=(2.8 * columns, 2.7 * len(groups)), squeeze=False)
    rows = []
    for line, (name, own) in zip(panels, groups.items(), strict=True):
        for panel, picture in zip(line, own[0].results["pictures"], strict=False):
            kehl_runs.shown(panel, picture, f"{titles[name]}, frame {picture['frame']}")
        near = [(kehl_runs.errors_mm(one)[:, list(joints)] <= NEAR_MM).mean() for one in own]
        found = kehl_runs.error_interval(own, joints)
        rows.append({
            "cues": titles[name], "runs": len(own), "mean_error_mm": kehl_runs.error_interval(own).value,
            f"{what}_mm": found.value, f"{what}_low_mm": found.low, f"{what}_high_mm": found.high,
            f"{what}_within_{NEAR_MM:.0f}mm": float(np.mean(near)),
            "frames_per_s": 1 / float(np.mean([np.mean(one.results["seconds"]) for one in own])),
        })  # fmt: skip
    return groups, rows, figure
