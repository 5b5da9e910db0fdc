"""Scalable body models: SHBM-APF against APF on the same frames, and what scouts for hidden limbs cost. Rows 5g and 5h of README.md.

python benchmarks/bench_scalable.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from dataclasses import replace

import cv2
import numpy as np
from _scene import ROOM
from _timing import report
from bench_pose import FPS, target_of, walk

from hmc.body.flesh import flesh_points, place_points
from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.proportions import default_body
from hmc.pose.method import Capture, begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.methods.scalable import method_preset
from hmc.pose.steps.annealed import annealed_subject
from hmc.pose.steps.presets import PRESETS, PosePreset
from hmc.pose.steps.restrict import part_mask
from hmc.pose.views.hull_target import make_target
from hmc.pose.views.person_view import PersonView
from hmc.search.filters import AnnealedSettings
from hmc.voxels.grid import VoxelGrid

#: The thesis's particles: all models of SHBM-APF together, in 2 layers each; APF in 6 layers.
SHBM_PARTICLES, APF_PARTICLES = 1100, 3600
ROUNDS = 5


def run(preset: PosePreset, body, voxel_m: float, poses, targets, seed: int = 0) -> tuple[float, float]:
    """Seconds a frame of the filter, and mean error of the landmarks, metres, from the true first pose."""
    subject = annealed_subject(body, Capture(FPS, voxel_m, np.asarray(ROOM)), preset)
    step, tracked, seconds, errors = annealed_pose_step(preset), begin_tracking(subject, poses[0]), 0.0, []
    for k, target in enumerate(targets):
        rng = np.random.default_rng([seed, k])
        start = time.thread_time()
        tracked, _ = step(rng, tracked, PersonView(k, target))
        seconds += time.thread_time() - start
        errors.append(np.linalg.norm(landmarks(body, tracked.state) - landmarks(body, poses[k + 1]), axis=1).mean())
    return seconds / len(targets), float(np.mean(errors))


def without_shanks(body, pose, voxel_m: float):
    """Hulls of a body whose shanks nothing shows."""
    grid, flesh = VoxelGrid.from_room(ROOM, voxel_m), flesh_points(body, voxel_m / 2)
    rows = ~part_mask(["r_shank", "l_shank"])[flesh.part]
    points = place_points(*segment_transforms(body, pose), flesh.points[rows], flesh.segment[rows])
    voxels = np.unique(grid.index_of(points), axis=0)
    return make_target(grid, voxels, voxels, floor_z=0.0)


def main() -> int:
    cv2.setNumThreads(1)
    body, good = default_body(1.75), True
    poses = walk(body)
    scores = replace(PRESETS["canton2009"], body="default", drift_scale=PRESETS["default"].drift_scale)
    strong = AnnealedSettings(layers=6, particles=APF_PARTICLES // 6, survival_rate=0.04, spread=0.6)
    apf = replace(scores, annealed=strong)
    structural = replace(PRESETS["default"].structural, gamma=SHBM_PARTICLES / N_DOF)
    for voxel_m in (0.02, 0.03):
        size = f"{voxel_m * 100:.0f} cm"
        targets = [target_of(body, pose, voxel_m) for pose in poses[1:]]
        for model in ("1", "2"):
            shbm = method_preset(replace(scores, structural=structural), "shbm-apf", [model])
            rounds = [[run(one, body, voxel_m, poses, targets, k) for one in (apf, shbm)] for k in range(ROUNDS)]
            (apf_s, apf_m), (shbm_s, shbm_m) = np.median(rounds, axis=0)
            note = f"error {1000 * shbm_m:.0f} mm, APF {1000 * apf_m:.0f} mm; {1 / shbm_s:.0f} and {1 / apf_s:.0f} frames a second"
            if voxel_m == 0.02:
                good &= report(
                    "5g", f"SHBM-APF model {model} / APF, frames a second, {size}", apf_s / shbm_s, 1.5, at_least=True, note=note
                )
            else:
                good &= report("5g", f"SHBM-APF model {model}, frames a second, {size}", 1 / shbm_s, 15.0, at_least=True, note=note)
            good &= report("5g", f"SHBM-APF model {model} / APF, error, {size}", shbm_m / apf_m, 1.0)
    hidden = [without_shanks(body, pose, 0.03) for pose in poses[1:]] * 2
    ddm = method_preset(PRESETS["default"], "ddm-apf")
    still = replace(ddm, limbs=replace(ddm.limbs, found_frames=10**6))
    rounds = [[run(one, body, 0.03, [*poses, *poses[1:]], hidden, k)[0] for one in (PRESETS["default"], still)] for k in range(3)]
    plain_s, scouts_s = np.median(rounds, axis=0)
    note = f"{1000 * scouts_s:.1f} and {1000 * plain_s:.1f} ms a frame, both shanks hidden"
    good &= report("5h", "DDM-APF with scouts / APF, preset default, 3 cm", scouts_s / plain_s, 4 / 3, note=note)
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
