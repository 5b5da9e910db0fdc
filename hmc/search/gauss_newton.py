"""Damped Gauss-Newton within limits: the least squares of residuals that know how they change. Levenberg (1944); Marquardt (1963).

Nothing here knows of bodies. `gauss_newton_init` and `gauss_newton_step` go from state to state, `gauss_newton_run` does many steps and may
be continued. A parameter at its limit that would go beyond it takes no part in a step (the active set of projected Newton, Bertsekas
1982). The jacobian is asked for at accepted states only.

References
----------
K. Levenberg (1944), Quarterly of Applied Mathematics 2: 164. D. W. Marquardt (1963), SIAM Journal 11: 431. D. P. Bertsekas (1982), SIAM
Journal on Control and Optimization 20: 221.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

__all__ = [
    "Damping", "GaussNewtonSettings", "GaussNewtonState", "LeastSquares", "Residuals", "damped", "gauss_newton_init", "gauss_newton_run",
    "gauss_newton_step", "movable",
]  # fmt: skip

#: Added to what relative damping is relative to, so that a parameter on which no residual depends has a solution: it stays.
_LEAST_DIAGONAL = 1e-9


class Residuals(Protocol):
    """Residuals at some parameters.

    Attributes
    ----------
    residuals : ndarray, shape (m,)
    near : object
        What speeds up the next evaluation near these parameters; None where nothing does.
    """

    @property
    def residuals(self) -> np.ndarray: ...
    @property
    def near(self) -> Any: ...
    def pulls(self) -> tuple[Any, np.ndarray]:
        """Which residuals change with the parameters (indices or a slice), k of them, and how, shape (k, n)."""


L = TypeVar("L", bound=Residuals)


@dataclass(frozen=True)
class LeastSquares(Generic[L]):
    """What is minimised: the sum of squared residuals, and of squared distances from an anchor, over a box.

    Parameters
    ----------
    linearise : callable
        ``linearise(x, near)``, with `near` of parameters evaluated before, or None.
    low, high : ndarray, shape (n,)
        Limits; may be infinite.
    hold : ndarray, shape (n,)
        Weights of the squared distances from the anchor.
    free : ndarray of bool, shape (n,), optional
        Parameters that may move; all by default.
    """

    linearise: Callable[[np.ndarray, Any], L]
    low: np.ndarray
    high: np.ndarray
    hold: np.ndarray
    free: np.ndarray | None = None


@dataclass(frozen=True)
class Damping:
    """How the damping of the normal equations adapts.

    Parameters
    ----------
    first : float
    fall, rise : float
        Factors after a step that lowered the cost, and after one that did not.
    least, least_after_failure : float
        It does not fall below the first, and rises to the second at least.
    most : float
        Above this the minimisation ends.
    is_relative : bool
        Relative to the diagonal of the normal matrix (Marquardt); otherwise the same for all parameters (Levenberg).
    """

    first: float = 1e-2
    fall: float = 0.3
    rise: float = 10.0
    least: float = 1e-4
    least_after_failure: float = 1e-2
    most: float = 1e9
    is_relative: bool = True


@dataclass(frozen=True)
class GaussNewtonSettings:
    """How far to go, and when to stop.

    Parameters
    ----------
    iterations : int
        Most accepted steps.
    evaluations : int
        Most evaluations, the first included.
    tolerance : float
        Stop when a step lowers the cost, or promises to, by less than this share.
    least_gain : float
        Stop when a step lowers the cost by less than this.
    longest_step : float
        Largest change of a parameter in a step.
    damping : Damping
    """

    iterations: int = 12
    evaluations: int = 1000
    tolerance: float = 2e-3
    least_gain: float = 0.0
    longest_step: float = 0.5
    damping: Damping = field(default_factory=Damping)


@dataclass(frozen=True)
class _NormalEquations:
    """Gradient (half of the cost's), shape (n,), parameters that take part, shape (k,), and the matrix over these, shape (k, k)."""

    gradient: np.ndarray
    active: np.ndarray
    matrix: np.ndarray


@dataclass(frozen=True)
class GaussNewtonState(Generic[L]):
    """How far a minimisation has come.

    Parameters
    ----------
    x, anchor : ndarray, shape (n,)
    found : Residuals
        At `x`.
    cost, first_cost : float
        Now and at the start, the hold included.
    damping : float
        Of the next step.
    evaluations, accepted : int
        Of the residuals; of steps.
    is_done : bool
        Nothing more is to be gained.
    equations : object, optional
        The normal equations at `x`, after a step that was not accepted.
    """

    x: np.ndarray
    anchor: np.ndarray
    found: L
    cost: float
    first_cost: float
    damping: float
    evaluations: int = 1
    accepted: int = 0
    is_done: bool = False
    equations: _NormalEquations | None = None


def gauss_newton_init(
    problem: LeastSquares[L], x: np.ndarray, settings: GaussNewtonSettings, anchor: np.ndarray | None = None, near: Any = None
) -> GaussNewtonState[L]:
    """The state of a minimisation that has not moved.

    Parameters
    ----------
    problem : LeastSquares
    x : ndarray, shape (n,)
        Start; put within the limits.
    settings : GaussNewtonSettings
    anchor : ndarray, shape (n,), optional
        The start by default.
    near : object, optional
        `Residuals.near` of parameters evaluated before.
    """
    x = np.clip(x, problem.low, problem.high)
    anchor = x if anchor is None else anchor
    found, cost = _evaluate(problem, x, anchor, near)
    return GaussNewtonState(x, anchor, found, cost, cost, settings.damping.first)


def gauss_newton_step(problem: LeastSquares[L], state: GaussNewtonState[L], settings: GaussNewtonSettings) -> GaussNewtonState[L]:
    """The state after one step was tried.

    Parameters
    ----------
    problem : LeastSquares
    state : GaussNewtonState
    settings : GaussNewtonSettings
    """
    equations, damping = state.equations or _normal_equations(problem, state), settings.damping
    active, gradient, matrix = equations.active, equations.gradient[equations.active], equations.matrix
    step = np.zeros(len(state.x))
    heavier = damped(matrix, state.damping) if damping.is_relative else _plus_diagonal(matrix, state.damping)
    step[active] = -np.linalg.solve(heavier, gradient)
    promised = -step[active] @ (2 * gradient + matrix @ step[active])
    if promised <= settings.tolerance * state.cost:
        return replace(state, is_done=True)
    x = np.clip(state.x + np.clip(step, -settings.longest_step, settings.longest_step), problem.low, problem.high)
    found, cost = _evaluate(problem, x, state.anchor, state.found.near)
    if not cost < state.cost:
        stronger = max(state.damping * damping.rise, damping.least_after_failure)
        return replace(
            state, damping=stronger, evaluations=state.evaluations + 1, is_done=stronger > damping.most, equations=equations
        )  # fmt: skip
    gain = state.cost - cost
    return replace(
        state,
        x=x,
        found=found,
        cost=cost,
        damping=max(state.damping * damping.fall, damping.least),
        evaluations=state.evaluations + 1,
        accepted=state.accepted + 1,
        is_done=gain / max(state.cost, 1e-12) < settings.tolerance or gain < settings.least_gain,
        equations=None,
    )


def gauss_newton_run(
    problem: LeastSquares[L], state: GaussNewtonState[L], settings: GaussNewtonSettings, accepted: int | None = None
) -> GaussNewtonState[L]:
    """The state after steps until enough were accepted, or nothing is to be gained.

    Parameters
    ----------
    problem : LeastSquares
    state : GaussNewtonState
        From `gauss_newton_init`, or of a run that is to go on.
    settings : GaussNewtonSettings
    accepted : int, optional
        Accepted steps since the start after which to return; `GaussNewtonSettings.iterations` by default.
    """
    accepted = settings.iterations if accepted is None else accepted
    while state.accepted < accepted and state.evaluations < settings.evaluations and not state.is_done:
        state = gauss_newton_step(problem, state, settings)
    return state


def movable(x: np.ndarray, gradient: np.ndarray, low: np.ndarray, high: np.ndarray, free: np.ndarray | None = None) -> np.ndarray:
    """Indices of the parameters that take part in a step: free ones that are not at a limit beyond which they would go.

    Parameters
    ----------
    x, gradient, low, high : ndarray, shape (n,)
    free : ndarray of bool, shape (n,), optional
    """
    stuck = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
    return np.flatnonzero(~stuck if free is None else ~(stuck | ~free))


def damped(matrix: np.ndarray, damping: float, least: float = _LEAST_DIAGONAL) -> np.ndarray:
    """A normal matrix with this share of its diagonal added, and of `least`, shape (n, n)."""
    return _plus_diagonal(matrix, damping * (np.diagonal(matrix) + least))


def _plus_diagonal(matrix: np.ndarray, diagonal: np.ndarray | float) -> np.ndarray:
    """A copy with something added to its diagonal: at this size `numpy.diag` takes as long as the product of matrices."""
    out = matrix.copy()
    out.ravel()[:: len(matrix) + 1] += diagonal
    return out


def _evaluate(problem: LeastSquares[L], x: np.ndarray, anchor: np.ndarray, near: Any) -> tuple[L, float]:
    found = problem.linearise(x, near)
    return found, float(found.residuals @ found.residuals + problem.hold @ (x - anchor) ** 2)


def _normal_equations(problem: LeastSquares[L], state: GaussNewtonState[L]) -> _NormalEquations:
    rows, jacobian = state.found.pulls()
    gradient = jacobian.T @ state.found.residuals[rows] + problem.hold * (state.x - state.anchor)
    matrix = _plus_diagonal(jacobian.T @ jacobian, problem.hold)
    active = movable(state.x, gradient, problem.low, problem.high, problem.free)
    return _NormalEquations(gradient, active, matrix[active[:, None], active])
