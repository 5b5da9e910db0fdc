"""Levenberg-Marquardt on the same cues, for comparison: SciPy's MINPACK. Kehl (2006), section 7.3."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from hmc.pose.objectives.cue_rows import Matches, leclerc

__all__ = ["LmSettings", "lm_run", "robust_residuals"]


@dataclass(frozen=True)
class LmSettings:
    """When it stops.

    Parameters
    ----------
    evaluations : int
        Most evaluations of the residuals, of the full pose and of each chain.
    tolerance : float
        Relative change of cost and of parameters that counts as none.
    """

    evaluations: int = 40
    tolerance: float = 1e-3


def robust_residuals(matches: Matches, rows: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Residuals of which half the squares sum to the objective less what is missing, and their Jacobian.

    Each vector residual is scaled so that half its square is the potential of its error.

    Parameters
    ----------
    matches : Matches
    rows : ndarray, shape (n, 3, 24)
    width : float

    Returns
    -------
    residuals : ndarray, shape (3 n,)
    jacobian : ndarray, shape (3 n, 24)
    """
    error = 0.5 * np.einsum("ni,ni->n", matches.residuals, matches.residuals)
    safe = np.maximum(error, 1e-12)
    scale = np.sqrt(matches.weight * leclerc(safe, width) / safe)
    # d scale / d error, from scale^2 = weight * rho(e) / e
    slope = 0.5 * scale * (np.exp(-safe / width) / (width * np.maximum(leclerc(safe, width), 1e-300)) - 1 / safe)
    change = np.einsum("ni,nij->nj", matches.residuals, rows)
    full = scale[:, None, None] * rows + slope[:, None, None] * matches.residuals[:, :, None] * change[:, None, :]
    return (scale[:, None] * matches.residuals).ravel(), full.reshape(-1, rows.shape[-1])


def lm_run(
    matched: Sequence[Callable[[np.ndarray], tuple[Matches, np.ndarray]]],
    parameters: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    groups: Sequence[np.ndarray],
    width: float,
    settings: LmSettings,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Minimise group after group.

    Matches are looked for anew at every evaluation. MINPACK knows no limits: parameters are put back into them before they are used, and
    what lies beyond pulls back as a residual.

    Parameters
    ----------
    matched : sequence of callable, one a group
        Parameters (24,) to matches and their Jacobian.
    parameters, low, high : ndarray, shape (24,)
    groups : sequence of ndarray of int
    width : float
    settings : LmSettings

    Returns
    -------
    parameters : ndarray, shape (24,)
    evaluations : ndarray of int, one a group
    value : float
        Of the objective at the end.
    """
    parameters = np.array(parameters, float)
    counts, cost = [], np.nan
    for find, group in zip(matched, groups, strict=True):
        parameters[group], evaluations, cost = _minimise(find, parameters, low, high, group, width, settings)
        counts.append(evaluations)
    return parameters, np.array(counts), cost


def _minimise(matched, parameters, low, high, group, width, settings) -> tuple[np.ndarray, int, float]:
    """One group's parameters at the minimum, evaluations, and the cost there."""
    memory: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}  # MINPACK asks for residuals and Jacobian at the same place

    def both(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = x.tobytes()
        if key not in memory:
            memory.clear()
            at = parameters.copy()
            at[group] = np.clip(x, low[group], high[group])
            beyond = x - at[group]
            matches, derivatives = matched(at)
            residuals, rows = robust_residuals(matches, derivatives, width)
            rows = np.concatenate([rows[:, group] * (beyond == 0), np.diag((beyond != 0).astype(float))])
            memory[key] = np.concatenate([residuals, beyond]), rows
        return memory[key]

    def residuals_at(x: np.ndarray) -> np.ndarray:
        return both(x)[0]

    def jacobian(x: np.ndarray) -> np.ndarray:
        return both(x)[1]

    found = least_squares(
        residuals_at, parameters[group], jac=jacobian, method="lm", max_nfev=settings.evaluations,
        xtol=settings.tolerance, ftol=settings.tolerance, gtol=settings.tolerance,
    )  # fmt: skip
    return np.clip(found.x, low[group], high[group]), int(found.nfev), float(found.cost)
