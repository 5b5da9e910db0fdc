"""How far the body's parts reach into one another: the symmetric cost's form of Canton's double occupancy (Eq. 6.14).

Two limbs in one place explain the hull as well as one there, so without a price for it both arms of a boxer end on the one
that is stretched out. Points on the axes of the limbs are tested against the cones of parts that are no neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.body.flesh import place_points
from hmc.pose.body.model import PARTS, BodyModel

__all__ = ["AxisPoints", "axis_points", "penetration_depth", "penetration_rows"]

#: Share of each limb part's length from which its axis is tested: what lies nearer to the joint is inside its neighbour anyway.
_FROM = {"upper_arm": 0.6, "forearm": 0.25, "thigh": 0.6, "shank": 0.2}
#: Points on the axis of each cone.
POINTS_A_CONE = 3
_NEIGHBOURS = {
    "upper_arm": ("upper_arm", "forearm"),
    "forearm": ("upper_arm", "forearm"),
    "thigh": ("thigh", "shank"),
    "shank": ("thigh", "shank"),
}


@dataclass(frozen=True)
class AxisPoints:
    """Points on the axes of the limbs and the cones that they must stay out of.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Metres, segment's frame.
    segment : ndarray of int, shape (n,)
    against : ndarray of bool, shape (n, n_cones)
    """

    points: np.ndarray
    segment: np.ndarray
    against: np.ndarray


def axis_points(body: BodyModel) -> AxisPoints:
    """Choose the points: as many for any body, so that they move smoothly with its dimensions.

    Parameters
    ----------
    body : BodyModel
    """
    cones = body.cones
    points, segments, against = [], [], []
    for cone, part in enumerate(cones.part):
        name = PARTS[part]
        kind = name[2:]
        if kind not in _FROM or (cones.start[cone] - cones.end[cone])[2] ** 2 + (cones.start[cone] - cones.end[cone])[1] ** 2 < 1e-3:
            continue  # the trunk, the head; the foot, which lies across its shank
        own = [PARTS.index(f"{name[:2]}{other}") for other in _NEIGHBOURS[kind]]
        foes = ~np.isin(cones.part, own)
        if kind == "thigh":
            foes &= cones.part != PARTS.index("torso")
        first = cones.part.tolist().index(part) == cone
        start = _FROM[kind] if first else 0.0
        n = POINTS_A_CONE
        t = (start + (1 - start) * (np.arange(n) + 0.5) / n)[:, None]
        points.append((1 - t) * cones.start[cone] + t * cones.end[cone])
        segments.append(np.full(n, cones.segment[cone]))
        against.append(np.repeat(foes[None], n, axis=0))
    return AxisPoints(np.concatenate(points), np.concatenate(segments), np.concatenate(against))


def penetration_depth(body: BodyModel, axes: AxisPoints, rotations: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Depth of each axis point in the cone that it is deepest in.

    Parameters
    ----------
    body : BodyModel
    axes : AxisPoints
    rotations : ndarray, shape (n, 11, 3, 3)
    positions : ndarray, shape (n, 11, 3)
        As from `hmc.pose.body.kinematics.segment_transforms`.

    Returns
    -------
    ndarray, shape (n, n_points)
        Metres; 0 where a point is in none.
    """
    points = place_points(rotations, positions, axes.points, axes.segment)
    return _depths(body, axes, rotations, positions, points)[0].max(1)


def penetration_rows(
    body: BodyModel, axes: AxisPoints, rotations: np.ndarray, positions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The same for one state, with what is needed to move the parts apart.

    Returns
    -------
    depth : ndarray, shape (n_points,)
    outward : ndarray, shape (n_points, 3)
        The way out of the cone, unit vector, world.
    points : ndarray, shape (n_points, 3)
        World, metres.
    segment, other : ndarray of int, shape (n_points,)
        Segments of the point and of the cone.
    """
    points = place_points(rotations, positions, axes.points, axes.segment)
    depths, turn, local = _depths(body, axes, rotations[None], positions[None], points[None])
    deepest = depths[0].argmax(0)
    k = np.arange(len(points))
    lateral = local[0, deepest, :2, k]
    norm = np.linalg.norm(lateral, axis=1, keepdims=True)
    lateral = np.where(norm > 1e-9, lateral / np.maximum(norm, 1e-9), [1.0, 0.0])
    outward = np.einsum("ki,kij->kj", lateral, turn[0, deepest, :2])
    return depths[0, deepest, k], outward, points, axes.segment, body.cones.segment[deepest]


def _depths(body, axes, rotations, positions, points):
    """Depth of every point in every cone it must stay out of, (n, n_cones, n_points); world to cone; local coordinates."""
    cones = body.cones
    turn = cones.bases.astype(rotations.dtype) @ np.swapaxes(rotations[:, cones.segment], -1, -2)
    start = positions[:, cones.segment] + (rotations[:, cones.segment] @ cones.start[..., None].astype(rotations.dtype))[..., 0]
    shift = (turn @ start[..., None])[..., 0]
    local = turn @ np.swapaxes(points, -1, -2)[:, None] - shift[..., None]
    x, y, along = local[:, :, 0], local[:, :, 1], local[:, :, 2]
    length = cones.lengths.astype(rotations.dtype)[:, None]
    t = np.clip(along / length, 0, 1)
    first, slope = cones.radii[:, 0].astype(rotations.dtype), (cones.radii[:, 1] - cones.radii[:, 0]).astype(rotations.dtype)
    a, b = first[:, :1] + slope[:, :1] * t, first[:, 1:] + slope[:, 1:] * t
    level = np.sqrt((x / a) ** 2 + (y / b) ** 2)
    inside = (level < 1) & (along > 0) & (along < length) & axes.against.T
    return np.where(inside, (1 - level) * np.minimum(a, b), 0), turn, local
