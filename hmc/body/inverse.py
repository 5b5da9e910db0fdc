"""Inverse kinematics: the state whose landmarks lie nearest to given ones."""

from __future__ import annotations

import numpy as np

from hmc.body.joints import N_DOF
from hmc.body.kinematics import dof_masks, joint_twists
from hmc.body.model import BodyModel
from hmc.body.proportions import landmark_segments

__all__ = ["fit_landmarks"]

_SEGMENTS = landmark_segments()
_MASKS = dof_masks()[_SEGMENTS].astype(float)


def fit_landmarks(
    body: BodyModel, points: np.ndarray, start: np.ndarray, iterations: int = 40, stay: float = 1e-4
) -> tuple[np.ndarray, float]:
    """Least squares over the landmarks, within the joint limits, by damped Gauss-Newton steps.

    Parameters
    ----------
    body : BodyModel
    points : ndarray, shape (15, 3)
        World, metres; NaN where a landmark is not known.
    start : ndarray, shape (27,)
        Start; angles that the landmarks leave open stay near it.
    iterations : int
        Most steps tried.
    stay : float
        Weight (square metres over square radians) of staying near the start.

    Returns
    -------
    state : ndarray, shape (27,)
    error : float
        Root mean squared distance of the known landmarks, metres.
    """
    known = np.isfinite(points).all(1)
    target = points[known]
    low, high = body.limits.low, body.limits.high
    start = np.clip(start, low, high)

    masks = _MASKS[known][:, None]

    def evaluate(state):
        axes, centres, rotations, positions = joint_twists(body, state)
        places = positions[_SEGMENTS] + (rotations[_SEGMENTS] @ body.tips[..., None])[..., 0]
        residual = places[known] - target
        # axis x (p - centre) for all points and angles, coordinate by coordinate: `numpy.cross` takes several times as long.
        (x, y, z), (u, v, w) = axes.T, (places[known][:, None] - centres).transpose(2, 0, 1)
        jacobian = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)
        jacobian[:, :, :3] = np.eye(3)
        jacobian *= masks
        return residual.ravel(), jacobian.reshape(-1, N_DOF), float((residual**2).sum() + stay * ((state - start) ** 2).sum())

    state = start
    residual, jacobian, cost = evaluate(state)
    damping = 1e-2
    for _ in range(iterations):
        gradient = jacobian.T @ residual + stay * (state - start)
        stuck = ((state <= low) & (gradient > 0)) | ((state >= high) & (gradient < 0))
        active = np.flatnonzero(~stuck)
        matrix = jacobian[:, active].T @ jacobian[:, active] + (stay + damping) * np.eye(active.size)
        step = np.zeros(N_DOF)
        step[active] = -np.linalg.solve(matrix, gradient[active])
        trial = np.clip(state + np.clip(step, -0.7, 0.7), low, high)
        trial_residual, trial_jacobian, trial_cost = evaluate(trial)
        if trial_cost < cost:
            done = cost - trial_cost < 1e-9
            state, residual, jacobian, cost = trial, trial_residual, trial_jacobian, trial_cost
            damping = max(damping * 0.3, 1e-6)
            if done:
                break
        else:
            damping *= 4
            if damping > 1e3:
                break
    return state, float(np.sqrt((residual.reshape(-1, 3) ** 2).sum(1).mean()))
