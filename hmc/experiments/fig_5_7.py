"""Figure 5.7: the angles of an elbow and of a knee over a walk, truth and estimate read as poses of one reference body.

Source: Canton (2009), section 5.3.2, Eq. 5.9. Estimates are by bodies whose lengths and axes are not the reference body's; the true joints
are the rendered actor's. That angles of two bodies can be compared shows in that they follow one another: the error must be less than that
of an estimate that knows nothing but the angle's mean, in joints that move. Methods that do not follow count for no claim.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import pose_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.run_means import gains, mean_interval, run_values
from hmc.experiments.truth import estimates
from hmc.metrics.angles import REFERENCE_ANGLES, angular_errors, reference_angles, score_angles

__all__ = ["EXPERIMENT"]

SHOWN = ("l_elbow_flexion", "l_knee_flexion")
#: The curves are of a method that follows: of one that does not they show nothing.
SHOWN_METHOD = "default"
#: A joint moves where its true angle deviates by this in a run, degrees.
MOVES_DEG = 5.0
#: Both landmarks of an angle must be this near to the truth, metres.
MATCHED_M = 0.1


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Curves on the first recording, and the angular scores of every method."""
    names = list(REFERENCE_ANGLES)
    figure, panels = plt.subplots(len(SHOWN), 1, figsize=(7, 4.2), sharex=True)
    first = next(one for one in cells if one.parameters["method"] == SHOWN_METHOD)
    estimate, truth = estimates(first)
    seconds = np.array(first.results["frames"]) / first.results["fps"]
    for axes, name in zip(panels, SHOWN, strict=True):
        k = names.index(name)
        true, ours = (np.degrees(reference_angles(points)[:, k]) for points in (truth, estimate))
        axes.plot(seconds, true, color=COLORS["paper"], label="truth")
        axes.plot(seconds, ours, color=COLORS["particle"], label="estimate")
        axes.plot(seconds, np.degrees(angular_errors(estimate, truth)[:, k]), color=COLORS["other"], label="error")
        axes.set(ylabel=f"{name.replace('_', ' ')}\n(degrees)")
    panels[0].legend(ncols=3)
    panels[-1].set_xlabel("seconds")
    panels[0].set_title(runs.METHODS[SHOWN_METHOD])
    rows: list[dict] = []
    counted_gain: dict = {}
    curves: dict = {}
    for method, title in runs.METHODS.items():
        ours = [one for one in cells if one.parameters["method"] == method]
        own = [estimates(one) for one in ours]
        free, matched = (np.degrees(np.concatenate([angular_errors(*pair, threshold) for pair in own])) for threshold in (None, MATCHED_M))
        every, counted = score_angles(free), score_angles(matched)
        by_angle = score_angles(matched, "angle")
        moving = run_values(ours, _better_than_the_mean)
        follows = mean_interval(moving)
        if method in runs.followed(cells):
            matched_gain = gains(run_values(ours, _mean_error(None)), run_values(ours, _mean_error(MATCHED_M)))
            counted_gain |= {(clip, (method, repeat)): value for (clip, repeat), value in matched_gain.items()}
            curves |= {(clip, (method, repeat)): value for (clip, repeat), value in moving.items()}
        rows.append({"method": title, "mean_deg": float(counted.mean), "deviation_deg": float(counted.deviation),
                     "mean_of_all_deg": float(every.mean), "angles_counted": float(counted.counted / every.counted),
                     "gain_on_the_mean_angle_deg": follows.value, "gain_low_deg": follows.low, "gain_high_deg": follows.high}
                    | {f"{name}_deg": float(by_angle.mean[names.index(name)]) for name in SHOWN})  # fmt: skip
    claims = (
        _claim("elbows and knees follow the truth's", curves, "error less than that of the mean angle"),
        _claim("angles of matched landmarks alone have smaller errors than all", counted_gain, "error less"),
    )
    caption = (
        f"Angular errors on the reference body; the first two columns count angles with both landmarks within {1000 * MATCHED_M:g} mm. "
        "The paper: Canton, Figure 5.7, without figures; its table 6.3 has 7.09 and 4.21 degrees for the marker-based filter."
    )
    return Report((Table("fig-5.7", caption, rows),), {"fig-5.7": figure}, claims)


def _claim(text: str, values: dict, what: str) -> Claim:
    gain = mean_interval(values)
    return decide(text, gain, f"{what} by {gain.value:.2f} degrees [{gain.low:.2f}, {gain.high:.2f}]")


def _mean_error(threshold: float | None) -> Callable[[Cell], float]:
    """Mean angular error of a run, of all angles or of matched ones, degrees."""

    def value(one: Cell) -> float:
        return float(np.degrees(score_angles(angular_errors(*estimates(one), threshold)).mean))

    return value


def _better_than_the_mean(one: Cell) -> float:
    """By how much elbows and knees are nearer to the truth than their own mean is, degrees; NaN where none moves or is estimated."""
    estimate, truth = estimates(one)
    bends = [k for k, name in enumerate(REFERENCE_ANGLES) if name.endswith(("elbow_flexion", "knee_flexion"))]
    estimated, true = (np.degrees(reference_angles(points)[:, bends]) for points in (estimate, truth))
    both = np.isfinite(estimated) & np.isfinite(true)
    both &= np.nanstd(true, axis=0) > MOVES_DEG
    if not both.any():
        return np.nan
    mean = np.where(both, true, 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    gained = np.abs(mean - true) - np.abs(estimated - true)
    return float(gained[both].mean())


EXPERIMENT = Experiment(
    "fig-5.7", "angles on one reference body: elbow and knee", "Canton, Figure 5.7", runs.grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
