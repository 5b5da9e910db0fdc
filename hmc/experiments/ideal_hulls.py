"""What hulls better than those of images are made of: faultless silhouettes of the actor, those of the tracker's own body, or that body.

They tell what of an error is the silhouettes', what the visual hull's and what the body's; nothing that is measured in them is accuracy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import cv2
import numpy as np

from hmc.body.cones import cone_distance
from hmc.body.flesh import place_points
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.camera.model import Camera, Rig, project
from hmc.io.masks import MaskStep
from hmc.synthetic.image import person_pixels
from hmc.synthetic.scene import Scene, crowd_at
from hmc.voxels.grid import VoxelGrid

__all__ = ["actor_masks", "body_masks", "body_silhouette", "body_voxels"]

#: Points on the outline of each end of a cone.
OUTLINE = 24
#: Silhouettes are drawn so many times larger, as what is drawn covers every pixel that its outline touches.
FINER = 4


def actor_masks(rig: Rig, scene: Scene, frames: Iterable[int]) -> Iterator[MaskStep]:
    """Silhouettes of a scene's first person, whatever stands before them, without images."""
    for frame in frames:
        crowd = crowd_at(scene, frame)
        yield _step(frame, [person_pixels(camera, crowd, 0) for camera in rig])


def body_masks(rig: Rig, body: BodyModel, states: Mapping[int, np.ndarray]) -> Iterator[MaskStep]:
    """Silhouettes of a body in poses, shape (37,), by frame, without images."""
    for frame, state in states.items():
        yield _step(frame, [body_silhouette(body, state, camera) for camera in rig])


def _step(frame: int, masks: list[np.ndarray]) -> MaskStep:
    nothing = (None,) * len(masks)
    return MaskStep(frame, nothing, tuple(masks), nothing)


def body_silhouette(body: BodyModel, state: np.ndarray, camera: Camera) -> np.ndarray:
    """Pixels in which a camera sees some cone of a body in a pose, shape (37,); ndarray of bool, shape (h, w).

    A truncated cone is the convex hull of its two ends, and so is its image, but for distortion between them. A cone of which something is
    not in view is left out.
    """
    width, height = camera.size
    mask = np.zeros((height * FINER, width * FINER), np.uint8)
    for points in _outlines(body, *segment_transforms(body, state)):
        uv, valid = project(camera, points)
        if valid.all():
            cv2.fillConvexPoly(mask, cv2.convexHull((uv * (16 * FINER)).round().astype(np.int32)), 1, shift=4)
    return mask[::FINER, ::FINER].astype(bool)


def body_voxels(body: BodyModel, state: np.ndarray, grid: VoxelGrid) -> np.ndarray:
    """Voxels whose centre is in some cone of a body in a pose, shape (37,); ndarray of bool, of the grid's shape."""
    rotations, positions = segment_transforms(body, state)
    inside = np.zeros(grid.shape, bool)
    for cone, points in enumerate(_outlines(body, rotations, positions)):
        low = np.maximum(grid.index_of(points.min(axis=0)), 0)
        high = np.minimum(grid.index_of(points.max(axis=0)) + 1, grid.shape)
        if (low < high).all():
            part, segment = tuple(map(slice, low, high)), body.cones.segment[cone]
            centres = grid.centres(np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), axis=-1))
            inside[part] |= cone_distance(body.cones, cone, (centres - positions[segment]) @ rotations[segment]) <= 0
    return inside


def _outlines(body: BodyModel, rotations: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Points on the outlines of both ends of every cone, shape (n_cones, 2 OUTLINE, 3), world, metres."""
    cones = body.cones
    turns = np.linspace(0, 2 * np.pi, OUTLINE, endpoint=False)
    across = cones.radii[:, :, None, :] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)  # (n_cones, 2, OUTLINE, 2)
    ends = np.stack([cones.start, cones.end], axis=1)[:, :, None]
    points = (ends + across @ cones.bases[:, None, :2]).reshape(-1, 3)
    return place_points(rotations, positions, points, np.repeat(cones.segment, 2 * OUTLINE)).reshape(-1, 2 * OUTLINE, 3)
