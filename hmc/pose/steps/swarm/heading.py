"""Which way a skeleton faces: toes, the walk, and which way round knees and elbows can bend. Left and right follow from it."""

from __future__ import annotations

import numpy as np

from hmc.body.spin_skeleton import torso_frames

__all__ = ["facing_evidence", "heading_of", "spin_towards"]

#: Slower people do not show their heading, metres a second; from here on it counts fully at twice the speed.
WALK_M_S = 0.4
#: Feet shorter than this along the floor point nowhere, metres.
LEAST_FOOT_M = 0.05


def heading_of(feet: np.ndarray, velocity: np.ndarray | None = None) -> np.ndarray | None:
    """The horizontal direction in which a person faces, as the feet and the walk show it.

    Parameters
    ----------
    feet : ndarray, shape (k, 3)
        From heel to toe, metres.
    velocity : ndarray, shape (3,), optional
        Metres a second.

    Returns
    -------
    ndarray, shape (2,), or None
        Its length says how sure it is, 1 for a foot or a brisk walk; None where nothing shows.
    """
    total = np.zeros(2)
    for foot in feet:
        size = float(np.hypot(foot[0], foot[1]))
        if size > LEAST_FOOT_M:
            total += foot[:2] / size
    if velocity is not None:
        speed = float(np.hypot(velocity[0], velocity[1]))
        if speed > WALK_M_S:
            total += min(speed / (2 * WALK_M_S), 2.0) * velocity[:2] / speed
    return total if np.linalg.norm(total) > 0.5 else None


def facing_evidence(state: np.ndarray, heading: np.ndarray | None) -> float:
    """How well a state faces that way: the cosine of the angle between, times the heading's length; 0 without a heading.

    Parameters
    ----------
    state : ndarray, shape (23,)
    heading : ndarray, shape (2,), or None
        As from `heading_of`.
    """
    if heading is None:
        return 0.0
    forward = torso_frames(state)[:2, 0]
    size = float(np.linalg.norm(forward))
    return 0.0 if size < 0.2 else float(forward @ heading) / size


def spin_towards(state: np.ndarray, heading: np.ndarray) -> float:
    """The spin with which a state faces a horizontal direction, radians.

    Parameters
    ----------
    state : ndarray, shape (23,)
    heading : ndarray, shape (2,)
    """
    still = state.copy()
    still[6] = 0.0
    frame = torso_frames(still)
    wanted = np.array([heading[0], heading[1], 0.0]) @ frame
    return float(np.arctan2(wanted[1], wanted[0]))
