"""What belongs to more than one frame, on its own: motion priors, the start, finding a lost pose again, smoothing.

Ours, not a paper's; the motion priors are those of Canton (2009), section 3.1.2.2. Lost is who cannot be seen for 1.5 seconds while they
walk on: no camera has silhouettes then. Smoothing is applied to the estimates of the preset `default` as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.by_action import scores_by_repeat, spread
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.style import COLORS
from hmc.experiments.five_actions import LONG_SUFFIX, action_name, action_title
from hmc.experiments.markerless_runs import VOXEL_M, action_sources, pose_results, run_method, tracked
from hmc.experiments.pose_intervals import none_better, score_difference
from hmc.experiments.truth import estimates
from hmc.metrics.landmarks import landmark_errors
from hmc.motion.smoothing import Smoothing, smooth_positions
from hmc.pose.follow import FollowOptions
from hmc.pose.method import PoseMethod
from hmc.pose.methods.annealed import annealed_method
from hmc.pose.steps.presets import PRESETS
from hmc.voxels.hulls import HullStep

__all__ = ["EXPERIMENT", "hidden", "jitter_mm"]

#: Actions, the cameras of a recording, seeds.
ACTIONS = {False: ("walk", "jog", "throw_catch", "box"), True: ("jog",)}
CAMERAS, SEEDS = 4, 3
#: Who gets lost, and how many seeds of that.
LOST_ACTORS = {False: ("man", "woman"), True: ("man",)}
LOST_SEEDS = {False: 3, True: 1}
#: Nothing is seen from here to there, seconds from the start.
GONE_S = (2.0, 3.5)
#: The pose is back where the mean error of a frame is below this, millimetres.
BACK_MM = 60.0
#: Windows of smoothing, seconds; 0: as estimated.
WINDOWS_S = (0.0, 0.2, 0.3, 0.5, 0.7)
DEFAULT, NO_RECOVERY = "default", "without recovery"


def _preset(**changes) -> PoseMethod:
    return annealed_method(replace(PRESETS["default"], **changes))


#: What is in place of what `default` has.
WAYS: dict[str, PoseMethod] = {
    DEFAULT: _preset(),
    "motion: smooth": _preset(motion="smooth"),
    "motion: none": _preset(motion="none"),
    "start: spectral": _preset(start="spectral"),
    NO_RECOVERY: replace(_preset(), recover=None),
}


def grid(plan: Plan) -> list[dict]:
    """Every way but that without recovery on every action; `default` and that one on a walk with a gap."""
    sources = action_sources(plan, ACTIONS[plan.quick])
    if plan.quick and not plan.recordings:
        sources = sources[::2]  # one actor
    lost = list(plan.recordings) or [
        rendered(action_name("walk", actor, False) + (LONG_SUFFIX if plan.quick else "")) for actor in LOST_ACTORS[plan.quick]
    ]
    seen = [(source, way, (), repeat) for source in sources for way in WAYS if way != NO_RECOVERY for repeat in range(SEEDS)]
    gaps = [(one, way, GONE_S, repeat) for one in lost for way in (DEFAULT, NO_RECOVERY) for repeat in range(LOST_SEEDS[plan.quick])]
    return [
        {"recording": source.label, "cameras": CAMERAS, "way": way, "gone_s": list(gone), "repeat": repeat}
        for source, way, gone, repeat in (*seen, *gaps)
    ]


def hidden(step: HullStep, first: int, last: int) -> HullStep:
    """A frame as it is, or, from frame `first` to before `last`, with no person in any silhouette."""
    if not first <= step.index < last:
        return step
    nothing = np.zeros_like(step.strict)
    masks = tuple(None if mask is None else np.zeros_like(mask) for mask in step.masks)
    return replace(step, masks=masks, strict=nothing, tolerant=nothing, loose=nothing)


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Estimate the first person's poses; landmarks and truth, metres, and the frames in which nothing is seen.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``way`` (a key of `WAYS`), ``gone_s`` (from, to; or nothing), ``repeat``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    seen = tracked(inputs, parameters["recording"], parameters["cameras"])
    recording = seen.recording
    gone = [recording.start + round(second * recording.fps) for second in parameters["gone_s"]]
    change = (lambda step: hidden(step, *gone)) if gone else None
    people = run_method(seen, WAYS[parameters["way"]], FollowOptions(VOXEL_M, int(rng.integers(2**31)), change=change))
    return pose_results(recording, people) | {"gone": gone}


def jitter_mm(errors: np.ndarray) -> float:
    """Mean second difference from frame to frame of the vectors (n, 15, 3) from truth to estimate, metres; in millimetres."""
    return float(1000 * np.nanmean(np.linalg.norm(np.diff(errors, 2, axis=0), axis=-1)))


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Mean errors by way, errors by window of smoothing, and errors after the gap."""
    whole = [one for one in cells if not one.parameters["gone_s"]]
    gaps = [one for one in cells if one.parameters["gone_s"]]
    ways, smooth, (found, figure) = _way_rows(whole), _smoothing_rows(whole), _gap_rows(gaps)
    by_way = _by_way(whole)
    back = {way: [row["back_after_s"] for row in found if row["way"] == way] for way in (DEFAULT, NO_RECOVERY)}
    as_is, short = (next(row for row in smooth if (row["action"], row["window_s"]) == ("all", window)) for window in (0.0, 0.3))
    claims = (
        none_better(
            "no other motion prior or start is better than the default's by a millimetre or more",
            by_way[DEFAULT],
            {way: own for way, own in by_way.items() if way.startswith(("motion", "start"))},
            ("way",),
        ),
        Claim(
            "who was out of sight while walking on is found again, and is not without recovery",
            None not in back[DEFAULT] and set(back[NO_RECOVERY]) == {None},
            "; ".join(f"{way}: {', '.join('never' if s is None else f'after {s:.2f} s' for s in own)}" for way, own in back.items()),
        ),
        Claim(
            "smoothing over .3 s takes half of the jitter or more, and no accuracy",
            short["jitter_mm"] <= as_is["jitter_mm"] / 2 and short["mean_mm"] <= as_is["mean_mm"] + 0.5,
            f"jitter {as_is['jitter_mm']:.1f} to {short['jitter_mm']:.1f} mm, error {as_is['mean_mm']:.1f} to {short['mean_mm']:.1f} mm",
        ),
    )
    captions = {
        "ways": f"Mean joint error of `default` with another motion prior or start, {CAMERAS} cameras, and its spread over "
        "seeds; what that costs, with its interval of 95 % over clips and seeds.",
        "smoothing": "Estimates of `default` smoothed over some seconds: mean error, and its second difference from frame to frame.",
        "found-again": f"A walker whom no camera sees from {GONE_S[0]} to {GONE_S[1]} s: the mean error of the frames after that, and when "
        f"it is below {BACK_MM:.0f} mm for good.",
    }
    tables = tuple(Table(name, captions[name], rows) for name, rows in (("ways", ways), ("smoothing", smooth), ("found-again", found)))
    return Report(tables, {"found-again": figure}, claims)


