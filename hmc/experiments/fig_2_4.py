"""Figure 2.4: colors of voxels as the average over all cameras, and over those that have direct sight of the voxel.

Source: Canton (2009), section 2.2.4: the plain average is biased, as cameras behind the body tell of its other side; visibility, along 3-D
Bresenham lines, takes the bias away. The thesis shows pictures. Here the true color of a voxel is the paint of the nearest point of the
rendered actor's skin, and what is measured is the angle between both in the space of linear colors: how bright the light is does not count.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.five_actions import action_recipes
from hmc.experiments.markerless_runs import FRONTEND, MASKS_KEY, action_sources, tracked
from hmc.experiments.run_means import gains, mean_interval
from hmc.experiments.truth import first_truth
from hmc.io.masks import kept_masks
from hmc.io.recording import iterate_frames
from hmc.synthetic.scene import Scene, build_scene
from hmc.synthetic.truth import true_colors
from hmc.tracking.resumable import person_grid
from hmc.voxels.color import color_voxels, visibility
from hmc.voxels.components import components
from hmc.voxels.hulls import stream_hulls
from hmc.voxels.surface import surface

__all__ = ["EXPERIMENT", "angles_deg"]

WAYS = {"plain": "average over all cameras", "visible": "over those that see the voxel"}
VOXEL_M = 0.03
#: What has fewer voxels is nobody.
LEAST_VOXELS = 20
#: Of linear colors; what is nearer to black than this has no hue.
GAMMA, LEAST = 2.2, 1e-3


def grid(plan: Plan) -> list[dict]:
    """Some frames of the five actions by both actors (quick: by the actors in turn), as shares of the length."""
    sources = action_sources(plan, in_turn=plan.quick)
    return [{"recording": source.label, "at": at} for source in sources for at in ((0.2, 0.8) if plan.quick else (0.1, 0.3, 0.5, 0.7, 0.9))]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Mean angle of both ways over the surface of one frame, degrees; the voxels of the first frame, for the picture."""
    seen = tracked(inputs, parameters["recording"], 0)
    truth = first_truth(seen.recording)
    k = int(parameters["at"] * len(truth.frames))
    frame = int(truth.frames[k])
    around = person_grid(seen.recording, VOXEL_M)
    kept = kept_masks(seen.masks, MASKS_KEY, frame, frame + 1)
    step = next(iter(stream_hulls(seen.recording, around, FRONTEND, first=frame, last=frame + 1, masks=kept, on_problem=lambda line: None)))
    images = next(iter(iterate_frames(seen.recording, frame, frame + 1))).images
    # The person's piece of the strict hull: voxels of the tolerant one that stand off the body show the room behind it in some cameras.
    body = np.zeros(around.shape, bool)
    body[tuple(components(step.strict, around, LEAST_VOXELS).of(0).T)] = True
    shell = surface(body)
    sight = visibility(body, around, seen.recording.rig, shell)
    # Voxels that no camera sees have no color of their own in the thesis: they are no part of its colored set.
    shell, sight = shell[sight.any(axis=0)], sight[:, sight.any(axis=0)]
    points = around.centres(shell)
    rig = seen.recording.rig
    colors = {"plain": color_voxels(around, rig, images, shell), "visible": color_voxels(around, rig, images, shell, sight)}
    paint = true_colors(_scene_of(parameters["recording"]), frame, points)
    known = np.isfinite(colors["visible"]).all(axis=1) & np.isfinite(colors["plain"]).all(axis=1)
    angles = {way: float(angles_deg((own[known] / 255) ** GAMMA, paint[known]).mean()) for way, own in colors.items()}
    picture = {"points": points[known], "paint": paint[known] ** (1 / GAMMA)} | {way: own[known] / 255 for way, own in colors.items()}
    return {"voxels": int(known.sum()), "angle_deg": angles, "shown": picture if parameters["at"] < 0.25 else None}


def _scene_of(label: str) -> Scene:
    """The scene of a rendered recording, which knows how the actor is painted."""
    name = label.rpartition("@")[0]
    for recipe in action_recipes():
        if recipe.name == name:
            return build_scene(recipe)
    raise InputError(f"{name}: the true colors of a body are known of rendered actions only; leave --recordings out")


def angles_deg(colors: np.ndarray, paint: np.ndarray) -> np.ndarray:
    """Angles between colors, (n, 3) both, linear; (n,), degrees."""
    first, second = (one / np.maximum(np.linalg.norm(one, axis=1, keepdims=True), LEAST) for one in (colors, paint))
    return np.degrees(np.arccos(np.clip((first * second).sum(axis=1), 0, 1)))


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Angles by recording, and the voxels of one frame."""
    rows = []
    for label in (*dict.fromkeys(one.parameters["recording"] for one in cells), None):
        own = [one for one in cells if label is None or one.parameters["recording"] == label]
        row: dict = {"recording": label.rpartition("@")[0] if label else "all", "frames": len(own)}
        for name in WAYS:
            known = mean_interval(_by_frame(own, name))
            row |= {f"{name}_deg": known.value, f"{name}_low_deg": known.low, f"{name}_high_deg": known.high}
        rows.append(row)
    gain = mean_interval(gains(_by_frame(cells, "plain"), _by_frame(cells, "visible")))
    claim = decide("colors by visibility are nearer to the true ones than the plain average", gain, f"by {gain} degrees")
    caption = "Mean angle between estimated and true colors of surface voxels. The paper: Canton, Figure 2.4, pictures."
    return Report((Table("fig-2.4", caption, rows),), {"fig-2.4": _draw(cells)}, (claim,))


def _by_frame(cells: Sequence[Cell], name: str) -> dict:
    return {(one.parameters["recording"], one.parameters["at"]): float(one.results["angle_deg"][name]) for one in cells}


def _draw(cells: Sequence[Cell]) -> plt.Figure:
    """The body's voxels from the side on which it is broadest: paint, plain average, by visibility."""
    shown = next((one.results["shown"] for one in cells if one.results["shown"]), None)
    titles = {"paint": "true paint", "plain": "(b) all cameras", "visible": "(c) by visibility"}
    figure, panels = plt.subplots(1, len(titles), figsize=(7.4, 4), sharey=True)
    if shown is None:
        return figure
    points = np.array(shown["points"])
    across, along = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), full_matrices=False)[2]
    order = np.argsort(points[:, :2] @ along)
    for axes, (name, title) in zip(panels, titles.items(), strict=True):
        colors = np.clip(np.array(shown[name])[order, ::-1], 0, 1)
        axes.scatter(points[order, :2] @ across, points[order, 2], c=colors, s=9, marker="s", linewidths=0)
        axes.set(aspect="equal", title=title, xlabel="metres")
    return figure


EXPERIMENT = Experiment("fig-2.4", "colors of voxels with and without visibility", "Canton, Figure 2.4", grid, cell, report)
