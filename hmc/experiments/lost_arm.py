"""An arm that the silhouettes lose for a second: how far the pose goes astray, and how soon the arm is taken back.

Ours, not a paper's. From the silhouettes of all cameras but one everything near the arm is cut out, from below the shoulder to beyond the
hand, while the person goes on moving; the hull has no arm then. After that the silhouettes are as they were segmented.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import matplotlib.pyplot as plt
import numpy as np

from hmc.camera.model import Camera, Rig, project
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Source, Table
from hmc.experiments.engine.inputs import Inputs, once, rendered
from hmc.experiments.engine.style import COLORS
from hmc.experiments.markerless_runs import MASKS_KEY, VOXEL_M, run_method, tracked
from hmc.experiments.truth import estimate_of, first_truth
from hmc.io.masks import MaskStep, keep_masks, kept_masks
from hmc.io.results import PoseTable
from hmc.landmarks import landmark_index
from hmc.pose.follow import FollowOptions
from hmc.pose.registry import pose_method

__all__ = ["EXPERIMENT", "taken_back", "without_arm"]

#: Recordings, arms and seeds.
SOURCES = {False: ("box", "gesture", "throw_catch"), True: ("box",)}
ARMS = {False: ("l", "r"), True: ("l",)}
SEEDS = {False: 3, True: 1}
#: The arm is gone from here to there, seconds from the start.
GONE_S = (1.6, 2.6)
#: What is cut out around the arm: its radius, metres, and how far it goes on beyond the wrist, in forearms.
RADIUS_M, HAND = 0.1, 0.7
#: An arm is there where elbow and wrist are closer to the truth than this, metres, and lost where one is farther than that.
BACK_M, LOST_M = 0.1, 0.15
#: It is back when it is there for so many frames in a row; so many frames are given to it.
STAYS, GIVEN = 5, 15


def grid(plan: Plan) -> list[dict]:
    """Both arms, on every recording, with every seed."""
    sources: tuple[Source, ...] = plan.recordings or tuple(rendered(name) for name in SOURCES[plan.quick])
    return [
        {"recording": source.label, "arm": arm, "repeat": repeat}
        for source in sources
        for arm in ARMS[plan.quick]
        for repeat in range(SEEDS[plan.quick])
    ]


def without_arm(camera: Camera, mask: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A silhouette from which an arm is cut out.

    Parameters
    ----------
    camera : Camera
    mask : ndarray of bool, shape (h, w)
    points : ndarray, shape (3, 3)
        Shoulder, elbow and wrist, world, metres.

    Returns
    -------
    ndarray of bool, shape (h, w)
    """
    shoulder, elbow, wrist = points
    way = np.array([0.7 * shoulder + 0.3 * elbow, elbow, wrist + HAND * (wrist - elbow)])
    uv, valid = project(camera, way)
    if not valid.all():
        return mask
    depth = float(np.linalg.norm(way.mean(axis=0) - camera.centre))
    radius = RADIUS_M * float(camera.matrix[0, 0]) / depth
    hole = np.zeros(mask.shape, np.uint8)
    cv2.polylines(hole, [np.rint(uv).astype(np.int32)[:, None]], False, 1, max(1, round(2 * radius)))
    return mask & (hole == 0)


