"""Eigenmap against scikit-learn, swarm against pyswarms, and the whole method's frames a second, in one run.

Row 7: six eigenvectors of a person's voxel graph against ``sklearn.manifold.spectral_embedding`` (arpack) of the same graph, residual
at most 1e-5, target at most .75. Row 8: the swarm against ``pyswarms.single.GlobalBestPSO`` at equal evaluations, target at most .6;
without pyswarms the row is left out.
"""

from __future__ import annotations

import logging
import statistics
import time

import numpy as np
from _scene import ROOM, people, ring_rig, silhouette
from _timing import interleaved, report
from sklearn.manifold import spectral_embedding

from hmc.body.spin_skeleton import model_of_height
from hmc.pose.spectral.eigenmap import eigenmap
from hmc.pose.spectral.graph import adjacency, build_graph
from hmc.pose.spectral.reading import read_body
from hmc.pose.steps.swarm.temporal import swarm_step
from hmc.search.swarm import PsoSettings, pso_run
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.components import components
from hmc.voxels.grid import VoxelGrid

SIZE_M = 0.03
DIMENSIONS, PARTICLES, ITERATIONS, REPEATS = 23, 40, 150, 41


def person() -> tuple[np.ndarray, np.ndarray]:
    """Voxels of one person, seen by seven cameras, and their centres."""
    rig = ring_rig(7)
    grid = VoxelGrid.from_room(ROOM, SIZE_M)
    masks = [silhouette(camera, people([(0.0, 0.0)])) for camera in rig]
    blobs = components(carve(make_tables(grid, rig), masks), grid)
    return blobs.of(0), grid.centres(blobs.of(0))


def row_7(voxels: np.ndarray) -> None:
    """The eigenvectors."""
    weights = adjacency(build_graph(voxels, SIZE_M))
    degree = np.asarray(weights.sum(axis=1)).ravel()
    found = eigenmap(weights, 6)
    residual = np.abs(degree[:, None] * found.vectors * (1 - found.values) - weights @ found.vectors).max()
    times = interleaved(
        {
            "ours": lambda: eigenmap(weights, 6),
            "theirs": lambda: spectral_embedding(weights, n_components=6, eigen_solver="arpack", drop_first=True, random_state=0),
        }
    )
    print(f"{len(voxels)} voxels; residual {residual:.1e} (at most 1e-5)")
    report("7", "six eigenvectors against scikit-learn's arpack embedding", times["ours"] / times["theirs"], 0.75)


def rastrigin(x: np.ndarray) -> np.ndarray:
    """A bowl with many dents, (n, d) to (n,)."""
    return (x**2 - 3 * np.cos(2 * np.pi * x) + 3).sum(1)


def row_8() -> None:
    """The swarm at equal evaluations and equal parameters."""
    try:
        from pyswarms.single import GlobalBestPSO
    except ImportError:
        print("8    pyswarms is not here: left out")
        return
    logging.disable(logging.CRITICAL)
    low, high = np.full(DIMENSIONS, -4.0), np.full(DIMENSIONS, 4.0)
    plan = PsoSettings(PARTICLES, ITERATIONS)
    options = {"w": plan.inertia, "c1": plan.own, "c2": plan.shared}
    costs: dict[str, list[float]] = {"ours": [], "theirs": []}
    times: dict[str, list[float]] = {"ours": [], "theirs": []}
    for seed in range(REPEATS):
        start = time.thread_time()
        costs["ours"].append(pso_run(np.random.default_rng(seed), rastrigin, low, high, plan).cost)
        times["ours"].append(time.thread_time() - start)
        np.random.seed(seed)  # noqa: NPY002 - pyswarms draws from the global generator
        start = time.thread_time()
        theirs = GlobalBestPSO(PARTICLES, DIMENSIONS, options, bounds=(low, high))
        costs["theirs"].append(theirs.optimize(rastrigin, ITERATIONS, verbose=False)[0])
        times["theirs"].append(time.thread_time() - start)
    medians = {name: statistics.median(values) for name, values in costs.items()}
    print(f"median optimum of {REPEATS} runs of {PARTICLES} x {ITERATIONS}: ours {medians['ours']:.2f}, theirs {medians['theirs']:.2f}")
    report("8", "swarm against pyswarms", statistics.median(times["ours"]) / statistics.median(times["theirs"]), 0.6)


def whole(voxels: np.ndarray, points: np.ndarray) -> None:
    """Frames a second of one core: reading a frame, and reading and fitting it."""
    model = model_of_height(1.75)
    reading = read_body(voxels, points, SIZE_M, 1.75)
    state, _ = swarm_step(np.random.default_rng(0), model, None, reading, 30.0)
    seconds = interleaved(
        {
            "read": lambda: read_body(voxels, points, SIZE_M, 1.75),
            "fit": lambda: swarm_step(np.random.default_rng(1), model, state, reading, 30.0),
        },
        rounds=9,
    )
    report("", "eigenmap, segmentation, curves: frames a second", 1 / seconds["read"], 10, at_least=True)
    report("", "the whole method, following: frames a second", 1 / (seconds["read"] + seconds["fit"]), 5, at_least=True)


def main() -> None:
    """All of it."""
    voxels, points = person()
    row_7(voxels)
    row_8()
    whole(voxels, points)


if __name__ == "__main__":
    main()
