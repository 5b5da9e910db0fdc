"""Little colored balls on an actor's joints, as marker-based motion capture has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from hmc.synthetic.actor import Actor
from hmc.synthetic.skeleton import BONE_NAMES

__all__ = ["BALL_RADIUS_M", "with_balls"]

BALL_RADIUS_M = 0.02
#: Which bone's origin a ball sits beside, and on which side of it (in the frame of the second bone, of the left side of the body).
_PLACES: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("pelvis", "pelvis", (1, 0, 0)), ("neck", "chest", (-1, 0, 0)), ("head", "head", (0, 0, 1)),
    *((f"{side}_{bone}", frame if frame == "chest" else f"{side}_{frame}", direction) for side in "lr" for bone, frame, direction in (
        ("upper_arm", "chest", (0, 0, 1)), ("forearm", "upper_arm", (0, 0, 1)), ("hand", "forearm", (0, 0, 1)),
        ("thigh", "thigh", (0, 1, 0)), ("shank", "thigh", (1, 0, 0)), ("foot", "shank", (0, 1, 0)),
    )),
)  # fmt: skip
#: The skin is looked for within this distance of the line from the joint outwards, and no farther along it, metres.
_BESIDE_M, _ALONG_M = 0.025, 0.3


def with_balls(actor: Actor, color: tuple[float, float, float]) -> Actor:
    """An actor with a ball beside each of fifteen joints.

    Parameters
    ----------
    actor : Actor
    color : tuple of float
        sRGB in [0, 1].

    Returns
    -------
    Actor
    """
    ball, faces = _sphere()
    vertices, normals, triangles, weights = [actor.vertices], [actor.normals], [actor.triangles], [actor.weights]
    on = []
    for bone, frame, (x, y, z) in _PLACES:
        outwards = actor.bind_frames[BONE_NAMES.index(frame)] @ np.array([x, -y if bone.startswith("r_") else y, z], float)
        away = actor.vertices - actor.bind_joints[BONE_NAMES.index(bone)]
        along = away @ outwards
        beside = np.linalg.norm(away - along[:, None] * outwards, axis=1)
        skin = int(np.argmax(np.where((beside < _BESIDE_M) & (along < _ALONG_M), along, -np.inf)))
        centre = actor.vertices[skin] + 0.6 * BALL_RADIUS_M * outwards
        triangles.append(faces + sum(len(part) for part in vertices))
        vertices.append(centre + BALL_RADIUS_M * ball)
        normals.append(ball)
        weights.append(sparse.csr_matrix(np.repeat(actor.weights[[skin]].toarray(), len(ball), axis=0)))
        on += [skin] * len(ball)
    paint = np.tile(np.array(color, float)[::-1] ** 2.2, (len(on), 1))
    return replace(
        actor,
        vertices=np.concatenate(vertices),
        normals=np.concatenate(normals),
        triangles=np.concatenate(triangles),
        weights=sparse.csr_matrix(sparse.vstack(weights)),
        bones=np.concatenate([actor.bones, actor.bones[on]]),
        parts=np.concatenate([actor.parts, actor.parts[on]]),
        albedo=np.concatenate([actor.albedo, paint]),
    )


def _sphere() -> tuple[np.ndarray, np.ndarray]:
    """Unit vertices and outward triangles of an octahedron whose faces were cut into four twice."""
    axes = np.eye(3)
    faces = np.array([[s * axes[0], t * axes[1], u * axes[2]][:: int(s * t * u)] for s in (1, -1) for t in (1, -1) for u in (1, -1)])
    for _ in range(2):
        a, b, c = faces.swapaxes(0, 1)
        ab, bc, ca = ((p + q) / np.linalg.norm(p + q, axis=1, keepdims=True) for p, q in ((a, b), (b, c), (c, a)))
        faces = np.concatenate([np.stack(corner, axis=1) for corner in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    vertices, index = np.unique(faces.reshape(-1, 3).round(9), axis=0, return_inverse=True)
    return vertices, index.reshape(-1, 3)
