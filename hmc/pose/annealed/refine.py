"""Local least-squares refinement of a pose: Gauss-Newton steps with damping on the symmetric cost's distances.

Each body-surface sample outside the tolerant hull pulls its segment back along the hull's distance field; each point of the
strict hull's surface outside the body, and each ray that misses it, pulls the nearest cone towards itself. Both move with
the twists of the joints (Canton 2009, Eq. A.1), so the Jacobian needs no differences; it takes
the flesh as round and straight near each point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.pose.annealed.cone_maps import ConeMaps, cone_maps
from hmc.pose.annealed.floor import above_floor, lowest_support
from hmc.pose.annealed.hull_target import HullTarget, distance_gradient
from hmc.pose.annealed.nearest_cone import Candidates, Nearest, candidates, nearest_cones, towards
from hmc.pose.annealed.penetration import penetration_rows
from hmc.pose.annealed.symmetric import POSTURE, BodyPoints, SymmetricSettings, posture_spread
from hmc.pose.body.joints import N_DOF
from hmc.pose.body.kinematics import dof_masks, joint_twists
from hmc.pose.body.model import BodyModel

__all__ = ["RefineInfo", "RefineSettings", "refine", "refine_best", "residual_rows", "residual_values"]

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
        Stop when the cost falls by less than this share in a step, or none is left that promises more.
    stay_weight : float
        Weight (square metres for a step of one prior deviation) that holds angles no data speaks of, such as the twist of a
        straight arm, where the start has them.
    """

    iterations: int = 12
    tolerance: float = 2e-3
    stay_weight: float = 4e-6


@dataclass(frozen=True)
class RefineInfo:
    """What a refinement came to.

    Parameters
    ----------
    cost_before, cost_after : float
        Square metres, the hold included.
    cost : float
        The symmetric cost alone, afterwards, square metres.
    evaluations : int
        Of the cost.
    """

    cost_before: float
    cost_after: float
    cost: float
    evaluations: int


@dataclass(frozen=True)
class _Problem:
    """What stays the same while a pose descends; as the arguments of `refine`, with the weights of the hold, shape (27,)."""

    body: BodyModel
    samples: BodyPoints
    target: HullTarget
    hull_points: np.ndarray
    cost_settings: SymmetricSettings
    settings: RefineSettings
    free: np.ndarray
    hold: np.ndarray


@dataclass(frozen=True)
class _Descent:
    """How far a pose has come: its distances and costs, the damping of the next step, and what is to be told in the end."""

    state: np.ndarray
    anchor: np.ndarray
    found: _Distances
    cost: float
    first: float
    evaluations: int = 1
    accepted: int = 0
    damping: float = 1e-2
    is_done: bool = False


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
    problem = _Problem(
        body, samples, target, hull_points, cost_settings, settings, _free(free), settings.stay_weight / _deviation(deviation) ** 2
    )
    return _outcome(_descend(problem, _begin(problem, state, anchor), settings.iterations))


def refine_best(
    body: BodyModel,
    samples: BodyPoints,
    starts: Sequence[np.ndarray],
    target: HullTarget,
    hull_points: np.ndarray,
    cost_settings: SymmetricSettings,
    settings: RefineSettings,
    anchor: np.ndarray | None = None,
    trial_steps: int = 3,
    is_hopeless: Callable[[np.ndarray, float], bool] | None = None,
) -> tuple[np.ndarray, RefineInfo]:
    """Refine several starts by some steps each, and the one that is best then to the end.

    Parameters
    ----------
    body, samples, target, hull_points, cost_settings, settings
        As for `refine`.
    starts : sequence of ndarray, shape (27,)
    anchor : ndarray, shape (27,), optional
        As for `refine`; each start's own by default.
    trial_steps : int
        Accepted steps after which the best goes on alone.
    is_hopeless : callable, optional
        Told the best state after its first steps and its cost (square metres, the hold included): whether to leave it there.

    Returns
    -------
    state : ndarray, shape (27,)
    info : RefineInfo
        Of the best, with the evaluations of all.
    """
    problem = _Problem(
        body, samples, target, hull_points, cost_settings, settings, _free(None), settings.stay_weight / _deviation(None) ** 2
    )
    trials: list[_Descent] = []
    for start in starts:
        begun = _begin(problem, start, anchor, trials[-1].found.pairs if trials else None)
        trials.append(_descend(problem, begun, trial_steps))
    best = min(trials, key=lambda trial: trial.cost)
    before = sum(trial.evaluations for trial in trials) - best.evaluations
    if is_hopeless is None or not is_hopeless(best.state, best.cost):
        best = _descend(problem, best, settings.iterations)
    state, info = _outcome(best)
    return state, replace(info, evaluations=info.evaluations + before)


