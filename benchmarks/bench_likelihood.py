"""Particle likelihood, overlap and whole annealing layers against bare gathers and loops. Rows 5a to 5d of README.md.

python benchmarks/bench_likelihood.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np
from _scene import ROOM
from _timing import interleaved, report

from hmc.body.flesh import flesh_points, place_points
from hmc.body.kinematics import place_segments, segment_transforms
from hmc.body.model import PARTS, neutral_state
from hmc.body.proportions import default_body
from hmc.pose.objectives.four_scores import ScoreVariances, log_likelihood_factorised, make_score_table, map_scores, observe, scores
from hmc.pose.objectives.overlap import quick_overlap
from hmc.pose.objectives.overlap_exact import exact_overlap
from hmc.pose.steps.presets import PRESETS, drift
from hmc.search import annealed_step, filter_layer, particle_init, truncated_drift, truncated_normal
from hmc.voxels.grid import VoxelGrid

PARTICLES = 600
TARGETS = {0.02: {"5a": 2.8, "5b": 3.5, "fps": 8}, 0.03: {"5a": 3.2, "5b": 4.2, "fps": 20}}
#: The first layer's drift at 30 frames a second, and that of a middle layer.
DRIFTS = {"layer 1": 1.0, "layer 4": 0.125}


def scene(voxel_m: float):
    """A person of 1.75 m who stands in the room, as voxels; the body that is to be fitted is the same."""
    body = default_body(1.75)
    grid = VoxelGrid.from_room(ROOM, voxel_m)
    pose = neutral_state("down", body.limits)
    pose[:6] = 0.113, -0.207, 0.987, 0.3, 0.02, 0.05
    fine = flesh_points(body, voxel_m / 2)
    occupied = np.zeros(grid.shape, bool)
    occupied[tuple(grid.index_of(place_points(*segment_transforms(body, pose), fine.points, fine.segment)).T)] = True
    return body, grid, pose, occupied


def log_likelihood_of(table, maps):
    """The factorised likelihood of the printed preset as a function of states."""
    variances = ScoreVariances().by_part()
    return lambda states: log_likelihood_factorised(scores(table, states, maps), variances)


def bare_gather(table, states, maps):
    """One `take` of every voxel that the likelihood looks up: all points in the occupancy, the surface's in its map."""
    rotations, positions = segment_transforms(table.body, states)
    order = np.argsort(~table.flesh.is_surface, kind="stable")
    world = place_points(rotations, positions, table.flesh.points[order], table.flesh.segment[order])
    voxels = np.clip(np.floor((world - maps.origin) / maps.voxel_size_m), 0, np.array(maps.occupancy.shape) - 1).astype(np.int64)
    index = np.ravel_multi_index(np.moveaxis(voxels, -1, 0), maps.occupancy.shape).T.copy()
    shell = index[: table.flesh.is_surface.sum()]
    occupancy, surface = maps.occupancy.ravel(), maps.surface.ravel()
    out = np.empty(index.shape, np.uint8)

    def run():
        occupancy.take(index, out=out, mode="wrap")
        surface.take(shell, out=out[: len(shell)], mode="wrap")

    return run


def one_by_one(table, states, maps):
    """A whole layer's likelihood, particle by particle: NumPy over the points of one body, a Python loop over particles."""
    flesh, variances = table.flesh, ScoreVariances().by_part()
    occupancy, surface, size = maps.occupancy, maps.surface / 255, maps.voxel_size_m
    values = np.empty(len(states))
    for n, state in enumerate(states):
        rotations, positions = segment_transforms(table.body, state)
        world = place_points(rotations, positions, flesh.points, flesh.segment)
        outside = np.any((world < maps.room[0]) | (world > maps.room[1]), axis=1)
        voxels = np.clip(np.floor((world - maps.origin) / size).astype(int), 0, np.array(occupancy.shape) - 1)
        i, j, k = voxels.T
        empty, far = 1 - occupancy[i, j, k], (1 - surface[i, j, k]) * flesh.is_surface
        out, hollow, distance = (np.bincount(flesh.part, w, len(PARTS)) for w in (outside, empty, far))
        double = exact_overlap(flesh, rotations[None], positions[None], maps.origin, size)[0]
        score = np.stack([out, double * table.counts[:, 1], hollow, distance], axis=1) / table.counts
        values[n] = -0.5 * np.sum(score**2 / variances)
    return values


