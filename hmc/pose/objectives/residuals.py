"""The symmetric cost at one pose as residuals, and how they change with the pose.

Each body-surface sample outside the tolerant hull pulls its segment back along the hull's distance field; each point of the
strict hull's surface outside the body, and each ray that misses it, pulls the nearest cone towards itself. Both move with
the twists of the joints (Canton 2009, Eq. A.1), so the Jacobian needs no differences; it takes
the flesh as round and straight near each point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hmc.body.cone_maps import ConeMaps, cone_maps
from hmc.body.cones import places_and_directions
from hmc.body.floor import above_floor, gap_slope, lowest_support, off_floor, sole_places
from hmc.body.joints import N_DOF
from hmc.body.kinematics import dof_masks, joint_twists
from hmc.body.nearest_cone import Candidates, Nearest, candidates, nearest_cones, towards
from hmc.body.penetration import penetration_rows
from hmc.body.prior import POSTURE, posture_spread
from hmc.pose.objectives.objective import Linearisation, Misfit
from hmc.pose.views.hull_target import distance_gradient

if TYPE_CHECKING:
    from hmc.pose.objectives.symmetric import Symmetric

__all__ = ["Distances", "distances", "residual_rows"]

#: Which degrees of freedom move each segment, and last the world.
_MASKS = np.concatenate([dof_masks().astype(float), np.zeros((1, N_DOF))])
#: The same of one segment relative to another, in rows ``len(_MASKS) * other + segment``, and the first row relative to the world.
_RELATIVE = (_MASKS - _MASKS[:, None]).reshape(-1, N_DOF)
_TO_WORLD = len(_MASKS) * (len(_MASKS) - 1)


@dataclass(frozen=True)
class Distances:
    """The distances of one state, group by group, and what it takes to tell how they change with it.

    Parameters
    ----------
    residuals : ndarray, shape (n + 37,)
        Weighted: of the body's surface, of what is to be covered, of the axes' depth, of the floor and of standing, and of the posture.
    weights : ndarray, shape (5,)
        Of the first three, of the floor, and of feet that stand on it.
    axes, centres : ndarray, shape (37, 3)
        The joints' twists.
    maps : ConeMaps
    pairs : Candidates
        For poses near this one.
    points, slope : ndarray, shape (n_surface, 3)
        The surface's points in the world, metres, and how far each gets from the hull where it moves.
    outside, depth : ndarray
        Distances, metres, not weighted.
    nearest : Nearest
    outward, axis_points : ndarray, shape (n_axes, 3)
    segment, other : ndarray of int, shape (n_axes,)
        As from `penetration_rows`.
    floor : tuple of ndarray
        Of the lowest support (`lowest_support`), and after it of the soles that stand (`sole_places`): how the residual changes with its
        height, its place and its carrier; empty where there is no floor.
    spread : ndarray, shape (37,)
        Of the posture (`posture_spread`), radians.
    objective : Symmetric
        Of which these are the distances.
    """

    residuals: np.ndarray
    weights: np.ndarray
    axes: np.ndarray
    centres: np.ndarray
    maps: ConeMaps
    pairs: Candidates
    points: np.ndarray
    slope: np.ndarray
    outside: np.ndarray
    nearest: Nearest
    depth: np.ndarray
    outward: np.ndarray
    axis_points: np.ndarray
    segment: np.ndarray
    other: np.ndarray
    floor: tuple[np.ndarray, np.ndarray, np.ndarray]
    spread: np.ndarray
    objective: Symmetric

    @property
    def near(self) -> Candidates:
        """What speeds up the next call."""
        return self.pairs

    @property
    def misfit(self) -> Misfit:
        """Body outside of the hulls, and hull points and rays that no part of the body covers."""
        places, _ = places_and_directions(self.objective.asked)
        return Misfit(self.outside, self.objective.points.surface.part, places, self.nearest.distance)

    def pulls(self) -> tuple[np.ndarray, np.ndarray]:
        """Which residuals change with the state, ndarray of int, shape (m,), and how, shape (m, 37)."""
        return _pulls(self)


def distances(objective: Symmetric, state: np.ndarray, before: Candidates | None = None) -> Distances:
    """The distances of one state.

    Parameters
    ----------
    objective : Symmetric
    state : ndarray, shape (37,)
    before : Candidates, optional
        Of a pose near this one.
    """
    body, samples, target, settings = objective.body, objective.points, objective.target, objective.settings
    axes, centres, rotations, positions = joint_twists(body, state)
    maps = cone_maps(body.cones, np.concatenate([rotations, positions[..., None]], axis=-1)[..., None])
    carrier = samples.surface.segment
    points = np.einsum("nij,nj->ni", rotations.take(carrier, axis=0), samples.surface.points)
    points += positions.take(carrier, axis=0)
    outside, slope = distance_gradient(target, points)
    pairs = candidates(body.cones, maps, objective.asked, settings.cap_m, before)
    nearest = nearest_cones(body.cones, maps, pairs)
    depth, outward, axis_points, segment, other = penetration_rows(body, samples.axes, rotations, positions, maps)
    sizes = np.array([len(outside), len(nearest.distance), len(depth), 1, 1])
    floor_weights = settings.floor_weight, settings.standing_weight
    weights = np.sqrt(np.array([1, settings.uncovered_weight, settings.overlap_weight, *floor_weights]) / sizes)
    gap, floor = np.zeros(0), (np.zeros(0), np.zeros((0, 3)), np.zeros(0, int))
    if target.floor_z is not None:
        height, place, carrier_of = lowest_support(body, rotations[None], positions[None])
        gap = weights[3] * above_floor(height, target.floor_z)
        floor = weights[3] * gap_slope(height, target.floor_z), place, carrier_of
        if any(target.standing):
            soles, feet = sole_places(body, rotations[None], positions[None])
            stands = np.array(target.standing)[: len(feet)]
            bearing = soles[0, stands]
            gap = np.r_[gap, weights[4] * off_floor(bearing[:, 2], target.floor_z)]
            floor = np.r_[floor[0], np.repeat(weights[4], len(bearing))], np.concatenate([place, bearing]), np.r_[carrier_of, feet[stands]]
    spread = posture_spread(state)
    residuals = [
        weights[0] * np.minimum(outside, objective.outside_caps),
        weights[1] * np.minimum(nearest.distance, settings.cap_m),
        weights[2] * depth,
        gap,
        np.sqrt(settings.posture_weight) * (state - POSTURE[0]) / spread,
    ]
    return Distances(
        np.concatenate(residuals), weights, axes, centres, maps, pairs, points, slope, outside, nearest, depth, outward, axis_points,
        segment, other, floor, spread, objective,
    )  # fmt: skip


def _pulls(found: Distances) -> tuple[np.ndarray, np.ndarray]:
    body, samples, settings = found.objective.body, found.objective.points, found.objective.settings
    n_outside, n_asked = len(found.outside), len(found.nearest.distance)
    out = np.flatnonzero((found.outside > 0) & (found.outside < found.objective.outside_caps))
    pulled = found.nearest.distance[found.nearest.pulls]
    uncovered = np.flatnonzero((pulled > 0) & (pulled < settings.cap_m))
    deep = np.flatnonzero(found.depth)
    gap = np.flatnonzero(found.residuals[n_outside + n_asked + len(found.depth) : -N_DOF])
    # The way in which a point has to move to add to the distance, where the point is, and what moves it: a row of `_RELATIVE`.
    directions = [
        found.weights[0] * found.slope[out],
        found.weights[1] * towards(found.maps, found.nearest, uncovered),
        -found.weights[2] * found.outward[deep],
    ]
    places = [found.points[out], found.nearest.places[uncovered], found.axis_points[deep]]
    # What carries both parts leaves them where they are to one another.
    movers = [
        _TO_WORLD + samples.surface.segment[out],
        _TO_WORLD + body.cones.segment[found.nearest.cone[uncovered]],
        len(_MASKS) * found.other[deep] + found.segment[deep],
    ]
    if len(gap):
        slope, bearing, carrier = found.floor
        up = np.zeros((len(gap), 3))
        up[:, 2] = slope[gap]
        directions.append(up)
        places.append(bearing[gap])
        movers.append(_TO_WORLD + carrier[gap])
    rows = [out, n_outside + found.nearest.pulls[uncovered], n_outside + n_asked + deep, n_outside + n_asked + len(found.depth) + gap]
    n = sum(map(len, rows))
    wrenches = np.empty((n, 6))
    direction = np.concatenate(directions, out=wrenches[:, 3:])
    # g . (axis x (p - centre)) = (p x g) . axis - g . (axis x centre)
    wrenches[:, :3] = _cross(np.concatenate(places), direction)
    twists = np.concatenate([found.axes, -_cross(found.axes, found.centres)], axis=1)
    twists[:3] = np.eye(6)[3:]  # translations
    jacobian = np.empty((n + N_DOF, N_DOF))
    np.matmul(wrenches, twists.T, out=jacobian[:-N_DOF])
    jacobian[:-N_DOF] *= _RELATIVE.take(np.concatenate(movers), axis=0)
    jacobian[-N_DOF:] = np.diag(np.sqrt(settings.posture_weight) / found.spread)
    return np.concatenate([*rows, len(found.residuals) - N_DOF + np.arange(N_DOF)]), jacobian


def residual_rows(found: Linearisation) -> tuple[np.ndarray, np.ndarray]:
    """Weighted residuals at one state, and how all of them change with it.

    Parameters
    ----------
    found : Linearisation

    Returns
    -------
    residuals : ndarray, shape (n_residuals,)
        Metres; their squares sum to the cost.
    jacobian : ndarray, shape (n_residuals, 37)
        Zero where a distance is zero or beyond the cap.
    """
    pulled, rows = found.pulls()
    jacobian = np.zeros((len(found.residuals), N_DOF))
    jacobian[pulled] = rows
    return found.residuals, jacobian


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of rows; `numpy.cross` spends more time on its arguments than on the product."""
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)
