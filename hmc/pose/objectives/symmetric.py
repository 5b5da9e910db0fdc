"""The symmetric cost: body outside the tolerant hull, and silhouettes that no part of the body covers.

Canton's four scores (section 6.5) ask only that what the body fills be occupied, so a limb folded into the trunk costs
nothing. Here the silhouettes have to be covered too, ray by ray (`hmc.pose.views.rays`), and to a small part the surface of the
strict hull (every camera agrees). The tolerant hull (one camera may miss) is what the body must not leave.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hmc.body.cone_maps import ConeMaps, cone_maps, cones_near
from hmc.body.cones import cone_shapes, places_and_directions, slide_to_axis, squared_distance
from hmc.body.flesh import SurfaceSamples, surface_samples
from hmc.body.floor import floor_gap, off_floor, sole_places
from hmc.body.kinematics import place_segments
from hmc.body.model import PART_OF_DOF, PART_OF_SEGMENT, PARTS, BodyModel, Cones
from hmc.body.nearest_cone import Candidates
from hmc.body.penetration import AxisPoints, axis_points, depths_placed
from hmc.body.prior import POSTURE, posture_spread
from hmc.errors import InputError
from hmc.pose.objectives.residuals import Distances, distances
from hmc.pose.views.hull_target import HullTarget, distance_at, sample_points

__all__ = [
    "BodyPoints",
    "Symmetric",
    "SymmetricSettings",
    "body_distance",
    "body_points",
    "outside_distance",
    "thinned",
]

#: The largest cap: the distance fields must go beyond it by a voxel and more (`hmc.pose.views.hull_target.FAR_M`).
MOST_CAP_M = 0.2
#: Elements (pairs of a cone and a point x states) worked on at a time: what stays in the second-level cache.
CHUNK = 16384


@dataclass(frozen=True)
class SymmetricSettings:
    """Weights of the symmetric cost.

    Parameters
    ----------
    cap_m : float
        Distances beyond this count as this (metres), so that furniture in the hull or a cut-off limb cannot pull without end.
    uncovered_weight : float
        Weight of what the body does not cover against body outside the hull.
    ray_share : float
        Share of rays in what has to be covered; the rest is points of the strict hull's surface. A hull is fatter than its person, the
        more so the fewer cameras there are, and its surface makes the body swell and lean into ghosts; rays alone sometimes leave an arm
        before the trunk, which hides it. docs/accuracy.md has what both are worth.
    overlap_weight : float
        Weight of parts that reach into one another.
    posture_weight : float
        Square metres that an angle one spread (`posture_spread`) away from rest costs: it decides between poses that the hulls do not
        tell apart, such as the ways to fold an arm before the chest.
    floor_weight : float
        Weight of hanging in the air or being sunk in the floor (`hmc.body.floor`).
    standing_weight : float
        Weight of the heights over the floor, or under it, of heel and ball of a foot that is known to stand.
    hand_cap_m : float or None
        As `cap_m`, of a hand outside the hull; None: as of all else. Silhouettes lose hands, skin before wood.
    """

    cap_m: float = 0.06
    uncovered_weight: float = 0.4
    ray_share: float = 0.9
    overlap_weight: float = 2.0
    posture_weight: float = 3e-6
    floor_weight: float = 0.015
    standing_weight: float = 0.02
    hand_cap_m: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.cap_m <= MOST_CAP_M:
            raise InputError(f"`cap_m` must be above 0 and at most {MOST_CAP_M} m, where the hulls' distance fields end; got {self.cap_m}")


@dataclass(frozen=True)
class BodyPoints:
    """Points of one body at which the cost is taken: its surface, and the axes of its limbs."""

    surface: SurfaceSamples
    axes: AxisPoints


def body_points(body: BodyModel, coordinates: tuple[np.ndarray, np.ndarray, np.ndarray]) -> BodyPoints:
    """The points of a body, its surface sampled at given coordinates (`hmc.body.flesh.surface_coordinates`)."""
    return BodyPoints(surface_samples(body, coordinates), axis_points(body))


def thinned(points: BodyPoints, n: int) -> BodyPoints:
    """About `n` of the surface's points, evenly spread, and all of the axes'."""
    step = max(1, round(len(points.surface.points) / n))
    return BodyPoints(points.surface.where(slice(None, None, step)), points.axes)


def outside_distance(body: BodyModel, samples: SurfaceSamples, states: np.ndarray, target: HullTarget) -> np.ndarray:
    """Distance of each body-surface sample to the tolerant hull.

    Parameters
    ----------
    body : BodyModel
    samples : SurfaceSamples
    states : ndarray, shape (n, 37)
    target : HullTarget

    Returns
    -------
    ndarray of float32, shape (n, n_samples)
        Metres; 0 inside.
    """
    return _outside(samples, place_segments(body, states, target.origin), target, target.origin).T


def _outside(samples: SurfaceSamples, placed: np.ndarray, target: HullTarget, origin: np.ndarray) -> np.ndarray:
    """The same for segments placed around an origin, shape (n_samples, n)."""
    n, shape = placed.shape[-1], target.distance.shape
    out = np.empty((len(samples.points), n), np.float32)
    local = np.c_[samples.points, np.ones(len(samples.points))].astype(np.float32)
    # In voxels, counted from the corner of the crop's first one.
    columns = placed * np.float32(1 / target.voxel_size_m)
    columns[:, :, 3] += ((origin - target.origin) / target.voxel_size_m + 0.5).astype(np.float32)[:, None]
    edges = np.r_[0, np.flatnonzero(np.diff(samples.segment)) + 1, len(local)].tolist()
    segments = samples.segment[edges[:-1]]
    distance = target.distance.ravel()
    for start, stop, segment, inside in zip(edges, edges[1:], segments, _stay_in(local, edges, columns[segments], shape), strict=False):
        at = local[start:stop] @ columns[segment]  # (axis, point, particle)
        if inside:
            voxel = at.astype(np.int32)
            flat = voxel[0]
            for axis in (1, 2):
                flat *= shape[axis]
                flat += voxel[axis]
            distance.take(flat.astype(np.intp), out=out[start:stop], mode="wrap")
        else:
            world = (np.moveaxis(at, 0, -1) - np.float32(0.5)) * np.float32(target.voxel_size_m)
            out[start:stop] = distance_at(replace(target, origin=np.zeros(3)), world)
    return out


def _stay_in(local: np.ndarray, edges: list[int], columns: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Which runs of points, between edges, stay inside the crop in every particle, as seen from the sphere around each."""
    low, high = np.minimum.reduceat(local, edges[:-1]), np.maximum.reduceat(local, edges[:-1])
    middle = (low + high) / 2
    radius = np.linalg.norm(high - low, axis=1) / 2 * np.linalg.norm(columns[0, :, 0, 0]) + 0.01  # the columns count voxels
    centre = (middle[:, None, None] @ columns)[:, :, 0]
    return np.all((centre.min(axis=2) >= radius[:, None]) & (centre.max(axis=2) < np.array(shape) - radius[:, None]), axis=1)