def taken_back(errors: np.ndarray) -> int | None:
    """How many frames after the arm has come back to the silhouettes the pose has it back.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        The greater error of elbow and wrist in the frames since then, metres.

    Returns
    -------
    int or None
        0: in the first of them; None: not at all.
    """
    there = errors < BACK_M
    return next((k for k in range(len(there) - STAYS + 1) if there[k : k + STAYS].all()), None)


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Errors of elbow and wrist in every frame, metres, and the frames in which the arm is gone."""
    seen = tracked(inputs, parameters["recording"], 0)
    recording, masks, truth = seen.recording, seen.masks, first_truth(seen.recording)
    arm = [landmark_index(f"{parameters['arm']}_{part}") for part in ("shoulder", "elbow", "wrist")]
    gone = [recording.start + round(second * recording.fps) for second in GONE_S]
    end = recording.start + recording.n_frames

    def make(part: Path) -> None:
        kept = kept_masks(masks, MASKS_KEY, recording.start, end)
        cut = _cut(kept or iter(()), recording.rig, truth, arm, gone)
        for _ in keep_masks(part, MASKS_KEY, recording.start, cut, lambda line: None):
            pass

    holes = once(masks.with_name(f"masks-without-{parameters['arm']}-arm"), make)
    poses = run_method(replace(seen, masks=holes), pose_method("apf"), FollowOptions(VOXEL_M, int(rng.integers(2**31)))).poses
    errors = np.linalg.norm(estimate_of(truth, poses)[:, arm[1:]] - truth.positions[:, arm[1:]], axis=-1).max(axis=1)
    return {"frames": truth.frames, "errors_m": errors, "gone": gone}


def _cut(steps: Iterator[MaskStep], rig: Rig, truth: PoseTable, arm: list[int], gone: Sequence[int]) -> Iterator[MaskStep]:
    """The silhouettes, in some frames without the arm in all cameras but the first."""
    for step in steps:
        where = truth.positions[truth.frames == step.index]
        if not (gone[0] <= step.index < gone[1] and len(where)):
            yield step
            continue
        rest = [None if mask is None else without_arm(camera, mask, where[0][arm]) for camera, mask in zip(rig, step.masks, strict=True)]
        yield MaskStep(step.index, step.images, (step.masks[0], *rest[1:]), (None,) * len(rest))


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """How far away the arm was and how many frames it took, run by run."""
    rows: list[dict[str, Any]] = []
    figure, axes = plt.subplots(figsize=(5.2, 3.0))
    for one in cells:
        frames, errors = np.array(one.results["frames"]), np.array(one.results["errors_m"], float)
        first, last = one.results["gone"]
        hidden, after = errors[(frames >= first) & (frames < last)], errors[frames >= last]
        rows.append(
            {
                "recording": one.parameters["recording"].rpartition("@")[0],
                "arm": one.parameters["arm"],
                "repeat": one.parameters["repeat"],
                "worst_while_gone_mm": 1000 * float(np.nanmax(hidden)),
                "when_it_comes_back_mm": 1000 * float(hidden[-1]),
                "frames_until_taken_back": taken_back(after),
                "mean_after_mm": 1000 * float(np.nanmean(after[GIVEN:])),
            }
        )
        axes.plot(frames - last, 1000 * errors, color=COLORS["particle"], alpha=0.5, linewidth=0.8)
    axes.axvspan(first - last, 0, color=COLORS["paper"], alpha=0.1)
    axes.axvline(GIVEN, color=COLORS["other"], linewidth=0.8)
    axes.set(xlabel="frames since the arm can be seen again", ylabel="worse of elbow and wrist (mm)", ylim=(0, None))
    lost = [row for row in rows if row["worst_while_gone_mm"] > 1000 * LOST_M]
    slow = [row for row in rows if row["frames_until_taken_back"] is None or row["frames_until_taken_back"] > GIVEN]
    claims = (
        Claim("the arm is lost while it is cut out, in most runs", 2 * len(lost) > len(rows), f"{len(lost)} of {len(rows)} runs"),
        Claim(f"it is taken back within {GIVEN} frames, in every run", not slow, f"{len(rows) - len(slow)} of {len(rows)} runs"),
    )
    caption = (
        f"An arm cut out of the silhouettes of all cameras but one from {GONE_S[0]} to {GONE_S[1]} s: the worse error of elbow and wrist, "
        f"and the frames until both are within {1000 * BACK_M:.0f} mm for {STAYS} frames."
    )
    return Report((Table("lost-arm", caption, rows),), {"lost-arm": figure}, claims)


EXPERIMENT = Experiment("lost-arm", "an arm that is lost and taken back", "ours; docs/accuracy.md", grid, cell, report, version=2)
