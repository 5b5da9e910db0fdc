"""Which estimated person is which true one, over a whole recording, and where left and right were taken for each other."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import landmark_errors

__all__ = ["LIMB_PAIRS", "distances_apart", "exchange_sides", "frames_in_words", "match_persons", "runs", "swapped_frames"]

#: Farther than this, on the mean over landmarks, an estimate does not stand for a person.
GATE_M = 1.0

#: Landmarks of the left side by limb pair; each has its counterpart on the right.
LIMB_PAIRS: dict[str, tuple[str, ...]] = {"arms": ("l_shoulder", "l_elbow", "l_wrist"), "legs": ("l_hip", "l_knee", "l_ankle")}


def match_persons(
    truth_frames: np.ndarray,
    truth_persons: np.ndarray,
    truth_points: np.ndarray,
    frames: np.ndarray,
    persons: np.ndarray,
    points: np.ndarray,
    gate_m: float = GATE_M,
) -> dict[int, int]:
    """Match estimated persons with true ones, once for the whole recording.

    Each frame that two persons share is worth what their mean distance stays under the gate; the assignment of greatest total worth wins.
    An estimated person left over then joins the true person that it is worth most for, if that one's estimate does not stand in the same
    frames: it is the rest of a track that was lost and begun anew.

    Parameters
    ----------
    truth_frames, truth_persons : ndarray of int, shape (n,)
    truth_points : ndarray, shape (n, k, 3)
        Metres; NaN where missing.
    frames, persons, points : ndarray, shape (m,), (m,), (m, k, 3)
        The estimate.
    gate_m : float
        Distance at which a frame is worth nothing.

    Returns
    -------
    dict
        Estimated person to true person; those that match no true person are not in it.
    """
    true_names, names = np.unique(truth_persons), np.unique(persons)
    worth = np.zeros((len(true_names), len(names)))
    seen = [set(frames[persons == name].tolist()) for name in names]
    for i, true_name in enumerate(true_names):
        true_rows = truth_persons == true_name
        for j, name in enumerate(names):
            rows = persons == name
            apart = distances_apart(truth_frames[true_rows], truth_points[true_rows], frames[rows], points[rows])
            worth[i, j] = np.maximum(gate_m - apart, 0).sum()
    found: dict[int, int] = {}
    covered: list[set[int]] = [set() for _ in true_names]
    first = [(i, j) for i, j in zip(*linear_sum_assignment(-worth), strict=True)]
    rest = [(i, j) for i, j in np.argwhere(worth > 0) if (i, j) not in first]
    for i, j in first + sorted(rest, key=lambda pair: -worth[pair]):
        name = int(names[j])
        if worth[i, j] > 0 and name not in found and not covered[i] & seen[j]:
            found[name] = int(true_names[i])
            covered[i] |= seen[j]
    return found


def distances_apart(truth_frames: np.ndarray, truth_points: np.ndarray, frames: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Mean distance of the landmarks of one person from those of another, in each frame in which both have some.

    Parameters
    ----------
    truth_frames, frames : ndarray of int, shape (n,), (m,)
        None twice.
    truth_points, points : ndarray, shape (n, k, 3), (m, k, 3)
        Metres; NaN where missing.

    Returns
    -------
    ndarray, shape (frames in common,)
        Metres.
    """
    _, a, b = np.intersect1d(truth_frames, frames, return_indices=True)
    errors = landmark_errors(points[b], truth_points[a])
    known = np.isfinite(errors)
    some = known.any(axis=1)
    return np.where(known, errors, 0)[some].sum(axis=1) / known[some].sum(axis=1)


def exchange_sides(points: np.ndarray, limbs: str | None = None) -> np.ndarray:
    """The same points with left and right named the other way round.

    Parameters
    ----------
    points : ndarray, shape (..., 15, 3)
        In the order of `hmc.landmarks.LANDMARKS`.
    limbs : {"arms", "legs"}, optional
        Only these; otherwise both.
    """
    order = np.arange(len(LANDMARKS))
    for name in LIMB_PAIRS[limbs] if limbs else sum(LIMB_PAIRS.values(), ()):
        left, right = LANDMARKS.index(name), LANDMARKS.index("r" + name[1:])
        order[[left, right]] = right, left
    return points[..., order, :]


def swapped_frames(
    estimate: np.ndarray, truth: np.ndarray, limbs: str, gain_m: float = 0.05, ratio: float = 0.5
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frames in which a pair of limbs fits the truth much better with left and right exchanged.

    Parameters
    ----------
    estimate, truth : ndarray, shape (n_frames, 15, 3)
        Metres, NaN where missing.
    limbs : {"arms", "legs"}
    gain_m, ratio : float
        The mean error must fall by at least this much, and to less than this share. A fit that is merely poor passes neither.

    Returns
    -------
    swapped : ndarray of bool, shape (n_frames,)
    as_is, exchanged : ndarray, shape (n_frames,)
        Mean error of these limbs as named and with the sides exchanged, metres; NaN where nothing can be compared.
    """
    names = [*LIMB_PAIRS[limbs], *("r" + name[1:] for name in LIMB_PAIRS[limbs])]
    places = [LANDMARKS.index(name) for name in names]
    means = []
    for points in (estimate, exchange_sides(estimate, limbs)):
        errors = landmark_errors(points[:, places], truth[:, places])
        known = np.isfinite(errors)
        total = np.where(known, errors, 0).sum(axis=1)
        means.append(np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan))
    as_is, exchanged = means
    return (as_is - exchanged > gain_m) & (exchanged < ratio * as_is), as_is, exchanged


def runs(frames: np.ndarray) -> list[tuple[int, int]]:
    """Frame numbers as runs of consecutive ones: a list of (first, last)."""
    frames = np.unique(np.asarray(frames, int))
    breaks = np.flatnonzero(np.diff(frames) > 1)
    firsts, lasts = frames[np.r_[0, breaks + 1]] if len(frames) else frames, frames[np.r_[breaks, -1]] if len(frames) else frames
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def frames_in_words(frames: np.ndarray, most: int = 6) -> str:
    """Frame numbers in words: ``frames 3-17, 20 (16 frames)``."""
    parts = [str(first) if first == last else f"{first}-{last}" for first, last in runs(frames)]
    shown = ", ".join(parts[:most]) + (", ..." if len(parts) > most else "")
    return f"frame {shown}" if len(frames) == 1 else f"frames {shown} ({len(frames)} frames)"
