"""What of the printed filter's loss is the silhouettes', what the visual hull's, what the body's and what the likelihood's. Ours.

Source of the filter: Canton (2009), sections 6.3.4 (body), 6.5 (likelihood) and 6.7.2 (6 layers of 600).

The same filter, from the same first pose, in hulls that get better step by step: those of images; of faultless silhouettes of the actor;
of silhouettes of the tracker's own body in the pose nearest to the true one, so that the body fits what is seen; and that body itself,
voxel by voxel, so that nothing is carved. What it still loses there, its likelihood and its annealing lose. Scores are against that
nearest pose, as the thesis's body cannot take the true one: its arms are longer than people's. Beside it stand P0 twice as wide, the
symmetric likelihood of `default`, and a body of people's lengths.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.body.kinematics import landmarks
from hmc.experiments import filter_study as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results
from hmc.experiments.engine.inputs import Inputs, once, recipe_of, write_hulls
from hmc.experiments.exploratory import measured_truth
from hmc.experiments.ideal_hulls import actor_masks, body_masks, body_voxels
from hmc.experiments.markerless_runs import FRONTEND
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.study import change_of, runs_of, score_table, table_of
from hmc.experiments.truth import nearest_states
from hmc.io.recording import Recording
from hmc.synthetic.scene import build_scene
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import HullStep, stream_hulls

__all__ = ["CHANGES", "EXPERIMENT", "HULLS"]

#: What hulls are made of, and under which name those that are not of images are kept.
IMAGES, ACTOR, BODY_SILHOUETTES, BODY = HULLS = ("images", "the actor's silhouettes", "the body's silhouettes", "the body itself")
_FOLDERS = {ACTOR: "actor", BODY_SILHOUETTES: "body-silhouettes", BODY: "body"}
AS_PRINTED, WIDER, SYMMETRIC, LENGTHS = "as printed", "P0 twice as wide", "the symmetric likelihood", "a body of people's lengths"
#: What is changed in the filter, and how (`filter_study.BASE`).
CHANGES: dict[str, Mapping[str, Any]] = {
    AS_PRINTED: {},
    WIDER: {"drift_scale": 2.0},
    SYMMETRIC: {"likelihood": "symmetric"},
    LENGTHS: {"body": "people's"},
}
ACTIONS, STEPS = ("walk", "jog", "box"), ("Walking", "Jog")


def grid(plan: Plan) -> list[dict]:
    """Every kind of hull and every change on actions with and without a step; of the user's recordings nobody knows the actor's surface."""
    kinds = [kind for kind in HULLS if kind != ACTOR or all(source.folder is None for source in plan.recordings)]
    settings = [{"hulls_of": kind} | dict(change) for change in CHANGES.values() for kind in kinds]
    return runs.study_grid(plan, settings, runs.STUDY_FRAMES, ACTIONS, share="third")


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """As `filter_study.cell` in hulls of ``hulls_of``, one of `HULLS`; and ``nearest_m``, what the body can do of the truth, (n, 15, 3)."""
    label = parameters["recording"]
    recording = inputs.unseen_recording(label)
    if parameters["hulls_of"] == IMAGES:
        results = runs.cell(parameters, inputs, rng)
    else:
        results = runs.followed(rng, parameters, recording, lambda voxels: _kept(parameters, inputs, recording, voxels))
    states = _nearest(parameters, recording)
    nearest = landmarks(runs.study_body(parameters, recording), np.array([states[frame] for frame in results["frames"].tolist()]))
    return {**results, "nearest_m": nearest}


def _nearest(parameters: Parameters, recording: Recording) -> dict[int, np.ndarray]:
    """The poses of the cell's body that are nearest to the true ones, by frame."""
    truth = measured_truth(recording, parameters["recording"])
    states = nearest_states(runs.study_body(parameters, recording), truth.positions)
    return dict(zip(truth.frames.tolist(), states, strict=True))


