"""One shift in time for each camera, from what speaks against each shift of each pair."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hmc.check.sync.evidence import Evidence

__all__ = ["Certainty", "certainty", "find_shifts", "fractions", "moved_curve"]

#: Stretches of time that are as good as independent of each other, and how long one is at least, moments.
MOST_STRETCHES, LEAST_STRETCH = 10, 6
#: Shifts as near as this to the best say nothing against it.
NEAR = 1


class Certainty(NamedTuple):
    """How sure a camera's shift is.

    Parameters
    ----------
    margin : float
        How much worse any other shift is, in standard errors over stretches of time; NaN where nothing can be told.
    depth : float
        How far below its usual value the unlikeness is at the shift, from 0 to 1.
    agreeing : float
        The share of the other cameras each of which alone finds this shift, within a frame.
    """

    margin: float
    depth: float
    agreeing: float


def find_shifts(curves: np.ndarray, members: Sequence[int] | None = None) -> np.ndarray:
    """The shifts that agree best with all pairs.

    Each camera in turn takes the shift that fits the others' best, from several beginnings: no shifts, and those that each camera finds
    with every other alone.

    Parameters
    ----------
    curves : ndarray, shape (n, n, 2 * reach + 1)
        As from `Evidence.curves`.
    members : sequence of int, optional
        The cameras to look at; others keep 0.

    Returns
    -------
    ndarray of int, shape (n,)
        Frame t + shift of a camera belongs to moment t; the median of the members is 0.
    """
    n = len(curves)
    members = list(range(n)) if members is None else list(members)
    if not members:
        return np.zeros(n, int)
    wells = _wells(curves)
    reach = wells.shape[2] // 2
    starts = [np.zeros(n, int)]
    for root in members:
        start = np.zeros(n, int)
        for c in members:
            if c != root:
                start[c] = int(wells[root, c].argmin()) - reach
        starts.append(start)
    found = [_settled(wells, start, members) for start in starts]
    best = min(found, key=lambda one: (round(_total(wells, one, members), 6), int(np.abs(one).sum())))
    best = best - int(np.median(best[members]))
    return np.where(np.isin(np.arange(n), members), best, 0)


def _wells(curves: np.ndarray) -> np.ndarray:
    """Curves with nothing above their median: far from the truth, more or less unlike is all one."""
    n = len(curves)
    wells = np.zeros_like(curves)
    for i in range(n):
        for j in range(n):
            known = curves[i, j][np.isfinite(curves[i, j])]
            if len(known):
                usual = float(np.median(known))
                wells[i, j] = np.where(np.isfinite(curves[i, j]), np.minimum(curves[i, j], usual), usual) - usual
    return wells


def _settled(wells: np.ndarray, shifts: np.ndarray, members: list[int]) -> np.ndarray:
    shifts = shifts.copy()
    for _ in range(20):
        before = shifts.copy()
        for c in members:
            shifts[c] += _best_of(_own_curve(wells, shifts, members, c), 0)
        if (shifts == before).all():
            break
    return shifts


def _best_of(curve: np.ndarray, fallback: int) -> int:
    """The place of a curve's least value from its middle; `fallback` where it is flat."""
    return fallback if np.ptp(curve) == 0 else int(curve.argmin()) - len(curve) // 2


def _own_curve(wells: np.ndarray, shifts: np.ndarray, members: Sequence[int], c: int) -> np.ndarray:
    """The sum over a camera's pairs, by how far it is moved from where it is; 0 where moved out of reach."""
    size = wells.shape[2]
    total = np.zeros(size)
    for j in members:
        if j != c:
            total += moved_curve(wells[j, c], int(shifts[c] - shifts[j]), 0.0)
    return total


def moved_curve(curve: np.ndarray, by: int, outside: float) -> np.ndarray:
    """A curve with what was at its middle plus `by` in the middle."""
    result = np.full_like(curve, outside)
    n = len(curve)
    low, high = max(0, -by), min(n, n - by)
    if high > low:
        result[low:high] = curve[low + by : high + by]
    return result


