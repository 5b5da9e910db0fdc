"""The Monte Carlo core against SciPy, closed forms and plain loops."""

import doctest

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import integrate, optimize, stats

from hmc import search as montecarlo
from hmc.errors import InputError
from hmc.search import (
    AnnealedSettings,
    annealed_step,
    effective_sample_size,
    filter_layer,
    find_beta,
    normalise,
    particle_init,
    sir_step,
    spread_scale,
    survival_rate,
    systematic,
    temper,
    truncated_drift,
    truncated_normal,
)


def test_the_example_of_the_package_runs():
    results = doctest.testmod(montecarlo)
    assert results.attempted >= 5 and results.failed == 0


weight_arrays = hnp.arrays(float, st.integers(1, 60), elements=st.floats(0, 1e6)).filter(lambda w: w.sum() > 1e-3)


# --- weights


def test_normalise_is_the_softmax_and_survives_extremes():
    np.testing.assert_allclose(normalise(np.log([1.0, 3.0, 4.0])), [1 / 8, 3 / 8, 1 / 2])
    np.testing.assert_allclose(normalise(np.log([1.0, 3.0, 4.0]) - 1e4), [1 / 8, 3 / 8, 1 / 2], rtol=1e-10)
    np.testing.assert_array_equal(normalise([-np.inf, 0.0, -np.inf]), [0, 1, 0])
    np.testing.assert_array_equal(normalise([-np.inf] * 4), [0.25] * 4)
    np.testing.assert_array_equal(normalise([np.inf, 5.0, np.inf]), [0.5, 0, 0.5])
    with pytest.raises(ValueError, match="NaN"):
        normalise([0.0, np.nan])
    with pytest.raises(ValueError, match=r"got shape \(0,\)"):
        normalise([])


def test_effective_sample_size_closed_forms():
    assert effective_sample_size(np.full(7, 0.2)) == pytest.approx(7)
    assert effective_sample_size([0, 5, 0]) == pytest.approx(1)
    assert effective_sample_size([1e-300, 1e-300]) == pytest.approx(2)
    assert survival_rate([1, 1, 0, 0]) == pytest.approx(0.5)
    assert survival_rate([3, 1]) == pytest.approx(16 / 10 / 2)


# --- resampling


def loop_of_algorithm_2(weights, n, u):
    """Canton's Algorithm 2 (4 for other sizes), as printed."""
    total, cumulative = 0.0, []
    for weight in weights:
        total += weight
        cumulative.append(total)
    j, out = 0, []
    for i in range(n):
        while (u + i) / n > cumulative[j] / total:
            j += 1
        out.append(j)
    return out


def test_systematic_equals_the_printed_algorithm():
    for seed in range(200):
        rng = np.random.default_rng(seed)
        weights = rng.gamma(0.3, 1, rng.integers(1, 50))
        n = int(rng.integers(1, 100))
        u = np.random.default_rng(seed + 1).random()
        np.testing.assert_array_equal(systematic(np.random.default_rng(seed + 1), weights, n), loop_of_algorithm_2(weights, n, u))


@settings(deadline=None)
@given(weight_arrays, st.integers(1, 300), st.integers(0, 2**32))
def test_systematic_counts_lie_within_floor_and_ceiling(weights, n, seed):
    indices = systematic(np.random.default_rng(seed), weights, n)
    assert indices.shape == (n,)
    counts = np.bincount(indices, minlength=weights.size)
    expected = n * weights / weights.sum()
    assert np.all(counts >= np.floor(expected - 1e-6)) and np.all(counts <= np.ceil(expected + 1e-6))
    assert np.all(counts[weights == 0] == 0)


def test_systematic_is_unbiased():
    weights = np.array([0.05, 0.5, 0.0, 0.15, 0.3])
    rng = np.random.default_rng(3)
    mean = np.mean([np.bincount(systematic(rng, weights, 7), minlength=5) for _ in range(4000)], axis=0)
    np.testing.assert_allclose(mean, 7 * weights, atol=0.03)


