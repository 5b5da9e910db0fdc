"""Table 1 and figure 3: reconstruction and coloring at 64^3 and 128^3 from 4, 5 and 9 views, incremental and from scratch.

Source: Kehl (2006), section 4.1, on a Pentium IV of 3 GHz. Silhouettes are those of the superellipsoid body as it swings its arms, 15
frames a second, so that nothing but the reconstruction is measured. Times are processor times of one thread. Takes about 2 minutes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import cv2
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator

from hmc.body.joints import dof_index
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.body.solid_samples import surface_grid
from hmc.body.solids import SolidBody, solid_body
from hmc.camera.model import Rig, look_at, project
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.style import COLORS
from hmc.pose.objectives.cue_rows import pose_body
from hmc.pose.objectives.surface_cue import place
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.incremental import colored_surface, hull_init, hull_step, make_pixel_tables

__all__ = ["EXPERIMENT"]

ROOM = np.array([[-1.1, -1.1, 0.0], [1.1, 1.1, 2.2]])
FPS = 15.0
#: Table 1: milliseconds of reconstruction and texturing, by views and side.
PAPER_MS = {(4, 64): (6.63, 6.07), (4, 128): (38.80, 29.28), (5, 64): (7.56, 6.40), (5, 128): (40.72, 29.06), (9, 64): (12.67, 8.18),
            (9, 128): (64.78, 32.61)}  # fmt: skip


def grid(plan: Plan) -> list[dict]:
    """Views and sides."""
    sizes = [(5, 64), (5, 128)] if plan.quick else list(PAPER_MS)
    return [{"views": views, "side": side, "frames": 4 if plan.quick else 15} for views, side in sizes]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Milliseconds a frame, and whether the hulls are the same."""
    rig = _rig(parameters["views"])
    body = solid_body(default_body(1.78))
    voxels = VoxelGrid.from_room(ROOM, 2.2 / parameters["side"], len(rig))
    pixels, blocks = make_pixel_tables(voxels, rig), make_tables(voxels, rig)
    times: dict[str, list[float]] = {name: [] for name in ("incremental", "scratch", "blocks", "texturing")}
    state, same, surface = None, True, 0
    for frame in range(parameters["frames"] + 1):
        masks, images = _seen(body, rig, frame / FPS)
        before = state if state is not None else hull_init(pixels, masks)
        state, took = _timed(lambda b=before, m=masks: hull_step(pixels, b, m))
        _, scratch = _timed(lambda m=masks: hull_init(pixels, m))
        carved, blockwise = _timed(lambda m=masks: carve(blocks, m))
        (shell, _), texturing = _timed(lambda s=state, i=images: colored_surface(pixels, s, i))
        same &= bool(np.array_equal(state.occupied, carved))
        surface = len(shell)
        if frame:  # the first has nothing before it
            for name, value in zip(times, (took, scratch, blockwise, texturing), strict=True):
                times[name].append(1000 * value)
    return {"ms": {name: float(np.median(values)) for name, values in times.items()}, "identical": same, "surface_voxels": surface}


def _timed(function):
    start = time.thread_time()
    out = function()
    return out, time.thread_time() - start


def _rig(n: int) -> Rig:
    """Cameras in a ring, and one overhead."""
    around = np.arange(n - 1) * 2 * np.pi / (n - 1) + 0.4
    places = [(3.2 * np.cos(a), 3.2 * np.sin(a), 1.7) for a in around] + [(0.1, 0.0, 3.6)]
    return Rig(tuple(look_at(f"cam_{k:02d}", (640, 480), at, (0, 0, 1.0), 60) for k, at in enumerate(places)))


def _seen(body: SolidBody, rig: Rig, second: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Silhouettes and images, solid by solid as hulls of their points: solids are convex, and so are their images."""
    state = neutral_state("down", body.skeleton.limits)
    swing = np.sin(2 * np.pi * second)
    state[:3] = (0.3 * np.sin(second), 0.2, 0.93)
    state[dof_index("r_shoulder_y", "l_shoulder_y", "r_elbow_z", "r_hip_y", "l_hip_y")] = (
        0.8 * swing,
        -0.8 * swing,
        0.7,
        0.4 * swing,
        -0.4 * swing,
    )
    samples = surface_grid(body)
    points = place(pose_body(body, state), samples.points, samples.segment)
    masks, images = [], []
    for camera in rig:
        uv = project(camera, points)[0].astype(np.float32)
        image = np.full((*camera.size[::-1], 3), 120, np.uint8)
        mask = np.zeros(camera.size[::-1], np.uint8)
        for solid in range(len(body.solids)):
            outline = cv2.convexHull(uv[samples.solid == solid]).round().astype(np.int32)
            cv2.fillConvexPoly(mask, outline, 1)
            cv2.fillConvexPoly(image, outline, (40 + 15 * solid, 220 - 15 * solid, 90))
        masks.append(mask > 0)
        images.append(image)
    return masks, images


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Times beside the paper's."""
    rows = []
    for one in cells:
        views, side, ms = one.parameters["views"], one.parameters["side"], one.results["ms"]
        paper = PAPER_MS[views, side]
        rows.append({
            "views": views, "side": side, "surface_voxels": one.results["surface_voxels"], "incremental_ms": ms["incremental"],
            "scratch_ms": ms["scratch"], "blocks_ms": ms["blocks"], "texturing_ms": ms["texturing"],
            "identical": one.results["identical"], "paper_reconstruction_ms": paper[0], "paper_texturing_ms": paper[1],
        })  # fmt: skip
    figure, axes = plt.subplots(figsize=(7, 3.5))
    place_of = np.arange(len(rows))
    names = {"incremental_ms": ("incremental", COLORS["sparse"]), "scratch_ms": ("from scratch", COLORS["particle"]),
             "blocks_ms": ("by blocks", COLORS["person"]), "paper_reconstruction_ms": ("paper", COLORS["paper"])}  # fmt: skip
    for k, (column, (title, color)) in enumerate(names.items()):
        axes.bar(place_of + 0.2 * (k - 1.5), [row[column] for row in rows], 0.2, color=color, label=title)
    axes.set(yscale="log", ylabel="ms a frame", xticks=place_of, xticklabels=[f"{row['views']} views\n{row['side']}^3" for row in rows])
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    axes.legend()
    slow = [row["incremental_ms"] / row["blocks_ms"] for row in rows]
    claims = (
        Claim("the incremental hull is the block carve's to the voxel", all(row["identical"] for row in rows)),
        Claim("it takes at most three times as long", max(slow) <= 3, ", ".join(f"{value:.2f}" for value in slow)),
        Claim("it is quicker than the same tables from scratch", all(row["incremental_ms"] < row["scratch_ms"] for row in rows)),
    )
    caption = "Reconstruction and texturing of a moving body, median processor times. The paper: Kehl, Table 1 (Pentium IV, 3 GHz)."
    return Report((Table("kehl-1", caption, rows),), {"kehl-1": figure}, claims)


EXPERIMENT = Experiment("kehl-1", "the hull by look-up tables", "Kehl, Table 1", grid, cell, report)
