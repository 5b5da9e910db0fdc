"""Gaps of a trajectory, filled on demand; what lies before the first or behind the last known frame stays empty."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from scipy.interpolate import CubicSpline

from hmc.errors import InputError
from hmc.motion.trajectory import Trajectory, above_zero

__all__ = ["Fill", "check_fill", "complete_states", "fill_gaps", "fill_trajectory"]

Fill = Literal["none", "linear", "spline"]


def check_fill(how: Fill, max_gap_s: float | None = None) -> None:
    """Refuse what `fill_trajectory` cannot do, for callers who would read or compute much before that.

    Parameters
    ----------
    how : {"none", "linear", "spline"}
    max_gap_s : float, optional
        Longer gaps stay, seconds.

    Raises
    ------
    InputError
        When there is no such way, or a longest gap is no number above 0 or given where no gap is filled.
    """
    if how not in get_args(Fill):
        raise InputError(f"`fill` must be one of {', '.join(get_args(Fill))}; got {how!r}")
    if max_gap_s is None:
        return
    above_zero("max_gap_s", max_gap_s)
    if how == "none":
        raise InputError("max_gap_s (--max-gap) is of fill (--fill) linear or spline: give that too, or take it out")


def fill_gaps(values: np.ndarray, how: Fill, longest: float = np.inf) -> np.ndarray:
    """One or many columns with their gaps filled, each by itself.

    Parameters
    ----------
    values : ndarray, shape (n, ...)
        NaN in gaps.
    how : {"none", "linear", "spline"}
        A straight line, or a cubic spline through all that is known (not-a-knot; straight with fewer than four known rows).
    longest : float
        Gaps of more rows stay.

    Returns
    -------
    ndarray, shape (n, ...)

    Raises
    ------
    InputError
        When there is no such way.
    """
    check_fill(how)
    out = np.array(values, float)
    columns = out.reshape(len(out), -1)
    if how == "none":
        return out
    for column in columns.T:
        known = np.flatnonzero(np.isfinite(column))
        if len(known) < 2 or len(known) == len(column):
            continue
        before = np.searchsorted(known, np.arange(len(column)), side="right") - 1
        inside = (before >= 0) & (before < len(known) - 1) & ~np.isfinite(column)
        wanted = np.flatnonzero(inside)
        wanted = wanted[np.diff(known)[before[wanted]] - 1 <= longest]
        if how == "spline" and len(known) >= 4:
            column[wanted] = CubicSpline(known, column[known])(wanted)
        else:
            column[wanted] = np.interp(wanted, known, column[known])
    return columns.reshape(out.shape)


def fill_trajectory(one: Trajectory, how: Fill, max_gap_s: float | None = None) -> Trajectory:
    """Positions and states with their gaps filled.

    Parameters
    ----------
    one : Trajectory
    how : {"none", "linear", "spline"}
    max_gap_s : float, optional
        Longer gaps stay, seconds; by default all are filled.

    Raises
    ------
    InputError
        As `check_fill`.
    """
    check_fill(how, max_gap_s)
    longest = np.inf if max_gap_s is None else max_gap_s * one.fps
    states = None if one.states is None else _filled_states(one.states, how, longest)
    return replace(one, positions=fill_gaps(one.positions, how, longest), states=states)


def complete_states(one: Trajectory) -> tuple[np.ndarray, int]:
    """The states of every frame, for formats without gaps: straight between what is known, held before and after it.

    Parameters
    ----------
    one : Trajectory
        With states.

    Returns
    -------
    states : ndarray, shape (n, 33)
        An angle that is known in no frame is 0, or the nearest that its joint allows.
    filled : int
        Frames in which something was not known.
    """
    if one.states is None or one.body is None:
        raise ValueError("a trajectory without states")
    out = _filled_states(one.states, "linear", np.inf)
    rest = np.clip(0.0, one.body.limits.low, one.body.limits.high)
    for k, column in enumerate(out.T):
        known = np.flatnonzero(np.isfinite(column))
        column[:] = np.interp(np.arange(len(column)), known, column[known]) if len(known) else rest[k]
    return out, int((~np.isfinite(one.states)).any(axis=1).sum())


def _filled_states(states: np.ndarray, how: Fill, longest: float) -> np.ndarray:
    """Angles are followed over the half turn first, so that 179 degrees are near -179."""
    out = np.array(states, float)
    for column in out[:, 3:].T:
        known = np.isfinite(column)
        column[known] = np.unwrap(column[known])
    return fill_gaps(out, how, longest)
