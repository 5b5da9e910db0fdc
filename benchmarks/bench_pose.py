"""The pose filter with everything that the default preset switches on, and its distance fields. Rows 5e and 5f of README.md.

python benchmarks/bench_pose.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from _scene import ROOM, ring_rig
from _timing import interleaved, report
from scipy import ndimage

from hmc.body.flesh import flesh_points, place_points
from hmc.body.joints import dof_index
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import project
from hmc.pose.legs import leg_alternatives
from hmc.pose.method import Capture, Subject, begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.steps.annealed import annealed_subject
from hmc.pose.steps.presets import PRESETS, PosePreset
from hmc.pose.views.hull_target import FAR_M, HullTarget, make_target
from hmc.pose.views.near_distance import near_distance
from hmc.pose.views.person_view import PersonView
from hmc.pose.views.rays import with_rays
from hmc.search.filters import AnnealedSettings
from hmc.voxels.grid import VoxelGrid

FPS, FRAMES = 30.0, 10
#: Frames a second at least, by the side of the voxels, metres.
TARGETS = {0.03: 20.0, 0.02: 8.0}
#: The thesis's number of evaluations: 6 layers of 600 particles.
MANY = AnnealedSettings(layers=6, particles=600, survival_rate=0.04, spread=0.6)


def walk(body: BodyModel) -> list[np.ndarray]:
    """A person who walks on with swinging arms, a pose a frame."""
    poses = []
    for k in range(FRAMES + 1):
        pose, swing = neutral_state("down", body.limits), 0.5 * np.sin(2 * np.pi * k / FPS)
        pose[:3] = 0.1 + 1.2 * k / FPS, -0.2, 0.95
        pose[dof_index("r_hip_y", "l_hip_y")] = -swing, swing
        pose[dof_index("r_knee_y", "l_knee_y")] = 0.3 + 0.3 * np.sin(2 * np.pi * k / FPS + np.array([0.0, np.pi]))
        pose[dof_index("r_shoulder_y", "l_shoulder_y")] = 0.6 * swing, 0.6 * swing
        poses.append(np.clip(pose, body.limits.low, body.limits.high))
    return poses


def target_of(body: BodyModel, pose: np.ndarray, voxel_m: float) -> HullTarget:
    """The body's own voxels as hull, one voxel fatter as the tolerant one, and the rays of its silhouettes in five cameras."""
    grid, rig = VoxelGrid.from_room(ROOM, voxel_m), ring_rig()
    flesh = flesh_points(body, voxel_m / 2)
    points = place_points(*segment_transforms(body, pose), flesh.points, flesh.segment)
    occupied = np.zeros(grid.shape, bool)
    occupied[tuple(grid.index_of(points).T)] = True
    masks = []
    for camera in rig:
        mask = np.zeros(camera.size[::-1], np.uint8)
        uv, valid = project(camera, points)
        column, row = np.rint(uv[valid]).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < camera.size[0]) & (row < camera.size[1])
        mask[row[inside], column[inside]] = 1
        masks.append(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8)).astype(bool))
    target = make_target(grid, np.argwhere(occupied), np.argwhere(ndimage.binary_dilation(occupied)), floor_z=0.0)
    if target is None:
        raise RuntimeError("the scene has no person")
    return with_rays(target, rig, masks)


def seconds_a_frame(subject: Subject, preset: PosePreset, first: np.ndarray, targets: list[HullTarget]) -> tuple[float, float, float]:
    """Processor seconds of a frame's pose, of its legs, and evaluations of the annealed layers, search and refinement: means."""
    step, tracked = annealed_pose_step(preset), begin_tracking(subject, first)
    pose_s, legs_s, evaluations = 0.0, 0.0, 0
    for k, target in enumerate(targets):
        rng, view = np.random.default_rng(k), PersonView(k, target)
        start = time.thread_time()
        tracked, info = step(rng, tracked, view)
        middle = time.thread_time()
        leg_alternatives(rng, subject, tracked.state, view, preset.polish)
        pose_s, legs_s, evaluations = pose_s + middle - start, legs_s + time.thread_time() - middle, evaluations + info.evaluations
    return pose_s / len(targets), legs_s / len(targets), evaluations / len(targets)


def median_of(run: Callable[[], tuple[float, float, float]], rounds: int = 5) -> tuple[float, float, float]:
    """The round of the median total, after one to warm up."""
    run()
    return sorted((run() for _ in range(rounds)), key=lambda one: one[0] + one[1])[rounds // 2]


def main() -> int:
    cv2.setNumThreads(1)
    body, good = default_body(1.75), True
    preset = PRESETS["default"]
    poses = walk(body)
    for voxel_m, least in TARGETS.items():
        size = f"{voxel_m * 100:.0f} cm"
        targets = [target_of(body, pose, voxel_m) for pose in poses[1:]]
        for name, one in (("default", preset), ("default with 6 layers of 600", replace(preset, annealed=MANY))):
            subject = annealed_subject(body, Capture(FPS, voxel_m, np.asarray(ROOM)), one)
            pose_s, legs_s, evaluations = median_of(partial(seconds_a_frame, subject, one, poses[0], targets))
            total = pose_s + legs_s
            note = (
                f"pose {1e3 * pose_s:.1f} ms, legs {1e3 * legs_s:.1f} ms; {evaluations:.0f} evaluations, {evaluations / total:.0f} a second"
            )
            good &= report("5e", f"{name}, frames a second, {size}", 1 / total, least, at_least=True, note=note)
        tolerant = targets[0].tolerant
        reach = int(np.ceil(FAR_M / voxel_m))
        full = partial(ndimage.distance_transform_edt, ~tolerant)
        times = interleaved({"near": partial(near_distance, tolerant, reach), "full": full})
        note = f"{1e3 * times['near']:.1f} ms, {tolerant.size} voxels"
        good &= report("5f", f"distance field / full transform, {size}", times["near"] / times["full"], 0.4, note=note)
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