def _kept(parameters: Parameters, inputs: Inputs, recording: Recording, voxels: VoxelGrid) -> Path:
    """The folder of a whole recording's hulls, made once."""
    kind, body = _FOLDERS[parameters["hulls_of"]], list(runs.BODIES).index(parameters.get("body", "printed"))
    path = inputs.folder / parameters["recording"] / f"hulls-of-{kind}-{body}-{parameters['voxel_mm']:g}mm"
    return once(path, lambda part: write_hulls(part, _better_hulls(parameters, recording, voxels)))


def _better_hulls(parameters: Parameters, recording: Recording, voxels: VoxelGrid) -> Iterator[HullStep]:
    """Hulls of `ACTOR`, `BODY_SILHOUETTES` or `BODY` of the frames in which there is a truth, in order."""
    kind, body, states = parameters["hulls_of"], runs.study_body(parameters, recording), _nearest(parameters, recording)
    if kind == ACTOR:
        masks = actor_masks(recording.rig, build_scene(recipe_of(parameters["recording"].rpartition("@")[0])), states)
    else:
        masks = body_masks(recording.rig, body, states)
    for step in stream_hulls(recording, voxels, FRONTEND, masks=masks):
        if kind == BODY:
            inside = body_voxels(body, states[step.index], voxels)
            step = replace(step, strict=inside, tolerant=inside, loose=inside)
        yield step


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by action, hulls and change, against the body's nearest pose and the truth; of who walks and jogs, what each step brings."""
    frame = runs_of([replace(one, results={**one.results, "truth_m": one.results["nearest_m"]}) for one in cells])
    frame["change"] = [change_of(one, CHANGES) for one in cells]
    by = ("action", "hulls_of", "change")
    table = score_table(frame, by)
    table.insert(6, "MMTA_of_truth_percent", list(score_table(frame.assign(run=list(cells)), by).MMTA_percent))
    best = [replace(one, results={**one.results, "estimate_m": one.results["nearest_m"]}) for one in cells]
    table.insert(7, "MMTA_of_truth_at_best_percent", list(score_table(frame.assign(run=best), by).MMTA_percent))
    actions, kinds = list(dict.fromkeys(table.action)), list(dict.fromkeys(table.hulls_of))
    figure, panels = plt.subplots(1, len(actions), figsize=(9, 3.4), sharey=True, squeeze=False)
    for axes, action in zip(panels.flat, actions, strict=True):
        for change, line in table[table.action == action].groupby("change", sort=False):
            axes.plot(range(len(kinds)), line.MMTA_percent, "o-", label=change)
        axes.set(title=action, ylim=(0, 105))
        axes.set_xticks(range(len(kinds)), kinds, rotation=30, ha="right")
    panels[0, 0].set_ylabel("MMTA at 100 mm (%)")
    panels[0, -1].legend(fontsize=6)

    def those(kind: str, change: str = AS_PRINTED) -> list[Cell]:
        return list(frame[(frame.hulls_of == kind) & (frame.change == change) & frame.action.isin(STEPS)].run)

    claims = [
        ahead(f"who walks and jogs is followed better in hulls of {better} than of {worse}", those(better), those(worse), but=("hulls_of",))
        for worse, better in pairwise(kinds)
    ]
    claims += [
        ahead(f"in hulls of {kind}: better with {change}", those(kind, change), those(kind), but=tuple(changed))
        for kind in (IMAGES, BODY)
        for change, changed in CHANGES.items()
        if changed
    ]
    caption = (
        "The thesis's filter from the true first pose in hulls that get better step by step: scores at 100 mm against the pose of its body "
        "that is nearest to the true one, MMTA against the truth too, and what that of the nearest pose would be. No accuracy: the last "
        "two kinds are of the very body that is followed."
    )
    return Report((table_of("why-hulls", caption, table),), {"why-hulls": figure}, tuple(claims))


EXPERIMENT = Experiment("why-hulls", "what of the printed filter's loss is the hulls'", "ours", grid, cell, report)
