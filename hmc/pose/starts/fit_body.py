"""The person's own dimensions: lengths and girths fitted together with the poses of some frames.

The thesis scales one table by the stature and leaves the fit open (Canton 2009, section 9.2). Here the body's shape
(`hmc.body.dimensions.reshaped`) and the poses of all frames are found together by damped Gauss-Newton steps on the symmetric
cost; a Gaussian prior keeps the dimensions near the average person's. The poses are eliminated frame by frame (Schur
complement), so the work grows linearly with the frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hmc.body.dimensions import FITTED, FitBodySettings, highest_shape, prior_deviations, reshaped, whole_deviations
from hmc.body.joints import N_DOF, JointLimits
from hmc.body.model import BodyModel
from hmc.pose.objectives.objective import Objective
from hmc.pose.objectives.residuals import residual_rows
from hmc.pose.objectives.symmetric import body_points
from hmc.processes import share_out
from hmc.search.gauss_newton import damped, movable

__all__ = ["WORTH_IT", "FitBodyInfo", "fit_body", "of_a_start", "with_known_stature"]

#: Deviation of the stature's logarithm where the stature was given.
KNOWN_STATURE = 0.0075
#: Deviation of asymmetries at a start, which may have taken one leg for the other: only a whole run tells which is longer.
SIDES_UNKNOWN = 1e-3
#: A fitted body is taken where it lowers the cost to this share at most.
WORTH_IT = 0.97

Coordinates = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class FitBodyInfo:
    """What a fit came to.

    Parameters
    ----------
    cost_before, cost_after : float
        Mean of a frame, square metres.
    deviations : tuple of n_fitted floats
        How well the frames and the prior tell each dimension (`hmc.body.dimensions.whole_deviations`), by the weight of the prior against
        the cost.
    """

    cost_before: float
    cost_after: float
    deviations: tuple[float, ...]


@dataclass(frozen=True)
class _Prior:
    """What holds poses and dimensions where the data says little.

    Parameters
    ----------
    anchors : ndarray, shape (n_frames, 37)
        Poses near which those of the frames stay.
    hold : ndarray, shape (37,)
        Cost of a squared unit away from them.
    precision : ndarray, shape (n_fitted,)
        Cost a frame of a squared change of the shape.
    highest : ndarray, shape (n_fitted,)
        The largest change of each.
    """

    anchors: np.ndarray
    hold: np.ndarray
    precision: np.ndarray
    highest: np.ndarray


def with_known_stature(settings: FitBodySettings, known: bool) -> FitBodySettings:
    """Settings by which the fit changes the stature little, where it is known."""
    return replace(settings, scale_deviation=KNOWN_STATURE) if known else settings


def of_a_start(settings: FitBodySettings, known: bool) -> FitBodySettings:
    """Settings by which a start fits a body, both sides alike; whether the stature is known."""
    return with_known_stature(replace(settings, asymmetry_deviation=SIDES_UNKNOWN), known)


def fit_body(
    objectives: Sequence[Objective], states: np.ndarray, coordinates: Coordinates, settings: FitBodySettings, workers: int = 1
) -> tuple[BodyModel, np.ndarray, FitBodyInfo]:
    """One person's body with dimensions fitted to several frames.

    Parameters
    ----------
    objectives : sequence of Objective
        One a frame, all of one body: the start and the centre of the prior.
    states : ndarray, shape (n_frames, 37)
        Poses to start from.
    coordinates : tuple of ndarray
        Where the surface is sampled (`hmc.body.flesh.surface_coordinates`).
    settings : FitBodySettings
    workers : int
        Processes over which the frames are spread.

    Returns
    -------
    body : BodyModel
    states : ndarray, shape (n_frames, 37)
    info : FitBodyInfo
    """
    body = objectives[0].body
    hold = 1e-6 / np.r_[np.full(3, 0.05), np.full(N_DOF - 3, 0.25)] ** 2
    precision = settings.prior_weight / prior_deviations(settings) ** 2
    states = np.clip(states, body.limits.low, body.limits.high)
    prior = _Prior(states, hold, precision, highest_shape(body))
    shape = np.zeros(len(FITTED))

    def with_shape(shape: np.ndarray) -> list[Objective]:
        other = reshaped(body, shape)
        samples = body_points(other, coordinates)
        return [one.of_body(other, samples) for one in objectives]

    def rows(shape, states, found):
        """Residuals of each frame (`found`), and how they change with the pose and with the dimensions."""
        step = 0.01
        beside = [with_shape(shape + step * unit) for unit in np.eye(len(shape))]

        def of_frames(lot):
            out = []
            for k in lot:
                residual, jacobian = residual_rows(found[k])
                by_shape = [other[k].linearise(states[k], found[k].near).residuals for other in beside]
                out.append((residual, jacobian, (np.array(by_shape).T - residual[:, None]) / step))
            return out

        n = min(workers, len(states))
        lots = [range(k, len(states), n) for k in range(n)]
        told = share_out([partial(of_frames, lot) for lot in lots], workers)
        return [told[k % n][k // n] for k in range(len(states))]

    def costs(shape, states, near):
        """The cost of all and of the data a frame, and each frame's residuals, which are told more quickly near others."""
        found = [one.linearise(state, there) for one, state, there in zip(with_shape(shape), states, near, strict=True)]
        fit = sum(float(one.residuals @ one.residuals) for one in found)
        total = fit + float((prior.hold * (states - prior.anchors) ** 2).sum()) + len(states) * float(prior.precision @ shape**2)
        return total, fit / len(states), found

    total, before, found = costs(shape, states, [None] * len(states))
    after, damping = before, 1e-2
    covariance = np.diag(prior_deviations(settings) ** 2)
    for _ in range(settings.iterations):
        frames, near = rows(shape, states, found), [one.near for one in found]
        told, _, _ = _without_poses(frames, shape, states, prior, 0.0, body.limits)
        covariance = len(states) * settings.prior_weight * np.linalg.inv(told)
        for _ in range(4):
            trial_shape, trial_states = _gauss_newton(frames, shape, states, prior, damping, body.limits)
            trial_total, trial_fit, trial_found = costs(trial_shape, trial_states, near)
            if trial_total < total:
                break
            damping *= 8
        else:
            break
        gain = (total - trial_total) / total
        shape, states, total, after, found = trial_shape, trial_states, trial_total, trial_fit, trial_found
        damping = max(0.3 * damping, 1e-3)
        if gain < 3e-3:
            break
    return reshaped(body, shape), states, FitBodyInfo(before, after, tuple(whole_deviations(covariance).tolist()))


