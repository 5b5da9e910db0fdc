"""A finished trajectory made smooth, after the fact: the answer of Canton (2009, section 3.1.2.2) to jittery trajectories.

A filter knows only the past; once the whole run is there, each frame can be compared with those after it too. Landmarks are smoothed
with a local polynomial (Savitzky and Golay, 1964), not angles: those of a straight arm jump where the arm itself does not. Then each
frame's angles are the nearest ones whose landmarks are these, so bones keep their lengths and joints their limits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import JointLimits
from hmc.body.kinematics import landmarks
from hmc.body.proportions import make_bodies
from hmc.pose.follow import PosedPeople

__all__ = ["smooth_landmarks", "smooth_people"]

#: Degree of the polynomial: what turns round within the window is not cut off.
DEGREE = 3


def smooth_landmarks(frames: np.ndarray, positions: np.ndarray, fps: float, window_s: float) -> np.ndarray:
    """Landmarks of one person, each stretch of consecutive frames smoothed by itself.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Rising.
    positions : ndarray, shape (n, k, 3)
        Metres; a frame with NaN in it ends a stretch.
    fps : float
    window_s : float
        Time over which a polynomial of third degree is fitted around each frame, seconds.

    Returns
    -------
    ndarray, shape (n, k, 3)
        Stretches shorter than the window, and all where the window has fewer than five frames, are as they were.
    """
    # Imported here: it brings scipy.stats along, and most runs smooth nothing.
    from scipy.signal import savgol_filter

    out = np.array(positions, float)
    window = 2 * round(window_s * fps / 2) + 1
    if window < DEGREE + 2:
        return out
    known = np.flatnonzero(np.isfinite(out).all(axis=(1, 2)))
    for stretch in np.split(known, np.flatnonzero(np.diff(frames[known]) != 1) + 1):
        if len(stretch) >= window:
            out[stretch] = savgol_filter(out[stretch], window, DEGREE, axis=0)
    return out


def smooth_people(people: PosedPeople, limits: JointLimits, fps: float, window_s: float) -> PosedPeople:
    """The poses of all persons, smoothed.

    Parameters
    ----------
    people : PosedPeople
    limits : JointLimits
        Of the bodies with which they were estimated (`hmc.pose.method.PoseMethod.limits`).
    fps : float
        Frames a second.
    window_s : float
        As for `smooth_landmarks`.

    Returns
    -------
    PosedPeople
        Costs and notes are those of the poses as they were estimated.
    """
    states, positions = people.states.states.copy(), people.poses.positions.copy()
    for person, body in make_bodies(people.states.bodies, limits).items():
        rows = np.flatnonzero(people.poses.persons == person)
        wanted = smooth_landmarks(people.poses.frames[rows], positions[rows], fps, window_s)
        changed = np.flatnonzero((wanted != positions[rows]).any(axis=(1, 2)) & np.isfinite(wanted).all(axis=(1, 2)))
        for k in changed:
            states[rows[k]] = fit_landmarks(body, wanted[k], states[rows[k]])[0]
        positions[rows[changed]] = landmarks(body, states[rows[changed]])
    return replace(people, poses=replace(people.poses, positions=positions), states=replace(people.states, states=states))
