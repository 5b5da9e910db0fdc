"""Particle filter and annealed particle filter as steps on frozen states (Canton 2009, Alg. 1 and 3).

One :func:`filter_layer` resamples, propagates and weighs. A step of the plain filter is one layer; a step of the annealed
filter is several, each with a smaller drift and with the power of the likelihood that lets a wanted fraction survive. Filters
with other likelihoods, drifts, resampling or particle counts from layer to layer call the same layer with their own functions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hmc.errors import InputError
from hmc.search.annealing import find_beta, temper
from hmc.search.truncated import truncated_normal
from hmc.search.weights import effective_sample_size, normalise, systematic

__all__ = [
    "AnnealedInfo",
    "AnnealedSettings",
    "LayerInfo",
    "ParticleState",
    "annealed_step",
    "filter_layer",
    "particle_init",
    "sir_step",
    "spread_scale",
    "truncated_drift",
]

#: More layers, or particles in one, are a slip: memory and time for them are nowhere.
MOST_LAYERS, MOST_PARTICLES = 1_000, 100_000

#: ``(n, d)`` states to ``(n,)`` log likelihoods.
LogLikelihood = Callable[[np.ndarray], np.ndarray]
#: Generator and ``(n, d)`` states to ``(n, d)`` moved states.
Propagate = Callable[[np.random.Generator, np.ndarray], np.ndarray]
#: Generator, ``(n_in,)`` weights and a number to that many indices.
Resample = Callable[[np.random.Generator, np.ndarray, int], np.ndarray]

BetaStatus = Literal["fixed", "found", "flat", "ties", "few"]


@dataclass(frozen=True)
class ParticleState:
    """Weighted particles, the belief about one state vector.

    Parameters
    ----------
    particles : ndarray, shape (n, d)
    log_weights : ndarray, shape (n,)
        Up to a common constant.
    """

    particles: np.ndarray
    log_weights: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Weighted mean, shape (d,): the filter's estimate (Eq. 3.16 and 3.19)."""
        return normalise(self.log_weights) @ self.particles


@dataclass(frozen=True)
class LayerInfo:
    """What happened in one layer.

    Parameters
    ----------
    ess : float
        Effective sample size after weighing.
    survival_rate : float
        The same as a fraction of the layer's particles.
    beta : float
        Power of the likelihood.
    beta_status : str
        ``"fixed"``, or how :func:`find_beta` ended.
    evaluations : int
        Evaluations of the likelihood: the number of particles.
    ancestors : ndarray of int, shape (n,)
        Which particle of the state before each one was drawn from.
    best : ndarray, shape (d,)
        The particle of the highest likelihood.
    best_log_likelihood : float
    drift : ndarray, shape (d,)
        How far the particles moved, the root of the mean square of each variable's moves.
    """

    ess: float
    survival_rate: float
    beta: float
    beta_status: BetaStatus
    evaluations: int
    ancestors: np.ndarray
    best: np.ndarray
    best_log_likelihood: float
    drift: np.ndarray


