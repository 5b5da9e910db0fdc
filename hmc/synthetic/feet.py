"""Where the feet of an actor are: the ends of both soles."""

from __future__ import annotations

import numpy as np

from hmc.synthetic.actor import Actor
from hmc.synthetic.skeleton import BONE_NAMES, joint_positions

__all__ = ["true_foot_points"]


def true_foot_points(actor: Actor, root: np.ndarray, orientations: np.ndarray) -> np.ndarray:
    """Heels and toes, shoes included.

    Parameters
    ----------
    actor : Actor
    root : ndarray, shape (n, 3)
        Of the pelvis, world, metres.
    orientations : ndarray, shape (n, n_bones, 3, 3)
        World from bone.

    Returns
    -------
    ndarray, shape (n, 4, 3)
        World, metres, in the order of `hmc.landmarks.FOOT_POINTS`: on the sole, below the foremost and the rearmost point of the skin.
    """
    joints = joint_positions(actor.skeleton, root, orientations)
    points = []
    for side in "lr":
        foot, toes = (BONE_NAMES.index(f"{side}_{name}") for name in ("foot", "toes"))
        sole = -actor.skeleton.ankle_height
        for bone, low, end in ((foot, sole, np.min), (toes, sole - actor.skeleton.offsets[toes, 2], np.max)):
            own = (actor.vertices[actor.bones == bone] - actor.bind_joints[bone]) @ actor.bind_frames[bone]
            points.append(joints[:, bone] + orientations[:, bone] @ np.array([end(own[:, 0]), 0.0, low]))
    return np.stack(points, axis=1)
