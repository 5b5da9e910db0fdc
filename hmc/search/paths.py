"""The cheapest way through some choices in each frame (Viterbi, IEEE Transactions on Information Theory 13, 1967)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

__all__ = ["cheapest_path"]


def cheapest_path(own: Sequence[np.ndarray] | np.ndarray, between: Callable[[int], np.ndarray]) -> np.ndarray:
    """Which choice of each frame makes the cheapest way through all of them.

    Parameters
    ----------
    own : sequence of ndarray, or ndarray of shape (n, m)
        What each choice of a frame costs by itself, shape (m_k,) each; the numbers of choices may differ.
    between : callable
        ``between(k) -> ndarray, shape (m_{k-1}, m_k)``: what it costs to come from each choice of the frame before `k` to each in it.

    Returns
    -------
    ndarray of int, shape (n,)
        Of ways that cost the same the one whose choices are first, from the end backwards.

    Raises
    ------
    ValueError
        When a frame has no choice.
    """
    if any(len(costs) == 0 for costs in own):
        raise ValueError("each frame must have at least one choice")
    came_from: list[np.ndarray] = []
    best = own[0] if len(own) else np.zeros(1)
    for k in range(1, len(own)):
        steps = best[:, None] + between(k)
        came_from.append(steps.argmin(axis=0))
        best = steps.min(axis=0) + own[k]
    path = [int(best.argmin())][: len(own)]
    for before in reversed(came_from):
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], int)
