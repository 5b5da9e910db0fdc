"""Table 1 and figure 3: reconstruction and coloring at 64^3 and 128^3 from 4, 5 and 9 views, incremental and from scratch.

Source: Kehl (2006), section 4.1, on a Pentium IV of 3 GHz. Silhouettes are those of the superellipsoid body as it swings its arms, 15
frames a second, so that nothing but the reconstruction is measured. Times are processor times of one thread; bodies of three statures.
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
from hmc.experiments.engine.intervals import decide, difference, interval
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.engine.style import COLORS
from hmc.pose.objectives.cue_rows import pose_body
from hmc.pose.objectives.surface_cue import place
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.incremental import colored_surface, hull_init, hull_step, make_pixel_tables

__all__ = ["EXPERIMENT"]

ROOM = np.array([[-1.1, -1.1, 0.0], [1.1, 1.1, 2.2]])
FPS = 15.0
#: Bodies, one a run.
STATURES_M = (1.78, 1.64, 1.88)
REPEATS = len(STATURES_M)
#: Surface voxels that the paper has, by side.
PAPER_SURFACE = {64: (1100, 1300), 128: (4500, 5500)}
#: Table 1: milliseconds of reconstruction and texturing, by views and side.
PAPER_MS = {(4, 64): (6.63, 6.07), (4, 128): (38.80, 29.28), (5, 64): (7.56, 6.40), (5, 128): (40.72, 29.06), (9, 64): (12.67, 8.18),
            (9, 128): (64.78, 32.61)}  # fmt: skip


def grid(plan: Plan) -> list[dict]:
    """All the paper's views and sides, three bodies each."""
    return [
        {"views": views, "side": side, "frames": 4 if plan.quick else 15, REPEAT: k} for views, side in PAPER_MS for k in range(REPEATS)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Milliseconds a frame, and whether the hulls are the same."""
    rig = _rig(parameters["views"])
    body = solid_body(default_body(STATURES_M[parameters[REPEAT]]))
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
    return {"ms": times, "identical": same, "surface_voxels": surface}


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
    """Times beside the paper's, and the paper's own claims."""
    sizes = list(dict.fromkeys((one.parameters["views"], one.parameters["side"]) for one in cells))
    groups = {size: [one for one in cells if (one.parameters["views"], one.parameters["side"]) == size] for size in sizes}
    rows = [_row(size, own) for size, own in groups.items()]
    figure, axes = plt.subplots(figsize=(9, 3.5))
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
    same = all(row["identical"] for row in rows)
    gains = {size: difference(_runs(own), _ms(own, "scratch"), _ms(own, "incremental")) for size, own in groups.items()}
    detail = ", ".join(f"{views} views, {side}^3: {gain} ms" for (views, side), gain in gains.items())
    claims = [
        Claim("the updated hull is the one that is carved anew, voxel by voxel", same),
        decide("updating is quicker than the same tables from scratch, at every size", list(gains.values()), detail, same),
    ]
    for side in sorted({side for _, side in sizes}):
        few, many = ([one for one in cells if (one.parameters["views"], one.parameters["side"]) == (views, side)] for views in (4, 9))
        if few and many:
            # Per view the time falls: 9 views take less than 9/4 of what 4 take.
            spare = difference(_runs(few), _ms(few, "incremental", 9 / 4), _ms(many, "incremental"))
            text = f"at {side}^3 the time grows less than the number of views, from 4 to 9"
            claims.append(decide(text, spare, f"{spare} ms less than in proportion", same))
    caption = "Reconstruction and texturing of a moving body, mean processor times. The paper: Kehl, Table 1 (Pentium IV, 3 GHz)."
    return Report((Table("kehl-1", caption, rows),), {"kehl-1": figure}, tuple(claims))


def _row(size: tuple[int, int], own: Sequence[Cell]) -> dict:
    views, side = size
    found = {name: interval(_runs(own), *_ms(own, name)) for name in ("incremental", "scratch", "blocks", "texturing")}
    paper, surface = PAPER_MS[size], PAPER_SURFACE[side]
    return {
        "views": views, "side": side, "runs": len(own), "surface_voxels": float(np.mean([one.results["surface_voxels"] for one in own])),
        "incremental_ms": found["incremental"].value, "low_ms": found["incremental"].low, "high_ms": found["incremental"].high,
        "scratch_ms": found["scratch"].value, "blocks_ms": found["blocks"].value, "texturing_ms": found["texturing"].value,
        "identical": all(one.results["identical"] for one in own), "paper_reconstruction_ms": paper[0], "paper_texturing_ms": paper[1],
        "paper_surface_voxels": f"{surface[0]} to {surface[1]}",
    }  # fmt: skip


def _runs(own: Sequence[Cell]) -> list[str]:
    return [f"body {one.parameters[REPEAT]}" for one in own]


def _ms(own: Sequence[Cell], what: str, times: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Sum of milliseconds and number of frames, a run."""
    spent = [np.asarray(one.results["ms"][what], float) for one in own]
    return np.array([times * one.sum() for one in spent]), np.array([float(one.size) for one in spent])


EXPERIMENT = Experiment("kehl-1", "the hull by look-up tables", "Kehl, Table 1", grid, cell, report, version=2)
