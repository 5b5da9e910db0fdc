"""Visual hulls from eight and from four cameras: ghost legs. Hsiao (2008), Figure 3-8.

Its four cameras are the first of the eight, side by side. Pieces of the hull at the height of the shanks, the share of the hull that is far
from the true body, and what the check for ghosts says and removes (`hmc.pose.spectral.ghosts`). Quick: about three minutes.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.ratios import Parts, ratio_gain, ratio_interval
from hmc.experiments.hsiao_runs import person_hulls, scene_of, sequences
from hmc.io.recording import open_recording
from hmc.pose.spectral.ghosts import check_ghosts, remove_ghosts
from hmc.synthetic.truth import true_parts
from hmc.tracking.views import FrameViews

__all__ = ["EXPERIMENT"]

#: Farther than this from the skin is no part of the body, metres; voxels inside are nearer than a trunk's half depth.
FAR_M = 0.08
EVERY, EVERY_FULL = 9, 15
_NAMES = ("s1_wave", "s2_throw_ball", "s4_struggle", "s7_push_case", "s8_walk")
#: Which of the cameras, by number: all, the first four (Figure 3-8), and every second one.
RIGS: dict[str, list[int]] = {"eight": list(range(8)), "1 to 4": [0, 1, 2, 3], "every second": [0, 2, 4, 6]}
#: Columns of a cell's rows after the frame's number.
_COLUMNS = ("legs", "removed_by_color", "litres", "litres_far_from_body", "litres_far_after_removal", "litres_after_removal")


def grid(plan: Plan) -> list[dict]:
    """A cell a sequence and rig."""
    every = EVERY if plan.quick else EVERY_FULL
    return [{"recording": source.label, "cameras": rig, "every": every} for source in sequences(plan, _NAMES) for rig in RIGS]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Hulls of some frames."""
    scene = scene_of(parameters["recording"])
    folder = inputs.recording_folder(parameters["recording"])
    names = open_recording(folder).rig.names
    recording = open_recording(folder, cameras=[names[k] for k in RIGS[parameters["cameras"]]])
    rows, shown, texts = [], None, []
    for step, grid_, voxels, _ in person_hulls(recording):
        if step.index % parameters["every"]:
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
        if shown is None or len(found.pieces) > shown[0]:
            shown = len(found.pieces), grid_.centres(voxels)
    return {
        "rows": np.array(rows).reshape(-1, 1 + len(_COLUMNS)),
        "shown": None if shown is None else shown[1],
        "texts": sorted(set(texts)),
    }


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a sequence and rig, and one for all with intervals; the hulls with most legs of the first sequence in a picture."""
    of_rig = {rig: [one for one in cells if one.parameters["cameras"] == rig] for rig in RIGS}
    table = [_row(one.parameters["recording"].rpartition("@")[0], rig, [one]) for rig, own in of_rig.items() for one in own]
    table += [_row("all", rig, own) for rig, own in of_rig.items() if own]
    few, many = of_rig["1 to 4"], of_rig["eight"]
    legs = ratio_interval(few, _mean("legs"))
    more, far = (ratio_gain(few, many, _mean(column)) for column in ("legs", "litres_far_from_body"))
    claims = (
        decide("more than two legs with four cameras", legs.over(2), str(legs)),
        decide("more legs with four cameras than with eight", more, f"more by {more}"),
        decide("more hull far from the body with four cameras", far, f"more by {far} l"),
    )
    return Report((Table("hsiao-3.8", "Hulls from eight and four cameras.", table),), {"hsiao-3.8": draw(of_rig)}, claims)


def _values(one: Cell, column: str) -> np.ndarray:
    return np.array(one.results["rows"], float).reshape(-1, 1 + len(_COLUMNS))[:, 1 + _COLUMNS.index(column)]


def _mean(column: str) -> Parts:
    return lambda one: (float(_values(one, column).sum()), float(len(_values(one, column))))


def _row(name: str, rig: str, cells: Sequence[Cell]) -> dict:
    values = {column: np.concatenate([_values(one, column) for one in cells]) for column in _COLUMNS}
    texts = sorted({text for one in cells for text in one.results["texts"]})
    return (
        {"sequence": name, "cameras": rig, "frames": len(values["legs"]), "most_legs": values["legs"].max(initial=0)}
        | {column: own.mean() if len(own) else None for column, own in values.items()}
        | {"said": "; ".join(texts)}
    )


def draw(of_rig: dict[str, list[Cell]]) -> plt.Figure:
    """A hull a rig."""
    figure = plt.figure(figsize=(9, 4))
    for k, (rig, own) in enumerate(of_rig.items()):
        points = next((np.array(one.results["shown"]) for one in own if one.results["shown"] is not None), None)
        ax = figure.add_subplot(1, len(of_rig), k + 1, projection="3d")
        ax.set_title(f"cameras: {rig}")
        if points is not None:
            ax.scatter(*points.T, s=2, c=points[:, 2], cmap="viridis")
            ax.set_box_aspect(np.ptp(points, axis=0))
            ax.view_init(8, 20)
    return figure


EXPERIMENT = Experiment("hsiao-3.8", "visual hull from eight and four cameras", "Hsiao, Figure 3-8", grid, cell, report, version=2)
