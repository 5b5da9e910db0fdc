"""The front end: everything after the mixture of Gaussians against the mixture itself, and frames a second. Rows 4, 4c
and 4d of README.md.

    python benchmarks/bench_frontend.py

Images are made here: people of ellipsoids in clothes of their own, walking before textured walls, with sensor noise.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
from _scene import ROOM, people, ring_rig, silhouette
from _timing import report

from hmc.camera.segmentation import SegmentationSettings, segment_views, train_background
from hmc.io.recording import Frame
from hmc.voxels.carving import carve_levels, make_tables
from hmc.voxels.completion import complete_masks, make_completion_tables
from hmc.voxels.components import components
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, settle
from hmc.voxels.looks import look_once
from hmc.voxels.surface import surface

VOXEL_M = 0.04
N_FRAMES = 30


def make_images(rig, n_people: int, rng) -> tuple[list, list]:
    """Twenty empty images of each camera, and `N_FRAMES` sets of images with people."""
    width, height = rig[0].size
    walls = [cv2.resize(rng.integers(90, 170, (12, 16, 3)).astype(np.uint8), (width, height)) for _ in rig]

    def noisy(image):
        return np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)

    empty = [[noisy(wall) for _ in range(20)] for wall in walls]
    clothes = rng.integers(20, 235, (n_people, 3))
    starts = np.array([(0.1, 0.0), (-0.75, 0.55), (0.7, -0.6)])[:n_people]
    frames = []
    for t in range(N_FRAMES):
        images = []
        for camera, wall in zip(rig, walls, strict=True):
            image = wall.copy()
            for start, color in zip(starts + np.array([0.01 * t, 0]), clothes, strict=True):
                image[silhouette(camera, people([start]))] = color
            images.append(noisy(image))
        frames.append(images)
    return empty, frames


def measure(n_people: int) -> tuple[float, float, float, float, float, float]:
    """Time of all but the mixture over the mixture's, on one thread; frames a second on two; processor time a frame; voxels; the time
    in which cameras decide one another's doubts, over the mixture's; and whole silhouettes, with the mixture and with all that the cameras
    settle among them, over the mixture alone.

    The ratio is of processor time in frames in which the background does not learn, since learning is the mixture's; the frames a
    second are of all. These are by the clock on the wall, and hold on an idle machine alone: the processor time, seconds,
    tells what they could be at most, two threads' worth a second.
    """
    still, learning = SegmentationSettings(learn_every=10**9), SegmentationSettings()
    rig, rng = ring_rig(), np.random.default_rng(0)
    empty, frames = make_images(rig, n_people, rng)
    grid = VoxelGrid.from_room(ROOM, VOXEL_M)
    tables = make_tables(grid, rig)
    masks: tuple = ()
    models = tuple(train_background(images) for images in empty)
    completion = make_completion_tables(ROOM, rig)
    mixture, whole, completing, silhouettes, voxels = [], [], [], [], 0

    def front_end(images, settings, pool=None):
        nonlocal models, masks
        masks, models = segment_views(models, images, settings, pool)
        strict, tolerant = carve_levels(tables, masks, (0, 1))
        blobs = components(tolerant, grid, 50)
        surface(strict)
        return blobs

    for images in frames:
        start = time.thread_time()
        for model, image in zip(models, images, strict=True):
            model.mixture.apply(image, learningRate=0)
        middle = time.thread_time()
        voxels += len(front_end(images, still).voxels)
        mixture.append(middle - start)
        end = time.thread_time()
        complete_masks(completion, masks, [model.doubtful for model in models])
        whole.append(end - middle)
        completing.append(time.thread_time() - end)
    for images in frames:  # as `hmc.voxels.hulls` does, in which the background learns too
        start = time.thread_time()
        look, after = look_once(dict(enumerate(models)), Frame(0, tuple(images), None), learning)
        models = tuple(after.values())
        settle(completion, look, FrontendSettings())
        silhouettes.append(time.thread_time() - start)
    ratio = float(np.median(np.subtract(whole, mixture)) / np.median(mixture))
    every = float(np.mean(silhouettes) / np.median(mixture))
    with ThreadPoolExecutor(2) as pool:
        start, used = time.perf_counter(), time.process_time()
        for images in frames:
            front_end(images, learning, pool)
        speed = len(frames) / (time.perf_counter() - start)
        used = (time.process_time() - used) / len(frames)
    return ratio, speed, used, voxels / len(frames), float(np.median(completing) / np.median(mixture)), every


def main() -> int:
    cv2.setNumThreads(1)
    good = True
    for n_people, most, least, most_completing, most_whole in ((1, 0.5, 25, 0.25, 3.0), (3, 1.5, 15, 0.35, 4.0)):
        ratio, speed, used, voxels, completing, every = measure(n_people)
        note = f"tolerant hull of {voxels:.0f} voxels"
        good &= report("4", f"after the mixture / mixture, {n_people} people", ratio, most, note=note)
        good &= report("4c", f"cameras decide one another's doubts / mixture, {n_people} people", completing, most_completing)
        good &= report("4d", f"whole silhouettes / mixture, {n_people} people", every, most_whole)
        note = f"{used * 1e3:.0f} ms of processor time a frame: at most {2 / used:.0f}"
        good &= report("4", f"frames a second on two threads, {n_people} people", speed, least, at_least=True, note=note)
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
