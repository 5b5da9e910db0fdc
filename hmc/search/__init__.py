"""Monte Carlo core: weights, resampling, survival rate, annealing and particle-filter steps over arrays of states.

Nothing here knows of bodies or rooms: a state is a row of numbers and a likelihood is a function of an ``(n, d)`` array.
Source: Canton (2009), chapter 3 and section 6.3.4.

A filter is two functions, *init* and *step*: a small frozen state goes in, a new state and a record of what happened come
out. Annealing a likelihood with two peaks, the lower one where the particles start:

>>> import numpy as np
>>> from hmc.search import AnnealedSettings, annealed_step, particle_init
>>> def log_likelihood(x):
...     return np.log(np.exp(-8 * (x[:, 0] - 2) ** 2) + 0.5 * np.exp(-8 * (x[:, 0] + 1) ** 2))
>>> state = particle_init(np.full((1, 1), -1.0))
>>> state, info = annealed_step(np.random.default_rng(0), state, log_likelihood, sd=2.0, low=-5.0, high=5.0, settings=AnnealedSettings())
>>> bool(abs(info.estimate[0] - 2) < 0.1)
True
"""

from hmc.search.annealing import BetaInfo, find_beta, temper
from hmc.search.filters import (
    AnnealedInfo,
    AnnealedSettings,
    LayerInfo,
    ParticleState,
    annealed_step,
    filter_layer,
    particle_init,
    sir_step,
    spread_scale,
    truncated_drift,
)
from hmc.search.fitness import combined_cost, log_fitness, log_joint_fitness
from hmc.search.paths import cheapest_path
from hmc.search.truncated import truncated_normal
from hmc.search.weights import effective_sample_size, normalise, survival_rate, systematic

__all__ = [
    "AnnealedInfo",
    "AnnealedSettings",
    "BetaInfo",
    "LayerInfo",
    "ParticleState",
    "annealed_step",
    "cheapest_path",
    "combined_cost",
    "effective_sample_size",
    "filter_layer",
    "find_beta",
    "log_fitness",
    "log_joint_fitness",
    "normalise",
    "particle_init",
    "sir_step",
    "spread_scale",
    "survival_rate",
    "systematic",
    "temper",
    "truncated_drift",
    "truncated_normal",
]
