"""Figure 7.15: DDM-APF against APF behind furniture: hidden limbs are dropped and taken back, the rest is kept.

Source: Canton (2009), section 7.5.2, which shows pictures. Here it is measured: a limb is hidden where less than 30 % of its true flesh is
in the tolerant hull, of what is free of other parts, and shown where more than 60 % is; between the two, either is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import scalable_runs as runs
from hmc.experiments.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.filter_runs import HEIGHT_M
from hmc.experiments.inputs import Inputs, rendered
from hmc.experiments.markerless_runs import FRONTEND, MASKS_KEY, tracked
from hmc.experiments.pose_runs import VOXEL_M, estimates, first_truth, standing_state
from hmc.frontend import stream_hulls
from hmc.landmarks import landmark_index
from hmc.mask_store import kept_masks
from hmc.metrics.landmarks import landmark_errors
from hmc.pose.annealed.apf import make_filter, score_maps
from hmc.pose.annealed.presets import pose_preset
from hmc.pose.body.inverse import fit_landmarks
from hmc.pose.body.proportions import default_body
from hmc.pose.scalable.limbs import LimbSettings
from hmc.pose.scalable.methods import method_preset
from hmc.pose.scalable.models import UNITIVE_PIECES
from hmc.pose.scalable.restrict import part_mask
from hmc.pose.scalable.scouts import limb_occupancy
from hmc.pose.sequence import targets_of
from hmc.recording import Recording
from hmc.results import PoseTable, TrackTable
from hmc.tracking.resumable import person_grid

__all__ = ["EXPERIMENT", "hidden_and_shown", "waits"]

METHODS = (runs.APF, "DDM-APF", "SHBM-DDM-APF")
#: Recordings of people behind furniture.
RECORDINGS = {False: ("counter", "pick_up", "sit"), True: ("counter",)}
HIDDEN, SHOWN = 0.3, 0.6
#: Limbs that may be missing, and the landmark that tells whether one is.
ENDS = {"r_upper_arm": "r_elbow", "r_forearm": "r_wrist", "l_upper_arm": "l_elbow", "l_forearm": "l_wrist",
        "r_thigh": "r_knee", "r_shank": "r_ankle", "l_thigh": "l_knee", "l_shank": "l_ankle"}  # fmt: skip
#: Frames within which a hidden limb must be dropped, and one that is shown again taken back.
DROP_FRAMES, BACK_FRAMES = 10, 15


def grid(plan: Plan) -> list[dict]:
    """Every method on every recording."""
    sources = plan.recordings or tuple(rendered(name) for name in RECORDINGS[plan.quick])
    return [{"recording": source.label, "method": method} for source in sources for method in METHODS]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Poses from videos alone by the preset `default`, and how much of every true limb the hull has."""
    recording, tracks, masks = tracked(inputs, parameters["recording"], 0)
    truth = first_truth(recording)
    name, models = runs.METHODS[parameters["method"]]
    preset = method_preset(pose_preset("default"), name, models)
    results = runs.chain(recording, tracks, masks, truth, preset, int(rng.integers(2**31)))
    return results | {"occupancy": _occupancy(recording, tracks, masks, truth)}


def _occupancy(recording: Recording, tracks: TrackTable, masks, truth: PoseTable) -> np.ndarray:
    """Of every limb in every true frame, shape (n, n_limbs); NaN where it cannot be told."""
    grid = person_grid(recording, VOXEL_M)
    preset = method_preset(pose_preset("default"), "ddm-apf")
    body = default_body(float(recording.subject_height_m[0]) if recording.subject_height_m else HEIGHT_M)
    table = make_filter(body, preset, recording.fps, VOXEL_M, recording.room).table
    limbs = LimbSettings(tree=UNITIVE_PIECES).tree.limbs
    whole = part_mask(UNITIVE_PIECES.unions[-1].model.parts)
    out = np.full((len(truth.frames), len(limbs)), np.nan)
    first, last = int(truth.frames[0]), int(truth.frames[-1]) + 1
    state = standing_state(body, truth.positions[0])
    where = TrackTable(truth.frames, np.zeros(len(truth.frames), int), truth.positions.mean(axis=1))
    kept = kept_masks(masks, MASKS_KEY, first, last)
    for hull in stream_hulls(recording, grid, FRONTEND, first=first, last=last, masks=kept, on_problem=lambda line: None):
        row = np.flatnonzero(truth.frames == hull.index)
        target = targets_of(recording, grid, where, hull).get(0)
        if not len(row) or target is None or table is None:
            continue
        state, _ = fit_landmarks(body, truth.positions[row[0]], state)
        maps = score_maps(target, recording.room)
        # What hangs on a limb goes with it, so that a bent knee does not cover the thigh.
        out[row[0]] = [limb_occupancy(table, state, maps, limb.parts, whole) for limb in limbs]
    return out


