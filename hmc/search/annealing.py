"""The annealing rate: which power of the likelihood lets a wanted fraction of the particles survive (Canton 2009, 3.2.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hmc.search.weights import normalise, survival_rate

__all__ = ["BetaInfo", "find_beta", "temper"]

#: |log(survival rate / target)| at which the root counts as found.
TOLERANCE = 1e-6
#: Most cuts of the bracket; some ten suffice, and each but the first few at least halves it in the end.
MOST_CUTS = 200
#: The bracket goes no farther than this; the exponential of it is still finite.
FARTHEST = 700.0
#: Differences of log likelihood below this are no differences: their scale could not be inverted.
SMALLEST_RANGE = 1e-200


@dataclass(frozen=True)
class BetaInfo:
    """How :func:`find_beta` ended.

    Parameters
    ----------
    status : str
        ``"found"``; or why no power reaches the target: ``"flat"`` (all particles are equally likely), ``"ties"`` (more
        particles share the best likelihood than should survive), ``"few"`` (fewer are possible at all than should survive).
    survival_rate : float
        Survival rate at the returned power.
    evaluations : int
        How often Eq. 3.21 was evaluated.
    """

    status: Literal["found", "flat", "ties", "few"]
    survival_rate: float
    evaluations: int


def temper(log_likelihood: np.ndarray, beta: float) -> np.ndarray:
    """Logarithm of the likelihood to the power `beta` (Eq. 3.18); an impossible state stays impossible even at power 0."""
    log_likelihood = np.asarray(log_likelihood, float)
    if beta > 0:
        return beta * log_likelihood
    return np.where(np.isneginf(log_likelihood), -np.inf, 0.0)


def find_beta(log_likelihood: np.ndarray, target_survival: float) -> tuple[float, BetaInfo]:
    """Power of the likelihood at which the survival rate of the particles is `target_survival`.

    The survival rate of ``likelihood ** beta`` (Canton, Eq. 3.21) falls with beta from the fraction of possible particles
    to the fraction that share the best likelihood. The root is found by regula falsi (the Illinois variant, which halves
    the end that stays) on the logarithm of the rate over the logarithm of beta. Nothing holds beta below 1: the filter
    looks for the maximum of the likelihood, not for its posterior (below Eq. 3.18).

    Parameters
    ----------
    log_likelihood : array_like, shape (n,)
        ``-inf`` where a particle is impossible.
    target_survival : float
        Wanted survival rate, above 0 and at most 1.

    Returns
    -------
    beta : float
        Where no root exists: 1 if all are equally likely (or all impossible), 0 if fewer particles are possible than
        should survive, and if the best are too many, a power at which all others have vanished.
    info : BetaInfo

    Raises
    ------
    ValueError
        When the target is outside (0, 1], or a likelihood is NaN or ``+inf``.
    """
    log_likelihood = np.asarray(log_likelihood, float)
    if not 0 < target_survival <= 1:
        raise ValueError(f"`target_survival` must be above 0 and at most 1; got {target_survival}")
    n = log_likelihood.size
    peak = log_likelihood.max()
    if np.isnan(peak) or peak == np.inf:
        raise ValueError("`log_likelihood` holds NaN or +inf")
    possible = log_likelihood[log_likelihood > -np.inf] - peak
    if possible.size == 0:
        return 1.0, BetaInfo("flat", 1.0, 0)
    scale = -possible.min()
    flat = scale <= max(SMALLEST_RANGE, 4 * np.finfo(float).eps * abs(peak))
    if flat and possible.size == n:
        return 1.0, BetaInfo("flat", 1.0, 0)
    if flat or possible.size <= target_survival * n:
        return 0.0, BetaInfo("few", possible.size / n, 0)

    possible /= scale
    best = possible > -SMALLEST_RANGE
    if np.count_nonzero(best) >= target_survival * n:
        vanishing = 40 / -possible[~best].max()  # all others at e^-40 of the best or less
        return _rescale(vanishing, scale), BetaInfo("ties", float(np.count_nonzero(best) / n), 0)

    def excess(log_beta: float) -> float:
        weights = np.exp(np.exp(log_beta) * possible)
        return float(np.log(weights.sum() ** 2 / (weights @ weights) / (n * target_survival)))

    log_beta, evaluations = _regula_falsi(excess, start=float(-np.log(-possible.mean())))
    beta = _rescale(np.exp(log_beta), scale)
    return beta, BetaInfo("found", survival_rate(normalise(temper(log_likelihood - peak, beta))), evaluations)


def _rescale(beta: float, scale: float) -> float:
    """Power for the log likelihood itself from the power for it divided by `scale`; never infinite."""
    with np.errstate(over="ignore"):
        return float(min(beta / scale, np.finfo(float).max))


def _regula_falsi(function: Callable[[float], float], start: float) -> tuple[float, int]:
    """Root of a falling function that changes sign somewhere; also the number of evaluations.

    Steps that double bracket the root from `start`. Then the secant through the bracket's ends cuts it, and the value at an
    end that stays twice is halved (Illinois), or one end would stay for ever.
    """
    low = high = start
    at_low = at_high = function(start)
    evaluations, step = 1, 1.0
    while at_low < 0 and low > -FARTHEST:
        high, at_high = low, at_low
        low = max(low - step, -FARTHEST)
        at_low = function(low)
        evaluations, step = evaluations + 1, 2 * step
    while at_high > 0 and high < FARTHEST:
        low, at_low = high, at_high
        high = min(high + step, FARTHEST)
        at_high = function(high)
        evaluations, step = evaluations + 1, 2 * step

    kept = 0
    middle = start
    for _ in range(MOST_CUTS):
        if at_low == at_high:
            return low, evaluations  # both zero, to rounding
        middle = (low * at_high - high * at_low) / (at_high - at_low)
        at_middle = function(middle)
        evaluations += 1
        if abs(at_middle) <= TOLERANCE or not low < middle < high:
            break
        if at_middle > 0:
            low, at_low = middle, at_middle
            at_high *= 0.5 if kept > 0 else 1.0
            kept = 1
        else:
            high, at_high = middle, at_middle
            at_low *= 0.5 if kept < 0 else 1.0
            kept = -1
    return middle, evaluations
