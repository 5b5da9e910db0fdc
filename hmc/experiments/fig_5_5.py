"""Figure 5.5: the metrics frame by frame: mean error and MMTP, deviation and MMTA.

Source: Canton (2009), section 5.3.1: the deviation over a frame's landmarks rises where MMTA falls; the mean error is moved by lost
landmarks, MMTP is less so. Both are read as rank correlations over the frames of a run. Runs in which nothing was ever lost say nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import spearmanr

from hmc.experiments import pose_runs as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.run_means import gains, mean_interval, run_values
from hmc.metrics.landmarks import LandmarkScores, score

__all__ = ["EXPERIMENT"]

SCORES = {"deviation": "deviation", "mean": "mean", "MMTP": "mmtp"}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A run over time, and how strongly each score goes with MMTA in all of them."""
    methods = runs.followed(cells)
    known = [one for one in cells if one.parameters["method"] in methods]
    rows = []
    per_run: dict[str, dict] = {name: {} for name in SCORES}
    for method in methods:
        own = [one for one in known if one.parameters["method"] == method]
        found = {name: run_values(own, partial(_with_mmta, name=name)) for name in SCORES}
        for name, values in found.items():
            per_run[name] |= {(clip, (method, repeat)): value for (clip, repeat), value in values.items()}
        rows.append({"method": runs.METHODS[method]} | _row(found))
    rows.append({"method": "all"} | _row(per_run))
    together = mean_interval({run: -value for run, value in per_run["deviation"].items()})
    steadier = mean_interval(gains(per_run["MMTP"], per_run["mean"]))
    claims = (
        decide("the deviation rises where MMTA falls", together, f"rank correlation, sign exchanged, {_told(together)}"),
        decide("the mean goes with what is lost more than MMTP does", steadier, f"correlations differ by {_told(steadier)}"),
    )
    caption = (
        f"Rank correlation over the frames of a run with MMTA (matched within {runs.PAPER_THRESHOLD_MM:g} mm), mean over runs and its "
        "interval; of methods that follow. The paper: Canton, Figure 5.5, curves without numbers."
    )
    return Report((Table("fig-5.5", caption, rows),), {"fig-5.5": _draw(known)} if known else {}, claims)


def _told(interval) -> str:
    return f"{interval.value:.2f} [{interval.low:.2f}, {interval.high:.2f}]"


def _row(found: dict[str, dict]) -> dict:
    row: dict = {"runs_with_losses": len(found["deviation"])}
    for name, values in found.items():
        known = mean_interval(values)
        row |= {f"{name}_with_MMTA": known.value, f"{name}_with_MMTA_low": known.low, f"{name}_with_MMTA_high": known.high}
    return row


def _by_frame(one: Cell) -> LandmarkScores:
    return score(runs.errors_mm(one), runs.PAPER_THRESHOLD_MM, by="frame")


def _with_mmta(one: Cell, name: str) -> float:
    """Rank correlation of a score with MMTA; NaN where either is always the same."""
    scores = _by_frame(one)
    values = getattr(scores, SCORES[name])
    known = np.isfinite(values)
    values, mmta = values[known], scores.mmta[known]
    if len(values) < 3 or np.ptp(values) == 0 or np.ptp(mmta) == 0:
        return np.nan
    return float(spearmanr(values, mmta).statistic)


def _draw(cells: Sequence[Cell]) -> plt.Figure:
    """The run in which MMTA changes most."""
    one = max(cells, key=lambda each: float(np.std(_by_frame(each).mmta)))
    scores = _by_frame(one)
    seconds = np.array(one.results["frames"]) / one.results["fps"]
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 4.4), sharex=True)
    upper.plot(seconds, scores.mean, color=COLORS["other"], label="mean")
    upper.plot(seconds, scores.mmtp, color=COLORS["particle"], label="MMTP")
    upper.set(ylabel="mm", title=f"{one.parameters['recording'].rpartition('@')[0]}, {runs.METHODS[one.parameters['method']]}")
    upper.legend(ncols=2)
    lower.plot(seconds, scores.deviation, color=COLORS["other"], label="deviation")
    lower.set(xlabel="seconds", ylabel="deviation (mm)", ylim=(0, 1.25 * scores.deviation[np.isfinite(scores.deviation)].max()))
    right = lower.twinx()
    right.plot(seconds, 100 * scores.mmta, color=COLORS["particle"], label="MMTA")
    right.set(ylabel="MMTA (%)", ylim=(0, 125), yticks=range(0, 101, 20))
    right.grid(False)
    lower.legend(handles=[*lower.get_lines(), *right.get_lines()], ncols=2)
    return figure


EXPERIMENT = Experiment("fig-5.5", "metrics frame by frame", "Canton, Figure 5.5", runs.grid, runs.cell, report, runs.FAMILY, runs.VERSION)