def report_correlation(table, rotations, positions, placed, voxel_m) -> bool:
    """Row 5c's second half: the quick overlap against the exact count on voxels of 1 cm, over a layer's particles.

    The count on the voxels of the run itself depends on where their lattice happens to lie, so how it correlates with itself
    on a shifted lattice is the most that anything can reach against it; both are noted.
    """
    share = table.counts[:, 1] / table.counts[:, 1].sum()
    shifted = [exact_overlap(table.flesh, rotations, positions, np.full(3, start), voxel_m) @ share for start in (0.0, 0.37 * voxel_m)]
    fine = exact_overlap(flesh_points(table.body, 0.01), rotations, positions, np.zeros(3), 0.01)
    quick = quick_overlap(table.overlap, placed)
    same, itself = np.corrcoef([quick @ share, *shifted])[0, 1], np.corrcoef(shifted)[0, 1]
    note = f"on voxels of {voxel_m * 100:.0f} cm {same:.3f}, these with themselves shifted {itself:.3f}"
    what = f"correlation with the exact count, table of {voxel_m * 100:.0f} cm"
    return report("5c", what, np.corrcoef(quick @ share, fine @ share)[0, 1], 0.98, at_least=True, note=note)


def main() -> int:
    cv2.setNumThreads(1)
    good = True
    for voxel_m, targets in TARGETS.items():
        body, grid, pose, occupied = scene(voxel_m)
        maps, table = observe(occupied, grid), make_score_table(body, flesh_points(body, voxel_m))
        low, high = body.limits.low, body.limits.high
        size = f"{voxel_m * 100:.0f} cm"
        for name, scale in DRIFTS.items():
            rng = np.random.default_rng(0)
            states = truncated_normal(rng, np.tile(pose, (PARTICLES, 1)), drift(30) * scale, low, high)
            rotations, positions = segment_transforms(body, states)
            placed = place_segments(body, states, maps.origin)
            state, propagate = particle_init(states), truncated_drift(drift(30), low, high, scale)
            likelihood = log_likelihood_of(table, maps)
            # The layer draws from one point, so that its particles spread as those of the likelihood do.
            start = particle_init(pose[None])
            times = interleaved(
                {
                    "gather": bare_gather(table, states, maps),
                    "likelihood": lambda t=table, p=placed, m=maps: map_scores(t, p, m),
                    "overlap": lambda t=table, p=placed: quick_overlap(t.overlap, p),
                    "layer": lambda s=start, f=likelihood, d=propagate, r=rng: filter_layer(r, s, f, d, PARTICLES, 0.5),
                }
            )
            gather = times["gather"]
            note = ", ".join(f"{what} {value * 1e3:.1f} ms" for what, value in times.items())
            good &= report("5a", f"likelihood / gather, {size}, {name}", times["likelihood"] / gather, targets["5a"], note=note)
            good &= report("5b", f"whole layer / gather, {size}, {name}", times["layer"] / gather, targets["5b"])
            good &= report("5c", f"overlap / likelihood, {size}, {name}", times["overlap"] / times["likelihood"], 0.35)
            if name == "layer 1":
                good &= report_correlation(table, rotations, positions, placed, voxel_m)
                some = states[:60]
                loop = interleaved(
                    {
                        "loop": lambda t=table, s=some, m=maps: one_by_one(t, s, m),
                        "layer": lambda s=state, f=likelihood, d=propagate, r=rng: filter_layer(r, s, f, d, PARTICLES, 0.5),
                    },
                    rounds=5,
                )
                note = f"loop {loop['loop'] * 10:.2f} s"
                good &= report(
                    "5d", f"layer / loop over particles, {size}", loop["layer"] / (loop["loop"] * PARTICLES / 60), 0.04, note=note
                )

        def frame(t=table, o=occupied, g=grid, p=pose, a=low, b=high):
            likelihood = log_likelihood_of(t, observe(o, g))
            return annealed_step(
                np.random.default_rng(0), particle_init(p[None]), likelihood, drift(30), a, b, PRESETS["canton2009"].annealed
            )

        seconds = interleaved({"frame": frame}, rounds=7)["frame"]
        good &= report("5d", f"6 layers of 600, frames a second, {size}", 1 / seconds, targets["fps"], at_least=True, note="with its maps")
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