def test_systematic_with_one_weight_or_nearly_one():
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(systematic(rng, [0, 0, 1e-12, 0], 5), [2] * 5)
    nearly = np.full(1000, 1e-17)
    nearly[123] = 1
    assert set(systematic(rng, nearly, 600)) == {123}


@pytest.mark.parametrize("weights", [[0, 0], [1, -1, 3], [np.nan, 1], [np.inf, 1], []])
def test_systematic_refuses_what_are_no_weights(weights):
    with pytest.raises(ValueError, match="weights"):
        systematic(np.random.default_rng(0), weights, 3)


# --- annealing rate


def rate_at(log_likelihood, beta):
    """Eq. 3.21 as printed, with its normalisation."""
    weights = np.exp(beta * (np.asarray(log_likelihood) - np.max(log_likelihood)))
    weights /= weights.sum()
    return 1 / (np.sum(weights**2) * len(weights))


@settings(deadline=None)
@given(st.integers(0, 2**32), st.integers(5, 300), st.floats(0.01, 0.99), st.floats(-8, 8))
def test_find_beta_agrees_with_brentq(seed, n, target, log_scale):
    rng = np.random.default_rng(seed)
    log_likelihood = -rng.gamma(2, np.exp(log_scale), n)
    assume(target > 1.2 / n)
    beta, info = find_beta(log_likelihood, target)
    assert info.status == "found"
    assert info.survival_rate == pytest.approx(target, rel=1e-4)
    spread = np.std(log_likelihood)
    by_scipy = optimize.brentq(lambda x: np.log(rate_at(log_likelihood, np.exp(x) / spread) / target), -30, 30)
    assert rate_at(log_likelihood, beta) == pytest.approx(rate_at(log_likelihood, np.exp(by_scipy) / spread), rel=1e-4)


def test_find_beta_closed_form():
    # One of two at likelihood 1, the other at e^-1: (1 + x)^2 / (2 (1 + x^2)) = alpha with x = e^-beta.
    alpha = 0.8
    a, b = 1 - 2 * alpha, 2.0
    x = (-b + np.sqrt(b * b - 4 * a * a)) / (2 * a)
    beta, _ = find_beta(np.array([0.0, -1.0]), alpha)
    assert beta == pytest.approx(-np.log(x), rel=1e-4)


@settings(deadline=None)
@given(st.integers(0, 2**32), st.floats(0.05, 0.9), st.floats(0.05, 0.9))
def test_a_smaller_target_never_needs_a_smaller_power(seed, first, second):
    log_likelihood = -np.random.default_rng(seed).gamma(2, 3, 200)
    beta_low, _ = find_beta(log_likelihood, min(first, second))
    beta_high, _ = find_beta(log_likelihood, max(first, second))
    assert beta_low >= beta_high * (1 - 1e-5)


def test_find_beta_is_not_held_below_one_and_scales():
    log_likelihood = -np.random.default_rng(1).gamma(2, 0.01, 300)
    beta, _ = find_beta(log_likelihood, 0.1)
    assert beta > 1
    assert find_beta(log_likelihood * 1e9 - 7e8, 0.1)[0] == pytest.approx(beta / 1e9, rel=1e-4)


