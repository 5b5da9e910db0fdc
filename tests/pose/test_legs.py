"""Left and right leg told apart over time: against brute force, on swinging points, and on a rendered walker's hulls."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_array_equal
from posed import COST, mean_error, subject_of, true_state, view_of

from hmc.body.exchange import swapped_pose
from hmc.body.joints import N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.landmarks import landmark_index
from hmc.pose.legs import LegSettings, TellLegs, choose_legs, leg_alternatives, limb_points
from hmc.pose.method import StepInfo, begin_tracking
from hmc.pose.objectives.symmetric import Symmetric
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.refine import refine

FPS = 15.0
PRESET = replace(PRESETS["default"], symmetric=COST)


def path_cost(path, frames, costs, legs, settings):
    """The cost of one path, a frame at a time."""
    reach = round(settings.reach_s * FPS)
    costs = costs * [1, 1 + settings.doubt]
    total = costs[0][path[0]]
    for k in range(1, len(path)):
        here, there = path[k - 1], path[k]
        a, b = max(0, k - 1 - reach), min(len(path) - 1, k + reach)
        step = (legs[k][there] - legs[k - 1][here]) / (frames[k] - frames[k - 1]) * FPS
        before = (legs[k - 1][here] - legs[a][here]) / (frames[k - 1] - frames[a]) * FPS if a < k - 1 else step
        after = (legs[b][there] - legs[k][there]) / (frames[b] - frames[k]) * FPS if b > k else step
        jump = np.mean([np.mean(np.sum(d**2, axis=1)) for d in (step - before, after - step, after - before)])
        total += settings.jump_weight * min(jump, settings.largest_jump_m_s**2) + costs[k][there]
    return total


@pytest.mark.parametrize("seed", range(4))
def test_the_path_is_the_cheapest_of_all(seed):
    rng = np.random.default_rng(seed)
    n, settings = 8, LegSettings()
    frames = np.cumsum(rng.integers(1, 3, n))
    costs, legs = rng.uniform(0, 2e-4, (n, 2)), rng.normal(0, 0.1, (n, 2, 4, 3))
    best = min(product((0, 1), repeat=n), key=lambda path: path_cost(path, frames, costs, legs, settings))
    assert_array_equal(choose_legs(frames, costs, legs, FPS, settings), best)


def swinging(n: int = 45):
    """Knees and ankles of a walk at one step in 9 frames, (n, 2 sides, 2, 3), metres."""
    phase = np.arange(n)[:, None] / 18 * 2 * np.pi + np.array([0, np.pi])
    joints = [
        np.stack(
            [0.07 * np.arange(n)[:, None] + swing * np.sin(phase), np.broadcast_to([0.1, -0.1], phase.shape), np.full_like(phase, z)], -1
        )
        for swing, z in ((0.18, 0.5), (0.35, 0.1))
    ]
    return np.stack(joints, axis=2)


def test_legs_that_were_exchanged_where_they_pass_are_put_right():
    """Two steps of a walk with exchanged legs: no cost tells, but for the first frames."""
    sides = swinging()
    right = sides.reshape(len(sides), 4, 3)
    wrong = sides[:, ::-1].reshape(len(sides), 4, 3)
    exchanged = np.zeros(len(sides), int)
    exchanged[9:18], exchanged[27:36] = 1, 1  # the legs pass at multiples of 9 frames
    pair = np.stack([right, wrong], axis=1)
    legs = np.where(exchanged[:, None, None, None] == 0, pair, pair[:, ::-1])
    costs = np.zeros((len(sides), 2))
    costs[:5, 1] = 2e-4
    assert_array_equal(choose_legs(np.arange(45), costs, legs, FPS, LegSettings()), exchanged)


@pytest.mark.parametrize("fps", [15, 30, 50, 60, 120, 240])
def test_exchanged_legs_are_put_right_at_any_rate(fps):
    """A stride of a second; hulls say nothing either way, at a cost as of real ones."""
    phase = 2 * np.pi * np.arange(3 * fps)[:, None] / fps + np.array([0, np.pi])
    forward = 1.3 * np.arange(3 * fps)[:, None] / fps
    joints = [
        np.stack([forward + swing * np.sin(phase), np.broadcast_to([0.1, -0.1], phase.shape), np.full_like(phase, z)], -1)
        for swing, z in ((0.18, 0.5), (0.35, 0.1))
    ]
    right = np.stack(joints, axis=2)
    exchanged = np.zeros(3 * fps, int)
    exchanged[fps : fps + round(fps / 2)] = 1  # the legs pass twice a stride
    followed = np.where(exchanged[:, None, None, None] == 0, right, right[:, ::-1]).reshape(-1, 4, 3)
    legs = np.stack([followed, followed[:, [2, 3, 0, 1]]], axis=1)
    picks = choose_legs(np.arange(3 * fps), np.full((3 * fps, 2), 2e-4), legs, fps, LegSettings())
    assert np.mean(picks == exchanged) > 0.97


def test_a_frame_that_went_wrong_does_not_turn_the_rest():
    sides = swinging().reshape(45, 4, 3)
    legs = np.stack([sides, sides[:, [2, 3, 0, 1]]], axis=1)
    legs[20] += np.random.default_rng(0).normal(0, 0.3, (2, 4, 3))
    costs = np.tile([2e-4, 3e-4], (45, 1))
    picks = choose_legs(np.arange(45), costs, legs, FPS, LegSettings())
    assert not picks[np.arange(45) != 20].any()


@pytest.fixture(scope="module")
def walker():
    acted = act("walk", frames=10)
    subject = subject_of(acted, PRESET)
    return acted, subject, [refined(subject, true_state(subject.body, acted, k), target) for k, target in enumerate(acted.targets)]


def refined(subject, state, target):
    return refine(Symmetric(subject.body, subject.points, target, target.surface, COST), state, PRESET.refine)[0]


def test_the_other_choice_has_exchanged_legs(walker):
    acted, subject, states = walker
    wide = int(
        np.argmax([np.linalg.norm(truth[landmark_index("l_ankle")] - truth[landmark_index("r_ankle")]) for truth in acted.landmarks])
    )
    choice = leg_alternatives(np.random.default_rng(0), subject, states[wide], view_of(acted.targets[wide]), PRESET.polish)
    assert_array_equal(choice.states[0], states[wide])
    kept, other = limb_points(subject.body, choice.states, LegSettings())
    assert np.linalg.norm(other[[1, 3]] - kept[[3, 1]], axis=1).max() < 0.15  # ankles
    assert np.linalg.norm(kept[1] - kept[3]) > 0.3
    assert np.all(choice.costs > 0)
    assert np.all((choice.states >= subject.body.limits.low) & (choice.states <= subject.body.limits.high))


def test_a_frame_without_a_hull_offers_nothing(walker):
    _, subject, states = walker
    choice = leg_alternatives(np.random.default_rng(0), subject, states[0], view_of(None), PRESET.polish)
    assert_array_equal(choice.states, [states[0], states[0]])
    assert_array_equal(choice.costs, 0)


def test_any_step_s_pose_is_offered_with_exchanged_legs_unless_a_leg_is_missing(walker):
    acted, subject, states = walker
    tell, tracked = TellLegs(PRESET.polish), begin_tracking(subject, states[0])
    view, missing = view_of(acted.targets[0]), np.zeros(N_DOF, bool)
    missing[dof_index("l_elbow_z")] = True  # an arm that is missing says nothing of the legs
    offered = tell(np.random.default_rng(0), (tracked, StepInfo(missing=missing)), view)
    expected = leg_alternatives(np.random.default_rng(0), subject, states[0], view, PRESET.polish)
    assert_array_equal(offered.states, expected.states)
    missing[dof_index("r_knee_y")] = True
    for info in (StepInfo(missing=missing), StepInfo("no hull of this person in this frame")):
        nothing = tell(np.random.default_rng(0), (tracked, info), view)
        assert_array_equal(nothing.states, [states[0]] * 2)
        assert not nothing.costs.any()


def test_arms_are_told_apart_too_where_that_is_asked(walker):
    _, subject, states = walker
    points = limb_points(subject.body, np.array(states[:2]), LegSettings(arms_too=True))
    whole = landmarks(subject.body, np.array(states[:2]))
    names = [landmark_index(f"{side}_{name}") for side in "lr" for name in ("elbow", "wrist", "knee", "ankle")]
    assert {tuple(point) for point in points[0]} == {tuple(point) for point in whole[0, names]}


def test_a_walker_whose_legs_were_exchanged_is_put_right(walker):
    """True poses, but for some frames whose legs were exchanged: hulls and swing tell which."""
    acted, subject, states = walker
    given = [
        refined(subject, swapped_pose(subject.body, state, "legs"), acted.targets[k]) if 4 <= k < 8 else state
        for k, state in enumerate(states)
    ]
    rng = np.random.default_rng(1)
    choices = [
        leg_alternatives(rng, subject, state, view_of(target), PRESET.polish) for state, target in zip(given, acted.targets, strict=True)
    ]
    legs = np.array([limb_points(subject.body, one.states, LegSettings()) for one in choices])
    picks = choose_legs(np.arange(len(given)), np.array([one.costs for one in choices]), legs, acted.fps, LegSettings())
    errors = [
        [mean_error(landmarks(subject.body, one), truth) for one in (state, choice.states[pick])]
        for state, choice, pick, truth in zip(given, choices, picks, acted.landmarks, strict=True)
    ]
    before, after = np.mean(errors, axis=0)
    assert_array_equal(picks[:3], 0)
    assert after < 0.8 * before and after < 0.06
