"""Structural annealing: a filter thread a model, from the simplest body to the whole (Canton 2009, section 7.3).

Each thread filters its model's angles with annealed layers and hands its particles on to the next; the last one's particles flow back to
all. This module knows states and likelihoods, nothing of bodies; the likelihoods are functions passed in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.errors import InputError
from hmc.search.annealing import find_beta, temper
from hmc.search.filters import LayerInfo, LogLikelihood, ParticleState, filter_layer, truncated_drift
from hmc.search.weights import normalise, systematic

__all__ = [
    "StructuralInfo",
    "StructuralSettings",
    "Variables",
    "backward",
    "cross_limbs",
    "crossing",
    "forward",
    "ranked",
    "spread_schedule",
    "structural_step",
]


@dataclass(frozen=True)
class StructuralSettings:
    """Settings of `structural_step`; the defaults are the printed ones (Canton, 7.5.1), but for `assigned`.

    Parameters
    ----------
    gamma : float
        Particles for each dimension that a model adds (Eq. 7.28).
    assigned : tuple of int
        Dimensions by which particles are shared out among the models (Eq. 7.21), where they are not those that each adds.
    layers : int
        Annealed layers of each model, L.
    inner : float
        Factor on the spread from layer to layer of a model, alpha_H.
    structural : float
        Factor on the spread from model to model, alpha_S.
    survival_rate : float
        Wanted survival rate a layer.
    partitions : int
        Parts of equal size into which ranked particles are divided for the crossing.
    crossed : float
        Share of each part that is paired with the part of opposite rank.
    by_limb : bool
        Between the inner layers of a model particles exchange limbs, each by its own share of the likelihood (`cross_limbs`); beyond
        the thesis. A likelihood that is not told by limbs is not touched by it.

    Raises
    ------
    InputError
        When a number is out of its range.
    """

    gamma: float = 50.0
    assigned: tuple[int, ...] = ()
    layers: int = 2
    inner: float = 0.5
    structural: float = 0.8
    survival_rate: float = 0.5
    partitions: int = 5
    crossed: float = 0.2
    by_limb: bool = False

    def __post_init__(self) -> None:
        for name in ("gamma", "inner", "structural", "survival_rate"):
            if not getattr(self, name) > 0:
                raise InputError(f"`{name}` must be above 0; got {getattr(self, name)}")
        for name in ("layers", "partitions"):
            if getattr(self, name) < 1:
                raise InputError(f"`{name}` must be at least 1; got {getattr(self, name)}")
        for name in ("inner", "structural", "survival_rate"):
            if getattr(self, name) > 1:
                raise InputError(f"`{name}` must be at most 1; got {getattr(self, name)}")
        if not 0 <= self.crossed <= 1:
            raise InputError(f"`crossed` must lie in 0 to 1; got {self.crossed}")

    def particles(self, added: np.ndarray) -> np.ndarray:
        """Particles of each model for the dimensions that it adds (Eq. 7.28), two at least.

        Raises
        ------
        InputError
            When `assigned` has not one number a model.
        """
        if self.assigned and len(self.assigned) != len(added):
            raise InputError(f"`assigned` must have one number for each of {len(added)} models; got {self.assigned}")
        return np.maximum(np.rint(self.gamma * np.asarray(self.assigned or added)).astype(int), 2)


@dataclass(frozen=True)
class Variables:
    """What states are made of.

    Parameters
    ----------
    group : ndarray of int, shape (d,)
        The first model that has each variable.
    sd, low, high : ndarray, shape (d,)
        First spread and limits.
    limb : ndarray of int, shape (d,), optional
        The column of the likelihoods to which each variable belongs; by default limbs are not crossed.
    """

    group: np.ndarray
    sd: np.ndarray
    low: np.ndarray
    high: np.ndarray
    limb: np.ndarray | None = None


@dataclass(frozen=True)
class StructuralInfo:
    """What happened in one structural step.

    Parameters
    ----------
    estimates : ndarray, shape (n_models, d)
        Weighted mean of every model's particles (Eq. 7.11); NaN where the model lacks the variable.
    best : ndarray, shape (d,)
        The state of the highest likelihood met by the last model.
    best_log_likelihood : float
    evaluations : int
        Of all likelihoods.
    layers : tuple of tuple of LayerInfo
        For every model, its layers.
    """

    estimates: np.ndarray
    best: np.ndarray
    best_log_likelihood: float
    evaluations: int
    layers: tuple[tuple[LayerInfo, ...], ...]


def spread_schedule(group: np.ndarray, level: int, layer: int, settings: StructuralSettings) -> np.ndarray:
    """Factor on every variable's first spread in one layer of one model (Eq. 7.26, with the exponents of Eq. 7.23 to 7.25).

    Parameters
    ----------
    group : ndarray of int, shape (d,)
        The first model that has each variable, from 0.
    level, layer : int
        Model and its inner layer, from 0.
    settings : StructuralSettings

    Returns
    -------
    ndarray, shape (d,)
        0 where the model lacks the variable. It falls from layer to layer and from model to model.
    """
    before = np.maximum(level - group, 0)
    factor = settings.structural**before * settings.inner ** (before * settings.layers + layer)
    return np.where(group <= level, factor, 0.0)


def ranked(state: ParticleState) -> ParticleState:
    """The same particles by falling weight; equals keep their order."""
    order = np.argsort(-state.log_weights, kind="stable")
    return ParticleState(state.particles[order], state.log_weights[order])


def crossing(n: int, partitions: int, crossed: float) -> np.ndarray:
    """Which of ``n`` ranked particles of one set is joined with which of another: a permutation.

    The thesis draws its rule and does not state it (Fig. 7.9(c)); this is ours. Both sets are divided into parts of equal size by rank.
    Most particles are joined with the one of the same rank; the last share `crossed` of every part is joined with the same places of the
    part of opposite rank, so that the best of one set also meet the worst of the other.

    Parameters
    ----------
    n, partitions : int
        What does not fill a part keeps its rank.
    crossed : float
        0 to 1.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    pairs = np.arange(n)
    size = n // partitions
    n_crossed = round(crossed * size)
    if n_crossed:
        blocks = pairs[: size * partitions].reshape(partitions, size)
        blocks[:, size - n_crossed :] = blocks[::-1, size - n_crossed :].copy()
    return pairs


