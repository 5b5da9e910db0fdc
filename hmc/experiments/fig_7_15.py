"""Figure 7.15: DDM-APF against APF behind furniture: hidden limbs are dropped and taken back, the rest is kept.

Source: Canton (2009), section 7.5.2, which shows pictures. Here it is measured, limb by limb (`hmc.experiments.hiding`). The thresholds of
DDM-APF were found on `counter` and `workbench`; nothing was on `counter_unseen`, which has another room, furniture, person and motion. On
`pick_up` and `sit` no limb is hidden, and hardly one may be dropped.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.hiding import ENDS, hidden_and_shown, limb_views, rest_of, waits
from hmc.experiments.markerless_runs import VOXEL_M, pose_results, run_method, tracked
from hmc.experiments.truth import estimates, first_truth
from hmc.landmarks import landmark_index
from hmc.metrics.landmarks import landmark_errors
from hmc.pose.follow import FollowOptions
from hmc.pose.registry import pose_method

__all__ = ["EXPERIMENT"]

#: The thesis's own two, from the true first pose.
PRINTED = {"APF, canton2009": runs.APF, "DDM-APF, canton2009": "DDM-APF"}
#: Methods and recordings of people behind furniture, by `plan.quick`.
METHODS = {False: (runs.APF, "DDM-APF", "SHBM-DDM-APF", *PRINTED), True: (runs.APF, "DDM-APF", *PRINTED)}
RECORDINGS = {False: ("counter", "workbench", "counter_unseen", "pick_up", "sit"), True: ("counter", "workbench")}
#: Frames within which a hidden limb must be dropped, and one that is shown again taken back; error of the rest; share of the frames in
#: which a shown limb may be missing, percent.
DROP_FRAMES, BACK_FRAMES, REST_MM, WRONG_PERCENT = 10, 15, 60.0, 5.0
_ENDS = [landmark_index(name) for name in ENDS.values()]


def grid(plan: Plan) -> list[dict]:
    """Every method on every recording."""
    sources = plan.recordings or tuple(rendered(name) for name in RECORDINGS[plan.quick])
    return [{"recording": source.label, "method": method} for source in sources for method in METHODS[plan.quick]]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Poses by the preset `default`, from videos alone, or by `canton2009`, and how much of every true limb the recording shows."""
    label, method = parameters["recording"], parameters["method"]
    if method in PRINTED:
        results = runs.cell(runs.BASE | {"recording": label, "method": PRINTED[method], REPEAT: 0}, inputs, rng)
    else:
        seen, (name, models) = tracked(inputs, label, 0), runs.METHODS[method]
        people = run_method(seen, pose_method(name, models=models), FollowOptions(VOXEL_M, int(rng.integers(2**31))))
        results = pose_results(seen.recording, people)
    views = limb_views(inputs, label)
    there = np.isin(first_truth(inputs.recording(label)).frames, results["frames"])
    return results | {"occupancy": views.occupancy[there], "cameras": views.cameras[there]}


def _limb_rows(one: Cell) -> list[dict[str, Any]]:
    """Of a cell, a row a limb that is hidden or left out at some time."""
    estimate, truth = estimates(one)
    errors = 1000 * np.linalg.norm(estimate - truth, axis=-1)
    hidden, shown = hidden_and_shown(one.results["occupancy"])
    missing = np.isnan(estimate[:, _ENDS, 0])
    cameras = np.asarray(one.results["cameras"], float)
    rows = []
    for k, (limb, end) in enumerate(zip(ENDS, _ENDS, strict=True)):
        if not (hidden[:, k].any() or missing[:, k].any()):
            continue
        there = hidden[:, k] & ~missing[:, k]
        rows.append(
            {
                "recording": one.parameters["recording"].rpartition("@")[0],
                "method": one.parameters["method"],
                "limb": limb,
                "hidden_frames": int(hidden[:, k].sum()),
                "cameras_that_see_it_then": float(np.nanmean(cameras[hidden[:, k], k])) if hidden[:, k].any() else None,
                "of_these_dropped_percent": 100 * float(missing[hidden[:, k], k].mean()) if hidden[:, k].any() else None,
                "frames_to_drop": max(waits(hidden[:, k], missing[:, k]), default=None),
                "shown_frames": int(shown[:, k].sum()),
                "of_these_dropped_wrongly": int((missing & shown)[:, k].sum()),
                "frames_to_take_back": max(waits(shown[:, k], ~missing[:, k]), default=None),
                "invented_mm": float(errors[there, end].mean()) if there.any() else None,
            }
        )
    return rows


