"""Draws from truncated Gaussians (Canton 2009, section 6.3.4 and Fig. 6.6)."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

__all__ = ["truncated_normal"]

#: Rounds of plain rejection before the rest is drawn through the inverse distribution function.
REJECTION_ROUNDS = 2


def truncated_normal(
    rng: np.random.Generator,
    mean: np.ndarray,
    sd: np.ndarray | float,
    low: np.ndarray | float,
    high: np.ndarray | float,
) -> np.ndarray:
    """Draw from Gaussians cut to an interval each.

    Canton redraws what falls outside until nothing does. Here two rounds are redrawn at once for all, and what is still
    outside (where the interval lies in a tail, that may be everything) is drawn through the inverse distribution function.

    Parameters
    ----------
    rng : numpy.random.Generator
    mean, sd, low, high : array_like
        They broadcast together, e.g. ``(n, d)`` states with ``(d,)`` spreads and limits. A mean may lie outside its
        interval; a limit may be infinite; where `sd` is 0 the draw is the mean, clipped into the interval.

    Returns
    -------
    ndarray
        Of the broadcast shape; every number lies in its closed interval.

    Raises
    ------
    ValueError
        When a lower limit exceeds the upper one, a spread is negative or a number is NaN.
    """
    mean, sd, low, high = (np.asarray(value, float) for value in (mean, sd, low, high))
    if not np.all(low <= high):
        raise ValueError("each `low` must be at most its `high`")
    if not np.all((sd >= 0) & (sd < np.inf)):
        raise ValueError("`sd` must be finite and not negative")
    if not np.all(np.isfinite(mean)):
        raise ValueError("`mean` must be finite")
    shape = np.broadcast_shapes(mean.shape, sd.shape, low.shape, high.shape)
    draws = np.asarray(rng.standard_normal(shape) * sd + mean)
    outside = np.flatnonzero((draws < low) | (draws > high))
    if outside.size == 0:
        return draws

    mean, sd, low, high = (np.broadcast_to(value, shape).ravel()[outside] for value in (mean, sd, low, high))
    redrawn = np.empty(mean.shape)
    left = np.arange(mean.size)
    for _ in range(REJECTION_ROUNDS):
        redrawn[left] = mean[left] + sd[left] * rng.standard_normal(left.size)
        left = left[(redrawn[left] < low[left]) | (redrawn[left] > high[left])]
    redrawn[left] = _through_inverse(rng, mean[left], sd[left], low[left], high[left])
    draws.ravel()[outside] = redrawn
    return draws


def _through_inverse(rng: np.random.Generator, mean: np.ndarray, sd: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Draw through the inverse of the logarithm of the distribution function, which is exact however far out the tail."""
    safe = np.where(sd > 0, sd, 1.0)
    with np.errstate(over="ignore"):  # a tiny spread may put the limits infinitely far out
        a, b = (low - mean) / safe, (high - mean) / safe
    # Intervals above the mean are mirrored: the distribution function keeps its precision in the lower tail only.
    mirrored = a > 0
    a, b = np.where(mirrored, -b, a), np.where(mirrored, -a, b)
    log_a, log_b = log_ndtr(a), log_ndtr(b)
    u = rng.random(mean.shape)
    # log((1 - u) F(a) + u F(b)), relative to F(b), which is not below F(a)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = ndtri_exp(log_b + np.log(u + (1 - u) * np.exp(log_a - log_b)))
    z = np.where(np.isfinite(z), z, b)
    z = np.where(mirrored, -z, z)
    return np.clip(np.where(sd > 0, mean + safe * z, mean), low, high)
