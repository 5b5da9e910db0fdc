"""Stochastic Meta Descent: gradient descent whose step sizes are learnt while it runs. Kehl (2006), section 6.2; Schraudolph (1999).

It knows nothing of bodies. An objective is a function that gives, for parameters, the gradient and the product of (what stands for) the
Hessian with a vector; a stochastic one draws other samples every time it is called.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

__all__ = ["Evaluation", "SmdInfo", "SmdSettings", "SmdState", "converged", "smd_init", "smd_run", "smd_step"]

Product = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Evaluation:
    """An objective at some parameters.

    Parameters
    ----------
    value : float
    gradient : ndarray, shape (n,)
    product : callable
        Vector (n,) to the Hessian's product with it (n,).
    curvature : ndarray, shape (n,)
        The Hessian's diagonal, or what it is at most: first step sizes are taken from it.
    """

    value: float
    gradient: np.ndarray
    product: Product
    curvature: np.ndarray


@dataclass(frozen=True)
class SmdSettings:
    """Parameters of the descent.

    Parameters
    ----------
    first_step : float
        First step sizes, in shares of the inverse curvature ("observe the value of the gradient in the first few iterations").
    meta_step : float
        mu of Eq. 18, in shares of the first step sizes, for parameters in degrees and centimetres. "Values of one-tenth of the initial
        step sizes" worked best in the paper (section 7); first steps that are half the inverse curvature leave little to learn.
    memory : float
        lambda of Eq. 19.
    average : int
        n of Eq. 20: states over which the moving average is taken.
    iterations : int
        Most of them, Eq. 21.
    reach : float
        An iteration changes a parameter by so many tolerances at most, so that no descent runs away; the paper has no such bound.
    """

    first_step: float = 0.5
    meta_step: float = 0.0003
    memory: float = 0.3
    average: int = 3
    iterations: int = 25
    reach: float = 20.0


@dataclass(frozen=True)
class SmdState:
    """Between two iterations.

    Parameters
    ----------
    parameters, steps, trace : ndarray, shape (n,)
        p, a and v of Eq. 17 to 19.
    meta : ndarray, shape (n,)
        mu of Eq. 18.
    history : tuple of ndarray
        The last parameters, `SmdSettings.average` of them at most, the newest last.
    """

    parameters: np.ndarray
    steps: np.ndarray
    trace: np.ndarray
    meta: np.ndarray
    history: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class SmdInfo:
    """How a descent went.

    Parameters
    ----------
    iterations : ndarray of int, shape (n_groups,)
        Of each group of parameters.
    values : ndarray, shape (n,)
        The objective, on the samples of each iteration.
    path : ndarray, shape (n + 1, n_parameters)
    """

    iterations: np.ndarray
    values: np.ndarray
    path: np.ndarray


def smd_init(parameters: np.ndarray, steps: np.ndarray, meta: np.ndarray) -> SmdState:
    """A state that has not moved.

    Parameters
    ----------
    parameters, steps, meta : ndarray, shape (n,)
    """
    parameters = np.asarray(parameters, float)
    return SmdState(parameters, np.asarray(steps, float), np.zeros_like(parameters), np.asarray(meta, float), (parameters,))


def smd_step(state: SmdState, found: Evaluation, low: np.ndarray, high: np.ndarray, settings: SmdSettings) -> SmdState:
    """One iteration, Eq. 17 to 19 and 22, 23.

    Parameters
    ----------
    state : SmdState
    found : Evaluation
        At the state's parameters.
    low, high : ndarray, shape (n,)
        Limits into which parameters are put back.
    settings : SmdSettings
    """
    steps = state.steps * np.clip(1 + state.meta * state.trace * found.gradient, 0.5, 2.0)
    parameters = np.clip(state.parameters - steps * found.gradient, low, high)
    # The gradient that would have led there without limits.
    constrained = (state.parameters - parameters) / steps
    trace = settings.memory * state.trace + steps * (constrained - settings.memory * found.product(state.trace))
    return SmdState(parameters, steps, trace, state.meta, (*state.history, parameters)[-settings.average - 1 :])


def converged(state: SmdState, tolerance: np.ndarray, settings: SmdSettings, group: np.ndarray | slice = slice(None)) -> bool:
    """Whether the moving average has come to rest, Eq. 20.

    Parameters
    ----------
    state : SmdState
    tolerance : ndarray, shape (n,)
        What each parameter may change, its unit of the norm.
    settings : SmdSettings
    group : ndarray of int, optional
        The parameters that are asked about.
    """
    if len(state.history) <= settings.average:
        return False
    moved = (state.history[-1] - state.history[-1 - settings.average]) / tolerance
    return float(np.linalg.norm(moved[group])) <= settings.average


def smd_run(
    objective: Callable[[np.ndarray, np.ndarray], Evaluation],
    parameters: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    tolerance: np.ndarray,
    settings: SmdSettings,
    groups: Sequence[np.ndarray] | None = None,
    units: np.ndarray | float = 1.0,
) -> tuple[np.ndarray, SmdInfo]:
    """Descend until every group of parameters has come to rest.

    Groups that share no term of the objective are so many descents in one: each stops by itself.

    Parameters
    ----------
    objective : callable
        ``objective(parameters, going)``, with `going` (n_groups,) telling which groups are still moving.
    parameters, low, high, tolerance : ndarray, shape (n,)
    settings : SmdSettings
    groups : sequence of ndarray of int, optional
        One group of all parameters by default. What is in no group stays.
    units : ndarray, shape (n,), optional
        Of the parameters: what counts as a change of one in Eq. 18.

    Returns
    -------
    parameters : ndarray, shape (n,)
    info : SmdInfo
    """
    groups = [np.arange(len(parameters))] if groups is None else list(groups)
    going = np.ones(len(groups), bool)
    counts = np.zeros(len(groups), int)
    values: list[float] = []
    state: SmdState | None = None
    path = [np.asarray(parameters, float)]
    while going.any() and len(values) < settings.iterations:
        at = path[-1]
        found = objective(at, going)
        if state is None:
            steps = settings.first_step / np.maximum(found.curvature, 1e-9)
            state = smd_init(at, steps, settings.meta_step * steps / np.square(units))
        free = np.zeros(len(at), bool)
        free[np.concatenate([group for group, moving in zip(groups, going, strict=True) if moving])] = True
        found = replace(found, gradient=np.where(free, found.gradient, 0.0))
        reach = np.where(free, settings.reach, 0.0) * tolerance
        state = smd_step(state, found, np.maximum(low, at - reach), np.minimum(high, at + reach), settings)
        path.append(state.parameters)
        values.append(found.value)
        counts += going
        going &= [not converged(state, tolerance, settings, group) for group in groups]
    return path[-1], SmdInfo(counts, np.array(values), np.array(path))