def _without_poses(frames, shape: np.ndarray, states: np.ndarray, prior: _Prior, damping: float, limits: JointLimits):
    """Normal matrix and gradient of the shape, the poses eliminated; and of each frame what moves, and how by the shape and by itself."""
    n_shape = len(shape)
    matrix = np.diag(len(states) * prior.precision)
    gradient = len(states) * prior.precision * shape
    solved = []
    for (residual, by_pose, by_shape), state, anchor in zip(frames, states, prior.anchors, strict=True):
        pose_gradient = by_pose.T @ residual + prior.hold * (state - anchor)
        free = movable(state, pose_gradient, limits.low, limits.high)
        normal = damped(by_pose[:, free].T @ by_pose[:, free] + np.diag(prior.hold[free]), damping)
        cross = by_pose[:, free].T @ by_shape
        inverse = np.linalg.solve(normal, np.column_stack([cross, pose_gradient[free]]))
        matrix += by_shape.T @ by_shape - cross.T @ inverse[:, :n_shape]
        gradient += by_shape.T @ residual - cross.T @ inverse[:, n_shape]
        solved.append((free, inverse))
    return matrix, gradient, solved


def _gauss_newton(frames, shape: np.ndarray, states: np.ndarray, prior: _Prior, damping: float, limits: JointLimits):
    """One damped step of shape and poses together, the poses eliminated."""
    n_shape = len(shape)
    matrix, gradient, solved = _without_poses(frames, shape, states, prior, damping, limits)
    moving = movable(shape, gradient, np.full(n_shape, -np.inf), prior.highest)
    step = np.zeros(n_shape)
    step[moving] = np.clip(-np.linalg.solve(damped(matrix[np.ix_(moving, moving)], damping, least=0.0), gradient[moving]), -0.1, 0.1)
    step = np.minimum(step, prior.highest - shape)
    new_states = states.copy()
    for row, (free, inverse) in zip(new_states, solved, strict=True):
        row[free] += np.clip(-inverse[:, n_shape] - inverse[:, :n_shape] @ step, -0.3, 0.3)
    return shape + step, np.clip(new_states, limits.low, limits.high)
