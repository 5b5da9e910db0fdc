"""Likelihoods with several peaks on which figures 3.3 and 3.5 of Canton (2009) are computed again; the thesis does not state its own."""

from __future__ import annotations

import numpy as np

__all__ = ["BOUNDS", "PEAKS", "log_mixture", "moving_log_likelihood", "target_path"]

#: Where states may lie, in one dimension.
BOUNDS = (-10.0, 10.0)
#: Figure 3.3: height, place and width of the peaks. The highest is the narrowest.
PEAKS = ((1.0, 5.5, 0.6), (0.6, -4.5, 1.4), (0.5, -0.5, 1.2))
#: Figure 3.5: of every period of so many frames, those in which something that looks more like the target than itself leaves it; how far
#: it gets along every axis; how much less likely the target then is; the width of the peaks; and what is likely anywhere.
PERIOD, DISTRACTOR_FRAMES = 40, range(10, 16)
APART, HIDDEN, WIDTH, CLUTTER = 3.0, 0.9, 0.5, 0.01


def log_mixture(x: np.ndarray) -> np.ndarray:
    """Logarithm of the likelihood of figure 3.3 at states, (n, 1) to (n,)."""
    return np.log(sum(height * np.exp(-0.5 * ((x[:, 0] - place) / width) ** 2) for height, place, width in PEAKS) + 1e-300)


def target_path(frames: int) -> np.ndarray:
    """Where the target of figure 3.5 is, (frames, 3)."""
    turns = np.arange(frames)[:, None] / PERIOD
    return 3 * np.sin(2 * np.pi * turns * np.array([1.0, 1.13, 1.26]) + np.array([0, np.pi / 2, np.pi]))


def moving_log_likelihood(states: np.ndarray, target: np.ndarray, frame: int) -> np.ndarray:
    """Logarithm of the likelihood of figure 3.5 in one frame: a peak on the target, for some frames a higher one that leaves it, clutter.

    Parameters
    ----------
    states : ndarray, shape (n, 3)
    target : ndarray, shape (3,)
    frame : int

    Returns
    -------
    ndarray, shape (n,)
    """
    off = states - target
    likelihood = np.exp(-0.5 * (off**2).sum(axis=1) / WIDTH**2)
    if frame % PERIOD in DISTRACTOR_FRAMES:
        gone = APART * DISTRACTOR_FRAMES.index(frame % PERIOD) / len(DISTRACTOR_FRAMES)
        likelihood = HIDDEN * likelihood + np.exp(-0.5 * ((off - gone) ** 2).sum(axis=1) / WIDTH**2)
    return np.log(likelihood + CLUTTER)