def _by_action(cells: Sequence[Cell]) -> dict[str, list[Cell]]:
    """Cells by what the thesis calls their action, and all."""
    groups: dict[str, list[Cell]] = {}
    for one in cells:
        groups.setdefault(action_title(one.parameters["recording"]), []).append(one)
    return {**groups, "all": list(cells)}


def _by_way(cells: Sequence[Cell]) -> dict[str, list[Cell]]:
    groups: dict[str, list[Cell]] = {}
    for one in cells:
        groups.setdefault(one.parameters["way"], []).append(one)
    return groups


def _way_rows(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for action, group in _by_action(cells).items():
        by_way = _by_way(group)
        for way, own in by_way.items():
            scores = scores_by_repeat(own)
            means, near = ([score[name] for score in scores] for name in ("mean_mm", "MMTA_50_percent"))
            cost = score_difference(own, by_way[DEFAULT], "mean_mm", ("way",))
            rows.append(
                {
                    "action": action,
                    "way": way,
                    "mean_mm": float(np.mean(means)),
                    "mean_spread_mm": spread(means),
                    "costs_mm": cost.value,
                    "costs_low_mm": cost.low,
                    "costs_high_mm": cost.high,
                    "MMTA_50_percent": float(np.mean(near)),
                }
            )
    return rows


def _smoothing_rows(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for action, group in _by_action([one for one in cells if one.parameters["way"] == DEFAULT]).items():
        for window in WINDOWS_S:
            errors, jitter = [], []
            for one in group:
                estimate, truth = estimates(one)
                if window:
                    estimate = smooth_positions(estimate, one.results["fps"], Smoothing("polynomial", window_s=window))
                errors.append(1000 * float(np.nanmean(landmark_errors(estimate, truth))))
                jitter.append(jitter_mm(estimate - truth))
            rows.append({"action": action, "window_s": window, "mean_mm": float(np.mean(errors)), "jitter_mm": float(np.mean(jitter))})
    return rows


def _gap_rows(cells: Sequence[Cell]) -> tuple[list[dict[str, Any]], plt.Figure]:
    rows: list[dict[str, Any]] = []
    figure, axes = plt.subplots(figsize=(5.6, 3.0))
    for one in cells:
        frames, fps, (_, last) = np.array(one.results["frames"]), one.results["fps"], one.results["gone"]
        errors = 1000 * landmark_errors(*estimates(one)).mean(axis=1)
        after = errors[frames >= last]
        there = np.minimum.accumulate((after < BACK_MM)[::-1])[::-1]
        way = one.parameters["way"]
        rows.append(
            {
                "recording": one.parameters["recording"].rpartition("@")[0],
                "way": way,
                "repeat": one.parameters["repeat"],
                "first_frame_mm": float(after[0]),
                "back_after_s": float(there.argmax() / fps) if there.any() else None,
                "last_quarter_second_mm": float(np.nanmean(after[-max(1, round(fps / 4)) :])),
            }
        )
        axes.plot((frames - last) / fps, errors, color=COLORS["particle" if way == DEFAULT else "sparse"], label=way)
    axes.axvspan(-(GONE_S[1] - GONE_S[0]), 0, color=COLORS["paper"], alpha=0.1)
    axes.set(xlabel="seconds since the walker can be seen again", ylabel="mean error (mm)", ylim=(0, None))
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    axes.legend(handles.values(), handles.keys())
    return rows, figure


EXPERIMENT = Experiment(
    "over-time", "motion priors, starts, recovery and smoothing", "ours; docs/accuracy.md", grid, cell, report, version=2
)