def test_find_beta_states_why_there_is_no_root():
    beta, info = find_beta(np.full(10, -3e5), 0.5)
    assert (beta, info.status, info.survival_rate) == (1.0, "flat", 1.0)
    beta, info = find_beta(np.full(10, -np.inf), 0.5)
    assert (beta, info.status, info.survival_rate) == (1.0, "flat", 1.0)

    tied = np.array([0.0, 0.0, 0.0, -1.0, -2.0])
    beta, info = find_beta(tied, 0.5)
    assert info.status == "ties" and info.survival_rate == pytest.approx(0.6)
    assert survival_rate(normalise(temper(tied, beta))) == pytest.approx(0.6, rel=1e-9)

    mostly_impossible = np.array([0.0, -1.0] + [-np.inf] * 8)
    beta, info = find_beta(mostly_impossible, 0.5)
    assert info.status == "few" and beta == 0 and info.survival_rate == pytest.approx(0.2)
    np.testing.assert_allclose(normalise(temper(mostly_impossible, beta)), [0.5, 0.5] + [0] * 8)
    # A reachable target among impossible ones
    assert find_beta(mostly_impossible, 0.15)[1].survival_rate == pytest.approx(0.15, rel=1e-5)

    one_is_everything = np.array([0.0] + [-1e12] * 9)
    beta, info = find_beta(one_is_everything, 0.5)
    assert info.status == "found" and info.survival_rate == pytest.approx(0.5, rel=1e-5)
    assert find_beta(np.array([0.0, -1e-320, -1.0, -2.0]), 0.26)[1].status in ("ties", "found")


def test_find_beta_refuses_bad_input():
    with pytest.raises(ValueError, match="target_survival"):
        find_beta(np.zeros(3), 0)
    with pytest.raises(ValueError, match="NaN"):
        find_beta(np.array([0, np.nan]), 0.5)


# --- truncated draws

INTERVALS = {
    "inside": (0.0, 1.0, -1.0, 0.5),
    "narrow": (0.2, 1.0, 0.1, 0.15),
    "half open": (0.0, 2.0, -np.inf, -1.0),
    "mean at the limit": (0.0, 0.3, 0.0, 2.0),
    "upper tail": (0.0, 1.0, 4.0, 9.0),
    "lower tail": (0.0, 1.0, -9.0, -4.0),
    "far tail": (0.0, 1.0, 30.0, np.inf),
    "open": (3.0, 2.0, -np.inf, np.inf),
}


@pytest.mark.parametrize("name", INTERVALS)
def test_truncated_draws_follow_scipys_distribution(name):
    mean, sd, low, high = INTERVALS[name]
    draws = truncated_normal(np.random.default_rng(5), np.full(20_000, mean), sd, low, high)
    assert draws.min() >= low and draws.max() <= high
    truth = stats.truncnorm((low - mean) / sd, (high - mean) / sd, loc=mean, scale=sd)
    assert stats.kstest(draws, truth.cdf).pvalue > 0.005


@settings(deadline=None)
@given(
    hnp.arrays(float, (7, 4), elements=st.floats(-100, 100)),
    hnp.arrays(float, 4, elements=st.floats(0, 50)),
    hnp.arrays(float, 4, elements=st.floats(-100, 100)),
    hnp.arrays(float, 4, elements=st.floats(0, 100)),
    st.integers(0, 2**32),
)
def test_truncated_draws_always_lie_within_the_limits(mean, sd, low, width, seed):
    draws = truncated_normal(np.random.default_rng(seed), mean, sd, low, low + width)
    assert draws.shape == mean.shape
    assert np.all((draws >= low) & (draws <= low + width))
    np.testing.assert_array_equal(draws[:, sd == 0], np.clip(mean, low, low + width)[:, sd == 0])


def test_truncated_normal_takes_scalars_and_names_bad_arguments():
    rng = np.random.default_rng(0)
    assert truncated_normal(rng, 0.0, 1.0, 5.0, 6.0).shape == ()
    for arguments, word in (
        ((0, 1, 1, 0), "low"),
        ((0, -1, 0, 1), "sd"),
        ((0, np.nan, 0, 1), "sd"),
        ((np.nan, 1, 0, 1), "mean"),
        ((0, 1, np.nan, 1), "low"),
    ):
        with pytest.raises(ValueError, match=word):
            truncated_normal(rng, *arguments)


# --- filters