@dataclass(frozen=True)
class AnnealedSettings:
    """Settings of :func:`annealed_step`; the defaults are the printed ones (Canton, 3.2.2 and 6.7.2).

    Parameters
    ----------
    layers : int
    particles : int or sequence of int
        Particles a layer, one number or one for each layer.
    survival_rate : float or sequence of float
        Wanted survival rate a layer, above 0 and at most 1.
    spread : ``"survival"``, ``"variance"`` or float
        How the drift shrinks: by the survival rates of the layers already run (Eq. 3.22); by their square roots, which reads the P of that
        equation as the covariance matrix that the text calls it; or by this factor a layer.

    Raises
    ------
    InputError
        When a number is out of its range or a sequence has not one entry a layer.
    """

    layers: int = 6
    particles: int | Sequence[int] = 600
    survival_rate: float | Sequence[float] = 0.5
    spread: Literal["survival", "variance"] | float = "survival"

    def __post_init__(self) -> None:
        if not 1 <= self.layers <= MOST_LAYERS:
            raise InputError(f"`layers` must be at least 1 and at most {MOST_LAYERS}; got {self.layers}")
        for name in ("particles", "survival_rate"):
            value = getattr(self, name)
            if np.ndim(value) > 0 and np.shape(value) != (self.layers,):
                raise InputError(f"`{name}` must be one number or one for each of the {self.layers} layers; got {value}")
        if not (np.min(self.particles) >= 1 and np.max(self.particles) <= MOST_PARTICLES):
            raise InputError(f"`particles` must be at least 1 and at most {MOST_PARTICLES} in every layer; got {self.particles}")
        if not (np.min(self.survival_rate) > 0 and np.max(self.survival_rate) <= 1):
            raise InputError(f"`survival_rate` must be above 0 and at most 1; got {self.survival_rate}")
        if self.spread not in ("survival", "variance") and not (isinstance(self.spread, (int, float)) and 0 < self.spread < np.inf):
            raise InputError(f"`spread` must be 'survival', 'variance' or a positive factor a layer; got {self.spread!r}")

    def layer_particles(self, layer: int) -> int:
        """Particles in a layer, counted from 0."""
        return int(np.broadcast_to(self.particles, self.layers)[layer])

    def layer_survival(self, layer: int) -> float:
        """Wanted survival rate in a layer, counted from 0."""
        return float(np.broadcast_to(self.survival_rate, self.layers)[layer])


@dataclass(frozen=True)
class AnnealedInfo:
    """What happened in one annealed step; arrays have one entry a layer.

    Parameters
    ----------
    ess, survival_rate, beta, scale : ndarray, shape (layers,)
        As in :class:`LayerInfo`; `scale` is what the drift was multiplied by.
    beta_status : tuple of str
    evaluations : int
        Evaluations of the likelihood in all.
    estimate : ndarray, shape (d,)
        Weighted mean of the last layer (Eq. 3.19).
    best : ndarray, shape (d,)
        The state of the highest likelihood met in any layer.
    best_log_likelihood : float
    """

    ess: np.ndarray
    survival_rate: np.ndarray
    beta: np.ndarray
    scale: np.ndarray
    beta_status: tuple[str, ...]
    evaluations: int
    estimate: np.ndarray
    best: np.ndarray
    best_log_likelihood: float


def particle_init(particles: np.ndarray, log_weights: np.ndarray | None = None) -> ParticleState:
    """A filter's first state.

    Parameters
    ----------
    particles : array_like, shape (n, d)
        One row is enough: the first layer draws as many as it wants.
    log_weights : array_like, shape (n,), optional
        Equal by default.

    Raises
    ------
    ValueError
        When a shape is wrong.
    """
    particles = np.array(particles, float)
    if particles.ndim != 2 or len(particles) == 0:
        raise ValueError(f"`particles` must be (n, d) with n at least 1; got shape {particles.shape}")
    log_weights = np.zeros(len(particles)) if log_weights is None else np.array(log_weights, float)
    if log_weights.shape != (len(particles),):
        raise ValueError(f"`log_weights` must be ({len(particles)},), one a particle; got shape {log_weights.shape}")
    return ParticleState(particles, log_weights)


def truncated_drift(sd: np.ndarray | float, low: np.ndarray | float, high: np.ndarray | float, scale: float = 1.0) -> Propagate:
    """Propagation by a Gaussian of spread ``scale * sd`` that is cut to [low, high] (Canton, Eq. 6.3 and Fig. 6.6)."""
    return lambda rng, particles: truncated_normal(rng, particles, np.multiply(sd, scale), low, high)


