"""Particle swarm optimisation. Kennedy and Eberhart (1995); Hsiao (2008), section 3.2.2.2.

`pso_init` and `pso_step` go from state to state; `pso_run` does both. What draws a particle besides its own best place is the best
place of all, of its neighbours in a ring, or of its own swarm of several.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

__all__ = ["PsoSettings", "PsoState", "pso_init", "pso_run", "pso_step"]

Cost = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class PsoSettings:
    """How a swarm moves.

    Parameters
    ----------
    particles, iterations : int
    inertia, own, shared : float
        t1, t2 and t3 of the thesis, which gives no values; these are the constriction of Clerc and Kennedy (2002).
    topology : {"global", "ring", "swarms"}
        Whose best place draws a particle: that of all, of itself and its two neighbours, or of its swarm.
    swarms : int
        Number of swarms.
    fastest : float
        Largest velocity as a share of the range.
    anywhere : bool
        Whether all particles begin anywhere in the box, as in the thesis's pseudo code; else the first at places that are known.
    stop_spread : float
        The run ends when no best place is farther from the best of all than this share of the range; 0: never.
    """

    particles: int = 30
    iterations: int = 40
    inertia: float = 0.7298
    own: float = 1.49618
    shared: float = 1.49618
    topology: Literal["global", "ring", "swarms"] = "global"
    swarms: int = 3
    fastest: float = 0.5
    anywhere: bool = False
    stop_spread: float = 0.0


@dataclass(frozen=True)
class PsoState:
    """A swarm.

    Parameters
    ----------
    positions, velocities : ndarray, shape (n, d)
    best : ndarray, shape (n, d)
        Each particle's best place so far.
    best_costs : ndarray, shape (n,)
    evaluations : int
    """

    positions: np.ndarray
    velocities: np.ndarray
    best: np.ndarray
    best_costs: np.ndarray
    evaluations: int

    @property
    def leader(self) -> np.ndarray:
        """The best place of all, shape (d,)."""
        return self.best[int(self.best_costs.argmin())]

    @property
    def cost(self) -> float:
        """Its cost."""
        return float(self.best_costs.min())


def pso_init(
    rng: np.random.Generator, cost: Cost, low: np.ndarray, high: np.ndarray, settings: PsoSettings, starts: np.ndarray | None = None
) -> PsoState:
    """A swarm spread evenly over a box, at rest.

    Parameters
    ----------
    rng : numpy.random.Generator
    cost : callable
        ``cost(positions) -> costs``, (n, d) to (n,).
    low, high : ndarray, shape (d,)
    settings : PsoSettings
    starts : ndarray, shape (k, d), optional
        Places that the first particles take, unless all begin anywhere.
    """
    positions = rng.uniform(low, high, (settings.particles, len(low)))
    if starts is not None and not settings.anywhere:
        k = min(len(starts), len(positions))
        positions[:k] = np.clip(starts[:k], low, high)
    return PsoState(positions, np.zeros_like(positions), positions, cost(positions), len(positions))


def pso_step(rng: np.random.Generator, cost: Cost, low: np.ndarray, high: np.ndarray, settings: PsoSettings, state: PsoState) -> PsoState:
    """One iteration; arguments as for `pso_init`. Who would leave the box stops at its wall."""
    n, d = state.positions.shape
    leaders = state.best[_leaders(state.best_costs, settings)]
    own, shared = rng.random((2, n, d))
    velocities = settings.inertia * state.velocities
    velocities += settings.own * own * (state.best - state.positions)
    velocities += settings.shared * shared * (leaders - state.positions)
    fastest = settings.fastest * (high - low)
    np.clip(velocities, -fastest, fastest, out=velocities)
    positions = state.positions + velocities
    outside = (positions < low) | (positions > high)
    np.clip(positions, low, high, out=positions)
    velocities[outside] = 0
    costs = cost(positions)
    better = costs < state.best_costs
    return PsoState(
        positions,
        velocities,
        np.where(better[:, None], positions, state.best),
        np.where(better, costs, state.best_costs),
        state.evaluations + n,
    )


def pso_run(
    rng: np.random.Generator,
    cost: Cost,
    low: np.ndarray,
    high: np.ndarray,
    settings: PsoSettings | None = None,
    starts: np.ndarray | None = None,
) -> PsoState:
    """A whole optimisation; arguments as for `pso_init`."""
    settings = settings or PsoSettings()
    state = pso_init(rng, cost, low, high, settings, starts)
    span = np.maximum(high - low, 1e-300)
    for _ in range(settings.iterations):
        state = pso_step(rng, cost, low, high, settings, state)
        if settings.stop_spread and (np.abs(state.best - state.leader) / span).max() < settings.stop_spread:
            break
    return state


def _leaders(costs: np.ndarray, settings: PsoSettings) -> np.ndarray:
    """Whose best place draws each particle, shape (n,)."""
    n = len(costs)
    if settings.topology == "global":
        return np.full(n, costs.argmin())
    index = np.arange(n)
    if settings.topology == "ring":
        near = np.stack([(index - 1) % n, index, (index + 1) % n])
        return near[costs[near].argmin(0), index]
    swarm = index * settings.swarms // n
    best = np.array([np.flatnonzero(swarm == k)[costs[swarm == k].argmin()] for k in range(settings.swarms)])
    return best[swarm]