def hidden_and_shown(occupancy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which limbs are hidden in which frames, and which are shown; neither where it is in between or unknown."""
    occupancy = np.asarray(occupancy, float)
    return occupancy < HIDDEN, occupancy > SHOWN


def waits(since: np.ndarray, reached: np.ndarray) -> list[int]:
    """For every stretch of frames in which something holds, after how many of them something else was reached: all where it was not.

    Parameters
    ----------
    since, reached : ndarray of bool, shape (n,)
    """
    edges = np.flatnonzero(np.diff(np.r_[False, since, False].astype(int)))
    return [int(np.argmax(np.r_[reached[start:stop], True])) for start, stop in edges.reshape(-1, 2)]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Error of what is estimated, limbs dropped and taken back, and a picture of both over time."""
    rows: list[dict[str, Any]] = []
    labels = list(dict.fromkeys(one.parameters["recording"] for one in cells))
    figure, panels = plt.subplots(2, len(labels), figsize=(5.2 * len(labels), 5), sharex="col", squeeze=False)
    ends = [landmark_index(name) for name in ENDS.values()]
    for column, label in zip(panels.T, labels, strict=True):
        for one in (one for one in cells if one.parameters["recording"] == label):
            estimate, truth = estimates(one)
            errors = 1000 * landmark_errors(estimate, truth)
            errors[np.isinf(errors)] = np.nan  # no estimate
            missing = np.isnan(estimate[:, ends, 0])
            hidden, shown = hidden_and_shown(one.results["occupancy"])
            drops = [wait for k in range(len(ENDS)) for wait in waits(hidden[:, k], missing[:, k])]
            backs = [wait for k in range(len(ENDS)) for wait in waits(shown[:, k], ~missing[:, k])]
            rows.append(
                {
                    "recording": label.rpartition("@")[0],
                    "method": one.parameters["method"],
                    "mean_mm": float(np.nanmean(errors)),
                    "MMTA_percent": 100 * float(np.mean(errors < 100)),
                    "MMTA_50_percent": 100 * float(np.mean(errors < 50)),
                    "hidden_limb_frames": int(hidden.sum()),
                    "of_these_dropped_percent": 100 * float(missing[hidden].mean()) if hidden.any() else None,
                    "shown_limb_frames": int(shown.sum()),
                    "of_these_dropped_wrongly_percent": 100 * float(missing[shown].mean()) if shown.any() else None,
                    "frames_to_drop": max(drops, default=0),
                    "frames_to_take_back": max(backs, default=0),
                }
            )
            column[0].plot(one.results["frames"], np.nanmean(errors, axis=1), label=one.parameters["method"])
            column[1].plot(one.results["frames"], missing.sum(axis=1), label=one.parameters["method"])
        column[1].plot(one.results["frames"], hidden.sum(axis=1), "k:", label="hidden in truth")
        column[0].set(title=label.rpartition("@")[0], ylabel="mean of what is estimated (mm)")
        column[1].set(xlabel="frame", ylabel="limbs left out")
    panels[0, 0].legend(fontsize=7)
    panels[1, 0].legend(fontsize=7)
    claims = []
    for label in dict.fromkeys(row["recording"] for row in rows):
        apf, *others = [row for row in rows if row["recording"] == label]
        for row in others:
            claims.append(
                Claim(
                    f"{label}: {row['method']} drops hidden limbs within {DROP_FRAMES} frames, takes them back within {BACK_FRAMES}, "
                    "and keeps the rest within 60 mm",
                    row["frames_to_drop"] <= DROP_FRAMES and row["frames_to_take_back"] <= BACK_FRAMES and row["mean_mm"] <= 60,
                    f"{row['frames_to_drop']} and {row['frames_to_take_back']} frames, {row['mean_mm']:.1f} mm; "
                    f"APF {apf['mean_mm']:.1f} mm",
                )
            )
    caption = (
        "Limbs that furniture hides: error of what is estimated, hidden limbs that are left out, shown limbs that are left out "
        "wrongly, and the longest wait until a hidden limb is dropped and a shown one taken back, frames."
    )
    return Report((Table("fig-7.15", caption, rows),), {"fig-7.15": figure}, tuple(claims))


EXPERIMENT = Experiment("fig-7.15", "limbs hidden by furniture", "Canton, Figure 7.15", grid, cell, report)