def test_sir_follows_the_kalman_filter():
    # x' = x + N(0, q), z = x + N(0, r): the exact posterior mean is Kalman's.
    rng = np.random.default_rng(2)
    q, r = 0.5, 0.8
    state = particle_init(rng.normal(0, 1, (20_000, 1)))
    mean, variance, truth = 0.0, 1.0, 0.3
    for _ in range(15):
        truth += rng.normal(0, q)
        z = truth + rng.normal(0, r)
        variance += q * q
        gain = variance / (variance + r * r)
        mean, variance = mean + gain * (z - mean), (1 - gain) * variance
        drift = truncated_drift(q, -np.inf, np.inf)
        state, info = sir_step(rng, state, lambda x, z=z: -0.5 * ((x[:, 0] - z) / r) ** 2, drift)
        assert state.mean[0] == pytest.approx(mean, abs=0.05)
    assert info.evaluations == 20_000 and info.beta == 1 and info.beta_status == "fixed"
    assert info.ess == pytest.approx(effective_sample_size(normalise(state.log_weights)))


def test_one_layer_weighs_by_the_tempered_likelihood():
    def log_likelihood(x):
        return -3 * np.abs(x[:, 0])

    state = particle_init([[0.5], [2.0]], [-np.inf, 0.0])
    state, info = filter_layer(
        np.random.default_rng(0), state, log_likelihood, truncated_drift(1.0, -4, 4), particles=500, target_survival=0.3
    )
    assert state.particles.shape == (500, 1) and set(info.ancestors) == {1}
    assert info.survival_rate == pytest.approx(0.3, rel=1e-4)
    np.testing.assert_allclose(normalise(state.log_weights), normalise(info.beta * log_likelihood(state.particles)))
    best = np.argmin(np.abs(state.particles[:, 0]))
    np.testing.assert_array_equal(info.best, state.particles[best])
    assert info.best_log_likelihood == log_likelihood(state.particles)[best]


def test_annealing_finds_the_higher_of_many_peaks_in_six_dimensions():
    # A cosine comb over a bowl: 5^6 peaks, the highest at `goal`, the start several peaks away.
    goal = np.array([1.0, -1.0, 0.5, 0.0, 1.5, -0.5])

    def log_likelihood(x):
        return -np.sum((x - goal) ** 2 + 0.3 * (1 - np.cos(2 * np.pi * (x - goal))), axis=1)

    many = AnnealedSettings(layers=10, particles=500, survival_rate=0.1, spread=0.7)
    found = 0
    for seed in range(10):
        state, info = annealed_step(np.random.default_rng(seed), particle_init(np.zeros((1, 6))), log_likelihood, 1.2, -4.0, 4.0, many)
        found += np.abs(info.estimate - goal).max() < 0.25
        assert info.best_log_likelihood >= log_likelihood(state.particles).max()
    # A single layer of as many particles does not get there.
    single = AnnealedSettings(layers=1, particles=5000)
    alone = [
        annealed_step(np.random.default_rng(seed), particle_init(np.zeros((1, 6))), log_likelihood, 1.2, -4, 4, single)[1]
        for seed in range(10)
    ]
    assert found >= 9
    assert sum(np.abs(info.estimate - goal).max() < 0.25 for info in alone) <= 2


def test_annealed_estimate_with_one_layer_at_power_one_is_the_posterior_mean():
    # Prior N(0.2, 0.5) cut to [0, 1], likelihood N(0.9, 0.3); by quadrature.
    def density(x):
        return np.exp(-0.5 * ((x - 0.2) / 0.5) ** 2 - 0.5 * ((x - 0.9) / 0.3) ** 2)

    mean = integrate.quad(lambda x: x * density(x), 0, 1)[0] / integrate.quad(density, 0, 1)[0]
    state, _ = sir_step(
        np.random.default_rng(1),
        particle_init([[0.2]]),
        lambda x: -0.5 * ((x[:, 0] - 0.9) / 0.3) ** 2,
        truncated_drift(0.5, 0, 1),
        particles=50_000,
    )
    assert state.mean[0] == pytest.approx(mean, abs=0.005)


