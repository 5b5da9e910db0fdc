"""CLEAR multiple-object tracking metrics: MOTP, MOTA, and the misses, false positives and mismatches behind them.

Source: Bernardin and Stiefelhagen (2008), as used in Canton (2009), section 4.4.1, Eq. 4.22 and 4.23. A pair that was matched before and is
still near enough stays matched; the rest is assigned at least total distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.errors import InputError
from hmc.io.results import TrackTable

__all__ = ["MotScores", "clear_mot", "clear_mot_distances"]

#: How far, in the xy plane, an estimate may be from the person that it stands for.
THRESHOLD_M = 0.5


@dataclass(frozen=True)
class MotScores:
    """What CLEAR MOT counts.

    Attributes
    ----------
    objects : int
        True objects, summed over frames (``g_t`` in Eq. 4.23).
    misses, false_positives, mismatches : int
        Objects without an estimate, estimates without an object, objects whose estimate changed its identity.
    matched : ndarray of int, shape (k, 2)
        Rows of truth and of estimate that belong together.
    distances : ndarray, shape (k,)
        Their distances.
    """

    objects: int
    misses: int
    false_positives: int
    mismatches: int
    matched: np.ndarray
    distances: np.ndarray

    @property
    def motp(self) -> float:
        """Mean distance of the matched pairs (Eq. 4.22), in the unit of the distances; NaN without any."""
        return float(self.distances.mean()) if len(self.distances) else float("nan")

    @property
    def mota(self) -> float:
        """One less the rates of misses, false positives and mismatches (Eq. 4.23); NaN without objects."""
        return 1 - (self.misses + self.false_positives + self.mismatches) / self.objects if self.objects else float("nan")


def clear_mot(truth: TrackTable, estimate: TrackTable, threshold_m: float = THRESHOLD_M, plane: bool = True) -> MotScores:
    """Score tracks against truth by position.

    Parameters
    ----------
    truth, estimate : TrackTable
    threshold_m : float
        Largest distance of a match.
    plane : bool
        Compare x and y only, as Canton does.

    Returns
    -------
    MotScores
        Distances in metres. A row with NaN in its position matches nothing.
    """
    columns = slice(0, 2 if plane else None)
    truth_points, points = truth.positions[:, columns], estimate.positions[:, columns]

    def distance(truth_rows: np.ndarray, rows: np.ndarray) -> np.ndarray:
        values = np.linalg.norm(truth_points[truth_rows] - points[rows], axis=-1)
        return np.where(values <= threshold_m, values, np.nan)

    return clear_mot_distances(truth.frames, truth.persons, estimate.frames, estimate.persons, distance)


def clear_mot_distances(
    truth_frames: np.ndarray,
    truth_ids: np.ndarray,
    frames: np.ndarray,
    ids: np.ndarray,
    distance: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> MotScores:
    """Score tracks against truth by any distance.

    Parameters
    ----------
    truth_frames, truth_ids : ndarray of int, shape (n,)
    frames, ids : ndarray of int, shape (m,)
        The estimate. Rows need no order by frame; within a frame, the first in the truth keeps an estimate that two objects remember.
    distance : callable
        Called once with (k,) rows of truth and (k,) rows of estimate, all pairs of equal frame; returns their (k,) distances, NaN for a
        pair that may not match.

    Returns
    -------
    MotScores

    Raises
    ------
    InputError
        When an identity stands twice in one frame, or lengths disagree.
    """
    truth_frames, truth_ids = _check_rows("truth", truth_frames, truth_ids)
    frames, ids = _check_rows("estimate", frames, ids)
    truth_rows, rows = _pairs_of_equal_frame(truth_frames, frames)
    values = np.asarray(distance(truth_rows, rows), float)
    near = np.isfinite(values)
    truth_rows, rows, values = truth_rows[near], rows[near], values[near]

    remembered: dict[int, int] = {}  # object to the estimate that it was last matched with
    kept: list[int] = []
    mismatches = 0
    objects, estimates = truth_ids[truth_rows].tolist(), ids[rows].tolist()
    ends = np.flatnonzero(np.diff(truth_frames[truth_rows])) + 1
    for first, last in zip([0, *ends.tolist()], [*ends.tolist(), len(values)], strict=True):
        used: dict[int, int] = {}  # estimate to the object that keeps it
        for k in range(first, last):
            if remembered.get(objects[k]) == estimates[k] and estimates[k] not in used:
                kept.append(k)
                used[estimates[k]] = objects[k]
        if len(used) == last - first:
            continue  # every pair of this frame is kept
        taken = set(used.values())
        free = [k for k in range(first, last) if objects[k] not in taken and estimates[k] not in used]
        for k in _assign(free, objects, estimates, values):
            mismatches += remembered.get(objects[k], estimates[k]) != estimates[k]
            remembered[objects[k]] = estimates[k]
            kept.append(k)
    chosen = np.array(kept, int)
    return MotScores(
        objects=len(truth_ids),
        misses=len(truth_ids) - len(chosen),
        false_positives=len(ids) - len(chosen),
        mismatches=mismatches,
        matched=np.stack([truth_rows[chosen], rows[chosen]], axis=1),
        distances=values[chosen],
    )


def _check_rows(label: str, frames: np.ndarray, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    frames, ids = np.asarray(frames), np.asarray(ids)
    if frames.ndim != 1 or frames.shape != ids.shape:
        raise InputError(f"{label}: frames and identities must be rows of one length; got {frames.shape} and {ids.shape}")
    order = np.lexsort([ids, frames])
    twice = (np.diff(frames[order]) == 0) & (np.diff(ids[order]) == 0)
    if twice.any():
        row = order[np.argmax(twice)]
        raise InputError(f"{label}: identity {ids[row]} stands twice in frame {frames[row]}")
    return frames, ids


def _pairs_of_equal_frame(a_frames: np.ndarray, b_frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of rows with equal frames, by frame and then in the order of `a` and of `b`."""
    a_order, b_order = np.argsort(a_frames, kind="stable"), np.argsort(b_frames, kind="stable")
    b_sorted = b_frames[b_order]
    first = np.searchsorted(b_sorted, a_frames[a_order], side="left")
    count = np.searchsorted(b_sorted, a_frames[a_order], side="right") - first
    a_rows = np.repeat(a_order, count)
    within = np.arange(len(a_rows)) - np.repeat(np.cumsum(count) - count, count)
    return a_rows, b_order[np.repeat(first, count) + within]


def _assign(pairs: list[int], objects: list[int], estimates: list[int], values: np.ndarray) -> list[int]:
    """The pairs that match as many objects as can be, at the least total distance."""
    rows = {name: place for place, name in enumerate(dict.fromkeys(objects[k] for k in pairs))}
    columns = {name: place for place, name in enumerate(dict.fromkeys(estimates[k] for k in pairs))}
    if len(rows) == len(pairs) == len(columns):
        return pairs  # no two pairs compete
    # A pair that may not match costs more than any assignment of pairs that may.
    costs = np.full((len(rows), len(columns)), 2 * min(len(rows), len(columns)) * (np.abs(values[pairs]).max() + 1) + 1)
    places = {}
    for k in pairs:
        place = rows[objects[k]], columns[estimates[k]]
        costs[place] = values[k]
        places[place] = k
    chosen = zip(*(indices.tolist() for indices in linear_sum_assignment(costs)), strict=True)
    return [places[place] for place in chosen if place in places]
