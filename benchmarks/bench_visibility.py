"""Line of sight: the exact mode against a walk in plain Python, the quick mode against the exact one. Row 2 of README.md.

python benchmarks/bench_visibility.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from _scene import ROOM, people, ring_rig, silhouette
from _timing import interleaved, report

from hmc.voxels.carving import carve, make_tables
from hmc.voxels.color import visibility
from hmc.voxels.grid import VoxelGrid


def walk(occupied, start, target) -> bool:
    """Bresenham's line in 3-D, one voxel at a time; both ends left out."""
    delta = [int(b) - int(a) for a, b in zip(start, target, strict=True)]
    length = [abs(d) for d in delta]
    main = length.index(max(length))
    others = [axis for axis in range(3) if axis != main]
    error = {axis: 2 * length[axis] - length[main] for axis in others}
    place = [int(a) for a in start]
    for _ in range(length[main] - 1):
        place[main] += 1 if delta[main] > 0 else -1
        for axis in others:
            if error[axis] >= 0:
                place[axis] += 1 if delta[axis] > 0 else -1
                error[axis] -= 2 * length[main]
            error[axis] += 2 * length[axis]
        if not all(0 <= p < n for p, n in zip(place, occupied.shape, strict=True)):
            return True
        if occupied[tuple(place)]:
            return False
    return True


def main() -> int:
    rig, good = ring_rig(), True
    for name, places in {"one person": [(0.1, 0.0)], "three people": [(0.1, 0.0), (-0.75, 0.55), (0.7, -0.6)]}.items():
        for voxel in (0.04, 0.02):
            grid = VoxelGrid.from_room(ROOM, voxel)
            occupied = carve(make_tables(grid, rig), [silhouette(camera, people(places)) for camera in rig])
            voxels = np.argwhere(occupied)
            exact, quick = (visibility(occupied, grid, rig, voxels, mode) for mode in ("exact", "quick"))
            label = f"{name}, {voxel * 100:.0f} cm"
            if voxel == 0.04:
                equal = np.mean([[walk(occupied, v, grid.index_of(c.centre)) for v in voxels] for c in rig] == exact)
                good &= report("2", f"exact equals a Python walk, {label}", equal, 1.0, at_least=True, note=f"{len(voxels)} voxels")
            good &= report("2", f"quick agrees with exact, {label}", np.mean(quick == exact), 0.95, at_least=True)
            times = interleaved(
                {mode: lambda m=mode, o=occupied, g=grid, v=voxels: visibility(o, g, rig, v, m) for mode in ("exact", "quick")}
            )
            note = f"{times['quick'] * 1e3:.2f} of {times['exact'] * 1e3:.2f} ms"
            good &= report("2", f"quick / exact, {label}", times["quick"] / times["exact"], 0.5, note=note)
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
