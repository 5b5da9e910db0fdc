"""Local least-squares refinement of a pose: Gauss-Newton steps with damping on the symmetric cost's distances.

Each body-surface sample outside the tolerant hull pulls its segment back along the hull's distance field; each point of the
strict hull's surface outside the body pulls the nearest cone towards itself. Both move with the twists of the joints
(Canton 2009, Eq. A.1), so the Jacobian needs no differences; it takes the flesh as round and straight near each point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.annealed.floor import floor_gap, lowest_support
from hmc.pose.annealed.hull_target import HullTarget, distance_gradient
from hmc.pose.annealed.penetration import penetration_depth, penetration_rows
from hmc.pose.annealed.symmetric import POSTURE, BodyPoints, SymmetricSettings, body_distance
from hmc.pose.body.flesh import place_points
from hmc.pose.body.joints import N_DOF
from hmc.pose.body.kinematics import dof_masks, joint_twists, segment_transforms
from hmc.pose.body.model import BodyModel

__all__ = ["RefineInfo", "RefineSettings", "refine", "residual_rows", "residual_values"]

_MASKS = dof_masks().astype(float)


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

    def evaluate(s):
        residuals, jacobian = residual_rows(body, samples, s, target, hull_points, cost_settings)
        offset = s - anchor
        cost = float(residuals @ residuals + hold @ offset**2)
        return jacobian.T @ residuals + hold * offset, jacobian.T @ jacobian + np.diag(hold), cost

    gradient, normal, cost = evaluate(state)
    first, evaluations, damping, accepted = cost, 1, 1e-2, 0
    while accepted < settings.iterations and damping < 1e4:
        # An angle at its limit that wants further out takes no part in this step.
        stuck = ((state <= low) & (gradient > 0)) | ((state >= high) & (gradient < 0)) | ~free
        active = np.flatnonzero(~stuck)
        matrix = normal[np.ix_(active, active)]
        matrix = matrix + damping * np.diag(np.diag(matrix) + 1e-9)
        step = np.zeros(N_DOF)
        step[active] = -np.linalg.solve(matrix, gradient[active])
        trial = np.clip(state + np.clip(step, -0.5, 0.5), low, high)
        trial_gradient, trial_normal, trial_cost = evaluate(trial)
        evaluations += 1
        if trial_cost < cost:
            gain = (cost - trial_cost) / max(cost, 1e-12)
            state, gradient, normal, cost = trial, trial_gradient, trial_normal, trial_cost
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
    axes, centres, rotations, positions = joint_twists(body, state)
    moments = _cross(axes, centres)
    surface = samples.surface
    points = place_points(rotations, positions, surface.points, surface.segment)
    value, slope = distance_gradient(target, points)
    residuals, jacobians = [], []
    for distance, direction, where, segment, weight in (
        (value, slope, points, surface.segment, 1.0 / len(points)),
        (*_hull_to_body(body, rotations, positions, hull_points), settings.explain_weight / len(hull_points)),
    ):
        # g . (axis x (p - centre)) = (p x g) . axis - g . (axis x centre)
        jacobian = _cross(where, direction) @ axes.T - direction @ moments.T
        jacobian[:, :3] = direction
        pull = (distance > 0) & (distance < settings.cap_m)
        jacobian *= _MASKS[segment] * (np.sqrt(weight) * pull)[:, None]
        residuals.append(np.sqrt(weight) * np.minimum(distance, settings.cap_m))
        jacobians.append(jacobian)
    depth, outward, where, segment, other = penetration_rows(body, samples.axes, rotations, positions)
    weight = np.sqrt(settings.overlap_weight / len(depth))
    jacobian = _cross(where, outward) @ axes.T - outward @ moments.T
    # What carries both parts leaves them where they are to one another.
    jacobian *= (_MASKS[other] - _MASKS[segment]) * (weight * (depth > 0))[:, None]
    residuals.append(weight * depth)
    jacobians.append(jacobian)
    if target.floor_z is not None:
        gap = floor_gap(body, rotations[None], positions[None], target.floor_z)
        _, lowest, carrier = lowest_support(body, rotations[None], positions[None])
        up = np.array([[0.0, 0.0, 1.0]])
        jacobian = _cross(lowest, up) @ axes.T - up @ moments.T
        jacobian[:, :3] = up
        residuals.append(np.sqrt(settings.floor_weight) * gap)
        jacobians.append(jacobian * _MASKS[carrier] * np.sqrt(settings.floor_weight) * (gap != 0))
    residuals.append(_posture(state, settings))
    jacobians.append(np.diag(np.sqrt(settings.posture_weight) / POSTURE[1]))
    return np.concatenate(residuals), np.concatenate(jacobians)


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


def _hull_to_body(body: BodyModel, rotations, positions, points):
    """Distance of hull points to the nearest cone; how it changes when that cone moves (minus the outward direction)."""
    cones = body.cones
    turn = cones.bases @ np.swapaxes(rotations[cones.segment], -1, -2)
    start = positions[cones.segment] + (rotations[cones.segment] @ cones.start[..., None])[..., 0]
    shift = (turn @ start[..., None])[..., 0]
    local = (turn.reshape(-1, 3) @ points.T).reshape(len(turn), 3, -1) - shift[..., None]
    x, y, along = local[:, 0], local[:, 1], local[:, 2]
    length = cones.lengths[:, None]
    clipped = np.clip(along, 0, length)
    beyond = along - clipped
    t = clipped / length
    first, slope = cones.radii[:, 0], cones.radii[:, 1] - cones.radii[:, 0]
    level = (x / (first[:, :1] + slope[:, :1] * t)) ** 2 + (y / (first[:, 1:] + slope[:, 1:] * t)) ** 2
    shrink = 1 - 1 / np.sqrt(np.maximum(level, 1.0))
    squared = (x * x + y * y) * shrink**2 + beyond**2
    nearest = squared.argmin(0)
    k = np.arange(len(points))
    distance = np.sqrt(squared[nearest, k])
    shrink = shrink[nearest, k]
    outward = np.stack([x[nearest, k] * shrink, y[nearest, k] * shrink, beyond[nearest, k]], -1)
    outward /= np.maximum(distance, 1e-9)[:, None]
    direction = (outward[:, None, :] @ turn[nearest])[:, 0]
    return distance, -direction, points, cones.segment[nearest]
