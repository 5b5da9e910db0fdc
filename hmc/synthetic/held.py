"""A cube in an actor's right hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from hmc.synthetic.actor import PARTS, Actor
from hmc.synthetic.room import Box, paint_boxes
from hmc.synthetic.skeleton import BONE_NAMES

__all__ = ["with_cube"]

#: The mesh has edges of about this length, metres.
_EDGE_M = 0.03


def with_cube(actor: Actor, side_m: float, color: tuple[float, float, float]) -> Actor:
    """An actor who holds a cube; it counts as part of the arm in what is rendered as truth of silhouettes.

    Parameters
    ----------
    actor : Actor
    side_m : float
        Metres.
    color : tuple of float
        sRGB in [0, 1].

    Returns
    -------
    Actor
    """
    hand = BONE_NAMES.index("r_hand")
    outwards = actor.bind_joints[hand] - actor.bind_joints[BONE_NAMES.index("r_forearm")]
    outwards = outwards / np.linalg.norm(outwards)
    reach = float(((actor.vertices - actor.bind_joints[hand])[actor.bones == hand] @ outwards).max())
    centre = actor.bind_joints[hand] + (0.8 * reach + side_m / 2) * outwards
    box = Box(centre, np.full(3, side_m / 2), 0.0, "plain", color)
    vertices, normals, albedo, triangles = paint_boxes((box,), _EDGE_M, 0)
    n = len(vertices)
    weights = sparse.csr_matrix((np.ones(n), (np.arange(n), np.full(n, hand))), shape=(n, len(BONE_NAMES)))
    return replace(
        actor,
        vertices=np.concatenate([actor.vertices, vertices]),
        normals=np.concatenate([actor.normals, normals]),
        triangles=np.concatenate([actor.triangles, triangles + len(actor.vertices)]),
        weights=sparse.csr_matrix(sparse.vstack([actor.weights, weights])),
        bones=np.concatenate([actor.bones, np.full(n, hand)]),
        parts=np.concatenate([actor.parts, np.full(n, list(PARTS).index("r_arm"))]),
        albedo=np.concatenate([actor.albedo, albedo]),
    )
