"""Multi-cue descent: frames a second with all cues, and against Levenberg-Marquardt with equal points, in one run. Row 13 of README.md.

python benchmarks/bench_smd.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import replace

import cv2
import numpy as np
from _scene import ring_rig
from _timing import interleaved, report

from hmc.body.joints import dof_index
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import project
from hmc.pose.methods.smd import SMD_PRESETS
from hmc.pose.objectives.cue_rows import pose_body
from hmc.pose.objectives.surface_cue import place
from hmc.pose.steps.descent.tracker import make_tracker, track_init, track_step
from hmc.pose.views.skin import observe_voxels
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid

CUBE = np.array([[-1.1, -1.1, 0.0], [1.1, 1.1, 2.2]])
FRAMES = 6


def pose(second: float) -> np.ndarray:
    """A body that swings arms and legs, 27 numbers."""
    state, swing = neutral_state("down"), np.sin(2 * np.pi * second)
    state[:3] = (0.2 * np.sin(second), 0.1, 0.93)
    state[dof_index("r_shoulder_y", "l_shoulder_y", "r_hip_y", "l_hip_y")] = (0.7 * swing, -0.7 * swing, -0.4 * swing, 0.4 * swing)
    return state


def observed(tracker, rig, grid, tables, second: float):
    """Hull, colors and images of the body at one time."""
    points = place(pose_body(tracker.body, pose(second)), tracker.grid.points, tracker.grid.segment)
    masks, images = [], []
    for camera in rig:
        uv = project(camera, points)[0].astype(np.float32)
        image, mask = np.full((*camera.size[::-1], 3), 130, np.uint8), np.zeros(camera.size[::-1], np.uint8)
        for solid in range(len(tracker.body.solids)):
            outline = cv2.convexHull(uv[tracker.grid.solid == solid]).round().astype(np.int32)
            cv2.fillConvexPoly(mask, outline, 1)
            cv2.fillConvexPoly(image, outline, (40 + 15 * solid, 220 - 15 * solid, 90))
        masks.append(mask > 0)
        images.append(image)
    occupied = carve(tables, masks)
    return observe_voxels(grid, rig, occupied, np.argwhere(occupied), images, masks)


def main() -> int:
    cv2.setNumThreads(1)
    rig = ring_rig()
    grid = VoxelGrid.from_room(CUBE, 2.2 / 64, len(rig))
    tables = make_tables(grid, rig)
    tracker = make_tracker(default_body(1.78), SMD_PRESETS["default"])
    frames = [observed(tracker, rig, grid, tables, k / 15) for k in range(FRAMES)]
    begun, _ = track_step(np.random.default_rng(0), tracker, track_init(pose(0.0)), frames[0])

    def follow(preset):
        state, one = begun, replace(tracker, preset=preset)
        for k, seen in enumerate(frames[1:]):
            state, _ = track_step(np.random.default_rng(k), one, state, seen)

    preset = tracker.preset
    times = interleaved(
        {
            "smd": lambda: follow(preset),
            "lm": lambda: follow(replace(preset, optimiser="lm")),
            "printed": lambda: follow(SMD_PRESETS["kehl2006"]),
        },
        rounds=5,
    )
    seconds = {name: value / (FRAMES - 1) for name, value in times.items()}
    note = f"{1e3 * seconds['smd']:.0f} ms; kehl2006: {1 / seconds['printed']:.1f} frames a second"
    good = report("13", "SMD with all cues, 5 views, frames a second", 1 / seconds["smd"], 10, at_least=True, note=note)
    note = f"LM {1e3 * seconds['lm']:.0f} ms"
    return 0 if report("13", "LM / SMD, equal points", seconds["lm"] / seconds["smd"], 1.5, at_least=True, note=note) and good else 1


if __name__ == "__main__":
    raise SystemExit(main())