def _total(wells: np.ndarray, shifts: np.ndarray, members: Sequence[int]) -> float:
    reach = wells.shape[2] // 2
    total = 0.0
    for i in members:
        for j in members:
            k = reach + shifts[j] - shifts[i]
            if i < j and 0 <= k < wells.shape[2]:
                total += float(wells[i, j, k])
    return total


def certainty(evidence: Evidence, shifts: np.ndarray, members: Sequence[int], c: int) -> Certainty:
    """How sure one camera's shift is against the other members'.

    Parameters
    ----------
    evidence : Evidence
    shifts : ndarray of int, shape (n,)
    members : sequence of int
    c : int

    Returns
    -------
    Certainty
    """
    others = [j for j in members if j != c]
    whole = evidence.curves()
    own = np.stack([moved_curve(whole[j, c], int(shifts[c] - shifts[j]), np.nan) for j in others]) if others else np.zeros((0, 1))
    own = own[np.isfinite(own).any(axis=1)] if len(own) else own
    middle = own.shape[1] // 2
    if not len(own) or not np.isfinite(own[:, middle]).any():
        return Certainty(np.nan, np.nan, np.nan)
    own = own[np.isfinite(own[:, middle])]
    usual = np.nanmedian(own, axis=1)
    depth = float(1 - own[:, middle].sum() / max(usual.sum(), 1e-9))
    agreeing = float(np.mean([abs(int(np.nanargmin(row)) - middle) <= NEAR for row in own]))
    n = min(MOST_STRETCHES, evidence.n_moments // LEAST_STRETCH)
    if n < 3:
        return Certainty(np.nan, depth, agreeing)
    gains = []
    for stretch in np.array_split(np.arange(evidence.n_moments), n):
        part = evidence.curves(stretch)
        # Moments are the other camera's: rows of pairs (j, c) are those of j, or else of c, a shift apart.
        rows = np.stack([moved_curve(part[j, c], int(shifts[c] - shifts[j]), np.nan) for j in others])
        known = np.isfinite(rows) & np.isfinite(rows[:, middle : middle + 1])
        number = known.sum(axis=0)
        worse = np.where(known, rows - rows[:, middle : middle + 1], 0).sum(axis=0) / np.maximum(number, 1)
        gains.append(np.where(number > 0, worse, np.nan))
    gained = np.stack(gains)
    number = np.isfinite(gained).sum(axis=0)
    enough = number >= max(3, n / 2)
    enough[middle - NEAR : middle + NEAR + 1] = False
    if not enough.any():
        return Certainty(np.nan, depth, agreeing)
    gained = gained[:, enough]
    mean = np.nanmean(gained, axis=0)
    error = np.nanstd(gained, axis=0, ddof=1) / np.sqrt(number[enough])
    return Certainty(float((mean / np.maximum(error, 1e-6)).min()), depth, agreeing)


def fractions(curves: np.ndarray, shifts: np.ndarray, members: Sequence[int]) -> np.ndarray:
    """What is left of a frame, by the two sides of each pair's curve, which rises evenly from the truth.

    Parameters
    ----------
    curves : ndarray, shape (n, n, 2 * reach + 1)
    shifts : ndarray of int, shape (n,)
    members : sequence of int

    Returns
    -------
    ndarray, shape (n,)
        To be added to the shifts, frames; their median is 0. NaN of cameras without a pair that tells.
    """
    rows, values, weights = [], [], []
    reach = curves.shape[2] // 2
    for i in members:
        for j in members:
            k = reach + int(shifts[j] - shifts[i])
            if i < j and 1 <= k < curves.shape[2] - 1:
                before, now, after = curves[i, j, k - 1 : k + 2]
                slope = max(before, after) - now
                if np.isfinite(slope) and slope > 0:
                    row = np.zeros(len(curves))
                    row[j], row[i] = 1, -1
                    rows.append(row)
                    values.append(np.clip((before - after) / (2 * slope), -0.5, 0.5))
                    weights.append(slope)
    result = np.full(len(curves), np.nan)
    if rows:
        scale = np.sqrt(weights)[:, None]
        solved = np.linalg.lstsq(np.stack(rows) * scale, np.array(values) * scale[:, 0], rcond=None)[0]
        told = np.abs(np.stack(rows)).any(axis=0)
        result[told] = solved[told] - np.median(solved[told])
    return result