def cross_limbs(
    rng: np.random.Generator, state: ParticleState, log_likelihood: np.ndarray, limb: np.ndarray, survival_rate: float
) -> ParticleState:
    """Children with the trunk of one particle and each limb of another, drawn by what the likelihood says of that limb alone.

    A particle is rarely right in all limbs at once; where the likelihood is a product over limbs, the best of each may be joined.

    Parameters
    ----------
    rng : numpy.random.Generator
    state : ParticleState
        Weighted; trunks are drawn by these weights.
    log_likelihood : ndarray, shape (n, n_limbs)
        Of each limb; the first column is the trunk.
    limb : ndarray of int, shape (d,)
        The column to which each variable belongs.
    survival_rate : float
        Wanted survival rate of each limb's draw.

    Returns
    -------
    ParticleState
        As many, of equal weights.
    """
    n = len(state.particles)
    children = state.particles[systematic(rng, normalise(state.log_weights), n)]
    for k in range(1, log_likelihood.shape[1]):
        own = log_likelihood[:, k]
        beta, _ = find_beta(own, survival_rate)
        # Shuffled: the draw keeps the order, and limbs are not to meet by it.
        drawn = rng.permutation(systematic(rng, normalise(temper(own, beta)), n))
        children[:, limb == k] = state.particles[np.ix_(drawn, limb == k)]
    return ParticleState(children, np.zeros(n))


def forward(
    rng: np.random.Generator, lower: ParticleState, upper: ParticleState, known: np.ndarray, n: int, settings: StructuralSettings
) -> ParticleState:
    """G_forward: the next model's first particles, from what has been filtered and from its own last ones (section 7.3.2.3).

    Both sets are ranked and resampled to `n` (adaptive resampling, Alg. 4), and joined by `crossing`: the variables that the lower model
    has come from it, the others from the upper model's own set (Eq. 7.22).

    Parameters
    ----------
    rng : numpy.random.Generator
    lower, upper : ParticleState
        Of states with all variables.
    known : ndarray of bool, shape (d,)
        The lower model's variables.
    n : int
    settings : StructuralSettings

    Returns
    -------
    ParticleState
        Of equal weights.
    """
    filtered, own = (_resampled(rng, one, n) for one in (lower, upper))
    own = own[crossing(n, settings.partitions, settings.crossed)]
    return ParticleState(np.where(known, filtered, own), np.zeros(n))


