"""Inverse kinematics: the state whose landmarks lie nearest to given ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.body.joints import N_DOF
from hmc.body.kinematics import dof_masks, joint_twists, point_motions
from hmc.body.model import BodyModel
from hmc.body.proportions import landmark_segments
from hmc.search.gauss_newton import Damping, GaussNewtonSettings, LeastSquares, gauss_newton_init, gauss_newton_run

__all__ = ["fit_landmarks"]

_SEGMENTS = landmark_segments()
_MASKS = dof_masks()[_SEGMENTS].astype(float)
#: Starts are often far off, so all angles are damped alike: relative damping lets those go that no landmark holds.
_SETTINGS = GaussNewtonSettings(
    tolerance=0.0,
    least_gain=1e-9,  # square metres
    longest_step=0.7,
    damping=Damping(rise=4.0, least=1e-6, least_after_failure=0.0, most=1e3, is_relative=False),
)


@dataclass(frozen=True)
class _Misses:
    """How far landmarks are from where they should be, shape (k, 3), and what moves them: see `joint_twists` for axes and centres."""

    miss: np.ndarray
    places: np.ndarray
    masks: np.ndarray
    axes: np.ndarray
    centres: np.ndarray
    near: None = None

    @property
    def residuals(self) -> np.ndarray:
        """Landmarks minus their targets, coordinate by coordinate, shape (3 k,), metres."""
        return self.miss.ravel()

    def pulls(self) -> tuple[slice, np.ndarray]:
        """All residuals, and how they change with the state, shape (3 k, 37)."""
        return slice(None), point_motions(self.axes, self.centres, self.places, self.masks).reshape(-1, N_DOF)


def fit_landmarks(
    body: BodyModel, points: np.ndarray, start: np.ndarray, iterations: int = 40, stay: float = 1e-4
) -> tuple[np.ndarray, float]:
    """The state of least squares over the landmarks, within the joint limits.

    Parameters
    ----------
    body : BodyModel
    points : ndarray, shape (15, 3)
        World, metres; NaN where a landmark is not known.
    start : ndarray, shape (37,)
        Start; angles that the landmarks leave open stay near it.
    iterations : int
        Most steps tried.
    stay : float
        Weight (square metres over square radians) of staying near the start.

    Returns
    -------
    state : ndarray, shape (37,)
    error : float
        Root mean squared distance of the known landmarks, metres.
    """
    known = np.isfinite(points).all(1)
    target, segments, tips, masks = points[known], _SEGMENTS[known], body.tips[known, :, None], _MASKS[known]

    def misses(state: np.ndarray, near: None) -> _Misses:
        axes, centres, rotations, positions = joint_twists(body, state)
        places = positions.take(segments, axis=0) + (rotations.take(segments, axis=0) @ tips)[..., 0]
        return _Misses(places - target, places, masks, axes, centres)

    problem = LeastSquares(misses, body.limits.low, body.limits.high, np.full(N_DOF, stay))
    settings = replace(_SETTINGS, iterations=iterations, evaluations=iterations + 1)
    end = gauss_newton_run(problem, gauss_newton_init(problem, start, settings), settings)
    return end.x, float(np.sqrt((end.found.miss**2).sum(1).mean()))