def _free(free: np.ndarray | None) -> np.ndarray:
    return np.ones(N_DOF, bool) if free is None else free


def _deviation(deviation: np.ndarray | None) -> np.ndarray:
    return np.r_[np.full(3, 0.1), np.full(N_DOF - 3, 0.5)] if deviation is None else deviation


def _outcome(descent: _Descent) -> tuple[np.ndarray, RefineInfo]:
    cost = float(descent.found.residuals @ descent.found.residuals)
    return descent.state, RefineInfo(descent.first, descent.cost, cost, descent.evaluations)


def _begin(problem: _Problem, state: np.ndarray, anchor: np.ndarray | None, before: Candidates | None = None) -> _Descent:
    state = np.clip(state, problem.body.limits.low, problem.body.limits.high)
    anchor = state if anchor is None else anchor
    found, cost = _evaluate(problem, state, anchor, before)
    return _Descent(state, anchor, found, cost, cost)


def _evaluate(problem: _Problem, state: np.ndarray, anchor: np.ndarray, before: Candidates | None = None) -> tuple[_Distances, float]:
    found = _distances(problem.body, problem.samples, state, problem.target, problem.hull_points, problem.cost_settings, before)
    return found, float(found.residuals @ found.residuals + problem.hold @ (state - anchor) ** 2)


def _descend(problem: _Problem, descent: _Descent, accepted: int) -> _Descent:
    """Go on until so many steps were accepted, or nothing is to be gained."""
    low, high, hold = problem.body.limits.low, problem.body.limits.high, problem.hold
    improved = True
    while descent.accepted < accepted and not descent.is_done:
        state, found = descent.state, descent.found
        if improved:
            pulled, jacobian = _pulls(problem.body, problem.samples, found, problem.cost_settings)
            gradient = jacobian.T @ found.residuals[pulled] + hold * (state - descent.anchor)
            normal = jacobian.T @ jacobian + np.diag(hold)
            # An angle at its limit that wants further out takes no part in this step.
            stuck = ((state <= low) & (gradient > 0)) | ((state >= high) & (gradient < 0)) | ~problem.free
            active = np.flatnonzero(~stuck)
            normal = normal[np.ix_(active, active)]
        matrix = normal + descent.damping * np.diag(np.diag(normal) + 1e-9)
        step = np.zeros(N_DOF)
        step[active] = -np.linalg.solve(matrix, gradient[active])
        promised = -step[active] @ (2 * gradient[active] + normal @ step[active])
        if promised < problem.settings.tolerance * descent.cost:
            return replace(descent, is_done=True)
        trial = np.clip(state + np.clip(step, -0.5, 0.5), low, high)
        trial_found, trial_cost = _evaluate(problem, trial, descent.anchor, found.pairs)
        improved = trial_cost < descent.cost
        descent = replace(descent, evaluations=descent.evaluations + 1)
        if improved:
            gain = (descent.cost - trial_cost) / max(descent.cost, 1e-12)
            descent = replace(
                descent,
                state=trial,
                found=trial_found,
                cost=trial_cost,
                damping=max(descent.damping * 0.3, 1e-4),
                accepted=descent.accepted + 1,
                is_done=gain < problem.settings.tolerance,
            )
        else:
            descent = replace(descent, damping=max(descent.damping * 10, 1e-2))
    return descent


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
    pulled, rows = _pulls(body, samples, distances, settings)
    jacobian = np.zeros((len(distances.residuals), N_DOF))
    jacobian[pulled] = rows
    return distances.residuals, jacobian


