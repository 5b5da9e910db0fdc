"""Local least-squares refinement of a pose: Gauss-Newton steps with damping on the symmetric cost's distances.

Each body-surface sample outside the tolerant hull pulls its segment back along the hull's distance field; each point of the
strict hull's surface outside the body, and each ray that misses it, pulls the nearest cone towards itself. Both move with
the twists of the joints (Canton 2009, Eq. A.1), so the Jacobian needs no differences; it takes
the flesh as round and straight near each point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.annealed.cone_maps import cone_maps
from hmc.pose.annealed.floor import floor_gap, lowest_support
from hmc.pose.annealed.hull_target import HullTarget, distance_gradient
from hmc.pose.annealed.nearest_cone import Candidates, candidates, nearest_cones
from hmc.pose.annealed.penetration import penetration_depth, penetration_rows
from hmc.pose.annealed.symmetric import POSTURE, BodyPoints, SymmetricSettings, body_distance
from hmc.pose.body.flesh import place_points
from hmc.pose.body.joints import N_DOF
from hmc.pose.body.kinematics import dof_masks, joint_twists, segment_transforms
from hmc.pose.body.model import BodyModel

__all__ = ["RefineInfo", "RefineSettings", "refine", "residual_rows", "residual_values"]

#: Which degrees of freedom move each segment, and last the world.
_MASKS = np.concatenate([dof_masks().astype(float), np.zeros((1, N_DOF))])
#: The same of one segment relative to another, in rows ``len(_MASKS) * other + segment``, and the first row relative to the world.
_RELATIVE = (_MASKS - _MASKS[:, None]).reshape(-1, N_DOF)
_TO_WORLD = len(_MASKS) * (len(_MASKS) - 1)


@dataclass(frozen=True)
class RefineSettings:
    """How a pose is refined.

    Parameters
    ----------
    iterations : int
        Most accepted steps.
    tolerance : float
        Stop when the cost falls by less than this share in a step.
    stay_weight : float
        Weight (square metres for a step of one prior deviation) that holds angles no data speaks of, such as the twist of a
        straight arm, where the start has them.
    """

    iterations: int = 12
    tolerance: float = 2e-3
    stay_weight: float = 4e-6


@dataclass(frozen=True)
class RefineInfo:
    """Cost before and after (square metres, the hold on the start included), and cost evaluations."""

    cost_before: float
    cost_after: float
    evaluations: int


def refine(
    body: BodyModel,
    samples: BodyPoints,
    state: np.ndarray,
    target: HullTarget,
    hull_points: np.ndarray,
    cost_settings: SymmetricSettings,
    settings: RefineSettings,
    free: np.ndarray | None = None,
    anchor: np.ndarray | None = None,
    deviation: np.ndarray | None = None,
) -> tuple[np.ndarray, RefineInfo]:
    """Move one pose to the nearest minimum of the symmetric cost.

    Parameters
    ----------
    body, samples, target, hull_points, cost_settings
        As for `hmc.pose.annealed.symmetric.symmetric_cost`.
    state : ndarray, shape (27,)
        Start.
    settings : RefineSettings
    free : ndarray of bool, shape (27,), optional
        Degrees of freedom that may move; all by default.
    anchor : ndarray, shape (27,), optional
        Pose on which the hold pulls; the start by default.
    deviation : ndarray, shape (27,), optional
        Deviations of the hold, metres and radians; .1 m and .5 rad by default.

    Returns
    -------
    state : ndarray, shape (27,)
        Within the body's joint limits.
    info : RefineInfo
    """
    free = np.ones(N_DOF, bool) if free is None else free
    low, high = body.limits.low, body.limits.high
    state = np.clip(state, low, high)
    anchor = state if anchor is None else anchor
    if deviation is None:
        deviation = np.r_[np.full(3, 0.1), np.full(N_DOF - 3, 0.5)]
    hold = settings.stay_weight / deviation**2

    def evaluate(s, before=None):
        found = _distances(body, samples, s, target, hull_points, cost_settings, before)
        return found, float(found.residuals @ found.residuals + hold @ (s - anchor) ** 2)

    found, cost = evaluate(state)
    first, evaluations, damping, accepted = cost, 1, 1e-2, 0
    improved = True
    while accepted < settings.iterations and damping < 1e4:
        if improved:
            pulled, jacobian = _pulls(found, cost_settings)
            gradient = jacobian.T @ found.residuals[pulled] + hold * (state - anchor)
            normal = jacobian.T @ jacobian + np.diag(hold)
        # An angle at its limit that wants further out takes no part in this step.
        stuck = ((state <= low) & (gradient > 0)) | ((state >= high) & (gradient < 0)) | ~free
        active = np.flatnonzero(~stuck)
        matrix = normal[np.ix_(active, active)]
        matrix = matrix + damping * np.diag(np.diag(matrix) + 1e-9)
        step = np.zeros(N_DOF)
        step[active] = -np.linalg.solve(matrix, gradient[active])
        trial = np.clip(state + np.clip(step, -0.5, 0.5), low, high)
        trial_found, trial_cost = evaluate(trial, found.pairs)
        evaluations += 1
        improved = trial_cost < cost
        if improved:
            gain = (cost - trial_cost) / max(cost, 1e-12)
            state, found, cost = trial, trial_found, trial_cost
            damping = max(damping * 0.3, 1e-4)
            accepted += 1
            if gain < settings.tolerance:
                break
        else:
            damping *= 5
    return state, RefineInfo(first, cost, evaluations)


def residual_rows(
    body: BodyModel,
    samples: BodyPoints,
    state: np.ndarray,
    target: HullTarget,
    hull_points: np.ndarray,
    settings: SymmetricSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """The symmetric cost at one state as weighted residuals, and how they change with the state.

    Parameters
    ----------
    body, samples, target, hull_points, settings
        As for `hmc.pose.annealed.symmetric.symmetric_cost`.
    state : ndarray, shape (27,)

    Returns
    -------
    residuals : ndarray, shape (n_residuals,)
        Metres; their squares sum to the cost.
    jacobian : ndarray, shape (n_residuals, 27)
        Zero where a distance is zero or beyond the cap.
    """
    distances = _distances(body, samples, state, target, hull_points, settings)
    pulled, rows = _pulls(distances, settings)
    jacobian = np.zeros((len(distances.residuals), N_DOF))
    jacobian[pulled] = rows
    return distances.residuals, jacobian


@dataclass(frozen=True)
class _Distances:
    """The distances of one state, group by group, and what it takes to tell how they change with it.

    Parameters
    ----------
    residuals : ndarray, shape (n + 27,)
        The posture's last.
    distance, cap, weight : ndarray, shape (n,)
    rows : ndarray of int, shape (m,)
        Which of these distances may change with the state.
    directions, places : tuple of ndarray, of shape (m, 3) in all
        The way in which a point has to move to add to the distance, and where the point is.
    movers : tuple of ndarray of int, of shape (m,) in all
        Rows of `_RELATIVE`.
    axes, centres : ndarray, shape (27, 3)
        The joints' twists.
    pairs : Candidates
        For poses near this one.
    """

    residuals: np.ndarray
    distance: np.ndarray
    cap: np.ndarray
    weight: np.ndarray
    rows: np.ndarray
    directions: tuple[np.ndarray, ...]
    places: tuple[np.ndarray, ...]
    movers: tuple[np.ndarray, ...]
    axes: np.ndarray
    centres: np.ndarray
    pairs: Candidates


def _distances(body, samples, state, target, hull_points, settings, before=None) -> _Distances:
    axes, centres, rotations, positions = joint_twists(body, state)
    maps = cone_maps(body.cones, np.concatenate([rotations, positions[..., None]], axis=-1)[..., None])
    carrier = samples.surface.segment
    points = np.einsum("nij,nj->ni", rotations[carrier], samples.surface.points) + positions[carrier]
    outside, slope = distance_gradient(target, points)
    pairs = candidates(body.cones, maps, hull_points, settings.cap_m, before)
    unexplained, pulls, towards, nearest, hull_places = nearest_cones(body.cones, maps, pairs)
    depth, outward, axis_places, segment, other = penetration_rows(body, samples.axes, rotations, positions, maps)
    gap, lowest, shank = np.zeros(0), np.zeros((0, 3)), np.zeros(0, int)
    if target.floor_z is not None:
        gap = floor_gap(body, rotations[None], positions[None], target.floor_z)
        _, lowest, shank = lowest_support(body, rotations[None], positions[None])

    sizes = np.array([len(outside), len(unexplained), len(depth), len(gap)])
    shares = np.array([1, settings.explain_weight, settings.overlap_weight, settings.floor_weight]) / np.maximum(sizes, 1)
    distance = np.concatenate([outside, unexplained, depth, gap])
    weight = np.repeat(np.sqrt(shares), sizes)
    cap = np.repeat([settings.cap_m, settings.cap_m, np.inf, np.inf], sizes)
    return _Distances(
        residuals=np.concatenate([weight * np.minimum(distance, cap), _posture(state, settings)]),
        distance=distance,
        cap=cap,
        weight=weight,
        rows=np.concatenate([np.arange(len(outside)), len(outside) + pulls, np.arange(len(outside) + len(unexplained), len(distance))]),
        directions=(slope, towards, -outward, np.tile([0.0, 0.0, 1.0], (len(gap), 1))),
        places=(points, hull_places, axis_places, lowest),
        # What carries both parts leaves them where they are to one another.
        movers=(_TO_WORLD + carrier, _TO_WORLD + nearest, len(_MASKS) * other + segment, _TO_WORLD + shank),
        axes=axes,
        centres=centres,
        pairs=pairs,
    )


def _pulls(found: _Distances, settings: SymmetricSettings) -> tuple[np.ndarray, np.ndarray]:
    """Which residuals change with the state, and how: shapes (m,) and (m, 27)."""
    distance = found.distance[found.rows]
    chosen = np.flatnonzero((distance != 0) & (distance < found.cap[found.rows]))
    rows = found.rows[chosen]
    wrenches = np.empty((len(rows), 6))
    directions = np.concatenate(found.directions).take(chosen, axis=0)
    directions *= found.weight[rows, None]
    # g . (axis x (p - centre)) = (p x g) . axis - g . (axis x centre)
    wrenches[:, :3] = _cross(np.concatenate(found.places).take(chosen, axis=0), directions)
    wrenches[:, 3:] = directions
    twists = np.concatenate([found.axes, -_cross(found.axes, found.centres)], axis=1)
    twists[:3] = np.eye(6)[3:]  # translations
    jacobian = np.empty((len(rows) + N_DOF, N_DOF))
    np.matmul(wrenches, twists.T, out=jacobian[:-N_DOF])
    jacobian[:-N_DOF] *= _RELATIVE.take(np.concatenate(found.movers).take(chosen), axis=0)
    jacobian[-N_DOF:] = np.diag(np.sqrt(settings.posture_weight) / POSTURE[1])
    return np.concatenate([rows, len(found.distance) + np.arange(N_DOF)]), jacobian


def residual_values(
    body: BodyModel,
    samples: BodyPoints,
    state: np.ndarray,
    target: HullTarget,
    hull_points: np.ndarray,
    settings: SymmetricSettings,
) -> np.ndarray:
    """The residuals of `residual_rows` alone, at a fraction of the work."""
    rotations, positions = segment_transforms(body, state)
    surface = samples.surface
    outside, _ = distance_gradient(target, place_points(rotations, positions, surface.points, surface.segment))
    depth = penetration_depth(body, samples.axes, rotations[None], positions[None])[0]
    unexplained = body_distance(body, state[None], hull_points)[0]
    cap = settings.cap_m
    floor = np.zeros(0) if target.floor_z is None else floor_gap(body, rotations[None], positions[None], target.floor_z)
    return np.concatenate(
        [
            np.sqrt(1 / len(outside)) * np.minimum(outside, cap).astype(float),
            np.sqrt(settings.explain_weight / len(hull_points)) * np.minimum(unexplained, cap).astype(float),
            np.sqrt(settings.overlap_weight / len(depth)) * depth,
            np.sqrt(settings.floor_weight) * floor,
            _posture(state, settings),
        ]
    )


def _posture(state: np.ndarray, settings: SymmetricSettings) -> np.ndarray:
    return np.sqrt(settings.posture_weight) * (state - POSTURE[0]) / POSTURE[1]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of rows; `numpy.cross` spends more time on its arguments than on the product."""
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)
