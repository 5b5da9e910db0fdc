"""Distances of hull points and rays to one pose: the nearest cone, how far off it is, and where (what the refinement pulls on); each part.

A refinement asks for pose after pose that hardly move, so cones that are out of reach of a point are left out until the body has moved by
a hand's breadth, and so are points that some cone holds anyway.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.body.cone_maps import ConeMaps, cone_maps, cones_near, to_cones
from hmc.body.cones import cone_shapes, places_and_directions, slide_to_axis, squared_distance, way_out
from hmc.body.kinematics import place_segments
from hmc.body.model import PARTS, BodyModel, Cones

__all__ = ["Candidates", "Nearest", "candidates", "nearest_cones", "part_distances", "towards"]

#: How far the ends of the cones may go before the candidates are looked for again, metres.
SLACK_M = 0.06


@dataclass(frozen=True)
class Candidates:
    """Pairs of a cone and a point that it may be nearest to, point by point.

    Parameters
    ----------
    points : ndarray, shape (m, 3) or (m, 6)
        All hull points or rays (`hmc.pose.views.rays`).
    held : ndarray of bool, shape (m,)
        Points that need no cone: some part of the body is there for sure.
    reach_m : float
        How far a cone may be off, metres.
    cone, point : ndarray of int, shape (n,)
    first, counts : ndarray of int, shape (k,)
        Where the pairs of the next point begin, and how many it has.
    at : ndarray of int, shape (3, n)
        Where the coordinates of each pair are among those of all pairs, shape (n_cones, 3, m).
    shapes : tuple of ndarray of float32, shapes (n, 1), (n, 2, 1) and (n, 2, 1)
        Of each pair's cone, as from `hmc.body.cones.cone_shapes`.
    ends : ndarray, shape (2, n_cones, 3)
        Of the cones' axes when the pairs were chosen, world, metres.
    cones : Cones
        Of which the shapes are.
    """

    points: np.ndarray
    held: np.ndarray
    reach_m: float
    cone: np.ndarray
    point: np.ndarray
    first: np.ndarray
    counts: np.ndarray
    at: np.ndarray
    shapes: tuple[np.ndarray, np.ndarray, np.ndarray]
    ends: np.ndarray
    cones: Cones


def candidates(cones: Cones, maps: ConeMaps, points: np.ndarray, reach_m: float, before: Candidates | None = None) -> Candidates:
    """The pairs that matter for a pose and those around it.

    Parameters
    ----------
    cones : Cones
    maps : ConeMaps
        Of the pose.
    points : ndarray, shape (m, 3) or (m, 6)
    reach_m : float
        Cones farther from a point than this do not matter, metres.
    before : Candidates, optional
        Of another pose and the same points: they are returned where they are still good. It may be another body's, if that is hardly
        thicker or thinner.
    """
    ends = np.stack([maps.start[:, :, 0], maps.start[:, :, 0] + maps.axis[:, :, 0] * cones.lengths[:, None]])
    if before is not None and ((ends - before.ends) ** 2).sum(axis=2).max() < SLACK_M**2:
        return before if before.cones is cones else replace(before, shapes=_shapes(cones, before.cone), cones=cones)
    places, directions = places_and_directions(points)
    near, held = cones_near(cones, maps, places, reach_m, directions, SLACK_M)
    point, cone = np.nonzero((near & ~held).T)
    at = cone * (3 * len(places)) + point + (np.arange(3) * len(places))[:, None]
    first = np.flatnonzero(np.diff(point, prepend=-1))
    counts = np.diff(first, append=len(point))
    return Candidates(points, held, reach_m, cone, point, first, counts, at, _shapes(cones, cone), ends, cones)


def _shapes(cones: Cones, cone: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    length, first, slope = (values[cone] for values in cone_shapes(cones))
    return length, first, slope


@dataclass(frozen=True)
class Nearest:
    """How far hull points or rays are from the body, and what pulls them together.

    Parameters
    ----------
    distance : ndarray, shape (m,)
        Metres; 0 inside the body, infinite where no cone is within reach.
    pulls : ndarray of int, shape (k,)
        The points of which the distance is neither.
    cone : ndarray of int, shape (k,)
        The cone that is nearest to each.
    offsets : ndarray, shape (3, k)
        The way out from the cone to each, in the cone's coordinates, metres.
    places : ndarray, shape (k, 3)
        The point, or that of the ray which is nearest, world, metres.
    """

    distance: np.ndarray
    pulls: np.ndarray
    cone: np.ndarray
    offsets: np.ndarray
    places: np.ndarray


def nearest_cones(cones: Cones, maps: ConeMaps, pairs: Candidates) -> Nearest:
    """Distance of hull points or rays to the nearest cone, which is found in single precision.

    Parameters
    ----------
    cones : Cones
    maps : ConeMaps
        Of the pose.
    pairs : Candidates
        That are good for this pose.
    """
    places, directions = places_and_directions(pairs.points)
    n = len(places)
    distance = np.where(pairs.held, 0.0, np.inf)
    local, along = to_cones(maps, places), None
    if directions is not None:
        along = (maps.to_cone[:, :, :3, 0].reshape(-1, 3) @ directions.T).reshape(local.shape)
    point, squared, cone = _nearest(local, along, pairs)
    distance[point[squared == 0]] = 0
    some = np.flatnonzero((squared > 0) & (squared < np.float32(1.01 * pairs.reach_m**2)))
    pulls, cone = point[some], cone[some]
    at = cone * (3 * n) + pulls + (np.arange(3) * n)[:, None]
    local, where = local.ravel().take(at), places[pulls]
    length, first, slope = (values.take(cone, axis=0) for values in cones.shapes)
    if directions is not None and along is not None:
        # The ray's nearest point moves along with the cone, but along the ray, where the distance does not change.
        where += slide_to_axis(local, along.ravel().take(at), length)[:, None] * directions[pulls]
    way_out(local, length, first, slope)
    distance[pulls] = np.sqrt(np.einsum("ik,ik->k", local, local))
    return Nearest(distance, pulls, cone, local, where)


def towards(maps: ConeMaps, nearest: Nearest, rows: np.ndarray) -> np.ndarray:
    """How some of the distances change when the cone moves: minus the outward direction, world, shape (n, 3).

    Parameters
    ----------
    maps : ConeMaps
        Of the pose.
    nearest : Nearest
    rows : ndarray of int, shape (n,)
        Among `Nearest.pulls`.
    """
    outward = nearest.offsets[:, rows] / -np.maximum(nearest.distance[nearest.pulls[rows]], 1e-9)
    return np.einsum("ik,kij->kj", outward, maps.to_cone[..., 0].take(nearest.cone[rows], axis=0)[:, :, :3])


def part_distances(body: BodyModel, state: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of hull points, or of rays, to each part of a body.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
    points : ndarray, shape (k, 3) or (k, 6)
        World, metres (`hmc.pose.views.rays`).

    Returns
    -------
    ndarray of float32, shape (n_parts, k)
        Metres, in the order of `hmc.body.model.PARTS`; 0 inside, infinite of a part that the body lacks.
    """
    places, directions = places_and_directions(points)
    origin = places.mean(axis=0)
    maps = cone_maps(body.cones, place_segments(body, state[None], origin))
    local = np.ascontiguousarray(to_cones(maps, (places - origin).astype(np.float32)).swapaxes(0, 1))
    lengths, first, slope = cone_shapes(body.cones)
    if directions is not None:
        along = maps.to_cone[:, :, :3, 0].reshape(-1, 3) @ directions.T.astype(np.float32)
        slide_to_axis(local, along.reshape(-1, 3, len(points)).swapaxes(0, 1), lengths)
    squared = np.empty(local.shape[1:], np.float32)
    squared_distance(local, lengths, first, slope, squared)
    return np.sqrt([squared[body.cones.part == part].min(axis=0, initial=np.inf) for part in range(len(PARTS))])


def _nearest(local: np.ndarray, along: np.ndarray | None, pairs: Candidates) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The points that have candidates, squared distance to the nearest, and that cone, from the coordinates in all cones."""
    if not len(pairs.point):
        return np.zeros(0, int), np.zeros(0, np.float32), np.zeros(0, int)
    places = local.ravel().take(pairs.at).astype(np.float32)[:, :, None]
    if along is not None:
        slide_to_axis(places, along.ravel().take(pairs.at).astype(np.float32)[:, :, None], pairs.shapes[0])
    squared = np.empty((len(pairs.cone), 1), np.float32)
    squared_distance(places, *pairs.shapes, squared)
    squared = squared[:, 0]
    best = np.flatnonzero(squared == np.minimum.reduceat(squared, pairs.first).repeat(pairs.counts))
    # Of several equally near cones the first.
    best = best[np.flatnonzero(np.diff(pairs.point[best], prepend=-1))]
    return pairs.point[best], squared[best], pairs.cone[best]
