"""Parts of a body: Sundaresan's segmentation and the modified one, against the rendered actor's true parts. Hsiao (2008), Figure 3-15.

A voxel is right when its part is that of the nearest point of the actor's skin; which arm or leg is the left one is not asked of the
segmentation, so the better of both ways counts. Sundaresan's leaves voxels unfitted: they count as wrong, and in a column of their own as
trunk. Limbs are apart where the true joints say so. Quick: about five minutes.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.hsiao_runs import VOXEL_M, limbs_apart, person_hulls, scene_of, sequences
from hmc.experiments.truth import first_truth
from hmc.pose.spectral.parts import PART_NAMES
from hmc.pose.spectral.segmentation import baseline_segmentation, segment_body
from hmc.pose.spectral.skeleton import baseline_skeletons, extract_skeletons
from hmc.synthetic.actor import PARTS
from hmc.synthetic.truth import true_parts

__all__ = ["COLORS_OF_PARTS", "EXPERIMENT", "FAMILY", "cell", "grid", "share_right"]

FAMILY = "hsiao-parts"
#: Every so many frames are looked at.
EVERY = 3
COLORS_OF_PARTS = ("0.55", "gold", "tab:red", "tab:blue", "tab:cyan", "tab:orange", "black")
_NAMES = ("s1_wave", "s3_throw_item", "s4_struggle", "s6_close_door")


def grid(plan: Plan) -> list[dict]:
    """One cell a sequence."""
    return [{"recording": source.label, "every": EVERY} for source in sequences(plan, _NAMES)]


def share_right(labels: np.ndarray, truth: np.ndarray) -> float:
    """Share of voxels with their true part, left and right as they fit better.

    Parameters
    ----------
    labels : ndarray of int, shape (n,)
        Places in `PART_NAMES`, -1 where unknown.
    truth : ndarray of int, shape (n,)
        Places in `hmc.synthetic.actor.PARTS`.
    """
    place = list(PARTS).index
    best = 0.0
    for arms in (("l_arm", "r_arm"), ("r_arm", "l_arm")):
        for legs in (("l_leg", "r_leg"), ("r_leg", "l_leg")):
            meant = np.array([place("trunk"), place("head"), *map(place, arms), *map(place, legs), -9])
            best = max(best, float(np.mean(meant[labels] == truth)))
    return best


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Both segmentations of some frames; the voxels of the first frame with limbs apart, for the pictures."""
    scene = scene_of(parameters["recording"])
    recording = inputs.recording(parameters["recording"])
    joints = {int(f): p for f, p in zip(*(lambda t: (t.frames, t.positions))(first_truth(recording)), strict=True)}
    rows, shown = [], None
    for step, grid_, voxels, votes in person_hulls(recording):
        if step.index % parameters["every"]:
            continue
        points = grid_.centres(voxels)
        truth = true_parts(scene, step.index, points)[0]
        ours = segment_body(voxels, points, VOXEL_M, None, votes)
        plain = segment_body(voxels, points, VOXEL_M, baseline_segmentation())
        filled = np.where(plain.labels < 0, PART_NAMES.index("trunk"), plain.labels)
        apart = limbs_apart(joints[step.index])
        rows.append(
            [
                step.index, int(apart), share_right(ours.labels, truth), share_right(plain.labels, truth), share_right(filled, truth),
                int(ours.whole), float(np.mean(ours.labels[truth == list(PARTS).index("trunk")] == 0)),
                float(np.mean(plain.labels[truth == list(PARTS).index("trunk")] == 0)),
            ]
        )  # fmt: skip
        if shown is None and apart:
            shown = {
                "points": points,
                "ours": ours.labels,
                "baseline": plain.labels,
                "places": np.nan_to_num(ours.places[:, :3]),
                "plain_places": np.nan_to_num(plain.places[:, :3]),
                "curves": {part: curve.tolist() for part, curve in extract_skeletons(ours, points).items()},
                "plain_curves": {part: curve.tolist() for part, curve in baseline_skeletons(plain.branches, points).items()},
                "joints": joints[step.index],
            }
    return {"rows": np.array(rows), "shown": shown}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a sequence and one for all; the first frame with limbs apart in a picture."""
    named = [(one.parameters["recording"].rpartition("@")[0], np.array(one.results["rows"], float)) for one in cells]
    table = []
    for name, rows in (*named, ("all", np.concatenate([rows for _, rows in named]))):
        for kind, chosen in (("apart", rows[:, 1] > 0), ("all frames", rows[:, 1] >= 0)):
            if chosen.any():
                mean = rows[chosen].mean(0)
                table.append(
                    {
                        "sequence": name, "limbs": kind, "frames": int(chosen.sum()), "modified": mean[2], "sundaresan": mean[3],
                        "sundaresan_rest_as_trunk": mean[4], "all_parts_found": mean[5], "trunk_found_modified": mean[6],
                        "trunk_found_sundaresan": mean[7],
                    }
                )  # fmt: skip
    every = next((row for row in table if row["sequence"] == "all" and row["limbs"] == "apart"), None)
    detail = (
        "" if every is None else f"{every['modified']:.3f}; Sundaresan's {every['sundaresan']:.3f}, {every['sundaresan_rest_as_trunk']:.3f}"
    )
    claims = (
        Claim("at least .9 of the voxels in their true part where limbs are apart", every is not None and every["modified"] >= 0.9, detail),
        Claim("more than Sundaresan's", every is not None and every["modified"] > every["sundaresan_rest_as_trunk"], detail),
    )
    shown = [one.results["shown"] for one in cells if one.results["shown"] is not None]
    figures = {"hsiao-3.15": draw(shown[0])} if shown else {}
    return Report((Table("hsiao-3.15", "Share of voxels in their true part.", table),), figures, claims)


def draw(shown: dict) -> plt.Figure:
    """Both segmentations in the eigenspace and in the room, as Figure 3-15."""
    figure = plt.figure(figsize=(9, 6))
    points, colors = np.array(shown["points"]), np.array(COLORS_OF_PARTS, object)
    for row, (labels, places, title) in enumerate(
        ((shown["baseline"], shown["plain_places"], "Sundaresan's"), (shown["ours"], shown["places"], "modified"))
    ):
        color = colors[np.array(labels, int)].tolist()
        first = figure.add_subplot(2, 2, 2 * row + 1, projection="3d")
        first.scatter(*np.array(places).T, s=2, c=color)
        first.set_title(f"{title}: first three dimensions")
        second = figure.add_subplot(2, 2, 2 * row + 2, projection="3d")
        second.scatter(*points.T, s=3, c=color)
        second.set_box_aspect(np.ptp(points, axis=0))
        second.view_init(8, 20)
        second.set_title("in the room")
    return figure


EXPERIMENT = Experiment("hsiao-3.15", "parts of a body against the true ones", "Hsiao, Figure 3-15", grid, cell, report, FAMILY)
