"""Structural annealing on functions whose maximum is known, and its operators against closed forms and plain loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from hmc.errors import InputError
from hmc.search.filters import AnnealedSettings, ParticleState, annealed_step, particle_init
from hmc.search.structural import (
    StructuralSettings,
    Variables,
    backward,
    cross_limbs,
    crossing,
    forward,
    ranked,
    spread_schedule,
    structural_step,
)

GROUP = np.array([0, 0, 1, 1, 2, 2])


def test_the_spread_falls_as_in_equations_7_23_to_7_25():
    s, h, layers = 0.8, 0.5, 2
    settings = StructuralSettings(layers=layers, inner=h, structural=s)
    fade = h**layers
    assert_allclose(spread_schedule(GROUP, 0, 0, settings), [1, 1, 0, 0, 0, 0])
    assert_allclose(spread_schedule(GROUP, 1, 0, settings), [s * fade, s * fade, 1, 1, 0, 0])
    assert_allclose(spread_schedule(GROUP, 2, 0, settings), [s**2 * fade**2] * 2 + [s * fade] * 2 + [1, 1])
    assert_allclose(spread_schedule(GROUP, 2, 1, settings), h * spread_schedule(GROUP, 2, 0, settings))


@given(st.floats(0.1, 1), st.floats(0.1, 1), st.integers(1, 4), st.integers(2, 5))
def test_a_variable_s_spread_never_grows(inner, structural, layers, models):
    settings = StructuralSettings(layers=layers, inner=inner, structural=structural)
    group = np.arange(models)
    steps = np.array([spread_schedule(group, level, layer, settings) for level in range(models) for layer in range(layers)])
    for variable in range(models):
        own = steps[variable * layers :, variable]
        assert own[0] == 1 and np.all(np.diff(own) <= 1e-15) and not steps[: variable * layers, variable].any()


def test_the_printed_assignment_of_particles():
    assert StructuralSettings(gamma=50).particles(np.array([6, 10, 6])).tolist() == [300, 500, 300]  # Eq. 7.29


@given(st.integers(1, 200), st.integers(1, 12), st.floats(0, 1))
def test_crossing_is_a_permutation_that_joins_equal_or_opposite_ranks(n, partitions, crossed):
    pairs = crossing(n, partitions, crossed)
    assert_array_equal(np.sort(pairs), np.arange(n))
    size = n // partitions
    own = np.arange(n)
    moved = np.flatnonzero(pairs != own)
    if size:
        assert_array_equal(pairs[moved] // size, partitions - 1 - moved // size)
        assert_array_equal(pairs[moved] % size, moved % size)
        # A middle part is its own opposite.
        assert len(moved) == round(crossed * size) * (partitions - partitions % 2)
    else:
        assert not len(moved)


@settings(deadline=None)  # the first call alone is slow, on a busy machine
@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 60), st.integers(0, 1000))
def test_forward_takes_what_is_filtered_and_keeps_the_rest(n_lower, n_upper, n, seed):
    rng = np.random.default_rng(seed)
    lower = ParticleState(np.c_[np.arange(n_lower), np.full(n_lower, -1.0)], rng.normal(size=n_lower))
    upper = ParticleState(np.c_[np.full(n_upper, -1.0), np.arange(n_upper)], rng.normal(size=n_upper))
    out = forward(rng, lower, upper, np.array([True, False]), n, StructuralSettings())
    for column, source in ((0, lower), (1, upper)):
        weights = np.exp(source.log_weights) / np.exp(source.log_weights).sum()
        counts = np.bincount(out.particles[:, column].astype(int), minlength=len(weights))
        assert np.all(np.abs(counts - n * weights) < 1 + 1e-9)  # systematic: each its floor or its ceiling
    ranks = np.argsort(np.argsort(-lower.log_weights, kind="stable"))
    assert np.all(np.diff(ranks[out.particles[:, 0].astype(int)]) >= 0)  # the heaviest first
    assert not out.log_weights.any()


def test_backward_refines_what_each_model_added():
    rng = np.random.default_rng(0)
    counts = np.array([4, 6, 5])
    threads = [ParticleState(np.full((n, 6), 10.0 * k), rng.normal(size=n)) for k, n in enumerate(counts)]
    threads[-1] = ParticleState(np.arange(5.0)[:, None] + np.zeros(6), np.array([0.0, -np.inf, -np.inf, 0.0, -np.inf]))
    out = backward(rng, threads, GROUP, counts)
    assert [one.particles.shape for one in out] == [(4, 6), (6, 6), (5, 6)]
    assert_array_equal(np.unique(out[0].particles), [0, 3])  # all of it is the last model's, of its living particles
    assert_array_equal(out[1].particles[:, :2], 10)  # what the model before it brought stays
    assert_array_equal(np.unique(out[1].particles[:, 2:]), [0, 3])
    assert out[2] is threads[2]


def test_ranked_keeps_the_order_of_equals():
    state = ranked(ParticleState(np.arange(5.0)[:, None], np.array([0.0, 1.0, 0.0, 1.0, -np.inf])))
    assert state.particles.ravel().tolist() == [1, 3, 0, 2, 4]


def test_one_model_is_the_annealed_filter():
    def likelihood(states):
        return -((states - 1) ** 2).sum(axis=1)

    low, high, sd = np.full(3, -5.0), np.full(3, 5.0), np.full(3, 0.5)
    start = particle_init(np.zeros((1, 3)))
    settings = StructuralSettings(gamma=20, layers=3, inner=0.5, survival_rate=0.3)
    (threads,), info = structural_step(
        np.random.default_rng(4), [start], [likelihood], Variables(np.zeros(3, int), sd, low, high), settings
    )
    state, annealed = annealed_step(np.random.default_rng(4), start, likelihood, sd, low, high, AnnealedSettings(3, 60, 0.3, 0.5))
    assert_array_equal(threads.particles, state.particles)
    assert_array_equal(info.best, annealed.best)
    assert info.evaluations == annealed.evaluations == 180


def test_a_chain_is_found_from_its_root_outwards_and_every_model_has_an_estimate():
    goal = np.array([1.0, -1.0, 0.5, 0.8, -0.7, 0.2])

    def likelihood_of(level):
        known = level >= GROUP
        # What a model lacks must not decide: that it is called with all variables is no matter.
        return lambda states: -50 * (known * (states - goal) ** 2).sum(axis=1)

    low, high, sd = np.full(6, -3.0), np.full(6, 3.0), np.full(6, 0.6)
    settings = StructuralSettings(gamma=40, survival_rate=0.1)
    threads = [particle_init(np.zeros((1, 6)))] * 3
    rng = np.random.default_rng(0)
    for _ in range(4):
        threads, info = structural_step(rng, threads, [likelihood_of(k) for k in range(3)], Variables(GROUP, sd, low, high), settings)
    assert_allclose(info.best, goal, atol=0.25)
    assert_allclose(info.estimates[2], goal, atol=0.25)
    for level in range(3):
        assert_array_equal(np.isnan(info.estimates[level]), level < GROUP)
        assert_allclose(info.estimates[level][level >= GROUP], goal[level >= GROUP], atol=0.35)
    assert info.evaluations == 2 * 3 * 80


@given(st.integers(2, 40), st.integers(0, 1000))
def test_limbs_are_drawn_each_by_its_own_share_of_the_likelihood(n, seed):
    rng = np.random.default_rng(seed)
    limb = np.array([1, 0, 2, 1, 0])
    particles = np.arange(n)[:, None] + np.linspace(0, 0.4, 5)  # each number tells whose it was, and which variable
    weights, shares = rng.normal(size=n), rng.normal(size=(n, 3))
    possible = rng.choice(n, 2, replace=False)
    shares[~np.isin(np.arange(n), possible), 2] = -np.inf
    out = cross_limbs(rng, ParticleState(particles, weights), shares, limb, 0.5)
    assert out.particles.shape == (n, 5) and not out.log_weights.any()
    assert_allclose(out.particles % 1, np.tile(np.linspace(0, 0.4, 5), (n, 1)), atol=1e-9)
    source = np.floor(out.particles + 1e-6).astype(int)
    assert_array_equal(source[:, 0], source[:, 3])  # a limb stays whole
    assert_array_equal(source[:, 1], source[:, 4])
    trunks = np.bincount(source[:, 1], minlength=n)
    assert np.all(np.abs(trunks - n * np.exp(weights) / np.exp(weights).sum()) < 1 + 1e-9)
    assert set(source[:, 2]) <= set(possible.tolist())
    if n >= 10:  # half of the possible ones survive, and the better a limb is the more often
        counts = np.bincount(source[:, 0], minlength=n)
        order = np.argsort(shares[:, 1])
        assert counts[order[-1]] >= counts[order[0]] and np.all(np.diff(counts[order]) >= -1)


def test_crossed_limbs_are_found_with_fewer_particles():
    goal = np.linspace(-0.9, 0.9, 12)
    group, limb = np.repeat([0, 1], [3, 9]), np.repeat(np.arange(4), 3)
    variables = Variables(group, np.full(12, 0.4), np.full(12, -2.0), np.full(12, 2.0), limb)
    settings = StructuralSettings(gamma=10, survival_rate=0.3)

    def errors(by_limb):
        def share(states):
            shares = -30 * np.stack([((states - goal)[:, limb == k] ** 2).sum(axis=1) for k in range(4)], axis=1)
            return shares if by_limb else shares.sum(axis=1)

        out = []
        for seed in range(12):
            threads, rng = [particle_init(np.zeros((1, 12)))] * 2, np.random.default_rng(seed)
            for _ in range(3):
                threads, info = structural_step(rng, threads, [share, share], variables, settings)
            out.append(np.linalg.norm(info.estimates[-1] - goal))
        return np.array(out)

    crossed, whole = errors(True), errors(False)
    assert crossed.mean() < 0.8 * whole.mean()
    assert np.mean(crossed < whole) > 0.8


def test_variables_that_no_model_has_stay_where_they_are():
    group = np.array([0, 1, 2, 2])
    start = particle_init(np.array([[0.0, 0.0, 0.3, -0.4]]))
    variables = Variables(group, np.ones(4), np.full(4, -2.0), np.full(4, 2.0))
    threads, _ = structural_step(
        np.random.default_rng(0), [start, start], [lambda s: -(s[:, 0] ** 2)] * 2, variables, StructuralSettings(gamma=30)
    )
    assert_array_equal(threads[-1].particles[:, 2:], np.tile([0.3, -0.4], (30, 1)))


@pytest.mark.parametrize("wrong", [{"gamma": 0}, {"layers": 0}, {"inner": 1.5}, {"structural": 0}, {"crossed": -0.1}, {"survival_rate": 2}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(InputError, match=f"`{next(iter(wrong))}`"):
        StructuralSettings(**wrong)
