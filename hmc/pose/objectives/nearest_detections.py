"""The nearest of a view's detections to every point of many clouds, exactly.

The particles' images of one marker in one view are a cloud. Seen from its bounding box most detections are out of question: too far, or
farther at best than another is at worst. What is left, often one, is compared particle by particle.
"""

from __future__ import annotations

import numpy as np

__all__ = ["nearest_detections"]


def nearest_detections(detections: np.ndarray, uv: np.ndarray, gate_px: float) -> tuple[np.ndarray, np.ndarray]:
    """The nearest detection of its view to every point, if any lies within the gate (Canton 2009, Eq. 6.5).

    Parameters
    ----------
    detections : ndarray of float32, shape (2, n_views, stride)
        Pixels; infinite after the last detection of a view, of which there are fewer than `stride`.
    uv : ndarray of float32, shape (2, n_views, n_markers, n)
        Images of the markers, pixels, finite.
    gate_px : float

    Returns
    -------
    place : ndarray of int, shape (n_views, n_markers, n)
        The detection's number in its view; ``stride - 1`` where none lies within the gate.
    squared : ndarray of float32, shape (n_views, n_markers, n)
        Squared distance, pixels; that of the gate where there is none.
    """
    views, markers, n = uv.shape[1:]
    none, gate = detections.shape[2] - 1, np.float32(gate_px**2)
    possible = _possible(detections, uv.min(axis=-1)[..., None], uv.max(axis=-1)[..., None], gate).reshape(views * markers, -1)
    counts = possible.sum(axis=1)
    # Clouds with the most candidates first: those that have a k-th one are then a stretch at the front, which needs no copy.
    order = np.argsort(-counts, kind="stable")
    counts, possible = counts[order], possible[order]
    candidates = np.argsort(~possible, axis=1, kind="stable")[:, : max(1, int(counts[0]))]
    u, v = uv.reshape(2, views * markers, n)[:, order]
    near = np.broadcast_to(detections[:, :, None], (2, views, markers, none + 1)).reshape(2, views * markers, -1)[:, order]
    near_u, near_v = (np.take_along_axis(axis, candidates, 1) for axis in near)
    best = np.full(u.shape, gate)
    winner = np.zeros(u.shape, np.int8 if candidates.shape[1] < 127 else np.int32)
    across, down, nearer = np.empty_like(u), np.empty_like(u), np.empty(u.shape, bool)
    for rank in range(int(counts[0])):
        last = int(np.searchsorted(-counts, -rank))  # clouds with more candidates than `rank`
        squared = np.subtract(u[:last], near_u[:last, rank, None], out=across[:last])
        other = np.subtract(v[:last], near_v[:last, rank, None], out=down[:last])
        np.multiply(squared, squared, out=squared)
        np.multiply(other, other, out=other)
        np.add(squared, other, out=squared)
        np.less(squared, best[:last], out=nearer[:last])
        # A later winner has the greater rank, so the maximum puts it in place; a masked copy takes three times as long.
        np.maximum(winner[:last], nearer[:last].view(np.int8) * winner.dtype.type(rank + 1), out=winner[:last])
        np.minimum(best[:last], squared, out=best[:last])
    back = np.argsort(order)
    # Winners count among their cloud's candidates from 1; a 0 is none.
    numbers = np.concatenate([np.full((len(candidates), 1), none), candidates], axis=1)[back]
    place = numbers.take(winner[back] + (np.arange(len(numbers)) * numbers.shape[1])[:, None])
    return place.reshape(views, markers, n), best[back].reshape(views, markers, n)


def _possible(detections: np.ndarray, low: np.ndarray, high: np.ndarray, gate: np.float32) -> np.ndarray:
    """Which detections can be the nearest to a point of a box and lie within the gate, shape (n_views, n_markers, stride)."""
    points = detections[:, :, None]
    outside = np.maximum(np.maximum(low - points, points - high), 0)
    inside = np.maximum(np.abs(points - low), np.abs(points - high))
    least, most = (outside**2).sum(axis=0), (inside**2).sum(axis=0)
    return least <= np.minimum(most.min(axis=-1, keepdims=True), gate)