def body_distance(body: BodyModel, states: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of hull points, or of rays, to the nearest truncated cone of the body.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (n, 37)
    points : ndarray, shape (k, 3) or (k, 6)
        World, metres (`hmc.pose.views.rays`).

    Returns
    -------
    ndarray of float32, shape (n, k)
        Metres; 0 inside the body.
    """
    # Relative to the points' middle: float32 then has digits to spare.
    places, directions = places_and_directions(points)
    origin = places.mean(axis=0)
    maps = cone_maps(body.cones, place_segments(body, states, origin))
    return _to_body(body.cones, maps, places - origin, directions).T


def _to_body(
    cones: Cones, maps: ConeMaps, points: np.ndarray, directions: np.ndarray | None = None, near: np.ndarray | None = None
) -> np.ndarray:
    """Distance of points, or of rays through them, to the nearest of the cones that are near them, shape (k, n); infinite where none is.

    `near`, shape (n_cones, k), says which are; all by default.
    """
    n_cones, n = len(maps.start), maps.start.shape[-1]
    cone, point = np.nonzero(np.ones((n_cones, len(points)), bool) if near is None else near)
    edges = np.searchsorted(cone, np.arange(n_cones + 1)).tolist()
    homogeneous = np.c_[points, np.ones(len(points))].astype(np.float32)[point]
    along = None if directions is None else directions.astype(np.float32)[point]
    length, first, slope = (values[cone] for values in cone_shapes(cones))
    step = max(1, CHUNK // n)
    local_buffer, along_buffer = np.empty((2, 3, step, n), np.float32)
    squared_buffer = np.empty((step, n), np.float32)
    out = np.full((len(points), n), np.inf, np.float32)
    for begin in range(0, len(cone), step):
        end = min(begin + step, len(cone))
        local, turned, squared = local_buffer[:, : end - begin], along_buffer[:, : end - begin], squared_buffer[: end - begin]
        pieces = [(c, max(edges[c], begin), min(edges[c + 1], end)) for c in range(cone[begin], cone[end - 1] + 1)]
        for c, start, stop in pieces:
            np.matmul(homogeneous[start:stop], maps.to_cone[c], out=local[:, start - begin : stop - begin])
            if along is not None:
                np.matmul(along[start:stop], maps.to_cone[c, :, :3], out=turned[:, start - begin : stop - begin])
        if along is not None:
            slide_to_axis(local, turned, length[begin:end])
        squared_distance(local, length[begin:end], first[begin:end], slope[begin:end], squared)
        for _, start, stop in pieces:
            members = point[start:stop]
            out[members] = np.minimum(out[members], squared[start - begin : stop - begin])
    return np.sqrt(out, out=out)


@dataclass(frozen=True)
class Symmetric:
    """The symmetric cost of poses in one frame: an objective (`hmc.pose.objectives.objective.Objective`).

    Parameters
    ----------
    body : BodyModel
    points : BodyPoints
        Of the body.
    target : HullTarget
    asked : ndarray, shape (k, 3) or (k, 6)
        What has to be covered (`hmc.pose.views.rays.points_to_cover`).
    settings : SymmetricSettings
    asked_part : ndarray of int, shape (k,), optional
        The part that is asked to cover each of `asked`; without it costs cannot be told by part.
    """

    body: BodyModel
    points: BodyPoints
    target: HullTarget
    asked: np.ndarray
    settings: SymmetricSettings = field(default_factory=SymmetricSettings)
    asked_part: np.ndarray | None = None

    @property
    def outside_caps(self) -> np.ndarray:
        """How far outside the hull each of the body's points counts at most, float32, shape (n_points,), metres."""
        cap_m, hand_cap_m = self.settings.cap_m, self.settings.hand_cap_m
        return np.where(self.points.surface.hand, cap_m if hand_cap_m is None else hand_cap_m, cap_m).astype(np.float32)

    def cost(self, states: np.ndarray) -> np.ndarray:
        """Mean squared distance of body from hulls, of silhouettes and hull from the body, depth of its parts in one another, and posture.

        Parameters
        ----------
        states : ndarray, shape (n, 37)

        Returns
        -------
        ndarray, shape (n,)
            Square metres.
        """
        settings = self.settings
        outside, uncovered, _, depth, gap, posture = self._terms(states)
        return (
            gap
            + np.einsum("ij,ij->j", outside, outside) / len(outside)
            + settings.uncovered_weight / len(self.asked) * np.einsum("ij,ij->j", uncovered, uncovered)
            + settings.overlap_weight / len(depth) * np.einsum("ij,ij->j", depth, depth)
            + posture.sum(axis=1)
        )

    def by_part(self, states: np.ndarray) -> np.ndarray | None:
        """`cost`, each part's own share of it.

        Parameters
        ----------
        states : ndarray, shape (n, 37)

        Returns
        -------
        ndarray, shape (n, n_parts), or None
            Square metres; standing on the floor is the torso's share. None without `asked_part`.
        """
        if self.asked_part is None:
            return None
        settings = self.settings
        outside, uncovered, asking, depth, gap, posture = self._terms(states)
        columns = np.eye(len(PARTS), dtype=outside.dtype)
        cost = posture @ columns[PART_OF_DOF]
        for values, part, weight in (
            (outside, self.points.surface.part, 1 / len(outside)),
            (uncovered, self.asked_part[asking], settings.uncovered_weight / len(self.asked)),
            (depth, PART_OF_SEGMENT[self.points.axes.segment], settings.overlap_weight / len(depth)),
        ):
            cost += weight * (values**2).T @ columns[part]
        cost[:, 0] += gap
        return cost

    def linearise(self, state: np.ndarray, near: Candidates | None = None) -> Distances:
        """Residuals at one state (37,); `near` are the candidates of a state near it."""
        return distances(self, state, near)

    def coarser(self, rng: np.random.Generator, n: int) -> Symmetric:
        """The objective with about `n` of the points to be covered."""
        return replace(self, asked=sample_points(rng, self.asked, n), asked_part=None)

    def of_body(self, body: BodyModel, points: BodyPoints) -> Symmetric:
        """The same of another body and the points of its surface."""
        return replace(self, body=body, points=points)

    def _terms(self, states: np.ndarray) -> tuple[np.ndarray, ...]:
        """What the cost is made of.

        Metres, each of shape (., n): distances of body from hulls; of silhouettes from the body, of points that are not in it in every
        state, and which these are; depths. Square metres: the cost of hanging in the air, shape (n,), and of each angle, shape (n, 37).
        """
        body, settings = self.body, self.settings
        cap = np.float32(settings.cap_m)
        places, directions = places_and_directions(self.asked)
        origin = places.mean(axis=0)
        placed = place_segments(body, states, origin)
        maps = cone_maps(body.cones, placed)
        outside = np.minimum(_outside(self.points.surface, placed, self.target, origin), self.outside_caps[:, None])
        near, held = cones_near(body.cones, maps, places - origin, settings.cap_m, directions)
        asking = np.flatnonzero(~held)
        along = None if directions is None else directions[asking]
        uncovered = np.minimum(_to_body(body.cones, maps, (places - origin)[asking], along, near[:, asking]), cap)
        depth = depths_placed(body, self.points.axes, placed, maps)
        gap = np.zeros(len(states))
        if self.target.floor_z is not None:
            rotations, positions = np.moveaxis(placed[:, :, :3], -1, 0), np.moveaxis(placed[:, :, 3], -1, 0)
            floor_z = self.target.floor_z - origin[2]
            gap = settings.floor_weight * floor_gap(body, rotations, positions, floor_z) ** 2
            if any(self.target.standing):
                soles = sole_places(body, rotations, positions)[0][..., 2]
                soles = soles[:, np.array(self.target.standing)[: soles.shape[1]]]
                gap += settings.standing_weight * np.square(off_floor(soles, floor_z)).sum(axis=1)
        posture = settings.posture_weight * ((states - POSTURE[0]) / posture_spread(states)) ** 2
        return outside, uncovered, asking, depth, gap, posture
