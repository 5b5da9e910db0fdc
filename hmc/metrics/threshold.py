"""Which errors belong to landmarks that are tracked: the threshold of MMTP and MMTA chosen from the errors themselves.

Source: Canton (2009), section 5.3.1, "Parameter-free evaluation", Eq. 5.7 and 5.8. The errors of tracked landmarks are taken to be
Gaussian, those of lost ones to be its tail: the threshold is where the errors below it look most like a Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import ndtr, ndtri

from hmc.errors import InputError

__all__ = ["ThresholdChoice", "choose_threshold", "lilliefors_statistic", "normal_quantiles", "quantile_r2"]

#: Thresholds that are tried.
CANDIDATES = 400
#: A threshold has at least this many errors below it, and this share of all: of a handful, any looks Gaussian.
LEAST_COUNT, LEAST_SHARE = 20, 0.1


@dataclass(frozen=True)
class ThresholdChoice:
    """A threshold and the curve from which it was chosen.

    Parameters
    ----------
    threshold : float
        In the unit of the errors.
    test : str
        ``"lilliefors"`` or ``"r2"``.
    candidates, values : ndarray, shape (k,)
        Thresholds that were tried, rising, and the test's figure for the errors up to each.
    """

    threshold: float
    test: str
    candidates: np.ndarray
    values: np.ndarray


def lilliefors_statistic(values: np.ndarray) -> float:
    """Largest difference between the distribution of values and the Gaussian of their mean and deviation (Lilliefors 1967).

    Parameters
    ----------
    values : array_like, shape (n,)
        Two at least, not all equal.
    """
    values = np.sort(np.asarray(values, float))
    n = len(values)
    spread = _spread(values)
    cdf = ndtr((values - values.mean()) / spread)
    steps = np.arange(n + 1) / n
    return float(max((steps[1:] - cdf).max(), (cdf - steps[:-1]).max()))


def normal_quantiles(n: int) -> np.ndarray:
    """Quantiles of the Gaussian to hold `n` sorted values against, at (i - 1/2) / n (Johnson and Wichern 2007, section 4.6); (n,)."""
    return ndtri((np.arange(n) + 0.5) / n)


def quantile_r2(values: np.ndarray) -> float:
    """Share of the variance of sorted values that a line over the Gaussian's quantiles accounts for, in [0, 1]; 1 is a Gaussian.

    Parameters
    ----------
    values : array_like, shape (n,)
        Two at least, not all equal.
    """
    values = np.sort(np.asarray(values, float))
    _spread(values)
    off, line = values - values.mean(), normal_quantiles(len(values))
    return float((off @ line) ** 2 / ((off @ off) * (line @ line)))


def choose_threshold(errors: np.ndarray, test: Literal["lilliefors", "r2"] = "lilliefors") -> ThresholdChoice:
    """The threshold below which the errors look most like a Gaussian (Canton, Eq. 5.7 and 5.8).

    Parameters
    ----------
    errors : array_like, any shape
        From `hmc.metrics.landmarks.landmark_errors`, 3-D or 2-D; what is not finite is left out.
    test : {"lilliefors", "r2"}
        Least Lilliefors statistic, or greatest R^2 of the quantiles.

    Returns
    -------
    ThresholdChoice

    Raises
    ------
    InputError
        When there are too few errors to tell, or all are equal.
    """
    errors = np.asarray(errors, float)
    errors = np.sort(errors[np.isfinite(errors)])
    if test not in ("lilliefors", "r2"):
        raise InputError(f"`test` must be 'lilliefors' or 'r2'; got {test!r}")
    least = max(LEAST_COUNT, int(np.ceil(LEAST_SHARE * len(errors))))
    if len(errors) < least or errors[least - 1] == errors[0]:
        raise InputError(f"a threshold cannot be chosen from {len(errors)} errors; at least {LEAST_COUNT} that differ are needed")
    # Thresholds are evenly spaced, as outliers are few: places among the sorted errors would leave the tail untried.
    levels = np.linspace(errors[least - 1], errors[-1], CANDIDATES)
    counts = np.unique(np.searchsorted(errors, levels, side="right"))
    function, sign = (lilliefors_statistic, 1) if test == "lilliefors" else (quantile_r2, -1)
    values = np.array([function(errors[:count]) for count in counts])
    candidates = errors[counts - 1]
    return ThresholdChoice(float(candidates[np.argmin(sign * values)]), test, candidates, values)


def _spread(values: np.ndarray) -> float:
    spread = values.std(ddof=1) if len(values) > 1 else 0.0
    if not spread > 0:
        raise InputError("values that do not differ have no distribution to test")
    return float(spread)
