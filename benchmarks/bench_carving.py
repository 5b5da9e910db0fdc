"""Carving against a bare gather of the full voxel-to-pixel tables, in one run. Rows 1a, 1b and 1c of README.md.

python benchmarks/bench_carving.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np
from _scene import ROOM, people, ring_rig, salt, silhouette
from _timing import interleaved, report

from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid

CUBE = np.array([[-1.1, -1.1, 0.0], [1.1, 1.1, 2.2]])
GRIDS = {"64^3": (CUBE, 2.2 / 64), "room 4 cm": (ROOM, 0.04), "128^3": (CUBE, 2.2 / 128), "room 2 cm": (ROOM, 0.02)}
CLEAN_TARGETS = {"64^3": 1.0, "room 4 cm": 0.4, "128^3": 0.25, "room 2 cm": 0.1}
NOISY_TARGETS = {"64^3": 2.0, "room 4 cm": 1.2}
OPEN3D_TARGETS = {"64^3": 0.03, "128^3": 0.01}


def bare_gather(tables, masks, width=32):
    """One `take` a camera of every voxel's pixel: the floor of any carving that looks at every voxel. Nothing else is done.

    The tables are as they are stored, in 32 bits; `width` 64 gives NumPy what it need not cast, for twice the memory.
    """
    sources = [np.append(mask.ravel(), False) for mask in masks]
    indices = [pixels.ravel().astype(f"int{width}") for pixels in tables.pixels]
    out = np.empty(indices[0].size, bool)

    def run():
        for source, index in zip(sources, indices, strict=True):
            source.take(index, out=out, mode="wrap")

    return run


def brute_force(tables, masks) -> np.ndarray:
    """All voxels, all cameras, no shortcut."""
    votes = [np.append(mask.ravel(), False)[pixels] for mask, pixels in zip(masks, tables.pixels, strict=True)]
    seen = [pixels < mask.size for mask, pixels in zip(masks, tables.pixels, strict=True)]
    inside = np.all([vote | ~see for vote, see in zip(votes, seen, strict=True)], axis=0) & (np.sum(seen, axis=0) >= 3)
    x, y, z = tables.blocks
    volume = inside.reshape(x, y, z, 8, 8, 8).transpose(0, 3, 1, 4, 2, 5).reshape(8 * x, 8 * y, 8 * z)
    nx, ny, nz = tables.grid.shape
    return volume[:nx, :ny, :nz]


def main() -> int:
    cv2.setNumThreads(1)
    rig, rng, good = ring_rig(), np.random.default_rng(0), True
    one = [silhouette(camera, people([(0.1, 0.0)])) for camera in rig]
    three = [silhouette(camera, people([(0.1, 0.0), (-0.75, 0.55), (0.7, -0.6)])) for camera in rig]
    noisy = [salt(mask, 0.003, rng) for mask in three]
    medians = [cv2.medianBlur(mask.view(np.uint8), 3) > 0 for mask in noisy]
    for name, (room, voxel) in GRIDS.items():
        tables = make_tables(VoxelGrid.from_room(room, voxel, len(rig)), rig)
        same = np.array_equal(carve(tables, one), brute_force(tables, one))
        times = interleaved(
            {"ours": lambda t=tables: carve(t, one), "gather": bare_gather(tables, one), "64": bare_gather(tables, one, 64)}
        )
        note = f"{times['ours'] * 1e3:.2f} ms; {times['ours'] / times['64']:.3f} of a gather with 64-bit tables; identical set: {same}"
        good &= report("1a", f"carve / gather, {name}", times["ours"] / times["gather"], CLEAN_TARGETS[name], note=note) and same
        if name in NOISY_TARGETS:
            same = np.array_equal(carve(tables, noisy, despeckle=True), brute_force(tables, medians))
            times = interleaved({"ours": lambda t=tables: carve(t, noisy, despeckle=True), "gather": bare_gather(tables, noisy)})
            note = f"{times['ours'] * 1e3:.2f} ms; identical set: {same}"
            good &= (
                report("1c", f"carve / gather, salt, 3 people, {name}", times["ours"] / times["gather"], NOISY_TARGETS[name], note=note)
                and same
            )
    return 0 if open3d_rows(rig, one) and good else 1


def open3d_rows(rig, masks) -> bool:
    """Row 1b, where Open3D is installed."""
    try:
        import open3d as o3d
    except ImportError:
        print("1b   carve / Open3D: not run, open3d is not installed")
        return True
    good = True
    for name, target in OPEN3D_TARGETS.items():
        room, voxel = GRIDS[name]
        grid = VoxelGrid.from_room(room, voxel)
        tables = make_tables(grid, rig)

        def theirs(room=room, voxel=voxel):
            side = float(room[1, 0] - room[0, 0])
            dense = o3d.geometry.VoxelGrid.create_dense(room[0], [0, 0, 0], voxel, side, side, side)
            for camera, mask in zip(rig, masks, strict=True):
                parameters = o3d.camera.PinholeCameraParameters()
                width, height = camera.size
                k = camera.matrix
                parameters.intrinsic = o3d.camera.PinholeCameraIntrinsic(width, height, k[0, 0], k[1, 1], k[0, 2], k[1, 2])
                parameters.extrinsic = np.vstack([np.column_stack([camera.rotation, camera.translation]), [0, 0, 0, 1]])
                dense.carve_silhouette(o3d.geometry.Image(mask.astype(np.float32)), parameters)
            return dense

        times = interleaved({"ours": lambda t=tables: carve(t, masks), "theirs": theirs}, rounds=3)
        kept = {tuple(v.grid_index) for v in theirs().get_voxels()}
        inside = all(tuple(v) in kept for v in np.argwhere(carve(tables, masks)))
        good &= report("1b", f"carve / Open3D, {name}", times["ours"] / times["theirs"], target, note=f"contained: {inside}") and inside
    return good


if __name__ == "__main__":
    raise SystemExit(main())
