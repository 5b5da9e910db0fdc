"""Hulls of rendered people: an actor's mesh, seen by a ring of cameras as perfect silhouettes and carved; no cone of ours in it."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from hmc.camera.model import Rig, look_at, project
from hmc.pose.views.hull_target import HullTarget, make_target
from hmc.pose.views.rays import with_rays
from hmc.synthetic import actions, gait
from hmc.synthetic.actor import make_actor, pose_mesh
from hmc.synthetic.motions import place
from hmc.synthetic.rasterise import rasterise
from hmc.synthetic.skeleton import landmark_positions
from hmc.voxels.carving import carve_levels, make_tables
from hmc.voxels.grid import VoxelGrid


def _seated(skeleton, times, rng):
    """The middle of sitting down and getting up, which takes three seconds."""
    return actions.sit(skeleton, np.interp(times, [times[0], times[-1] + 1e-9], [1.2, 1.9]), rng)


MOTIONS = {"walk": gait.walk, "stand": actions.stand, "gesture": actions.gesture, "box": actions.box, "seated": _seated}
ROOM = np.array([[-1.6, -1.6, 0.0], [1.6, 1.6, 2.3]])


@dataclass(frozen=True)
class Act:
    """What a person does: hulls and truth, frame by frame."""

    fps: float
    height_m: float
    grid: VoxelGrid
    targets: list[HullTarget]
    masks: list[list[np.ndarray]]  # a frame and camera
    landmarks: np.ndarray  # (n, 15, 3)
    velocities: np.ndarray  # (n, 3), of the pelvis
    heading: float  # radians, at the start


@cache
def ring(cameras: int = 5) -> Rig:
    angles = 2 * np.pi * (np.arange(cameras) + 0.25) / cameras
    return Rig(
        tuple(look_at(f"cam_{k:02d}", (320, 240), [2.9 * np.cos(a), 2.9 * np.sin(a), 2.0], [0, 0, 0.9], 62) for k, a in enumerate(angles))
    )


@cache
def act(
    motion: str,
    frames: int = 8,
    fps: float = 15,
    heading_deg: float = 40,
    height_m: float = 1.78,
    cameras: int = 5,
    voxel_m: float = 0.035,
    fists: bool = False,
    longer_left: tuple[float, float] = (0.0, 0.0),
) -> Act:
    """Let an actor do something in the middle of the ring."""
    rng = np.random.default_rng(5)
    actor = make_actor(height_m, "average", rng, "man", cell_m=0.03, fists=fists, longer_left=longer_left)
    times = np.arange(frames) / fps
    moved = place(MOTIONS[motion](actor.skeleton, times, rng), (-0.3, -0.2), heading_deg)
    rig, grid = ring(cameras), VoxelGrid.from_room(ROOM, voxel_m)
    tables = make_tables(grid, rig)
    targets, silhouettes = [], []
    for root, orientations in zip(moved.root, moved.orientations, strict=True):
        vertices, _ = pose_mesh(actor, root, orientations)
        masks = [silhouette(camera, vertices, actor.triangles) for camera in rig]
        silhouettes.append(masks)
        strict, tolerant = carve_levels(tables, masks, (0, 1))
        targets.append(with_rays(make_target(grid, np.argwhere(strict), np.argwhere(tolerant)), rig, masks))
    truth = landmark_positions(actor.skeleton, moved.root, moved.orientations)
    velocities = np.gradient(moved.root, 1 / fps, axis=0) if frames > 1 else np.zeros((1, 3))
    return Act(fps, height_m, grid, targets, silhouettes, truth, velocities, np.radians(heading_deg))


def silhouette(camera, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Pixels that see the mesh, (h, w) bool."""
    uv, _ = project(camera, vertices)
    depth = (vertices @ camera.rotation.T + camera.translation)[:, 2]
    mask = np.zeros(camera.size[0] * camera.size[1], bool)
    mask[rasterise(uv, depth, triangles, camera.size, cull=False).pixels] = True
    return mask.reshape(camera.size[::-1])
