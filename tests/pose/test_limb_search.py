"""Search for lost limbs on rendered people: a displaced limb is named, and found again."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose
from posed import COST, body_of, true_state

from hmc.body.joints import DOF_NAMES
from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.landmarks import landmark_index
from hmc.pose.objectives.objective import cost_at
from hmc.pose.objectives.symmetric import Symmetric, body_distance, outside_distance
from hmc.pose.steps.limb_search import SearchSettings, lost_limbs, search_limbs
from hmc.pose.steps.refine import RefineSettings, refine

SEARCH = SearchSettings(far_m=0.05, draws=250, gain=0.03)
# An arm held out where there is nothing, a leg kicked aside.
LOST = {
    "r_arm": {"r_shoulder_x": -1.4, "r_shoulder_z": 0.0, "r_elbow_z": 0.2},
    "l_arm": {"l_shoulder_x": 1.4, "l_shoulder_z": 0.0, "l_elbow_z": -0.2},
    "r_leg": {"r_hip_x": -0.9, "r_hip_y": 0.0, "r_knee_y": 0.0},
    "l_leg": {"l_hip_x": 0.9, "l_hip_y": 0.0, "l_knee_y": 0.0},
}
ENDS = {"arm": ("elbow", "wrist"), "leg": ("knee", "ankle")}


@pytest.fixture(scope="module")
def scene():
    """A walking person: the objective of a frame, and the state refined from the truth with its cost."""
    acted = act("walk")
    body, points = body_of(acted.height_m)
    target = acted.targets[3]
    objective = Symmetric(body, points, target, target.surface[::3], COST)
    state, info = refine(objective, true_state(body, acted, 3), RefineSettings())
    return objective, state, info.cost_after


def lose(state: np.ndarray, limb: str) -> np.ndarray:
    out = state.copy()
    for name, value in LOST[limb].items():
        out[DOF_NAMES.index(name)] = value
    return out


def named(rng, scene, state, settings) -> list[str]:
    """The limbs that are looked for at a state."""
    return lost_limbs(rng, scene[0].body, state, scene[0].linearise(state).misfit, settings)


@pytest.mark.parametrize("limb", LIMBS)
def test_a_limb_in_the_air_is_named(scene, limb):
    lost = lose(scene[1], limb)
    assert named(np.random.default_rng(0), scene, lost, SearchSettings(uncovered_share=1.0)) == [limb]
    # The hull where the limb should be is then uncovered, and others are looked for by turns: their own may have gone there.
    picks = [named(np.random.default_rng(k), scene, lost, SearchSettings(uncovered_share=0.005, at_once=2)) for k in range(20)]
    assert all(len(pick) == 2 and limb in pick for pick in picks) and set().union(*picks) == set(LIMBS)


def test_a_foot_that_nothing_covers_is_looked_for_by_legs(scene):
    """A foot lifted to the seat leaves the hull about it uncovered, which no arm reaches; picked blindly, half would be arms."""
    lifted = scene[1].copy()
    lifted[DOF_NAMES.index("r_knee_y")] = 2.2
    settings = SearchSettings(outside_share=1.0, uncovered_share=0.005, at_once=1)
    picks = [named(np.random.default_rng(k), scene, lifted, settings) for k in range(60)]
    assert all(len(pick) == 1 for pick in picks)
    assert sum(pick[0].endswith("leg") for pick in picks) >= 45


def test_a_good_pose_has_one_limb_looked_at_by_turns(scene):
    settings = SearchSettings(uncovered_share=0.5, far_m=0.08, random_share=1.0)
    picks = [named(np.random.default_rng(k), scene, scene[1], settings) for k in range(30)]
    assert {len(p) for p in picks} == {1} and {p[0] for p in picks} == set(LIMBS)
    settings = replace(settings, random_share=0.5)
    looked = sum(bool(named(np.random.default_rng(k), scene, scene[1], settings)) for k in range(60))
    assert 20 <= looked <= 40


def test_what_a_refinement_tells_is_what_the_search_asks(scene):
    """The distances of a refinement are those of its pose, as far as the search looks at them."""
    objective, state, _ = scene
    found, info = refine(objective, lose(state, "l_arm"), RefineSettings(iterations=2))
    body, target, told, far = objective.body, objective.target, info.misfit, SearchSettings().far_m
    # One reads the hull's distances between voxels, the other voxel by voxel.
    outside = outside_distance(body, objective.points.surface, found[None], target)[0]
    assert_allclose(told.outside, outside, atol=target.voxel_size_m)
    assert (told.outside > far).any() and (told.distance > far).any()
    np.testing.assert_array_equal(told.distance > far, body_distance(body, found[None], objective.asked)[0] > far)
    np.testing.assert_array_equal(told.part, objective.points.surface.part)
    np.testing.assert_array_equal(told.places, objective.asked)


@pytest.mark.parametrize("limb", LIMBS)
def test_a_lost_limb_is_found_again(scene, limb):
    objective, state, best = scene
    lost, info = refine(objective, lose(state, limb), RefineSettings(iterations=1))
    assert info.cost_after > 1.5 * best
    rng, body = np.random.default_rng(1), objective.body
    found, cost, evaluations = search_limbs(rng, objective, (lost, info.cost_after), [limb], RefineSettings(), SEARCH)
    assert cost < 0.6 * info.cost_after and evaluations > SEARCH.draws
    assert np.all((found >= body.limits.low) & (found <= body.limits.high))
    ends = [landmark_index(f"{limb[0]}_{end}") for end in ENDS[limb[2:]]]
    miss = np.linalg.norm(landmarks(body, found)[ends] - landmarks(body, state)[ends], axis=1)
    assert miss.max() < 0.10


def farthest(objective, one, other) -> float:
    """Of all landmarks of two poses, metres."""
    return float(np.linalg.norm(landmarks(objective.body, one) - landmarks(objective.body, other), axis=1).max())


def test_what_is_right_stays(scene):
    objective, state, cost = scene
    for seed in range(3):
        rng, settings = np.random.default_rng(seed), SearchSettings(gain=0.2)
        found, after, _ = search_limbs(rng, objective, (state, cost), list(LIMBS), RefineSettings(), settings)
        assert after <= cost
        assert farthest(objective, found, state) < 0.08


def test_draws_above_the_ratio_are_not_refined(scene):
    objective, state, cost = scene
    settings = SearchSettings(draw_ratio=0.0)
    found, after, evaluations = search_limbs(np.random.default_rng(0), objective, (state, cost), ["l_arm"], RefineSettings(), settings)
    np.testing.assert_array_equal(found, state)
    assert after == cost and evaluations == settings.draws + 1


def test_nothing_is_looked_for_when_nothing_is_asked(scene):
    objective, state, cost = scene
    found, after, evaluations = search_limbs(np.random.default_rng(0), objective, (state, cost), [], RefineSettings(), SEARCH)
    assert_allclose(found, state)
    assert after == cost and evaluations == 0


def test_the_same_seed_gives_the_same(scene):
    objective, state, _ = scene
    lost = lose(state, "l_arm")
    one, other = (search_limbs(np.random.default_rng(7), objective, (lost, 1.0), ["l_arm"], RefineSettings(), SEARCH) for _ in range(2))
    np.testing.assert_array_equal(one[0], other[0])
    assert one[1:] == other[1:]


@pytest.mark.parametrize("limb", LOST)
def test_few_draws_suffice_where_the_hull_shows_the_limb(scene, limb):
    """Half of them reach for what nothing covers; without that a few would often miss."""
    objective, state, _ = scene
    lost = lose(state, limb)
    settings = SearchSettings(draws=30)
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        found, _, _ = search_limbs(rng, objective, (lost, cost_at(objective, lost)), [limb], RefineSettings(), settings)
        assert farthest(objective, found, state) < 0.06
