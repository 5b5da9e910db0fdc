"""How far the body's parts reach into one another: the symmetric cost's form of Canton's double occupancy (Eq. 6.14).

Two limbs in one place cover the hull as well as one there, so without a price for it both arms of a boxer end on the one
that is stretched out. Points on the axes of the limbs are tested against the cones of parts that are no neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hmc.body.cone_maps import ConeMaps, cone_maps, cones_near, spread, to_cones
from hmc.body.cones import cone_depth, cone_shapes
from hmc.body.limbs import CHAIN_OF_PART
from hmc.body.model import PARTS, BodyModel

__all__ = ["AxisPoints", "axis_points", "depths_placed", "penetration_depth", "penetration_rows"]

#: Share of each limb part's length from which its axis is tested: what lies nearer to the joint is inside its neighbour anyway.
_FROM = {"upper_arm": 0.6, "forearm": 0.25, "thigh": 0.2, "shank": 0.2}
#: Points on the axis of each cone.
POINTS_A_CONE = 3
#: Elements (pairs of a cone and a point x states) worked on at a time: what stays in the second-level cache.
CHUNK = 16384


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
        foes = CHAIN_OF_PART[cones.part] != CHAIN_OF_PART[part]
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
    rotations : ndarray, shape (n, 16, 3, 3)
    positions : ndarray, shape (n, 16, 3)
        As from `hmc.body.kinematics.segment_transforms`.

    Returns
    -------
    ndarray, shape (n, n_points)
        Metres; 0 where a point is in none.
    """
    placed = np.moveaxis(np.concatenate([rotations, positions[..., None]], axis=-1), 0, -1)
    return depths_placed(body, axes, placed, cone_maps(body.cones, placed)).T


def depths_placed(body: BodyModel, axes: AxisPoints, placed: np.ndarray, maps: ConeMaps) -> np.ndarray:
    """Depth of each axis point (`penetration_depth`) for placed segments, particles last.

    Parameters
    ----------
    body : BodyModel
    axes : AxisPoints
    placed : ndarray, shape (16, 3, 4, n)
        As from `hmc.body.kinematics.place_segments`.
    maps : ConeMaps
        Of the same.

    Returns
    -------
    ndarray, shape (n_points, n)
        Metres; 0 where a point is in no cone.
    """
    points = _place_points(axes, placed)
    middle, far = spread(points)
    cone, point = np.nonzero(cones_near(body.cones, maps, middle, far)[0] & axes.against.T)
    depth = np.empty((len(cone), placed.shape[-1]), placed.dtype)
    shapes = [values[cone] for values in cone_shapes(body.cones, placed.dtype)]
    step = max(1, CHUNK // placed.shape[-1])
    for begin in range(0, len(cone), step):
        rows = slice(begin, begin + step)
        to_cone, members = maps.to_cone[cone[rows]], points[point[rows]]
        local = np.empty((3, *members[:, 0].shape), placed.dtype)
        for axis in range(3):
            np.einsum("mjn,mjn->mn", to_cone[:, axis, :3], members, out=local[axis])
            local[axis] += to_cone[:, axis, 3]
        depth[rows] = cone_depth(local, *(values[rows] for values in shapes))
    out = np.zeros((len(points), placed.shape[-1]), placed.dtype)
    for start, stop in pairwise([*np.flatnonzero(np.diff(cone, prepend=-1)), len(cone)]):
        out[point[start:stop]] = np.maximum(out[point[start:stop]], depth[start:stop])
    return out


def _place_points(axes: AxisPoints, placed: np.ndarray) -> np.ndarray:
    """The points in the world, shape (n_points, 3, n)."""
    local = np.c_[axes.points, np.ones(len(axes.points))].astype(placed.dtype)
    return (local[:, None, None] @ placed[axes.segment])[:, :, 0]


def penetration_rows(
    body: BodyModel, axes: AxisPoints, rotations: np.ndarray, positions: np.ndarray, maps: ConeMaps
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Depth of each axis point (`penetration_depth`) in one state, with what is needed to move the parts apart.

    Parameters
    ----------
    body : BodyModel
    axes : AxisPoints
    rotations : ndarray, shape (16, 3, 3)
    positions : ndarray, shape (16, 3)
    maps : ConeMaps
        Of the one state.

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
    cones = body.cones
    points = np.einsum("kij,kj->ki", rotations[axes.segment], axes.points) + positions[axes.segment]
    local = to_cones(maps, points)
    depths = cone_depth(local.swapaxes(0, 1).copy(), *cone_shapes(cones, float))
    depths *= axes.against.T  # of one state it takes longer to tell which are near
    deepest, k = depths.argmax(axis=0), np.arange(len(points))
    lateral = local[deepest, :2, k]
    norm = np.sqrt(np.einsum("ki,ki->k", lateral, lateral))[:, None]
    lateral = np.where(norm > 1e-9, lateral / np.maximum(norm, 1e-9), [1.0, 0.0])
    outward = np.einsum("ki,kij->kj", lateral, maps.to_cone[deepest, :2, :3, 0])
    return depths[deepest, k], outward, points, axes.segment, cones.segment[deepest]
