"""Costs joined and made into fitness, against SciPy's densities and the thesis's equations written out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal, norm

from hmc.errors import InputError
from hmc.pose.objectives.four_scores import log_likelihood_by_part, log_likelihood_factorised
from hmc.search import combined_cost, log_fitness, log_joint_fitness


def covariance_of(rng, k):
    root = rng.normal(size=(k, k))
    return root @ root.T + 0.1 * np.eye(k)


def test_costs_are_joined_as_in_equation_3_13():
    rng = np.random.default_rng(0)
    costs, shares = rng.random((7, 5, 3)), np.array([0.5, 0.3, 0.2])
    assert_allclose(combined_cost(costs, shares), sum(share * costs[..., k] for k, share in enumerate(shares)))
    assert combined_cost(costs.astype(np.float32), shares).dtype == np.float32


@pytest.mark.parametrize("shares", [[0.5, 0.5], [0.5, 0.6, 0.2], [1.2, -0.4, 0.2]])
def test_shares_that_are_none_are_refused(shares):
    with pytest.raises(InputError, match="shares"):
        combined_cost(np.zeros((4, 3)), shares)


def test_equation_3_14_is_a_gaussian():
    cost = np.linspace(0, 1, 9)
    assert_allclose(log_fitness(cost, 0.3), norm.logpdf(cost, 0, 0.3) - norm.logpdf(0, 0, 0.3))


@given(st.integers(1, 5), st.integers(0, 1000))
def test_equation_3_15_is_a_gaussian_of_several_scores(k, seed):
    rng = np.random.default_rng(seed)
    costs, covariance = rng.random((6, k)), covariance_of(rng, k)
    density = multivariate_normal(np.zeros(k), covariance)
    assert_allclose(log_joint_fitness(costs, covariance), density.logpdf(costs) - density.logpdf(np.zeros(k)), atol=1e-8)


def test_every_part_may_have_its_own_covariance():
    rng = np.random.default_rng(1)
    costs, covariances = rng.random((6, 3, 4)), np.array([covariance_of(rng, 4) for _ in range(3)])
    expected = np.stack([log_joint_fitness(costs[:, part], covariances[part]) for part in range(3)], axis=1)
    assert_allclose(log_joint_fitness(costs, covariances), expected)


def test_scores_that_go_together_count_less_than_ones_that_do_not():
    """What 3.15 is for: two scores that err together say less than two that agree by chance, and opposite errors say more."""
    together = np.array([[1.0, 0.8], [0.8, 1.0]])
    both, opposite = log_joint_fitness(np.array([[1.0, 1.0], [1.0, -1.0]]), together)
    assert both > log_joint_fitness(np.ones((1, 2)), np.eye(2))[0] > opposite


@pytest.mark.parametrize("covariance", [np.eye(3), np.ones((2, 2)), np.array([[1.0, 0.5], [0.2, 1.0]]), -np.eye(2)])
def test_what_is_no_covariance_is_refused(covariance):
    with pytest.raises(InputError, match="covariance"):
        log_joint_fitness(np.zeros((4, 2)), covariance)


def test_the_four_scores_are_its_diagonal():
    rng = np.random.default_rng(8)
    values, variances = rng.random((6, 10, 4)), 0.1 + rng.random((10, 4))
    expected = log_joint_fitness(values, variances[..., None] * np.eye(4))
    assert_allclose(log_likelihood_by_part(values, variances), expected)
    assert_allclose(log_likelihood_factorised(values, variances), expected.sum(axis=1))
