"""Several scores of a state made into one cost, and costs into the logarithm of a fitness (Canton 2009, section 3.1.2.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hmc.errors import InputError

__all__ = ["combined_cost", "log_fitness", "log_joint_fitness"]

#: By so much shares may miss a sum of 1.
ROUNDING = 1e-6


def combined_cost(costs: np.ndarray, shares: ArrayLike) -> np.ndarray:
    """Costs joined linearly (Canton, Eq. 3.13).

    Parameters
    ----------
    costs : ndarray, shape (..., k)
        Each 0 for a perfect match; in [0, 1] where the shares are to mean what they say.
    shares : array_like, shape (k,)
        lambda, the weight of each cost: not negative, 1 in all.

    Returns
    -------
    ndarray, shape (...)
        In the costs' precision.

    Raises
    ------
    InputError
        When the shares are not one a cost, or negative, or not 1 in all.
    """
    costs = np.asarray(costs)
    shares = np.asarray(shares, costs.dtype if costs.dtype.kind == "f" else float)
    if shares.shape != costs.shape[-1:]:
        raise InputError(f"`shares` must be one a cost, {costs.shape[-1]}; got shape {shares.shape}")
    if shares.min() < 0 or abs(float(shares.sum()) - 1) > ROUNDING:
        raise InputError(f"`shares` must not be negative and be 1 in all; got {shares.tolist()}")
    return costs @ shares


def log_fitness(cost: np.ndarray, sigma: float) -> np.ndarray:
    """Logarithm of the fitness of a cost, up to a constant (Canton, Eq. 3.14): ``-cost ** 2 / (2 sigma ** 2)``."""
    return -(np.asarray(cost) ** 2) / (2 * sigma**2)


def log_joint_fitness(costs: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Logarithm of the fitness of several costs together, up to a constant: a Gaussian in all of them (Canton, Eq. 3.15).

    Parameters
    ----------
    costs : ndarray, shape (..., k)
    covariance : array_like, shape (..., k, k)
        H, symmetric and positive definite: what each cost counts, and which of them go together.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    InputError
        When the covariance is not of that kind.
    """
    costs, covariance = np.asarray(costs, float), np.asarray(covariance, float)
    k = costs.shape[-1]
    if covariance.shape[-2:] != (k, k) or not np.allclose(covariance, np.swapaxes(covariance, -1, -2)):
        raise InputError(f"`covariance` must be symmetric, (..., {k}, {k}); got shape {covariance.shape}")
    try:
        root = np.linalg.inv(np.linalg.cholesky(covariance))
    except np.linalg.LinAlgError as error:
        raise InputError("`covariance` must be positive definite") from error
    # The length of the costs in units of the Gaussian's axes: never negative, whatever is rounded.
    along = np.einsum("...j,...ij->...i", costs, root)
    return -0.5 * np.einsum("...i,...i->...", along, along)
