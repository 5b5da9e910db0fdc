"""Objectives that add up: costs, residuals and derivatives of a sum are those of its parts, and a refinement takes a sum as any other."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose, assert_array_equal
from posed import COST, body_of, true_state

from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel
from hmc.landmarks import landmark_index
from hmc.pose.objectives.objective import Sum, cost_at
from hmc.pose.objectives.residuals import residual_rows
from hmc.pose.objectives.symmetric import Symmetric
from hmc.pose.steps.limb_search import SearchSettings, lost_limbs, search_limbs
from hmc.pose.steps.refine import RefineSettings, refine, refine_all, refine_best
from hmc.pose.steps.restrict import nearest_part


@dataclass(frozen=True)
class _PulledAt:
    residuals: np.ndarray
    jacobian: np.ndarray
    near: Any = None
    misfit: Any = None

    def pulls(self):
        return np.arange(len(self.residuals)), self.jacobian


@dataclass(frozen=True)
class Pulled:
    """A landmark that is pulled to a place: written for this test, by finite differences."""

    body: BodyModel
    landmark: int
    place: np.ndarray
    weight: float = 1.0

    def _off(self, state):
        return self.weight * (landmarks(self.body, state)[..., self.landmark, :] - self.place)

    def cost(self, states):
        return (self._off(states) ** 2).sum(-1)

    def by_part(self, states):
        return None

    def linearise(self, state, near=None):
        steps = 1e-6 * np.eye(N_DOF)
        jacobian = (self._off(state + steps) - self._off(state - steps)).T / 2e-6
        return _PulledAt(self._off(state), jacobian, near=self.landmark)

    def coarser(self, rng, n):
        return self


@pytest.fixture(scope="module")
def scene():
    """Two halves of what a frame asks of a body, a pull on a wrist, and poses."""
    acted = act("gesture")
    body, points = body_of(acted.height_m)
    target, true = acted.targets[0], true_state(body, acted)
    first, second = (Symmetric(body, points, target, target.surface[k::6], COST) for k in (0, 3))
    wrist = landmark_index("l_wrist")
    pull = Pulled(body, wrist, landmarks(body, true)[wrist] + [0.1, 0.0, 0.15])
    states = true + np.random.default_rng(0).normal(0, 0.1, (4, N_DOF))
    return Sum([first, second, pull]), states, true


def test_costs_add_up(scene):
    total, states, _ = scene
    assert total.body is total.parts[0].body
    assert_allclose(total.cost(states), sum(one.cost(states) for one in total.parts))
    assert cost_at(total, states[0]) == pytest.approx(sum(cost_at(one, states[0]) for one in total.parts))


def test_residuals_and_derivatives_stand_one_after_the_other(scene):
    total, states, _ = scene
    residuals, jacobian = residual_rows(total.linearise(states[0]))
    parts = [residual_rows(one.linearise(states[0])) for one in total.parts]
    assert_array_equal(residuals, np.concatenate([one for one, _ in parts]))
    assert_array_equal(jacobian, np.concatenate([rows for _, rows in parts]))
    found = total.linearise(states[0])
    rows, pulled = found.pulls()
    assert len(np.unique(rows)) == len(rows) == len(pulled) and rows.max() < len(residuals)
    # What speeds up the next state goes to the part that it is from.
    assert len(found.near) == 3 and found.near[2] == landmark_index("l_wrist")
    assert_allclose(total.linearise(states[0], found.near).residuals, residuals)


def test_the_misfit_is_that_of_the_parts_that_can_tell(scene):
    total, states, _ = scene
    told, single = total.linearise(states[0]).misfit, [one.linearise(states[0]).misfit for one in total.parts[:2]]
    for name in ("outside", "part", "places", "distance"):
        assert_array_equal(getattr(told, name), np.concatenate([getattr(one, name) for one in single]))
    assert Sum(total.parts[2:]).linearise(states[0]).misfit is None


def test_shares_of_the_parts_of_the_body_add_up_where_all_can_tell(scene):
    total, states, true = scene
    assert total.by_part(states) is None
    first, second, pull = total.parts
    with_parts = [replace(one, asked_part=nearest_part(one.body, true, one.asked)) for one in (first, second)]
    shares = Sum(with_parts).by_part(states)
    assert_allclose(shares, sum(one.by_part(states) for one in with_parts))
    assert_allclose(shares.sum(axis=1), Sum(with_parts).cost(states), rtol=1e-4)
    assert Sum([*with_parts, pull]).by_part(states) is None


def test_a_coarser_sum_is_the_sum_of_the_coarser(scene):
    total, states, _ = scene
    coarse = total.coarser(np.random.default_rng(3), 40)
    rng = np.random.default_rng(3)
    parts = [one.coarser(rng, 40) for one in total.parts]
    assert [len(one.asked) for one in coarse.parts[:2]] == [40, 40]
    assert_allclose(coarse.cost(states), sum(one.cost(states) for one in parts))


def test_a_refinement_goes_to_the_minimum_of_the_sum(scene):
    """The pull alone moves nothing but the arm, the hulls alone leave the wrist where it is: together they meet between."""
    total, _, true = scene
    plain, pull = Sum(total.parts[:2]), total.parts[2]
    weighted = Sum([*plain.parts, replace(pull, weight=0.3)])
    settings = RefineSettings(iterations=30)
    start = np.clip(true, total.body.limits.low, total.body.limits.high)
    (without, _), (found, info) = refine(plain, start, settings), refine(weighted, start, settings)
    assert info.cost == pytest.approx(cost_at(weighted, found)) and info.cost_after < info.cost_before
    assert cost_at(weighted, found) < cost_at(weighted, without)
    assert np.sqrt(pull.cost(found[None])) < np.sqrt(pull.cost(without[None])) - 0.01
    assert cost_at(plain, found) > cost_at(plain, without)
    for refined, told in (refine_best(weighted, [start, without], settings), refine_all(weighted, [start], settings)[0]):
        assert told.cost < 1.1 * info.cost
        assert np.all((refined >= total.body.limits.low) & (refined <= total.body.limits.high))


def test_lost_limbs_are_looked_for_in_a_sum(scene):
    total, _, true = scene
    settings, away = SearchSettings(draws=40), true.copy()
    away[LIMBS["r_arm"].dofs] = [0.0, -1.2, 0.0, 1.5]
    named = lost_limbs(np.random.default_rng(0), total.body, away, total.linearise(away).misfit, settings)
    assert "r_arm" in named
    state, cost, evaluations = search_limbs(
        np.random.default_rng(1), total, (away, cost_at(total, away)), named, RefineSettings(), settings
    )
    assert cost < 0.5 * cost_at(total, away) and evaluations > settings.draws
    wrist = landmark_index("r_wrist")
    off = [np.linalg.norm(landmarks(total.body, one)[wrist] - landmarks(total.body, true)[wrist]) for one in (away, state)]
    assert off[0] > 0.3 and off[1] < 0.08
