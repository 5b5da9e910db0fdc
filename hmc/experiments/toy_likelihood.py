"""Likelihoods with several peaks on which figures 3.3 and 3.5 of Canton (2009) are computed again; the thesis does not state its own."""

from __future__ import annotations

import numpy as np

__all__ = ["BOUNDS", "PEAKS", "Peaks", "drawn_peaks", "log_mixture", "moving_log_likelihood", "target_path"]

#: Where states may lie, in one dimension.
BOUNDS = (-10.0, 10.0)
#: Height, place and width of every peak, the highest first.
Peaks = tuple[tuple[float, float, float], ...]
#: Figure 3.3: the function that is drawn. The highest peak is the narrowest.
PEAKS: Peaks = ((1.0, 5.5, 0.6), (0.6, -4.5, 1.4), (0.5, -0.5, 1.2))
#: The others: how many peaks, heights and widths of the lower ones, widths of the highest, and how far apart they are at least.
N_PEAKS, LOWER, WIDE, NARROW, LEAST_APART = (3, 5), (0.3, 0.8), (0.8, 1.6), (0.4, 0.8), 3.0
#: Figure 3.5: of every period of so many frames, those in which something that looks more like the target than itself leaves it; how far
#: it gets along every axis; how much less likely the target then is; the width of the peaks; and what is likely anywhere.
PERIOD, DISTRACTOR_FRAMES = 40, range(10, 16)
APART, HIDDEN, WIDTH, CLUTTER = 3.0, 0.9, 0.5, 0.01


def drawn_peaks(function: int) -> Peaks:
    """The peaks of one of a family of functions; 0 is `PEAKS`, the others are drawn.

    Parameters
    ----------
    function : int
        Which.
    """
    if function == 0:
        return PEAKS
    rng = np.random.default_rng(function)
    n = int(rng.integers(N_PEAKS[0], N_PEAKS[1] + 1))
    places: list[float] = []
    while len(places) < n:
        place = float(rng.uniform(BOUNDS[0] + 1, BOUNDS[1] - 1))
        if all(abs(place - other) >= LEAST_APART for other in places):
            places.append(place)
    return (
        (1.0, places[0], float(rng.uniform(*NARROW))),
        *((float(rng.uniform(*LOWER)), place, float(rng.uniform(*WIDE))) for place in places[1:]),
    )


def log_mixture(x: np.ndarray, peaks: Peaks = PEAKS) -> np.ndarray:
    """Logarithm of the likelihood of figure 3.3 at states, (n, 1) to (n,)."""
    return np.log(sum(height * np.exp(-0.5 * ((x[:, 0] - place) / width) ** 2) for height, place, width in peaks) + 1e-300)


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
