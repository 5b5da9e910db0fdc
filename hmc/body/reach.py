"""A limb that reaches for a point, in closed form: two links, a ball joint and a hinge.

The hinge's angle follows from the distance (law of cosines); the ball joint turns the limb's end towards the point; the
swivel, by which elbow or knee turn about the line from joint to point, is free (Tolani, Goswami and Badler 2000).
"""

from __future__ import annotations

import numpy as np

from hmc.body.joints import SEGMENTS
from hmc.body.kinematics import segment_transforms
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel
from hmc.body.proportions import side_factor
from hmc.body.twists import rotations_about

__all__ = ["limb_joint", "limb_lengths", "reach"]


def limb_lengths(body: BodyModel, limb: str) -> tuple[float, float]:
    """Lengths of a limb's two links, metres: the lower one to the middle of the hand, or of the ankle's height."""
    d, factor = body.dimensions, side_factor(body.dimensions, limb[2:] + "s", limb[0])
    if LIMBS[limb].is_arm:
        return factor * d["upper_arm"], factor * d["forearm"] + 0.5 * d["hand"]
    return factor * d["thigh"], factor * d["shank"] + 0.5 * d["ankle_height"]


def limb_joint(body: BodyModel, state: np.ndarray, limb: str) -> tuple[np.ndarray, np.ndarray]:
    """Centre of the shoulder or hip, world, metres, shape (3,); rotation, world from the segment that carries it, shape (3, 3)."""
    rotations, positions = segment_transforms(body, state[None])
    upper = LIMBS[limb].segments[0]
    return positions[0, upper], rotations[0, SEGMENTS[upper].parent]


def reach(body: BodyModel, state: np.ndarray, limb: str, points: np.ndarray, swivels: np.ndarray) -> np.ndarray:
    """Angles of one limb whose end reaches for points, the rest of the body being where it is.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
    limb : {"r_arm", "l_arm", "r_leg", "l_leg"}
    points : ndarray, shape (n, 3)
        World, metres. A limb stretches towards a point that is too far.
    swivels : ndarray, shape (n,)
        Radians about the line from the joint to the point.

    Returns
    -------
    ndarray, shape (n, 4)
        The ball joint's x, y, z and the hinge's angle, within the body's limits: there the end may miss the point.
    """
    upper, lower = limb_lengths(body, limb)
    centre, carrier = limb_joint(body, state, limb)
    aim = (points - centre) @ carrier
    distance = np.clip(np.linalg.norm(aim, axis=1), abs(upper - lower) + 1e-6, upper + lower)
    bend = np.arccos(np.clip((distance**2 - upper**2 - lower**2) / (2 * upper * lower), -1, 1))
    zero = np.zeros_like(bend)
    if LIMBS[limb].is_arm:
        sign = 1.0 if LIMBS[limb].is_left else -1.0
        hinge = -sign * bend
        end = sign * np.stack([-lower * np.sin(hinge), upper + lower * np.cos(hinge), zero], axis=1)
    else:
        hinge = bend
        end = -np.stack([lower * np.sin(hinge), zero, upper + lower * np.cos(hinge)], axis=1)
    aim, end = (v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9) for v in (aim, end))
    turn = rotations_about(aim, swivels) @ _between(end, aim)
    dofs = LIMBS[limb].dofs
    low, high = body.limits.low[dofs], body.limits.high[dofs]
    both = np.concatenate([_angles(turn), np.repeat(hinge[None, :, None], 2, axis=0)], axis=-1)
    clipped = np.clip(both, low, high)
    better = np.abs(clipped - both).sum(-1).argmin(0)
    return clipped[better, np.arange(len(points))]


def _between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Rotations that turn unit vectors (n, 3) into others: half a turn about the middle of the two, after half a turn about the first."""
    middle = first + second
    opposite = np.linalg.norm(middle, axis=1) < 1e-9
    # Any perpendicular will do for opposite vectors.
    middle[opposite] = np.cross(first[opposite], np.eye(3)[np.abs(first[opposite]).argmin(1)])
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    half = np.full(len(first), np.pi)
    return rotations_about(middle, half) @ rotations_about(first, half)


def _angles(turn: np.ndarray) -> np.ndarray:
    """Both triples of angles for which ``R_x R_y R_z`` is a rotation, shape (2, n, 3)."""
    x, y, z = np.arctan2(-turn[:, 1, 2], turn[:, 2, 2]), np.arcsin(np.clip(turn[:, 0, 2], -1, 1)), np.arctan2(-turn[:, 0, 1], turn[:, 0, 0])
    both = np.stack([np.stack([x, y, z], axis=-1), np.stack([x + np.pi, np.pi - y, z + np.pi], axis=-1)])
    return (both + np.pi) % (2 * np.pi) - np.pi
