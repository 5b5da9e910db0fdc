"""The person's own dimensions: lengths and girths fitted together with the poses of some frames.

The thesis scales one table by the stature and leaves the fit open (Canton 2009, section 9.2). Here the logarithms of the
dimensions and the poses of all frames are found together by damped Gauss-Newton steps on the symmetric cost; a Gaussian
prior keeps the dimensions near the average person's. The poses are eliminated frame by frame (Schur complement), so the
work grows linearly with the frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.body.joints import N_DOF
from hmc.body.model import BodyModel
from hmc.body.proportions import make_body
from hmc.pose.objectives.residuals import residual_rows, residual_values
from hmc.pose.objectives.symmetric import SymmetricSettings, body_points
from hmc.pose.views.hull_target import HullTarget
from hmc.search.gauss_newton import damped, movable

__all__ = ["FitBodyInfo", "FitBodySettings", "fit_body"]

Coordinates = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class FitBodySettings:
    """How a body is fitted.

    Parameters
    ----------
    iterations : int
        Gauss-Newton steps.
    scale_deviation : float
        Prior deviation of the common scale's logarithm: how far the stature may be off.
    length_deviation, girth_deviation : float
        Prior deviations of the logarithms of single lengths and girths, from what they are at the common scale.
    prior_weight : float
        Square metres that one prior deviation in one dimension costs.
    """

    iterations: int = 8
    scale_deviation: float = 0.04
    length_deviation: float = 0.07
    girth_deviation: float = 0.20
    prior_weight: float = 4e-6


@dataclass(frozen=True)
class FitBodyInfo:
    """Mean cost a frame (square metres) before and after, and whether the fitted body is the one returned."""

    cost_before: float
    cost_after: float
    accepted: bool


#: Fitted dimensions. Hand, foot and ankle height only follow the common scale: hulls show them badly.
_LENGTHS = ("trunk", "head", "shoulder_half_width", "shoulder_drop", "hip_half_width", "upper_arm", "forearm", "thigh", "shank")
_GIRTHS = ("girth_torso", "girth_depth", "girth_head", "girth_arms", "girth_thighs", "girth_shanks")
_FITTED = ("height", *_LENGTHS, *_GIRTHS)


def fit_body(
    body: BodyModel,
    coordinates: Coordinates,
    states: np.ndarray,
    targets: Sequence[HullTarget],
    hull_points: Sequence[np.ndarray],
    cost_settings: SymmetricSettings,
    settings: FitBodySettings,
) -> tuple[BodyModel, np.ndarray, FitBodyInfo]:
    """Fit one person's dimensions to several frames.

    Parameters
    ----------
    body : BodyModel
        Start and centre of the prior.
    coordinates : tuple of ndarray
        Where the surface is sampled (`hmc.body.flesh.surface_coordinates`).
    states : ndarray, shape (n_frames, 27)
        Poses to start from.
    targets, hull_points : sequence
        One a frame.
    cost_settings : SymmetricSettings
    settings : FitBodySettings

    Returns
    -------
    body : BodyModel
    states : ndarray, shape (n_frames, 27)
    info : FitBodyInfo
    """
    low, high = body.limits.low, body.limits.high
    hold = 4e-6 / np.r_[np.full(3, 0.1), np.full(N_DOF - 3, 0.5)] ** 2
    precision = settings.prior_weight / np.array(
        [settings.scale_deviation**2] + [settings.length_deviation**2] * len(_LENGTHS) + [settings.girth_deviation**2] * len(_GIRTHS)
    )
    anchors = states = np.clip(states, low, high)
    shape = np.zeros(len(_FITTED))

    def rows(shape, states):
        bodies = [_reshaped(body, shape)]
        step = 0.01
        bodies += [_reshaped(body, shape + step * unit) for unit in np.eye(len(shape))]
        surfaces = [body_points(one, coordinates) for one in bodies]
        out = []
        for state, target, points in zip(states, targets, hull_points, strict=True):
            residual, jacobian = residual_rows(bodies[0], surfaces[0], state, target, points, cost_settings)
            by_shape = [residual_values(b, s, state, target, points, cost_settings) for b, s in zip(bodies[1:], surfaces[1:], strict=True)]
            out.append((residual, jacobian, (np.array(by_shape).T - residual[:, None]) / step))
        return out

    def costs(shape, states):
        one = _reshaped(body, shape)
        samples = body_points(one, coordinates)
        data = [residual_values(one, samples, s, t, p, cost_settings) for s, t, p in zip(states, targets, hull_points, strict=True)]
        fit = sum(float(r @ r) for r in data)
        total = fit + float((hold * (states - anchors) ** 2).sum()) + len(states) * float(precision @ shape**2)
        return total, fit / len(states)

    total, before = costs(shape, states)
    after, damping = before, 1e-2
    for _ in range(settings.iterations):
        frames = rows(shape, states)
        for _ in range(4):
            trial_shape, trial_states = _gauss_newton(frames, shape, states, anchors, hold, precision, damping, low, high)
            trial_total, trial_fit = costs(trial_shape, trial_states)
            if trial_total < total:
                break
            damping *= 8
        else:
            break
        gain = (total - trial_total) / total
        shape, states, total, after = trial_shape, trial_states, trial_total, trial_fit
        damping = max(0.3 * damping, 1e-3)
        if gain < 3e-3:
            break
    return _reshaped(body, shape), states, FitBodyInfo(before, after, True)


def _reshaped(body: BodyModel, shape: np.ndarray) -> BodyModel:
    factors = dict(zip(_FITTED, np.exp(shape), strict=True))
    dimensions = {}
    for name, value in body.dimensions.items():
        if name.startswith("girth_"):
            dimensions[name] = value * factors[name]
        elif name == "height":
            dimensions[name] = value * factors["height"]
        else:
            dimensions[name] = value * factors["height"] * factors.get(name, 1.0)
    return make_body(dimensions, body.limits)


def _gauss_newton(frames, shape, states, anchors, hold, precision, damping, low, high):
    """One damped step of shape and poses together, the poses eliminated."""
    n_shape = len(shape)
    matrix = np.diag(len(states) * precision)
    gradient = len(states) * precision * shape
    solved = []
    for (residual, by_pose, by_shape), state, anchor in zip(frames, states, anchors, strict=True):
        pose_gradient = by_pose.T @ residual + hold * (state - anchor)
        free = movable(state, pose_gradient, low, high)
        normal = damped(by_pose[:, free].T @ by_pose[:, free] + np.diag(hold[free]), damping)
        cross = by_pose[:, free].T @ by_shape
        inverse = np.linalg.solve(normal, np.column_stack([cross, pose_gradient[free]]))
        matrix += by_shape.T @ by_shape - cross.T @ inverse[:, :n_shape]
        gradient += by_shape.T @ residual - cross.T @ inverse[:, n_shape]
        solved.append((free, inverse))
    step = np.clip(-np.linalg.solve(damped(matrix, damping, least=0.0), gradient), -0.1, 0.1)
    new_states = states.copy()
    for row, (free, inverse) in zip(new_states, solved, strict=True):
        row[free] += np.clip(-inverse[:, n_shape] - inverse[:, :n_shape] @ step, -0.3, 0.3)
    return shape + step, np.clip(new_states, low, high)