def _row(one: Cell) -> dict[str, Any]:
    """Of a cell, errors of the rest and of all that is estimated, and what is dropped, of all limbs together."""
    estimate, truth = estimates(one)
    errors = 1000 * landmark_errors(estimate, truth)
    hidden, shown = hidden_and_shown(one.results["occupancy"])
    missing, rest = np.isnan(estimate[:, _ENDS, 0]), rest_of(hidden)
    drops = [wait for k in range(len(ENDS)) for wait in waits(hidden[:, k], missing[:, k])]
    backs = [wait for k in range(len(ENDS)) for wait in waits(shown[:, k], ~missing[:, k])]
    return {
        "recording": one.parameters["recording"].rpartition("@")[0],
        "method": one.parameters["method"],
        "mean_mm": float(errors[np.isfinite(errors)].mean()),
        "rest_mm": float(errors[rest & np.isfinite(errors)].mean()),
        "rest_MMTA_percent": 100 * float(np.mean(errors[rest] < 100)),
        "rest_MMTA_50_percent": 100 * float(np.mean(errors[rest] < 50)),
        "hidden_limb_frames": int(hidden.sum()),
        "of_these_dropped_percent": 100 * float(missing[hidden].mean()) if hidden.any() else None,
        "shown_limb_frames": int(shown.sum()),
        "of_these_dropped_wrongly_percent": 100 * float(missing[shown].mean()) if shown.any() else None,
        "frames_to_drop": max(drops, default=0),
        "frames_to_take_back": max(backs, default=0),
    }


def _claims(row: dict[str, Any], apf: dict[str, Any]) -> Iterator[Claim]:
    """What a method with DDM does where limbs are hidden, and that it hardly drops one where none is."""
    what, wrong = f"{row['recording']}: {row['method']}", row["of_these_dropped_wrongly_percent"] or 0.0
    told = f"{wrong:.1f} % of shown limbs' frames dropped wrongly, {row['rest_mm']:.1f} mm; APF {apf['rest_mm']:.1f} mm"
    kept = wrong <= WRONG_PERCENT and row["rest_mm"] <= REST_MM
    if not row["hidden_limb_frames"]:
        text = f"{what} drops limbs, of which none is hidden, in {WRONG_PERCENT:g} % of their frames at most, and keeps the body"
        yield Claim(f"{text} within {REST_MM:.0f} mm", kept, told)
        return
    yield Claim(
        f"{what} drops hidden limbs within {DROP_FRAMES} frames and no others, takes them back within {BACK_FRAMES}, and keeps the rest "
        f"within {REST_MM:.0f} mm",
        kept and row["frames_to_drop"] <= DROP_FRAMES and row["frames_to_take_back"] <= BACK_FRAMES,
        f"{row['frames_to_drop']} and {row['frames_to_take_back']} frames, {told}",
    )
    yield Claim(f"{what} keeps the rest within {REST_MM:.0f} mm where APF loses it", kept and apf["rest_mm"] > REST_MM, told)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """What is dropped and taken back limb by limb, errors of the rest, and a picture of both over time."""
    labels = list(dict.fromkeys(one.parameters["recording"] for one in cells))
    figure, panels = plt.subplots(2, len(labels), figsize=(5.2 * len(labels), 5), sharex="col", squeeze=False)
    rows: list[dict[str, Any]] = []
    limbs, claims = [], []
    for column, label in zip(panels.T, labels, strict=True):
        chosen = [one for one in cells if one.parameters["recording"] == label]
        for one in chosen:
            hidden, _ = hidden_and_shown(one.results["occupancy"])
            estimate, truth = estimates(one)
            errors = np.where(rest_of(hidden), 1000 * np.linalg.norm(estimate - truth, axis=-1), np.nan)
            seen = np.isfinite(errors).any(axis=1)
            frames = np.asarray(one.results["frames"])
            column[0].plot(frames[seen], np.nanmean(errors[seen], axis=1), label=one.parameters["method"])
            column[1].plot(frames, np.isnan(estimate[:, _ENDS, 0]).sum(axis=1), label=one.parameters["method"])
            limbs += _limb_rows(one)
        hidden, _ = hidden_and_shown(chosen[0].results["occupancy"])
        column[1].plot(chosen[0].results["frames"], hidden.sum(axis=1), "k:", label="hidden in truth")
        column[0].set(title=label.rpartition("@")[0], ylabel="mean error of the rest (mm)")
        column[1].set(xlabel="frame", ylabel="limbs left out")
        own = {one.parameters["method"]: _row(one) for one in chosen}
        rows += own.values()
        ddm = ((row, own["APF, canton2009" if method in PRINTED else runs.APF]) for method, row in own.items() if "DDM" in method)
        claims += [claim for pair in ddm for claim in _claims(*pair)]
    panels[0, 0].legend(fontsize=7)
    panels[1, 0].legend(fontsize=7)
    caption = (
        "Limbs that furniture hides: errors of all that is estimated and of the landmarks of no hidden limb, hidden limbs that are left "
        "out, shown limbs that are left out wrongly, and the longest waits, frames."
    )
    by_limb = (
        "Limb by limb: in how many frames it is hidden, how many cameras see half of it then, the longest wait until it is dropped "
        "and until it is taken back, frames, and the error of its end where it is estimated though hidden."
    )
    return Report((Table("fig-7.15", caption, rows), Table("fig-7.15-limbs", by_limb, limbs)), {"fig-7.15": figure}, tuple(claims))


EXPERIMENT = Experiment("fig-7.15", "limbs hidden by furniture", "Canton, Figure 7.15", grid, cell, report, version=4)
