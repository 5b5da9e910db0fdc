"""Which pieces of the body come near each other in which particles: what is worth testing for double occupancy."""

from __future__ import annotations

import numpy as np

from hmc.pose.objectives.overlap_pieces import Pieces

__all__ = ["near_pieces"]


def near_pieces(pieces: Pieces, pairs: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of pieces and particles in which they may share volume.

    The boxes around all particles are tested first, then the spheres around the pieces, then tapered capsules (the distance
    of two line segments, by Ericson 2005, Real-Time Collision Detection, section 5.1.9), and last whether a plane across
    either axis parts the two: capsules have round ends, the flesh has flat ones.

    Parameters
    ----------
    pieces : Pieces
    pairs : ndarray of int, shape (n_pairs, 2)
    frames : ndarray of float32, shape (k, 3, 4, n)
        From `hmc.pose.objectives.overlap_pieces.place_pieces`.

    Returns
    -------
    first, second, particle : ndarray of int, shape (t,)
        In the order of `pairs`.
    """
    n = frames.shape[-1]
    axis, middle = frames[:, :, 2], frames[:, :, 3] - frames[0, :, 3]  # whole bodies that move must not widen the boxes
    half, margin = pieces.half_length, np.float32(pieces.spacing_m / 2)
    widest = pieces.ends.max(axis=1)
    reach = half[:, None] * np.abs(axis).max(axis=2) + (widest + margin)[:, None]
    low, high = middle.min(axis=2) - reach, middle.max(axis=2) + reach
    i, j = pairs[np.all((low[pairs[:, 0]] < high[pairs[:, 1]]) & (high[pairs[:, 0]] > low[pairs[:, 1]]), axis=1)].T

    between = middle[i]
    between -= middle[j]
    squared = _dot(between, between)
    some = np.flatnonzero(squared.min(axis=1) < (half[i] + half[j] + widest[i] + widest[j] + margin) ** 2)
    i, j, between, squared = i[some], j[some], between[some], squared[some]
    axis_i, axis_j = axis[i], axis[j]
    cos, along_i, along_j = _dot(axis_i, axis_j), _dot(axis_i, between), _dot(axis_j, between)
    sin2 = np.maximum(1 - cos * cos, np.float32(1e-6))
    # The points s and t on the axes, from their middles, where they are nearest.
    half_i, half_j = half[i, None], half[j, None]
    s = cos * along_j
    s -= along_i
    s /= sin2
    _clip(s, half_i, out=s)
    t = cos * s
    t += along_j
    _clip(t, half_j, out=t)
    leaning = cos * t
    leaning -= along_i
    _clip(leaning, half_i, out=s)
    # |between + s axis_i - t axis_j| squared
    leaning *= 2
    squared += s * (s - leaning)
    squared += t * (t - 2 * along_j)
    s *= ((pieces.ends[i, 1] - pieces.ends[i, 0]) / half[i] / 2)[:, None]
    t *= ((pieces.ends[j, 1] - pieces.ends[j, 0]) / half[j] / 2)[:, None]
    s += t
    s += (pieces.ends[i].mean(axis=1) + pieces.ends[j].mean(axis=1) + margin)[:, None]
    s *= s
    touching = np.flatnonzero(squared < s)

    row = touching // n
    i, j, particle = i[row], j[row], touching - row * n
    cos, sin2, along_i, along_j = (np.abs(values.ravel()[touching]) for values in (cos, sin2, along_i, along_j))
    sin = np.sqrt(sin2)
    meet = along_j < half[j] + cos * half[i] + sin * widest[i] + margin
    meet &= along_i < half[i] + cos * half[j] + sin * widest[j] + margin
    meet = np.flatnonzero(meet)
    return i[meet], j[meet], particle[meet]


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Dot products of vectors along the second axis."""
    return np.einsum("pin,pin->pn", first, second)


def _clip(values: np.ndarray, bound: np.ndarray, out: np.ndarray) -> None:
    """Between minus a bound a row and it; `numpy.clip` takes twice as long."""
    np.maximum(values, -bound, out=out)
    np.minimum(out, bound, out=out)