def test_drift_shrinks_by_the_survival_rates_run_or_by_a_factor():
    assert spread_scale("survival", []) == 1
    assert spread_scale("survival", [0.5, 0.4]) == pytest.approx(0.2)
    # A covariance that falls by the rates (Eq. 3.22) has deviations that fall by their roots.
    assert spread_scale("variance", [0.5, 0.4]) ** 2 == pytest.approx(0.2) and spread_scale("variance", []) == 1
    assert spread_scale(0.7, [0.1, 0.9]) == pytest.approx(0.49)
    varied = AnnealedSettings(layers=4, particles=[50, 200, 100, 80], survival_rate=[0.5, 0.3, 0.2, 0.1])
    state, info = annealed_step(np.random.default_rng(0), particle_init([[0.0, 0.0]]), lambda x: -np.sum(x**2, axis=1), 1.0, -9, 9, varied)
    np.testing.assert_allclose(info.survival_rate, [0.5, 0.3, 0.2, 0.1], rtol=1e-4)
    np.testing.assert_allclose(info.scale, [1, 0.5, 0.15, 0.03], rtol=1e-4)
    assert info.evaluations == 430 and state.particles.shape == (80, 2)
    np.testing.assert_allclose(info.ess, info.survival_rate * [50, 200, 100, 80])


def test_a_step_keeps_its_input_and_repeats_with_its_seed():
    start = particle_init(np.zeros((3, 2)), [0.0, -1.0, -2.0])
    before = start.particles.copy(), start.log_weights.copy()
    runs = [
        annealed_step(np.random.default_rng(4), start, lambda x: -np.abs(x).sum(1), 1.0, -1, 1, AnnealedSettings(3, 40))[0]
        for _ in range(2)
    ]
    np.testing.assert_array_equal(runs[0].particles, runs[1].particles)
    np.testing.assert_array_equal(start.particles, before[0])
    np.testing.assert_array_equal(start.log_weights, before[1])


def test_a_likelihood_that_says_nothing_leaves_the_filter_alive():
    for value in (-np.inf, 0.0):
        state, info = annealed_step(
            np.random.default_rng(0),
            particle_init([[0.0]]),
            lambda x, value=value: np.full(len(x), value),
            1.0,
            -1,
            1,
            AnnealedSettings(3, 40),
        )
        assert info.beta_status == ("flat",) * 3
        np.testing.assert_array_equal(info.survival_rate, 1.0)
        assert np.isfinite(state.mean).all()


def test_another_resampler_can_be_passed_in():
    def only_the_last(rng, weights, n):
        return np.full(n, len(weights) - 1)

    _, info = filter_layer(
        np.random.default_rng(0),
        particle_init([[1.0], [2.0]]),
        lambda x: -x[:, 0],
        truncated_drift(0.0, -9, 9),
        particles=5,
        resample=only_the_last,
    )
    np.testing.assert_array_equal(info.ancestors, [1] * 5)


@pytest.mark.parametrize(
    "bad",
    [
        {"layers": 0},
        {"particles": 0},
        {"survival_rate": 1.5},
        {"survival_rate": np.nan},
        {"spread": "slow"},
        {"spread": -1.0},
        {"particles": [1, 2]},
    ],
)
def test_bad_settings_are_named(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        AnnealedSettings(**bad)


def test_bad_arrays_are_named():
    with pytest.raises(ValueError, match="particles"):
        particle_init(np.zeros(3))
    with pytest.raises(ValueError, match="log_weights"):
        particle_init(np.zeros((3, 1)), np.zeros(2))
    with pytest.raises(ValueError, match="log_likelihood"):
        sir_step(np.random.default_rng(0), particle_init(np.zeros((3, 1))), lambda x: x, truncated_drift(1.0, -1, 1))