@dataclass(frozen=True)
class _Distances:
    """The distances of one state, group by group, and what it takes to tell how they change with it.

    Parameters
    ----------
    residuals : ndarray, shape (n + 27,)
        Weighted: of the body's surface, of what is to be explained, of the axes' depth, of the floor, and of the posture.
    weights : ndarray, shape (4,)
        Of the first four.
    axes, centres : ndarray, shape (27, 3)
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
        As from `lowest_support`; empty where there is no floor.
    spread : ndarray, shape (27,)
        Of the posture (`posture_spread`), radians.
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


def _distances(body, samples, state, target, hull_points, settings, before=None) -> _Distances:
    axes, centres, rotations, positions = joint_twists(body, state)
    maps = cone_maps(body.cones, np.concatenate([rotations, positions[..., None]], axis=-1)[..., None])
    carrier = samples.surface.segment
    points = np.einsum("nij,nj->ni", rotations.take(carrier, axis=0), samples.surface.points)
    points += positions.take(carrier, axis=0)
    outside, slope = distance_gradient(target, points)
    pairs = candidates(body.cones, maps, hull_points, settings.cap_m, before)
    nearest = nearest_cones(body.cones, maps, pairs)
    depth, outward, axis_points, segment, other = penetration_rows(body, samples.axes, rotations, positions, maps)
    gap, floor = np.zeros(0), (np.zeros(0), np.zeros((0, 3)), np.zeros(0, int))
    if target.floor_z is not None:
        floor = lowest_support(body, rotations[None], positions[None])
        gap = above_floor(floor[0], target.floor_z)
    sizes = np.array([len(outside), len(nearest.distance), len(depth), 1])
    weights = np.sqrt(np.array([1, settings.explain_weight, settings.overlap_weight, settings.floor_weight]) / sizes)
    spread = posture_spread(state)
    residuals = [
        weights[0] * np.minimum(outside, settings.cap_m),
        weights[1] * np.minimum(nearest.distance, settings.cap_m),
        weights[2] * depth,
        weights[3] * gap,
        np.sqrt(settings.posture_weight) * (state - POSTURE[0]) / spread,
    ]
    return _Distances(
        np.concatenate(residuals), weights, axes, centres, maps, pairs, points, slope, outside, nearest, depth, outward, axis_points,
        segment, other, floor, spread,
    )  # fmt: skip


def _pulls(body: BodyModel, samples: BodyPoints, found: _Distances, settings: SymmetricSettings) -> tuple[np.ndarray, np.ndarray]:
    """Which residuals change with the state, and how: shapes (m,) and (m, 27)."""
    n_outside, n_explain = len(found.outside), len(found.nearest.distance)
    out = np.flatnonzero((found.outside > 0) & (found.outside < settings.cap_m))
    pulled = found.nearest.distance[found.nearest.pulls]
    explain = np.flatnonzero((pulled > 0) & (pulled < settings.cap_m))
    deep = np.flatnonzero(found.depth)
    gap = np.flatnonzero(found.residuals[n_outside + n_explain + len(found.depth) : -N_DOF])
    # The way in which a point has to move to add to the distance, where the point is, and what moves it: a row of `_RELATIVE`.
    directions = [
        found.weights[0] * found.slope[out],
        found.weights[1] * towards(found.maps, found.nearest, explain),
        -found.weights[2] * found.outward[deep],
    ]
    places = [found.points[out], found.nearest.places[explain], found.axis_points[deep]]
    # What carries both parts leaves them where they are to one another.
    movers = [
        _TO_WORLD + samples.surface.segment[out],
        _TO_WORLD + body.cones.segment[found.nearest.cone[explain]],
        len(_MASKS) * found.other[deep] + found.segment[deep],
    ]
    if len(gap):
        _, lowest, shank = found.floor
        directions.append(np.array([[0.0, 0.0, found.weights[3]]]))
        places.append(lowest)
        movers.append(_TO_WORLD + shank)
    rows = [out, n_outside + found.nearest.pulls[explain], n_outside + n_explain + deep, n_outside + n_explain + len(found.depth) + gap]
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


def residual_values(
    body: BodyModel,
    samples: BodyPoints,
    state: np.ndarray,
    target: HullTarget,
    hull_points: np.ndarray,
    settings: SymmetricSettings,
) -> np.ndarray:
    """The residuals of `residual_rows` alone, at less of the work."""
    return _distances(body, samples, state, target, hull_points, settings).residuals


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of rows; `numpy.cross` spends more time on its arguments than on the product."""
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)
