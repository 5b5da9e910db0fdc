"""Smoothing as a step on a finished result: landmarks, and then the angles whose landmarks these are, so that bones keep their lengths.

Each landmark is smoothed in each stretch in which it is known; nothing is smoothed over a gap. Sources: Winter (2009), section 3.4.4.2, for
the Butterworth filter run forwards and backwards; Savitzky and Golay (1964) for the polynomial. A filter of poses knows only the past; once
the whole run is there, each frame can be compared with those after it too (Canton 2009, section 3.1.2.2). Landmarks are smoothed, not
angles: those of a straight arm jump where the arm itself does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import landmarks
from hmc.errors import InputError
from hmc.motion.trajectory import Trajectory

__all__ = [
    "Smoothing",
    "butterworth",
    "local_polynomial",
    "smooth_positions",
    "smooth_trajectory",
    "stretches",
    "window_rows",
    "window_too_short",
]

#: Degree of the polynomial: what turns round within the window is not cut off.
DEGREE = 3
#: A window of fewer rows is met by such a polynomial.
LEAST_ROWS = DEGREE + 2
#: Order of one run of the filter; it is run forwards and backwards, which makes the order twice this.
ORDER = 2
#: Twice run, the filter halves power at a lower frequency than once: the cutoff is raised so that it does at the one that was asked for.
_TWICE = (np.sqrt(2) - 1) ** (1 / (2 * ORDER))


@dataclass(frozen=True)
class Smoothing:
    """How a trajectory is smoothed.

    Parameters
    ----------
    kind : {"butterworth", "polynomial"}
    cutoff_hz : float
        Of the Butterworth filter: the frequency of which half of the power is left. 6 Hz is usual for walking.
    window_s : float
        Of the polynomial of third degree: the time over which it is fitted around each frame, seconds.

    Raises
    ------
    InputError
        When there is no such kind, or a number is not above 0.
    """

    kind: Literal["butterworth", "polynomial"] = "butterworth"
    cutoff_hz: float = 6.0
    window_s: float = 0.4

    def __post_init__(self) -> None:
        if self.kind not in ("butterworth", "polynomial"):
            raise InputError(f"no smoothing {self.kind!r}; there are butterworth and polynomial")
        if not (self.cutoff_hz > 0 and self.window_s > 0):
            raise InputError("smoothing: cutoff and window must be above 0")


def butterworth(values: np.ndarray, fps: float, cutoff_hz: float) -> np.ndarray:
    """A low-pass without delay: a Butterworth filter of second order, forwards and backwards.

    Parameters
    ----------
    values : ndarray, shape (n, ...)
        One stretch without gaps.
    fps : float
    cutoff_hz : float

    Returns
    -------
    ndarray, shape (n, ...)
        As it was where the stretch is too short for the filter's ends (10 rows or fewer).

    Raises
    ------
    InputError
        When the frame rate is too low for the cutoff.
    """
    from scipy.signal import butter, filtfilt

    raised = cutoff_hz / _TWICE
    if raised >= fps / 2:
        raise InputError(f"a cutoff of {cutoff_hz:g} Hz needs more than {2 * raised:.1f} frames a second, and there are {fps:g}")
    numerator, denominator = butter(ORDER, raised, fs=fps)
    if len(values) <= 3 * (ORDER + 1) + 1:
        return np.array(values, float)
    return filtfilt(numerator, denominator, values, axis=0)


def local_polynomial(values: np.ndarray, fps: float, window_s: float) -> np.ndarray:
    """A polynomial of third degree fitted around each row, at either end that of the last window (Savitzky and Golay 1964).

    Written out, as `scipy.signal`, which has it, takes a third of a second to import.

    Parameters
    ----------
    values : ndarray, shape (n, ...)
        One stretch without gaps.
    fps : float
    window_s : float

    Returns
    -------
    ndarray, shape (n, ...)
        As it was where the stretch is shorter than the window, or the window has fewer than five rows.
    """
    window = window_rows(fps, window_s)
    half = window // 2
    smooth = np.array(values, float)
    if window < LEAST_ROWS or len(values) < window:
        return smooth
    powers = np.vander(np.linspace(-1, 1, window), DEGREE + 1)
    fitted = powers @ np.linalg.pinv(powers)  # of a window's rows, from all of them
    around = sliding_window_view(smooth, window, axis=0)
    return np.concatenate(
        [
            np.tensordot(fitted[:half], smooth[:window], 1),
            around @ fitted[half],
            np.tensordot(fitted[half + 1 :], smooth[-window:], 1),
        ]
    )


def window_rows(fps: float, window_s: float) -> int:
    """Rows of the polynomial's window, an odd number; fewer than `LEAST_ROWS` smooth nothing."""
    return 2 * round(window_s * fps / 2) + 1


