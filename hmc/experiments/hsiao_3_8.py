"""Visual hulls from eight and from four cameras: ghost legs. Hsiao (2008), Figure 3-8.

Pieces of the hull at the height of the shanks, the share of the hull that is far from the true body, and what the check for ghosts says and
removes (`hmc.pose.spectral.ghosts`). Quick: about two minutes.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.hsiao_runs import person_hulls, scene_of, sequences
from hmc.io.recording import open_recording
from hmc.pose.spectral.ghosts import check_ghosts, remove_ghosts
from hmc.synthetic.truth import true_parts
from hmc.tracking.views import FrameViews

__all__ = ["EXPERIMENT"]

#: Farther than this from the skin is no part of the body, metres; voxels inside are nearer than a trunk's half depth.
FAR_M = 0.08
EVERY = 9


def grid(plan: Plan) -> list[dict]:
    """Eight cameras, and every second of them."""
    label = sequences(plan, ("s1_wave",))[0].label
    return [{"recording": label, "cameras": n} for n in (8, 4)]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Hulls of some frames."""
    scene = scene_of(parameters["recording"])
    folder = inputs.recording_folder(parameters["recording"])
    names = open_recording(folder).rig.names
    recording = open_recording(folder, cameras=list(names[:: len(names) // parameters["cameras"]]))
    rows, shown, texts = [], None, []
    for step, grid_, voxels, _ in person_hulls(recording):
        if step.index % EVERY:
            continue
        far = true_parts(scene, step.index, grid_.centres(voxels))[1]
        found = check_ghosts(voxels, grid_, FrameViews(recording.rig, step.masks, step.images))
        left = remove_ghosts(voxels, grid_, found)
        far_left = true_parts(scene, step.index, grid_.centres(left))[1]
        litres = 1000 * grid_.voxel_size_m**3
        rows.append([step.index, len(found.pieces), int(found.ghosts.sum()), litres * len(voxels), litres * np.sum(far > FAR_M),
                     litres * np.sum(far_left > FAR_M), litres * len(left)])  # fmt: skip
        if found.text:
            texts.append(found.text)
        if shown is None:
            shown = grid_.centres(voxels)
    return {"rows": np.array(rows), "shown": shown, "texts": sorted(set(texts))}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a rig, and both hulls in one picture."""
    table = []
    figure = plt.figure(figsize=(7, 4))
    for k, one in enumerate(cells):
        rows = np.array(one.results["rows"], float)
        table.append(
            {
                "cameras": one.parameters["cameras"], "frames": len(rows), "legs": rows[:, 1].mean(), "most_legs": rows[:, 1].max(),
                "removed_by_color": rows[:, 2].mean(), "litres": rows[:, 3].mean(), "litres_far_from_body": rows[:, 4].mean(),
                "litres_far_after_removal": rows[:, 5].mean(), "said": "; ".join(one.results["texts"]),
            }
        )  # fmt: skip
        points = np.array(one.results["shown"])
        ax = figure.add_subplot(1, len(cells), k + 1, projection="3d")
        ax.scatter(*points.T, s=2, c=points[:, 2], cmap="viridis")
        ax.set_box_aspect(np.ptp(points, axis=0))
        ax.view_init(8, 20)
        ax.set_title(f"{one.parameters['cameras']} cameras")
    by = {row["cameras"]: row for row in table}
    claims = (
        Claim("more than two legs with four cameras, two with eight", by[4]["most_legs"] > 2 >= by[8]["most_legs"],
              f"{by[4]['legs']:.1f}, {by[8]['legs']:.1f} on average"),
        Claim("more hull far from the body with four cameras", by[4]["litres_far_from_body"] > by[8]["litres_far_from_body"],
              f"{by[4]['litres_far_from_body']:.1f}, {by[8]['litres_far_from_body']:.1f} l"),
    )  # fmt: skip
    return Report((Table("hsiao-3.8", "Hulls from eight and four cameras.", table),), {"hsiao-3.8": figure}, claims)


EXPERIMENT = Experiment("hsiao-3.8", "visual hull from eight and four cameras", "Hsiao, Figure 3-8", grid, cell, report)
