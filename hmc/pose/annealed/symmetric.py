"""The symmetric cost: body outside the tolerant hull, and strict hull that no part of the body explains.

Canton's four scores (section 6.5) ask only that what the body fills be occupied, so a limb folded into the trunk costs
nothing. Here the hull's own surface has to be explained too. The strict hull (every camera agrees) is what must be
explained; the tolerant one (one camera may miss) is what the body must not leave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.annealed.floor import floor_gap
from hmc.pose.annealed.hull_target import HullTarget, distance_at
from hmc.pose.annealed.penetration import AxisPoints, axis_points, penetration_depth
from hmc.pose.body.flesh import SurfaceSamples, place_points, surface_samples
from hmc.pose.body.joints import DOF_NAMES
from hmc.pose.body.kinematics import segment_transforms
from hmc.pose.body.model import BodyModel

__all__ = ["POSTURE", "BodyPoints", "SymmetricSettings", "body_distance", "body_points", "outside_distance", "symmetric_cost"]

#: Elements (states x cones x points) worked on at a time: what stays in the second-level cache.
CHUNK = 65536


# Angles at rest and how far people commonly go from there, degrees; what is not named rests at 0.
_REST_DEG = {"r_shoulder_x": 75, "l_shoulder_x": -75, "r_elbow_z": 25, "l_elbow_z": -25, "torso_y": 5, "r_knee_y": 8, "l_knee_y": 8}
_SPREAD_DEG = {
    "torso_x": 25, "torso_y": 45, "torso_z": 25, "neck_x": 25, "neck_y": 30,
    "shoulder_x": 90, "shoulder_y": 40, "shoulder_z": 70, "elbow_z": 90,
    "hip_x": 30, "hip_y": 70, "hip_z": 25, "knee_y": 90,
}  # fmt: skip


def _posture() -> tuple[np.ndarray, np.ndarray]:
    spread = [next((value for key, value in _SPREAD_DEG.items() if name.endswith(key)), np.inf) for name in DOF_NAMES]
    return np.radians([_REST_DEG.get(name, 0.0) for name in DOF_NAMES]), np.radians(spread)


#: Rest and spread of every angle, radians, each of shape (27,); the root's are free (spread infinite).
POSTURE = _posture()


@dataclass(frozen=True)
class SymmetricSettings:
    """Weights of the symmetric cost.

    Parameters
    ----------
    cap_m : float
        Distances beyond this count as this (metres), so that furniture in the hull or a cut-off limb cannot pull without end.
    explain_weight : float
        Weight of unexplained hull against body outside the hull.
    overlap_weight : float
        Weight of parts that reach into one another.
    posture_weight : float
        Square metres that an angle one `POSTURE` spread away from rest costs: it decides between poses that the hulls do not
        tell apart, such as the ways to fold an arm before the chest.
    floor_weight : float
        Weight of hanging in the air or being sunk in the floor (`hmc.pose.annealed.floor`).
    """

    cap_m: float = 0.06
    explain_weight: float = 1.0
    overlap_weight: float = 2.0
    posture_weight: float = 3e-6
    floor_weight: float = 0.015


@dataclass(frozen=True)
class BodyPoints:
    """Points of one body at which the cost is taken: its surface, and the axes of its limbs."""

    surface: SurfaceSamples
    axes: AxisPoints


def body_points(body: BodyModel, coordinates: tuple[np.ndarray, np.ndarray, np.ndarray]) -> BodyPoints:
    """The points of a body, its surface sampled at given coordinates (`hmc.pose.body.flesh.surface_coordinates`)."""
    return BodyPoints(surface_samples(body, coordinates), axis_points(body))


def outside_distance(body: BodyModel, samples: SurfaceSamples, states: np.ndarray, target: HullTarget) -> np.ndarray:
    """Distance of each body-surface sample to the tolerant hull.

    Parameters
    ----------
    body : BodyModel
    samples : SurfaceSamples
    states : ndarray, shape (n, 27)
    target : HullTarget

    Returns
    -------
    ndarray of float32, shape (n, n_samples)
        Metres; 0 inside.
    """
    rotations, positions = segment_transforms(body, states)
    points = place_points(rotations.astype(np.float32), positions.astype(np.float32), samples.points, samples.segment)
    return distance_at(target, points)


def body_distance(body: BodyModel, states: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of hull points to the nearest truncated cone of the body.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (n, 27)
    points : ndarray, shape (k, 3)
        World, metres.

    Returns
    -------
    ndarray of float32, shape (n, k)
        Metres; 0 inside the body.
    """
    rotations, positions = segment_transforms(body, states)
    cones = body.cones
    turn = (cones.bases @ np.swapaxes(rotations[:, cones.segment], -1, -2)).astype(np.float32)  # cone from world, (n, C, 3, 3)
    # Work relative to the points' middle: float32 then has digits to spare.
    middle = points.mean(0)
    start = positions[:, cones.segment] + (rotations[:, cones.segment] @ cones.start[..., None])[..., 0] - middle
    shift = (turn @ start[..., None].astype(np.float32))[..., 0]
    pts = np.ascontiguousarray((points - middle).T, np.float32)
    n, n_cones = turn.shape[:2]
    length = cones.lengths.astype(np.float32)[:, None]
    radii0, slope = cones.radii[:, 0].astype(np.float32), (cones.radii[:, 1] - cones.radii[:, 0]).astype(np.float32)
    out = np.empty((n, points.shape[0]), np.float32)
    step = max(1, CHUNK // (n_cones * points.shape[0]))
    for first in range(0, n, step):
        part = slice(first, min(first + step, n))
        local = turn[part].reshape(-1, 3) @ pts
        local = local.reshape(-1, n_cones, 3, pts.shape[1])
        local -= shift[part][..., None]
        x, y, along = local[:, :, 0], local[:, :, 1], local[:, :, 2]
        clipped = np.clip(along, 0, length)
        beyond = along - clipped
        t = clipped / length
        a = x / (radii0[:, :1] + slope[:, :1] * t)
        b = y / (radii0[:, 1:] + slope[:, 1:] * t)
        level2 = a * a + b * b
        np.maximum(level2, 1.0, out=level2)
        # lateral * (1 - 1 / level), squared
        squared = (x * x + y * y) * (1 - 1 / np.sqrt(level2)) ** 2 + beyond * beyond
        np.sqrt(squared.min(1), out=out[part])
    return out


def symmetric_cost(
    body: BodyModel,
    points: BodyPoints,
    states: np.ndarray,
    target: HullTarget,
    hull_points: np.ndarray,
    settings: SymmetricSettings,
) -> np.ndarray:
    """Mean squared distance of the body from the hulls, of the hull from the body, depth of its parts in one another, and posture.

    Parameters
    ----------
    body : BodyModel
    points : BodyPoints
    states : ndarray, shape (n, 27)
    target : HullTarget
    hull_points : ndarray, shape (k, 3)
        Points of the strict hull's surface (`hmc.pose.annealed.hull_target.sample_points`).
    settings : SymmetricSettings

    Returns
    -------
    ndarray, shape (n,)
        Square metres.
    """
    cap = np.float32(settings.cap_m)
    outside = np.minimum(outside_distance(body, points.surface, states, target), cap)
    unexplained = np.minimum(body_distance(body, states, hull_points), cap)
    rotations, positions = segment_transforms(body, states)
    depth = penetration_depth(body, points.axes, rotations.astype(np.float32), positions.astype(np.float32))
    floor = 0.0 if target.floor_z is None else settings.floor_weight * floor_gap(body, rotations, positions, target.floor_z) ** 2
    return (
        floor
        + np.einsum("ij,ij->i", outside, outside) / outside.shape[1]
        + settings.explain_weight / unexplained.shape[1] * np.einsum("ij,ij->i", unexplained, unexplained)
        + settings.overlap_weight / depth.shape[1] * np.einsum("ij,ij->i", depth, depth)
        + settings.posture_weight * (((states - POSTURE[0]) / POSTURE[1]) ** 2).sum(1)
    )
