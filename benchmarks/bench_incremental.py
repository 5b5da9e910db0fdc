"""The incremental hull against the block carve of the same frame, in one run. Row 12 of README.md.

python benchmarks/bench_incremental.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np
from _scene import people, ring_rig, silhouette
from _timing import interleaved, report

from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.incremental import hull_init, hull_step, make_pixel_tables

CUBE = np.array([[-1.1, -1.1, 0.0], [1.1, 1.1, 2.2]])
#: Fifteen frames a second and a walk of .75 m/s.
STEP_M = 0.05


def main() -> int:
    cv2.setNumThreads(1)
    good = True
    rig = ring_rig()
    before, now = ([silhouette(camera, people([(x, 0.0)])) for camera in rig] for x in (0.1, 0.1 + STEP_M))
    for side in (64, 128):
        grid = VoxelGrid.from_room(CUBE, 2.2 / side, len(rig))
        blocks, pixels = make_tables(grid, rig), make_pixel_tables(grid, rig)
        state = hull_init(pixels, before)
        same = np.array_equal(hull_step(pixels, state, now).occupied, carve(blocks, now))
        times = interleaved(
            {
                "step": lambda p=pixels, s=state: hull_step(p, s, now),
                "carve": lambda b=blocks: carve(b, now),
                "scratch": lambda p=pixels: hull_init(p, now),
            }
        )
        note = f"{times['step'] * 1e3:.2f} ms, from scratch {times['scratch'] * 1e3:.2f} ms; identical: {same}"
        good &= report("12", f"incremental hull / block carve, {side}^3", times["step"] / times["carve"], 3.0, note=note) and same
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