def window_too_short(fps: float, window_s: float) -> str:
    """In words, that the polynomial's window has too few rows to smooth anything; empty where it has enough."""
    rows = window_rows(fps, window_s)
    if rows >= LEAST_ROWS:
        return ""
    return (
        f"a window of {window_s:g} s has {rows} frame{'s' * (rows > 1)} at {fps:g} a second, and a polynomial of third degree smooths "
        f"{LEAST_ROWS} or more: give {(LEAST_ROWS - 1) / fps:.2g} s"
    )


def stretches(known: np.ndarray) -> list[np.ndarray]:
    """Rows of each stretch of known ones.

    Parameters
    ----------
    known : ndarray of bool, shape (n,)
    """
    rows = np.flatnonzero(known)
    return [part for part in np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1) if len(part)]


def smooth_positions(positions: np.ndarray, fps: float, how: Smoothing) -> np.ndarray:
    """Points over time, each smoothed in each stretch in which it is known.

    Parameters
    ----------
    positions : ndarray, shape (n, k, 3)
        A row a frame; NaN where a point is not known.
    fps : float
    how : Smoothing

    Returns
    -------
    ndarray, shape (n, k, 3)

    Raises
    ------
    InputError
        When the frame rate is too low for the cutoff.
    """
    out = np.array(positions, float)
    for k in range(out.shape[1]):
        for rows in stretches(np.isfinite(out[:, k]).all(axis=1)):
            out[rows, k] = _smooth(out[rows, k], fps, how)
    return out


def smooth_trajectory(one: Trajectory, how: Smoothing) -> Trajectory:
    """A trajectory made smooth.

    Parameters
    ----------
    one : Trajectory
    how : Smoothing

    Returns
    -------
    Trajectory
        Gaps are where they were. With states, these are the nearest to the smoothed landmarks, and the landmarks are theirs.

    Raises
    ------
    InputError
        When the frame rate is too low for the cutoff.
    """
    positions = smooth_positions(one.positions, one.fps, how)
    if one.states is None or one.body is None:
        return replace(one, positions=positions)
    changed = np.flatnonzero((np.nan_to_num(positions) != np.nan_to_num(one.positions)).any(axis=(1, 2)))
    states = one.states.copy()
    # What landmarks do not show, such as feet and the pelvis's tilt, is smoothed by itself; the fit begins there.
    states[changed] = _smoothed_states(one.states, one.fps, how)[changed]
    for row in changed:
        known = np.isfinite(states[row])
        states[row, known] = fit_landmarks(one.body, positions[row], np.where(known, states[row], 0.0))[0][known]
    placed = landmarks(one.body, np.nan_to_num(states[changed]))
    positions[changed] = np.where(np.isfinite(positions[changed]), placed, np.nan)
    return replace(one, positions=positions, states=states)


def _smoothed_states(states: np.ndarray, fps: float, how: Smoothing) -> np.ndarray:
    """Each degree of freedom by itself, angles followed over the half turn and brought back."""
    out = states.copy()
    for k, column in enumerate(out.T):
        for rows in stretches(np.isfinite(column)):
            if k < 3:
                column[rows] = _smooth(column[rows], fps, how)
            else:
                followed = np.unwrap(column[rows])
                column[rows] += _smooth(followed, fps, how) - followed
    return out


def _smooth(values: np.ndarray, fps: float, how: Smoothing) -> np.ndarray:
    return butterworth(values, fps, how.cutoff_hz) if how.kind == "butterworth" else local_polynomial(values, fps, how.window_s)
