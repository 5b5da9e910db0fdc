"""Tracking: Sparse Sampling and the ellipsoid particle filter against bare gathers of the same elements, and the whole chain's stages.

Run with ``OPENBLAS_NUM_THREADS=1 python benchmarks/bench_tracking.py``.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
from _scene import ROOM, people, ring_rig
from _timing import interleaved, report
from bench_frontend import make_images

from hmc.camera.segmentation import SegmentationSettings, segment_views, train_background
from hmc.tracking.appearance import N_COLORS, histogram
from hmc.tracking.blobs import Observation, observe
from hmc.tracking.following import init
from hmc.tracking.particle import overlap
from hmc.tracking.sparse import SparseSettings, filter_samples, propagate, sample_likelihood
from hmc.tracking.state import PersonMemory, Track, TrackerState
from hmc.tracking.surroundings import Surroundings, look_around
from hmc.tracking.trackers import make_tracker
from hmc.tracking.views import FrameViews
from hmc.voxels.carving import carve_levels, make_tables
from hmc.voxels.completion import complete_masks, doubtful_hulls, make_completion_tables
from hmc.voxels.grid import VoxelGrid

PLACES = np.array([[0.0, 0.0], [1.2, 0.4], [-1.1, 0.9]])
FPS = 25.0


def scene(voxel_size_m: float) -> Observation:
    """Three people of solid ellipsoids in the room."""
    grid = VoxelGrid.from_room(ROOM, voxel_size_m)
    centres = grid.centres()
    occupied = np.zeros(grid.shape, bool)
    for part in people(PLACES):
        occupied |= (((centres - part[:3]) / part[3:]) ** 2).sum(axis=-1) <= 1
    return observe(grid, occupied)


def colored(observation: Observation, around: Surroundings, rng: np.random.Generator) -> Surroundings:
    """The surroundings with made-up colors on the outer voxels: coloring is part of the input (Canton 2009, Eq. 4.30)."""
    occupied = np.zeros(np.array(observation.grid.shape) + 2, bool)
    inner = observation.indices + 1
    occupied[tuple(inner.T)] = True
    hidden = np.all([occupied[tuple((inner + step).T)] for step in (*np.eye(3, dtype=int), *-np.eye(3, dtype=int))], axis=0)
    return Surroundings(around.rows, np.where(hidden, -2, rng.integers(0, 40, len(inner)) * (N_COLORS // 40)))


def sparse_sampling(rng: np.random.Generator) -> list[bool]:
    """Row 10: a whole frame of Sparse Sampling, 1,000 colored samples a person, at 4 cm."""
    observation, settings = scene(0.04), SparseSettings()
    predicted = np.column_stack([PLACES, np.full(3, 0.95)])
    tracks = tuple(Track(k, place, place, np.zeros(3), 0.08, 0, 0) for k, place in enumerate(predicted))
    around = colored(observation, look_around(observation, predicted, 0.53, 0.03, False), rng)
    look = histogram(around.colors[around.colors >= 0])
    state = TrackerState(FPS, tracks, memories=tuple(PersonMemory(k, histogram=look) for k in range(3)))
    for _ in range(5):
        memories = filter_samples(rng, state, predicted, observation, around, settings).memories
        state = TrackerState(FPS, tracks, memories=memories)
    still = np.zeros((3, 3))
    samples, person = propagate(rng, state.memories, still, observation, around, settings)

    # The bare gather: occupancy and color of every voxel in every sample's neighbourhood, from volumes of the whole room.
    grid = observation.grid
    shape = np.array(grid.shape) + 4
    volumes = [np.zeros(int(shape.prod()), np.int32) for _ in range(2)]
    steps = np.array(list(np.ndindex(5, 5, 5)))
    cells = np.clip(samples, 0, np.array(grid.shape) - 1)[:, None] + steps
    index = (cells[..., 0] * shape[1] + cells[..., 1]) * shape[2] + cells[..., 2]
    out = np.empty(index.shape, np.int32)

    def gather() -> None:
        for volume in volumes:
            volume.take(index, out=out, mode="wrap")

    times = interleaved(
        {
            "gather": gather,
            "likelihood": lambda: sample_likelihood(samples, person, state.memories, observation, around, settings),
            "filter": lambda: filter_samples(rng, state, predicted, observation, around, settings),
        },
        rounds=41,
    )
    a_person = times["filter"] / 3
    note = f"{a_person * 1e3:.2f} ms a person and frame; gather {times['gather'] / 3 * 1e3:.2f} ms"
    return [
        report("10", "Sparse Sampling, likelihood / bare gather", times["likelihood"] / times["gather"], 3),
        report("10", "Sparse Sampling, whole filter / bare gather", times["filter"] / times["gather"], 3, note=note),
        report("10", "Sparse Sampling, share of real time a person, 25 Hz", a_person * FPS, 0.02),
    ]


def particle_filter(rng: np.random.Generator) -> list[bool]:
    """Row 10b: 200 ellipsoids at 2 cm against a gather of all their voxels."""
    observation = scene(0.02)
    grid, size = observation.grid, 0.02
    near = np.hypot(*(observation.points[:, :2] - PLACES[0]).T) <= 0.7
    voxels = observation.indices[near]
    centres = np.array([0, 0, 0.95]) + rng.normal(0, 0.04, (200, 3))
    radii = np.column_stack([np.full((200, 2), 0.3), centres[:, 2]])
    volume = np.zeros(grid.shape, np.uint8)
    volume[tuple(observation.indices.T)] = 1
    flat = volume.ravel()
    half = np.array([18, 18, 60])
    box = np.stack(np.meshgrid(*(np.arange(-h, h + 1) for h in half), indexing="ij"), axis=-1).reshape(-1, 3)
    inside = box[((box * size / [0.3, 0.3, 0.95]) ** 2).sum(axis=1) <= 1]
    steps = (inside[:, 0] * grid.shape[1] + inside[:, 1]) * grid.shape[2] + inside[:, 2]
    firsts = grid.index_of(centres) @ (grid.shape[1] * grid.shape[2], grid.shape[2], 1)

    def direct() -> np.ndarray:
        return np.array([flat.take(first + steps, mode="clip").sum() for first in firsts]) / len(steps)

    times = interleaved({"direct": direct, "columns": lambda: overlap(voxels, centres, radii, grid.origin, size)}, rounds=9)
    note = f"{times['columns'] * 1e3:.1f} ms"
    return [report("10b", "particle filter, 200 ellipsoids at 2 cm / direct gathers", times["columns"] / times["direct"], 0.35, note=note)]


def whole_chain(rng: np.random.Generator) -> list[bool]:
    """Five cameras, three people, voxels of 4 cm, from images to tracks: each stage's share, and frames a second on one processor.

    Stages are those of `stream_hulls` and `hmc.tracking.resumable.track_recording`, without reading the files. The background
    learns as often as it does in a recording. Frames a second are by processor time, so that other work hardly disturbs them: what two
    processors reach is more.
    """
    rig, settings = ring_rig(), SegmentationSettings()
    empty, frames = make_images(rig, 3, rng)
    grid = VoxelGrid.from_room(ROOM, 0.04)
    tables, completion = make_tables(grid, rig), make_completion_tables(ROOM, rig)
    models: tuple = tuple(train_background(images) for images in empty)
    tracker, state = make_tracker("sparse", color=True), init(FPS)
    spent: Counter[str] = Counter()
    names: set[int] = set()

    def timed(stage: str, function, *arguments):
        begun = time.process_time()
        result = function(*arguments)
        spent[stage] += time.process_time() - begun
        return result

    def hulls(masks, doubtful):
        levels = carve_levels(tables, masks, (0, 1, 2))
        if any(doubt is not None for doubt in doubtful):
            levels[2][doubtful_hulls(tables, masks, doubtful, (2,))[0]] = True
        return levels

    begun = time.perf_counter()
    with ThreadPoolExecutor(2) as pool:
        for frame, images in enumerate(frames):
            masks, models = timed("segmentation", segment_views, models, images, settings, pool)
            doubtful = tuple(model.doubtful for model in models)
            done = timed("completion", complete_masks, completion, masks, doubtful)
            strict, tolerant, _ = timed("carving", hulls, done.masks, doubtful if done.much else done.left)
            observation = timed("components", observe, grid, tolerant, strict, FrameViews(rig, done.masks, tuple(images)))
            state, info = timed("life cycle", tracker.step, rng, state, frame, observation)
            for stage, seconds in (("color", info.color_s), ("filter", info.filter_s)):
                spent[stage] += seconds
                spent["life cycle"] -= seconds
            names |= {track.person for track in state.tracks}
    speed, total = len(frames) / (time.perf_counter() - begun), sum(spent.values())
    for stage, seconds in spent.items():
        print(f"     {stage:58} {seconds / total:8.1%}   {1e3 * seconds / len(frames):.1f} ms of processor time a frame")
    note = f"{len(names)} people followed; {1e3 * total / len(frames):.0f} ms a frame; by the clock, two threads: {speed:.1f} a second"
    return [report("10c", "whole chain, frames a second of processor time", len(frames) / total, 15, at_least=True, note=note)]


if __name__ == "__main__":
    cv2.setNumThreads(1)
    generator = np.random.default_rng(0)
    sys.exit(not all([*sparse_sampling(generator), *particle_filter(generator), *whole_chain(generator)]))
