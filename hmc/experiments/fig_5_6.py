"""Figure 5.6: the threshold chosen from the errors, by Lilliefors' test and by R^2 of the quantiles.

Source: Canton (2009), section 5.3.1, "Parameter-free evaluation", Eq. 5.7 and 5.8: the two usually agree, and errors up to the threshold
are Gaussian where all together are not. Each run has its own threshold for the claims; pictures and table are of all runs together. Methods
that do not follow have no tracked landmarks to be told from lost ones, and count for no claim.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm

from hmc.experiments import pose_runs as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.run_means import RunValues, mean_interval, run_values
from hmc.metrics.landmarks import score
from hmc.metrics.threshold import choose_threshold, quantile_r2

__all__ = ["EXPERIMENT"]

#: Largest difference of two thresholds that agree; the thesis says "usually agree" and prints no number.
AGREE = 0.25


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The histogram with what is below the threshold, both curves, and the scores at the threshold."""
    figure, panels = plt.subplots(2, len(runs.METHODS), figsize=(9, 4.8), squeeze=False)
    rows = []
    for column, (method, title) in enumerate(runs.METHODS.items()):
        errors = runs.pooled_errors_mm(cells, method)
        choices = [choose_threshold(errors, test) for test in ("lilliefors", "r2")]
        known = errors[np.isfinite(errors)]
        upper, lower = panels[:, column]
        edges = np.linspace(0, np.quantile(known, 0.995), 50)
        within = known[known <= choices[0].threshold]
        upper.hist([within, known[known > choices[0].threshold]], edges, stacked=True, color=[COLORS["person"], "0.8"])
        scale = len(within) * (edges[1] - edges[0])
        upper.plot(edges, scale * norm.pdf(edges, within.mean(), within.std()), color=COLORS["particle"])
        upper.set(title=title, xlabel="error (mm)", yticks=[])
        lower.plot(choices[0].candidates, choices[0].values, color=COLORS["particle"])
        lower.set(xlabel="threshold (mm)", xlim=(0, edges[-1]), ylim=(0, 0.4))
        twin = lower.twinx()
        twin.plot(choices[1].candidates, choices[1].values, color=COLORS["sparse"])
        twin.set(ylim=(0.6, 1))
        twin.grid(False)
        for axes, choice, color in ((lower, choices[0], COLORS["particle"]), (lower, choices[1], COLORS["sparse"])):
            axes.axvline(choice.threshold, color=color, linestyle="--", linewidth=1)
        if column == 0:
            lower.set_ylabel("Lilliefors", color=COLORS["particle"])
        if column == len(runs.METHODS) - 1:
            twin.set_ylabel("R^2", color=COLORS["sparse"])
        at = score(errors, choices[0].threshold)
        rows.append({"method": title, "threshold_lilliefors_mm": choices[0].threshold, "threshold_R2_mm": choices[1].threshold,
                     "MMTP_mm": float(at.mmtp), "sigma_MMTP_mm": float(at.sigma_mmtp), "MMTA": float(at.mmta)})  # fmt: skip
    known = [one for one in cells if one.parameters["method"] in runs.followed(cells)]
    factors, gain = _by_run(known, _apart), mean_interval(_by_run(known, _straighter))
    agree = mean_interval({run: float(factor < np.log1p(AGREE)) for run, factor in factors.items()})
    claims = (
        decide(
            "both tests usually choose about the same threshold",
            agree.over(0.5),
            f"within {AGREE:.0%} in {agree.value:.0%} of the runs [{agree.low:.0%}, {agree.high:.0%}]",
        ),
        decide(
            "errors up to the threshold are nearer to a Gaussian than all",
            gain,
            f"R^2 larger by {gain.value:.3f} [{gain.low:.3f}, {gain.high:.3f}]",
        ),
    )
    caption = "Thresholds chosen from the errors, and the scores at Lilliefors' one. The paper: Canton, Figure 5.6, without figures."
    return Report((Table("fig-5.6", caption, rows),), {"fig-5.6": figure}, claims)


def _by_run(cells: Sequence[Cell], value: Callable[[Cell], float]) -> RunValues:
    """A figure of every run of every method: a method's runs are seeds of the same clips."""
    found: dict = {}
    for method in runs.METHODS:
        own = run_values([one for one in cells if one.parameters["method"] == method], value)
        found |= {(clip, (method, repeat)): figure for (clip, repeat), figure in own.items()}
    return found


def _apart(one: Cell) -> float:
    """Logarithm of the factor between both thresholds of a run."""
    first, second = (choose_threshold(runs.errors_mm(one), test).threshold for test in ("lilliefors", "r2"))
    return float(abs(np.log(first / second)))


def _straighter(one: Cell) -> float:
    """By how much R^2 is larger up to the threshold; that of Lilliefors' test, as the other one would choose what is then claimed."""
    errors = runs.errors_mm(one)
    errors = errors[np.isfinite(errors)]
    return quantile_r2(errors[errors <= choose_threshold(errors).threshold]) - quantile_r2(errors)


EXPERIMENT = Experiment(
    "fig-5.6", "choice of the threshold, by both tests", "Canton, Figure 5.6", runs.grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
