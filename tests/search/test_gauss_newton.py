"""Damped Gauss-Newton within limits against SciPy's trust-region and bounded linear least squares, and its rules one by one."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares, lsq_linear

from hmc.search.gauss_newton import (
    Damping,
    GaussNewtonSettings,
    LeastSquares,
    damped,
    gauss_newton_init,
    gauss_newton_run,
    gauss_newton_step,
    movable,
)

#: Down to the last digits, with room for short steps.
EXACT = GaussNewtonSettings(iterations=400, tolerance=1e-13, longest_step=10.0, damping=Damping(least=1e-12))


@dataclass(frozen=True)
class At:
    """Residuals at a place, from functions of it."""

    residuals: np.ndarray
    jacobian: np.ndarray
    near: object = None

    def pulls(self):
        rows = np.flatnonzero(self.jacobian.any(axis=1))  # the others do not change
        return rows, self.jacobian[rows]


def linear(matrix, goal):
    return lambda x, near: At(matrix @ x - goal, matrix)


def minimum(problem, start, chosen=EXACT, anchor=None):
    return gauss_newton_run(problem, gauss_newton_init(problem, start, chosen, anchor), chosen)


def random_box(rng, n):
    middle, half = rng.normal(0, 1, n), rng.uniform(0.1, 2, n)
    return middle - half, middle + half


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 8), relative=st.booleans())
def test_linear_residuals_in_a_box_have_the_minimum_that_scipy_finds(seed, n, relative):
    rng = np.random.default_rng(seed)
    matrix, goal = rng.normal(size=(n + 5, n)), rng.normal(0, 3, n + 5)
    low, high = random_box(rng, n)
    expected = lsq_linear(matrix, goal, (low, high), tol=1e-14)
    chosen = replace(EXACT, damping=replace(EXACT.damping, is_relative=relative))
    found = minimum(LeastSquares(linear(matrix, goal), low, high, np.zeros(n)), rng.uniform(low, high), chosen)
    assert np.all((found.x >= low) & (found.x <= high))
    assert found.cost == pytest.approx(2 * expected.cost, rel=1e-6, abs=1e-9)
    assert_allclose(found.x, expected.x, atol=2e-3)


def waves(matrix, goal):
    """Residuals that are gently curved: one minimum in the box."""

    def linearise(x, near):
        inner = matrix @ x
        return At(inner + 0.3 * np.sin(inner) - goal, (1 + 0.3 * np.cos(inner))[:, None] * matrix)

    return linearise


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6))
def test_curved_residuals_with_a_hold_have_the_minimum_that_scipy_finds(seed, n):
    rng = np.random.default_rng(seed)
    matrix = np.concatenate([np.eye(n), 0.3 * rng.normal(size=(4, n))])
    goal, (low, high), hold = rng.normal(0, 1, n + 4), random_box(rng, n), rng.uniform(0, 0.2, n)
    linearise, start, anchor = waves(matrix, goal), rng.uniform(low, high), rng.normal(size=n)

    def all_residuals(x):
        return np.r_[linearise(x, None).residuals, np.sqrt(hold) * (x - anchor)]

    expected = least_squares(all_residuals, start, bounds=(low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = minimum(LeastSquares(linearise, low, high, hold), start, anchor=anchor)
    assert np.all((found.x >= low) & (found.x <= high))
    assert found.cost == pytest.approx(np.sum(all_residuals(found.x) ** 2))
    assert found.cost <= 2 * expected.cost * (1 + 1e-6) + 1e-9


def rosenbrock(x, near):
    return At(np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]), np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]))


def test_the_valley_of_rosenbrock_is_followed_to_its_end():
    wide = np.full(2, np.inf)
    found = minimum(LeastSquares(rosenbrock, -wide, wide, np.zeros(2)), np.array([-1.2, 1.0]))
    assert_allclose(found.x, 1, atol=1e-6)
    assert found.first_cost == pytest.approx(24.2) and found.cost < 1e-12
    assert found.evaluations >= found.accepted + 1


def test_what_is_not_free_stays_and_costs_only_fall():
    wide, start = np.full(2, np.inf), np.array([-1.2, 1.0])
    problem = LeastSquares(rosenbrock, -wide, wide, np.zeros(2), np.array([False, True]))
    state = gauss_newton_init(problem, start, EXACT)
    while not state.is_done:
        after = gauss_newton_step(problem, state, EXACT)
        assert after.cost <= state.cost and after.x[0] == start[0]
        assert (after.damping < state.damping) == (after.accepted > state.accepted) or after.is_done
        state = after
    assert state.x[1] == pytest.approx(1.44)


def test_a_run_that_is_continued_ends_as_one_that_was_not():
    wide = np.full(2, np.inf)
    problem, start = LeastSquares(rosenbrock, -wide, wide, np.full(2, 1e-4)), np.array([-1.2, 1.0])
    chosen = GaussNewtonSettings()
    whole = gauss_newton_run(problem, gauss_newton_init(problem, start, chosen), chosen)
    some = gauss_newton_run(problem, gauss_newton_init(problem, start, chosen), chosen, accepted=3)
    assert some.accepted == 3 and not some.is_done
    rest = gauss_newton_run(problem, some, chosen)
    assert np.array_equal(rest.x, whole.x) and (rest.cost, rest.evaluations) == (whole.cost, whole.evaluations)


def test_stops_and_limits_of_a_step():
    wide = np.full(2, np.inf)
    problem, start = LeastSquares(rosenbrock, -wide, wide, np.zeros(2)), np.array([-1.2, 1.0])
    few = minimum(problem, start, replace(EXACT, evaluations=4))
    assert few.evaluations == 4 and not few.is_done
    assert minimum(problem, start, replace(EXACT, iterations=2)).accepted == 2
    lazy = minimum(problem, start, replace(EXACT, tolerance=0.99))
    assert lazy.is_done and lazy.evaluations <= 3
    short = replace(EXACT, longest_step=0.01)
    state = gauss_newton_init(problem, start, short)
    assert np.abs(gauss_newton_step(problem, state, short).x - start).max() <= 0.01 + 1e-12
    assert minimum(problem, start, replace(EXACT, tolerance=0.0, least_gain=1.0)).cost > 1e-3
    at_rest = minimum(problem, np.ones(2))
    assert at_rest.is_done and at_rest.evaluations == 1


def test_the_jacobian_is_asked_for_once_a_place_and_hints_are_handed_on():
    asked, hints = [], []

    class Counted(At):
        def pulls(self):
            asked.append(self.near)
            return super().pulls()

    def linearise(x, near):
        hints.append(near)
        at = rosenbrock(x, near)
        return Counted(at.residuals, at.jacobian, len(hints))

    wide = np.full(2, np.inf)
    problem = LeastSquares(linearise, -wide, wide, np.zeros(2))
    state = gauss_newton_run(problem, gauss_newton_init(problem, np.array([-1.2, 1.0]), EXACT, near="first"), EXACT)
    assert state.evaluations > state.accepted + 1, "no step failed"
    assert len(asked) == len(set(asked)) <= state.accepted + 1
    assert hints[0] == "first" and set(hints[1:]) <= set(asked)


def test_damping_goes_to_its_end_where_no_step_helps():
    wrong = LeastSquares(lambda x, near: At(x - 1, -np.eye(2)), np.full(2, -9.0), np.full(2, 9.0), np.zeros(2))
    end = minimum(wrong, np.zeros(2))
    assert end.is_done and end.accepted == 0 and end.damping > EXACT.damping.most and np.array_equal(end.x, np.zeros(2))


def test_what_is_at_its_limit_and_would_go_beyond_does_not_move():
    x, low, high = np.array([0.0, 0.0, 1.0, 1.0, 0.5]), np.zeros(5), np.ones(5)
    gradient = np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    assert movable(x, gradient, low, high).tolist() == [1, 2, 4]
    assert movable(x, gradient, low, high, np.array([True, True, False, True, False])).tolist() == [1]
    matrix = np.array([[4.0, 1.0], [1.0, 0.0]])
    assert_allclose(damped(matrix, 0.5), [[6.0, 1.0], [1.0, 0.5e-9]], atol=1e-8, rtol=0)
    assert damped(matrix, 0.5, least=0.0)[1, 1] == 0 and matrix[0, 0] == 4
