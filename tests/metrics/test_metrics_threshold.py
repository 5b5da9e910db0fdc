"""The parameter-free threshold: statistics against SciPy and the published table, choices against mixtures that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from hmc.errors import InputError
from hmc.metrics.landmarks import landmark_errors, score
from hmc.metrics.threshold import choose_threshold, lilliefors_statistic, normal_quantiles, quantile_r2


@pytest.mark.parametrize("n", [4, 30, 500])
def test_lilliefors_statistic_is_scipys(n):
    for seed in range(5):
        values = np.random.default_rng(seed).gamma(2, 1, n)
        wanted = stats.kstest((values - values.mean()) / values.std(ddof=1), "norm").statistic
        assert lilliefors_statistic(values) == pytest.approx(wanted, abs=1e-12)


# Lilliefors (1967), table 1: level .05 and .01, by sample size; as corrected by Dallal and Wilkinson (1986).
@pytest.mark.parametrize(("n", "at_5", "at_1"), [(10, 0.262, 0.304), (20, 0.192, 0.223), (30, 0.159, 0.185)])
def test_lilliefors_quantiles_are_the_published_ones(n, at_5, at_1):
    rng = np.random.default_rng(n)
    drawn = [lilliefors_statistic(sample) for sample in rng.standard_normal((6000, n))]
    np.testing.assert_allclose(np.quantile(drawn, [0.95, 0.99]), [at_5, at_1], atol=0.006)


def test_r2_is_that_of_a_linear_regression():
    values = np.random.default_rng(0).gamma(3, 2, 300)
    line = stats.linregress(stats.norm.ppf((np.arange(300) + 0.5) / 300), np.sort(values))
    assert quantile_r2(values) == pytest.approx(line.rvalue**2)
    np.testing.assert_allclose(normal_quantiles(5), stats.norm.ppf([0.1, 0.3, 0.5, 0.7, 0.9]))
    assert quantile_r2(normal_quantiles(50) * 3 + 7) == pytest.approx(1)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.floats(1e-3, 1e3), st.floats(-50, 50))
def test_both_figures_do_not_depend_on_unit_and_place(seed, factor, shift):
    values = np.random.default_rng(seed).gamma(2, 1, 60)
    for function in (lilliefors_statistic, quantile_r2):
        assert function(factor * values + shift) == pytest.approx(function(values), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
@pytest.mark.parametrize("test", ["lilliefors", "r2"])
def test_threshold_parts_a_gaussian_from_its_outliers(test, unit):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        errors = np.concatenate([rng.normal(0.05, 0.012, 2000), rng.uniform(0.13, 0.6, 300)]).clip(0)
        choice = choose_threshold(unit * np.append(errors, [np.nan, np.inf]), test)
        assert 0.08 * unit < choice.threshold < 0.14 * unit
        scores = score(unit * errors[None], choice.threshold)
        assert scores.mmta == pytest.approx(2000 / 2300, abs=0.01)
        assert scores.mmtp == pytest.approx(0.05 * unit, rel=0.02)
        assert scores.sigma_mmtp == pytest.approx(0.012 * unit, rel=0.07)
        assert len(choice.candidates) == len(choice.values) and (np.diff(choice.candidates) > 0).all()


def test_without_outliers_nearly_all_errors_count():
    errors = np.random.default_rng(1).normal(1, 0.1, 3000)
    for test in ("lilliefors", "r2"):
        assert (errors <= choose_threshold(errors, test).threshold).mean() > 0.99


def test_on_image_landmarks_the_same():
    rng = np.random.default_rng(2)
    truth = rng.uniform(0, 400, (200, 15, 2))
    offset = rng.normal(0, 1, truth.shape)
    estimate = truth + offset / np.linalg.norm(offset, axis=-1, keepdims=True) * rng.normal(8, 1.5, (200, 15, 1))
    estimate[:, 5] += 60
    errors = landmark_errors(estimate, truth)
    chosen = choose_threshold(errors).threshold
    assert 11 < chosen < 50
    assert score(errors, chosen).mmta == pytest.approx(14 / 15, abs=0.01)


def test_wrong_input():
    with pytest.raises(InputError, match="from 5 errors"):
        choose_threshold(np.arange(5.0))
    with pytest.raises(InputError, match="that differ"):
        choose_threshold(np.ones(100))
    with pytest.raises(InputError, match="'lilliefors' or 'r2'"):
        choose_threshold(np.arange(100.0), "chi2")
    for function in (lilliefors_statistic, quantile_r2):
        with pytest.raises(InputError, match="do not differ"):
            function([1.0, 1.0, 1.0])
