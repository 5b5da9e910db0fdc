"""Particle weights and their resampling (Canton 2009, section 3.1.2)."""

from __future__ import annotations

import numpy as np

__all__ = ["effective_sample_size", "normalise", "survival_rate", "systematic"]


def normalise(log_weights: np.ndarray) -> np.ndarray:
    """Weights that sum to 1 from logarithms of any size.

    Parameters
    ----------
    log_weights : array_like, shape (n,)
        Logarithms of weights up to a common constant; ``-inf`` is a weight of zero.

    Returns
    -------
    ndarray, shape (n,)
        Where all are ``-inf`` nothing is known, and the weights are equal; where some are ``+inf``, these share the whole.

    Raises
    ------
    ValueError
        When there are none, or one is NaN.
    """
    log_weights = np.asarray(log_weights, float)
    if log_weights.ndim != 1 or log_weights.size == 0:
        raise ValueError(f"`log_weights` must be (n,) with n at least 1; got shape {log_weights.shape}")
    peak = log_weights.max()
    if np.isnan(peak):
        raise ValueError("`log_weights` holds NaN; a likelihood must be a number, -inf where the state is impossible")
    weights = np.exp(log_weights - peak) if np.isfinite(peak) else (log_weights == peak).astype(float)
    return weights / weights.sum()


def effective_sample_size(weights: np.ndarray) -> float:
    """How many equal weights would be worth as much as these, from 1 to n (Canton, Eq. 3.10).

    Parameters
    ----------
    weights : array_like, shape (n,)
        Non-negative, not all zero; they need not sum to 1.
    """
    weights = np.asarray(weights, float)
    weights = weights / weights.max()
    return float(weights.sum() ** 2 / (weights @ weights))


def survival_rate(weights: np.ndarray) -> float:
    """Effective sample size as a fraction of the particles, from 1/n to 1 (Canton, Eq. 3.11)."""
    return effective_sample_size(weights) / len(weights)


def systematic(rng: np.random.Generator, weights: np.ndarray, n: int) -> np.ndarray:
    """Draw `n` indices by systematic resampling (Canton, Alg. 2; with any output size, Alg. 4).

    One uniform number places a comb of ``n`` equally spaced teeth over the cumulative weights, so index ``i`` is drawn
    ``floor(n w_i)`` or ``ceil(n w_i)`` times.

    Parameters
    ----------
    rng : numpy.random.Generator
    weights : array_like, shape (n_in,)
        Non-negative, finite, not all zero; they need not sum to 1.
    n : int
        Number of indices wanted.

    Returns
    -------
    ndarray of int, shape (n,)
        In ascending order.

    Raises
    ------
    ValueError
        When a weight is negative, infinite or NaN, or all are zero.
    """
    weights = np.asarray(weights, float)
    cumulative = weights.cumsum()
    total = cumulative[-1] if weights.size else 0.0
    if not (0 < total < np.inf) or weights.min() < 0:
        raise ValueError("`weights` must be finite, non-negative and not all zero")
    teeth = np.empty(weights.size + 1, np.int64)  # how many lie below each edge
    teeth[0] = 0
    teeth[1:] = np.ceil(cumulative * (n / total) - rng.random())
    # Rounding must neither lose the last tooth nor give it to a particle of weight zero.
    teeth[1 + cumulative.searchsorted(total) :] = n
    return np.arange(weights.size).repeat(teeth[1:] - teeth[:-1])
