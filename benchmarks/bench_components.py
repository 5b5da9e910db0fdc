"""Connected components against scipy.ndimage.label over the same room. Row 3 of README.md.

python benchmarks/bench_components.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from _scene import ROOM, people, ring_rig, silhouette
from _timing import interleaved, report
from scipy import ndimage

from hmc.voxels.carving import carve, make_tables
from hmc.voxels.components import components, label_voxels
from hmc.voxels.grid import VoxelGrid

NEIGHBOURS = np.ones((3, 3, 3))


def main() -> int:
    rig, rng, good = ring_rig(), np.random.default_rng(0), True
    places = [(0.1, 0.0), (-0.75, 0.55), (0.7, -0.6)]
    for voxel in (0.04, 0.02):
        grid = VoxelGrid.from_room(ROOM, voxel)
        occupied = carve(make_tables(grid, rig), [silhouette(camera, people(places)) for camera in rig], 1)
        occupied |= rng.random(occupied.shape) < 1e-4  # specks
        voxels, labels = label_voxels(occupied)
        theirs, n = ndimage.label(occupied, NEIGHBOURS)
        pairs = np.unique(np.stack([labels, theirs[tuple(voxels.T)]], axis=1), axis=0)
        same = len(pairs) == n == labels.max() + 1
        times = interleaved({"ours": lambda o=occupied, g=grid: components(o, g), "scipy": lambda o=occupied: ndimage.label(o, NEIGHBOURS)})
        note = f"{times['ours'] * 1e3:.2f} ms, {n} blobs, {len(voxels)} voxels; identical partition: {same}"
        good &= report("3", f"components / scipy, room {voxel * 100:.0f} cm", times["ours"] / times["scipy"], 0.3, note=note) and same
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
