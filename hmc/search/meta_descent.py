"""Stochastic Meta Descent: gradient descent whose step sizes are learnt while it runs. Kehl (2006), section 6.2; Schraudolph (1999).

It knows nothing of bodies. An objective is a function that gives, for parameters, the gradient and the product of (what stands for) the
Hessian with a vector; a stochastic one draws other samples every time it is called.

The step sizes are a diagonal conditioner: of parameters that pull at the same points, such as a trunk's place and the hips' angles, it
knows nothing, and the descent winds down a valley. With `SmdSettings.by_curvature` the same descent runs along other axes, in which the
curvature at the start is the unit matrix. The paper's runs along the parameters themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

__all__ = ["Evaluation", "SmdInfo", "SmdSettings", "SmdState", "converged", "curvature_axes", "smd_init", "smd_run", "smd_step"]

Product = Callable[[np.ndarray], np.ndarray]
#: A parameter of which one tolerance changes the objective by less than this share of what the strongest does is held back.
_FLAT = 1e-5


@dataclass(frozen=True)
class Evaluation:
    """An objective at some parameters.

    Parameters
    ----------
    value : float
    gradient : ndarray, shape (n,)
    product : callable
        Vector (n,) to the Hessian's product with it (n,).
    curvature : callable
        Gives the Hessian, or what it is at most, (n, n), positive semidefinite: asked for once, at the start, for axes and step sizes.
    """

    value: float
    gradient: np.ndarray
    product: Product
    curvature: Callable[[], np.ndarray]


@dataclass(frozen=True)
class SmdSettings:
    """Parameters of the descent.

    Parameters
    ----------
    first_step : float
        First step sizes, in shares of the inverse curvature ("observe the value of the gradient in the first few iterations"). More than
        1 is well for points that are matched anew at every iteration: along a limb the matches come along, and the way is farther.
    meta_step : float
        mu of Eq. 18, in shares of the first step sizes: "values of one-tenth of the initial step sizes" worked best (section 7).
    memory : float
        lambda of Eq. 19.
    average : int
        n of Eq. 20: states over which the moving average is taken.
    iterations : int
        Most of them, Eq. 21.
    reach : float
        An iteration changes a parameter by so many tolerances at most, so that no descent runs away; the paper has no such bound.
    by_curvature : bool
        Descend along axes in which the curvature at the start is the unit matrix; otherwise along the parameters, as in the paper.
    damping : float
        So large a share of the curvature's diagonal is added before axes are taken from it.
    averaged : bool
        The moving average of Eq. 20 is what is found; otherwise the last state, as in the paper. Every state comes from samples of
        its own, so the average rests on more of them.
    growth : float
        A step size grows by this factor at most from one iteration to the next; the paper has no such bound.
    """

    first_step: float = 1.5
    meta_step: float = 0.1
    memory: float = 0.3
    average: int = 4
    iterations: int = 12
    reach: float = 5.0
    by_curvature: bool = True
    damping: float = 0.1
    averaged: bool = True
    growth: float = 2.0


@dataclass(frozen=True)
class SmdState:
    """Between two iterations.

    Parameters
    ----------
    parameters : ndarray, shape (n,)
        p of Eq. 17.
    steps, trace, meta : ndarray, shape (n,)
        a, v and mu of Eq. 17 to 19, along the axes.
    axes, inverse : ndarray, shape (n, n)
        Columns: what a step of one along each axis changes in the parameters; and the inverse of that.
    history : tuple of ndarray
        The last parameters, `SmdSettings.average` and one more of them at most, the newest last.
    """

    parameters: np.ndarray
    steps: np.ndarray
    trace: np.ndarray
    meta: np.ndarray
    axes: np.ndarray
    inverse: np.ndarray
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


def smd_init(parameters: np.ndarray, steps: np.ndarray, meta: np.ndarray, axes: np.ndarray | None = None) -> SmdState:
    """A state that has not moved.

    Parameters
    ----------
    parameters, steps, meta : ndarray, shape (n,)
    axes : ndarray, shape (n, n), optional
        The parameters' own by default.
    """
    parameters = np.asarray(parameters, float)
    axes = np.eye(len(parameters)) if axes is None else axes
    return SmdState(
        parameters, np.asarray(steps, float), np.zeros_like(parameters), np.asarray(meta, float), axes, np.linalg.inv(axes), (parameters,)
    )


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
    gradient = found.gradient @ state.axes
    steps = state.steps * np.clip(1 + state.meta * state.trace * gradient, 0.5, settings.growth)
    parameters = np.clip(state.parameters - state.axes @ (steps * gradient), low, high)
    # The gradient that would have led there without limits.
    constrained = state.inverse @ (state.parameters - parameters) / steps
    product = found.product(state.axes @ state.trace) @ state.axes
    trace = settings.memory * state.trace + steps * (constrained - settings.memory * product)
    return SmdState(parameters, steps, trace, state.meta, state.axes, state.inverse, (*state.history, parameters)[-settings.average - 1 :])


def curvature_axes(curvature: np.ndarray, groups: Sequence[np.ndarray], tolerance: np.ndarray, damping: float) -> np.ndarray:
    """Axes in which a curvature is the unit matrix, group by group; what is in no group keeps its own.

    Parameters
    ----------
    curvature : ndarray, shape (n, n)
    groups : sequence of ndarray of int
    tolerance : ndarray, shape (n,)
    damping : float
        Share of the diagonal that is added.

    Returns
    -------
    ndarray, shape (n, n)
        ``axes.T @ curvature @ axes`` is the unit matrix within each group, but for the damping.
    """
    axes = np.eye(len(curvature))
    for group in groups:
        block = curvature[np.ix_(group, group)]
        effect = np.diag(block) * tolerance[group] ** 2
        least = _FLAT * effect.max() if effect.max() > 0 else 1.0
        block = block + np.diag(damping * np.diag(block) + least / tolerance[group] ** 2)
        axes[np.ix_(group, group)] = np.linalg.inv(np.linalg.cholesky(block)).T
    return axes


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
    bounds: tuple[np.ndarray, np.ndarray],
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
    parameters, tolerance : ndarray, shape (n,)
    bounds : tuple of ndarray, shape (n,)
        Low and high limits.
    settings : SmdSettings
    groups : sequence of ndarray of int, optional
        One group of all parameters by default. What is in no group stays.
    units : ndarray, shape (n,), optional
        Of the parameters: what counts as a change of one in Eq. 18, where the descent is along them.

    Returns
    -------
    parameters : ndarray, shape (n,)
    info : SmdInfo
    """
    groups = [np.arange(len(parameters))] if groups is None else list(groups)
    low, high = bounds
    going = np.ones(len(groups), bool)
    counts = np.zeros(len(groups), int)
    values: list[float] = []
    state: SmdState | None = None
    path = [np.asarray(parameters, float)]
    while going.any() and len(values) < settings.iterations:
        at = path[-1]
        found = objective(at, going)
        if state is None:
            state = _begun(at, found.curvature(), groups, tolerance, settings, units)
        free = np.zeros(len(at), bool)
        free[np.concatenate([group for group, moving in zip(groups, going, strict=True) if moving])] = True
        found = replace(found, gradient=np.where(free, found.gradient, 0.0))
        reach = np.where(free, settings.reach, 0.0) * tolerance
        state = smd_step(state, found, np.maximum(low, at - reach), np.minimum(high, at + reach), settings)
        path.append(state.parameters)
        values.append(found.value)
        counts += going
        going &= [not converged(state, tolerance, settings, group) for group in groups]
    end = path[-1].copy()
    for group, count in zip(groups, counts, strict=True):
        last = path[1 : count + 1][-settings.average if settings.averaged else -1 :]
        if last:
            end[group] = np.mean([one[group] for one in last], axis=0)
    return end, SmdInfo(counts, np.array(values), np.array(path))


def _begun(at: np.ndarray, curvature: np.ndarray, groups, tolerance: np.ndarray, settings: SmdSettings, units) -> SmdState:
    """The state before the first iteration, with axes and step sizes by the curvature."""
    if settings.by_curvature:
        steps = np.full(len(at), settings.first_step)
        return smd_init(at, steps, settings.meta_step * steps, curvature_axes(curvature, groups, tolerance, settings.damping))
    steps = settings.first_step / np.maximum(np.diag(curvature), 1e-9)
    return smd_init(at, steps, settings.meta_step * steps / np.square(units))
