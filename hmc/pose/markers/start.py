"""The first pose from markers alone: points of the world without names, and bodies that are laid into them."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.pose.body.inverse import fit_landmarks
from hmc.pose.body.joints import dof_index
from hmc.pose.body.kinematics import landmarks
from hmc.pose.body.model import BodyModel, neutral_state

__all__ = ["LEAST_POINTS", "lay_body", "start_poses"]

#: From fewer points than this no pose is begun.
LEAST_POINTS = 6
#: Headings that are tried, evenly spaced, and how far a marker may be from the point that it takes, round by round, metres.
HEADINGS = 12
GATES_M = (0.6, 0.5, 0.4, 0.3, 0.2, 0.2)
#: After so many rounds only so many trials are pursued.
ROUGH_ROUNDS, PURSUED = 2, 8
#: Poses whose markers are nearer to each other than this on the mean are alike, metres.
ALIKE_M = 0.08


def start_poses(body: BodyModel, points: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Poses that explain points, the best first, from several headings, arms and knees.

    Each trial alternates between giving every marker a point of its own (least total squared distance) and inverse kinematics.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips.
    points : ndarray, shape (n, 3)
        From `hmc.pose.markers.points.find_points`, of one person and of false detections.

    Returns
    -------
    list of (state, cost)
        States, shape (27,), no two alike, and the mean squared distance of the markers to their points, square metres; that of the last
        gate for a marker without one. Empty where there are too few points.
    """
    if len(points) < LEAST_POINTS:
        return []
    middle = np.median(points, axis=0)
    trials = []
    for heading in np.arange(HEADINGS) * 2 * np.pi / HEADINGS:
        for posture in _postures(body):
            state = posture.copy()
            state[:2], state[dof_index("root_rz")] = middle[:2], heading
            state[2] += middle[2] - np.median(landmarks(body, state)[:, 2])
            trials.append(lay_body(body, points, state, GATES_M[:ROUGH_ROUNDS]))
    rough = sorted((trial for trial in trials if np.isfinite(trial[1])), key=lambda trial: trial[1])[:PURSUED]
    laid = [lay_body(body, points, state, GATES_M[ROUGH_ROUNDS:]) for state, _ in rough]
    found: list[tuple[np.ndarray, float]] = []
    for state, cost in sorted((trial for trial in laid if np.isfinite(trial[1])), key=lambda trial: trial[1]):
        places = landmarks(body, state)
        if all(np.linalg.norm(landmarks(body, other) - places, axis=1).mean() > ALIKE_M for other, _ in found):
            found.append((state, cost))
    return found


def _postures(body: BodyModel) -> list[np.ndarray]:
    """Arms hanging, arms forward and bent, and arms stretched sideways."""
    hanging, sideways = (neutral_state(arms, body.limits) for arms in ("down", "sideways"))
    boxing = hanging.copy()
    boxing[dof_index("l_elbow_z", "r_elbow_z")] = np.radians([-90, 90])
    return [np.clip(state, body.limits.low, body.limits.high) for state in (hanging, boxing, sideways)]


def lay_body(body: BodyModel, points: np.ndarray, state: np.ndarray, gates_m: tuple[float, ...] = GATES_M) -> tuple[np.ndarray, float]:
    """Lay a body into points: markers take points (least total squared distance), inverse kinematics follows, and again.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips.
    points : ndarray, shape (n, 3)
        World, metres.
    state : ndarray, shape (27,)
        Start.
    gates_m : tuple of float
        How far a marker may be from the point that it takes, round by round, metres.

    Returns
    -------
    state : ndarray, shape (27,)
    cost : float
        Mean squared distance of the markers to their points, square metres; that of the last gate for a marker without one. Infinite where
        too few markers found a point.
    """
    cost, most = np.inf, gates_m[-1] ** 2
    for gate in gates_m:
        squared = ((landmarks(body, state)[:, None] - points) ** 2).sum(axis=-1)
        rows, columns = linear_sum_assignment(np.minimum(squared, gate**2))
        near = squared[rows, columns] < gate**2
        if near.sum() < LEAST_POINTS:
            return state, np.inf
        target = np.full((len(squared), 3), np.nan)
        target[rows[near]] = points[columns[near]]
        state, _ = fit_landmarks(body, target, state, iterations=8)
        off = ((landmarks(body, state) - target) ** 2).sum(axis=-1)
        cost = float(np.where(np.isnan(off), most, np.minimum(off, most)).mean())
    return state, cost
