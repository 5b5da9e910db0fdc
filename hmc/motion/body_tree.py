"""A body of ours as a tree of joints, and its flesh as surfaces of triangles, as files of other programs want them."""

from __future__ import annotations

import numpy as np

from hmc.body.feet import foot_places
from hmc.body.joints import DOF_NAMES, SEGMENTS
from hmc.body.kinematics import SEGMENT_DOFS
from hmc.body.model import BodyModel, Cones
from hmc.body.proportions import landmark_segments, stature
from hmc.io.export.glb import Mesh
from hmc.io.export.joint_tree import Joint, JointTree
from hmc.landmarks import FOOT_POINTS, LANDMARKS

__all__ = ["flesh_meshes", "joint_tree"]

#: Points around a cone.
_RING = 16


def joint_tree(body: BodyModel) -> JointTree:
    """The joints of a body, with the landmarks, and heels and toes where it has feet, as named points.

    Parameters
    ----------
    body : BodyModel
    """
    joints = tuple(
        Joint(one.name, one.parent, offset, one.axes, dofs) for one, offset, dofs in zip(SEGMENTS, body.offsets, SEGMENT_DOFS, strict=True)
    )
    points = {name: (int(place), tip) for name, place, tip in zip(LANDMARKS, landmark_segments(), body.tips, strict=True)}
    feet = foot_places(body)
    if feet is not None:
        points |= {name: (int(place), offset) for name, place, offset in zip(FOOT_POINTS, *feet, strict=True)}
    return JointTree(joints, DOF_NAMES, body.limits.low, body.limits.high, points, stature(body.dimensions))


def flesh_meshes(body: BodyModel) -> dict[int, Mesh]:
    """The flesh of each segment: the truncated cones that it carries, closed at both ends.

    Parameters
    ----------
    body : BodyModel
    """
    cones = body.cones
    return {
        int(place): _joined([_cone_mesh(cones, int(k)) for k in np.flatnonzero(cones.segment == place)])
        for place in np.unique(cones.segment)
    }


def _cone_mesh(cones: Cones, k: int) -> Mesh:
    angles = np.arange(_RING) * 2 * np.pi / _RING
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across, third, axis = cones.bases[k]
    plane = np.stack([across, third])
    ends = [cones.start[k] + (circle * cones.radii[k, 0]) @ plane, cones.end[k] + (circle * cones.radii[k, 1]) @ plane]
    outward = (circle / np.maximum(cones.radii[k].mean(axis=0), 1e-6)) @ plane
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    here, after = np.arange(_RING), (np.arange(_RING) + 1) % _RING
    sides = np.concatenate([np.stack([here, after, after + _RING], 1), np.stack([here, after + _RING, here + _RING], 1)])
    # Lids have vertices of their own, as their normals are others.
    fan = np.stack([np.zeros(_RING - 2, int), np.arange(1, _RING - 1), np.arange(2, _RING)], 1)
    lids = np.concatenate([2 * _RING + fan[:, ::-1], 3 * _RING + fan])
    normals = np.concatenate([outward, outward, np.tile(-axis, (_RING, 1)), np.tile(axis, (_RING, 1))])
    return Mesh(np.concatenate([*ends, *ends]), normals, np.concatenate([sides, lids]))


def _joined(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(one.vertices) for one in meshes[:-1])])
    return Mesh(
        np.concatenate([one.vertices for one in meshes]),
        np.concatenate([one.normals for one in meshes]),
        np.concatenate([one.triangles + start for one, start in zip(meshes, starts, strict=True)]),
    )
