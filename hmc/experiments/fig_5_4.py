"""Figure 5.4: histograms of the errors of three methods, and their quantiles against a Gaussian's.

Source: Canton (2009), section 5.2.2: the errors of the markerless algorithms have a long tail and lie off the line of a Gaussian's
quantiles, those of the marker-based one lie on it. How well they do is R^2, of each run by itself; pictures and table are of all runs
together.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm

from hmc.experiments import pose_runs as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.run_means import gains, mean_interval, run_values
from hmc.metrics.threshold import choose_threshold, lilliefors_statistic, normal_quantiles, quantile_r2

__all__ = ["EXPERIMENT"]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Both plots a method, and how Gaussian the errors are."""
    figure, panels = plt.subplots(2, len(runs.METHODS), figsize=(9, 4.8), squeeze=False)
    rows = []
    straight = {method: run_values([one for one in cells if one.parameters["method"] == method], _straight) for method in runs.METHODS}
    for column, (method, title) in enumerate(runs.METHODS.items()):
        errors = runs.pooled_errors_mm(cells, method)
        errors = np.sort(errors[np.isfinite(errors)])
        within = errors[errors <= choose_threshold(errors).threshold]
        upper, lower = panels[:, column]
        edges = np.linspace(0, np.quantile(errors, 0.995), 50)
        upper.hist(errors, edges, density=True, color="0.8")
        for values, color, label in ((errors, COLORS["other"], "all errors"), (within, COLORS["person"], "below the threshold")):
            share = len(values) / len(errors)
            upper.plot(edges, share * norm.pdf(edges, values.mean(), values.std()), color=color, label=label)
        upper.set(title=title, xlabel="error (mm)", yticks=[])
        quantiles = normal_quantiles(len(errors))
        lower.plot(quantiles, errors, ".", color=COLORS["particle"], markersize=2)
        middle = np.quantile(errors, [0.25, 0.75])
        slope = (middle[1] - middle[0]) / (norm.ppf(0.75) - norm.ppf(0.25))
        lower.plot(quantiles, middle.mean() + slope * quantiles, color=COLORS["other"], linewidth=1)
        lower.set(xlabel="quantile of a Gaussian", ylabel="error (mm)" if column == 0 else "")
        by_run = mean_interval(straight[method])
        rows.append({"method": title, "errors": len(errors), "mean_mm": errors.mean(), "deviation_mm": errors.std(),
                     "skewness": float(((errors - errors.mean()) ** 3).mean() / errors.std() ** 3), "R2_of_quantiles": quantile_r2(errors),
                     "R2_of_a_run": by_run.value, "R2_of_a_run_low": by_run.low, "R2_of_a_run_high": by_run.high,
                     "Lilliefors": lilliefors_statistic(errors)})  # fmt: skip
    panels[0, 0].legend()
    claims = []
    for method in ("canton2009", "default"):
        gain = mean_interval(gains(straight["markers"], straight[method]))
        detail = f"R^2 larger by {gain.value:.3f} [{gain.low:.3f}, {gain.high:.3f}]"
        claims.append(decide(f"marker-based errors are nearer to a Gaussian: {runs.METHODS[method]}", gain, detail))
    caption = "Errors of all landmarks and frames; R^2 also run by run, with its interval. The paper: Canton, Figure 5.4, without figures."
    return Report((Table("fig-5.4", caption, rows),), {"fig-5.4": figure}, tuple(claims))


def _straight(one: Cell) -> float:
    errors = runs.errors_mm(one)
    errors = errors[np.isfinite(errors)]
    return quantile_r2(errors) if len(errors) > 2 and np.ptp(errors) > 0 else np.nan


EXPERIMENT = Experiment(
    "fig-5.4", "error histograms and quantile plots", "Canton, Figure 5.4", runs.grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