def filter_layer(
    rng: np.random.Generator,
    state: ParticleState,
    log_likelihood: LogLikelihood,
    propagate: Propagate,
    particles: int | None = None,
    target_survival: float | None = None,
    resample: Resample = systematic,
) -> tuple[ParticleState, LayerInfo]:
    """Resample, propagate and weigh once.

    Parameters
    ----------
    rng : numpy.random.Generator
    state : ParticleState
    log_likelihood, propagate, resample : callable
        ``(n, d) -> (n,)``; ``(rng, (n, d)) -> (n, d)``; ``(rng, weights, n) -> indices``.
    particles : int, optional
        How many to draw; by default as many as there are.
    target_survival : float, optional
        If given, the likelihood is raised to the power at which this fraction survives; otherwise it is taken as it is.

    Returns
    -------
    state : ParticleState
    info : LayerInfo
    """
    n = len(state.particles) if particles is None else particles
    ancestors = resample(rng, normalise(state.log_weights), n)
    drawn = state.particles[ancestors]
    moved = propagate(rng, drawn)
    drift = np.sqrt(np.mean((moved - drawn) ** 2, axis=0))
    log_weights = np.asarray(log_likelihood(moved), float)
    if log_weights.shape != (len(moved),):
        raise ValueError(f"`log_likelihood` must give ({len(moved)},), one number a particle; it gave shape {log_weights.shape}")
    best = int(np.argmax(log_weights))
    best_log_likelihood = float(log_weights[best])
    beta = 1.0
    status: BetaStatus = "fixed"
    if target_survival is not None:
        beta, beta_info = find_beta(log_weights, target_survival)
        status = beta_info.status
        log_weights = temper(log_weights - best_log_likelihood if np.isfinite(best_log_likelihood) else log_weights, beta)
    ess = effective_sample_size(normalise(log_weights))
    info = LayerInfo(ess, ess / len(moved), beta, status, len(moved), ancestors, moved[best], best_log_likelihood, drift)
    return ParticleState(moved, log_weights), info


def sir_step(
    rng: np.random.Generator,
    state: ParticleState,
    log_likelihood: LogLikelihood,
    propagate: Propagate,
    particles: int | None = None,
    resample: Resample = systematic,
) -> tuple[ParticleState, LayerInfo]:
    """One instant of the sampling importance resampling filter (Canton, Alg. 1); the estimate is ``state.mean``.

    See :func:`filter_layer` for the arguments; :func:`truncated_drift` makes a `propagate`.
    """
    return filter_layer(rng, state, log_likelihood, propagate, particles, None, resample)


def spread_scale(spread: Literal["survival", "variance"] | float, survival_rates: Sequence[float]) -> float:
    """What the drift of the next layer is multiplied by, after layers with these survival rates (Eq. 3.22).

    The first layer's drift is P0; then it shrinks by the survival rates of the layers already run, by their square roots, or by a fixed
    factor for each of them.
    """
    if isinstance(spread, str):
        return float(np.prod(survival_rates)) ** (0.5 if spread == "variance" else 1.0)
    return float(spread) ** len(survival_rates)


def annealed_step(
    rng: np.random.Generator,
    state: ParticleState,
    log_likelihood: LogLikelihood,
    sd: np.ndarray | float,
    low: np.ndarray | float,
    high: np.ndarray | float,
    settings: AnnealedSettings,
) -> tuple[ParticleState, AnnealedInfo]:
    """One instant of the annealed particle filter (Canton, Alg. 3).

    Parameters
    ----------
    rng : numpy.random.Generator
    state : ParticleState
        The last layer of the instant before.
    log_likelihood : callable
        ``(n, d) -> (n,)``.
    sd : array_like, shape (d,) or scalar
        P0, the first layer's drift: half of the largest variation expected in one instant.
    low, high : array_like, shape (d,) or scalar
        Limits of the state.
    settings : AnnealedSettings

    Returns
    -------
    state : ParticleState
    info : AnnealedInfo
    """
    infos: list[LayerInfo] = []
    scales: list[float] = []
    for layer in range(settings.layers):
        scales.append(spread_scale(settings.spread, [info.survival_rate for info in infos]))
        state, info = filter_layer(
            rng,
            state,
            log_likelihood,
            truncated_drift(sd, low, high, scales[-1]),
            settings.layer_particles(layer),
            settings.layer_survival(layer),
        )
        infos.append(info)
    best = max(infos, key=lambda info: info.best_log_likelihood)
    return state, AnnealedInfo(
        ess=np.array([info.ess for info in infos]),
        survival_rate=np.array([info.survival_rate for info in infos]),
        beta=np.array([info.beta for info in infos]),
        scale=np.array(scales),
        beta_status=tuple(info.beta_status for info in infos),
        evaluations=sum(info.evaluations for info in infos),
        estimate=state.mean,
        best=best.best,
        best_log_likelihood=best.best_log_likelihood,
    )