def backward(
    rng: np.random.Generator, threads: Sequence[ParticleState], group: np.ndarray, counts: np.ndarray
) -> tuple[ParticleState, ...]:
    """G_backward: the last model's particles refine what each other model added (section 7.3.2.5).

    Parameters
    ----------
    rng : numpy.random.Generator
    threads : sequence of ParticleState
        Filtered, one a model; the last is the most detailed one's.
    group : ndarray of int, shape (d,)
        The first model that has each variable.
    counts : ndarray of int, shape (n_models,)
        Particles of each model.

    Returns
    -------
    tuple of ParticleState
        Where the next instant's filters start. Variables that a model lacks are the last model's too: nothing else is known of them.
    """
    out = []
    for level, thread in enumerate(threads[:-1]):
        best = _resampled(rng, threads[-1], counts[level])
        own = ranked(thread)
        keep = group < level
        # What is new has been resampled: its weight is in its numbers, its rank in its place.
        out.append(ParticleState(np.where(keep, own.particles, best), np.zeros(len(best))))
    return (*out, threads[-1])


def _resampled(rng: np.random.Generator, state: ParticleState, n: int) -> np.ndarray:
    """So many particles, ranked before they are drawn: the first ones stem from the heaviest."""
    state = ranked(state)
    return state.particles[systematic(rng, normalise(state.log_weights), n)]


def structural_step(
    rng: np.random.Generator,
    threads: Sequence[ParticleState],
    log_likelihoods: Sequence[LogLikelihood],
    variables: Variables,
    settings: StructuralSettings,
) -> tuple[tuple[ParticleState, ...], StructuralInfo]:
    """One instant: every model in turn, then back (section 7.3.1).

    Parameters
    ----------
    rng : numpy.random.Generator
    threads : sequence of ParticleState
        One a model, from the instant before; each particle has all variables, those of later models included.
    log_likelihoods : sequence of callable
        One a model, ``(n, d) -> (n,)``; or ``(n, d) -> (n, n_limbs)``, to be summed.
    variables : Variables
    settings : StructuralSettings

    Returns
    -------
    threads : tuple of ParticleState
    info : StructuralInfo
    """
    group, limb = variables.group, variables.limb
    counts = settings.particles(np.bincount(group, minlength=len(threads))[: len(threads)])
    filtered: list[ParticleState] = []
    infos: list[tuple[LayerInfo, ...]] = []
    estimates = np.full((len(threads), len(group)), np.nan)
    for level, thread in enumerate(threads):
        n = int(counts[level])
        state = forward(rng, filtered[-1], thread, group < level, n, settings) if level else thread
        layers, shares = [], None
        for layer in range(settings.layers):
            if limb is not None and shares is not None and limb[group <= level].any():
                state = cross_limbs(rng, state, shares, limb, settings.survival_rate)
            drift = truncated_drift(variables.sd * spread_schedule(group, level, layer, settings), variables.low, variables.high)
            state, info, shares = _weighed(rng, state, log_likelihoods[level], drift, n, settings.survival_rate)
            layers.append(info)
        filtered.append(state)
        infos.append(tuple(layers))
        estimates[level] = np.where(group <= level, state.mean, np.nan)
    best = max(infos[-1], key=lambda info: info.best_log_likelihood)
    evaluations = sum(info.evaluations for layers in infos for info in layers)
    return backward(rng, filtered, group, counts), StructuralInfo(estimates, best.best, best.best_log_likelihood, evaluations, tuple(infos))


def _weighed(rng, state, log_likelihood, drift, n, survival_rate) -> tuple[ParticleState, LayerInfo, np.ndarray | None]:
    """One layer, and each limb's share of the likelihood if that is told."""
    shares: list[np.ndarray] = []

    def total(states: np.ndarray) -> np.ndarray:
        values = np.asarray(log_likelihood(states), float)
        if values.ndim == 1:
            return values
        shares.append(values)
        return values.sum(axis=1)

    state, info = filter_layer(rng, state, total, drift, n, survival_rate)
    return state, info, shares[0] if shares else None
