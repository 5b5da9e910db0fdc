"""Which feet stand: walkers, runners, who stands still, who sits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from hmc.body.feet import foot_points
from hmc.body.joints import DOF_NAMES, N_DOF, dof_index
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.io.results import PoseStates
from hmc.pose.contacts import ground_under, standing_feet, standing_frames

BODY = default_body(1.8)
LEGS = sum(BODY.dimensions[name] for name in ("thigh", "shank", "ankle_height"))


def gait(fps, speed=1.3, stride_s=1.1, stance=0.6, seconds=4.0):
    """Times, ankles of a walker (n, 2, 3), and whether each foot is on the ground: still in stance, on an arc in between."""
    times = np.arange(0, seconds, 1 / fps)
    ankles, down = np.zeros((len(times), 2, 3)), np.zeros((len(times), 2), bool)
    for foot in range(2):
        phase = times / stride_s + foot / 2
        whole, part = np.floor(phase), phase % 1
        swing = np.clip((part - stance) / (1 - stance), 0, 1)
        ankles[:, foot, 0] = speed * stride_s * (whole + swing - np.sin(2 * np.pi * swing) / (2 * np.pi))
        ankles[:, foot, 2] = 0.09 + 0.15 * np.sin(np.pi * swing)
        down[:, foot] = part < stance
    return times, ankles, down


@pytest.mark.parametrize("fps", [15, 25, 60])
@pytest.mark.parametrize("speed, stride_s, stance", [(1.3, 1.1, 0.6), (3.0, 0.7, 0.35)])
def test_a_foot_of_a_walker_or_runner_stands_in_stance(fps, speed, stride_s, stance):
    times, ankles, down = gait(fps, speed, stride_s, stance)
    found = standing_frames(times, ankles + np.random.default_rng(0).normal(0, 0.002, ankles.shape))
    middle = down.copy()
    for shift in range(1, 1 + round(0.08 * fps)):  # not where a foot comes down or leaves
        middle &= np.roll(down, shift, 0) & np.roll(down, -shift, 0)
    assert found[middle].mean() > 0.9
    swung = ~down
    for shift in range(1, 1 + round(0.08 * fps)):
        swung &= ~np.roll(down, shift, 0) & ~np.roll(down, -shift, 0)
    assert found[swung].mean() < 0.05


@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_any_times_will_do(n, seed):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.choice([0.03, 0.1, 2.0], n))
    found = standing_frames(times, rng.normal(size=(n, 2, 3)))
    assert found.shape == (n, 2, 2) and found.dtype == bool


@given(st.integers(1, 40), st.sampled_from([10, 25, 30, 60]), st.integers(0, 2**32 - 1))
def test_rest_is_told_as_by_looking_at_all_other_frames(n, fps, seed):
    rng = np.random.default_rng(seed)
    times = np.sort(rng.choice(2 * n, n, replace=False)) / fps
    ankles = np.cumsum(rng.normal(0, 0.01, (n, 2, 3)), axis=0)
    speed = np.zeros((n, 2))
    for row, away in enumerate(np.abs(times - times[:, None])):
        near = away <= max(0.065, np.sort(away)[min(2, n - 1)]) + 1e-6
        if near.sum() > 1:
            slopes = np.polyfit(times[near] - times[row], ankles[near].reshape(near.sum(), -1), 1)[0]
            speed[row] = np.linalg.norm(slopes.reshape(2, 3), axis=-1)
    found = standing_frames(times, ankles)
    for row, away in enumerate(np.abs(times - times[:, None])):
        stride = away <= 1.0 + 1e-6
        low = ankles[row, :, 2] < ankles[stride][..., 2].min(axis=0) + 0.08
        slow = np.stack([speed[row] < 0.3, speed[row] < np.maximum(0.45, 0.25 * speed[stride].max(axis=0))], axis=-1)
        assert_array_equal(found[row], slow & low[:, None])


def states_of(states):
    return PoseStates(np.arange(len(states)), np.zeros(len(states), int), np.array(states), DOF_NAMES, {0: BODY.dimensions})


def poses(pelvis_z, lifted=0.0, n=20):
    state = neutral_state()
    state[2] = pelvis_z
    state[dof_index("r_hip_y", "r_knee_y")] = -lifted, lifted
    return [state] * n


def test_who_stands_still_stands_on_both_feet_and_who_lifts_one_on_the_other():
    both = standing_feet(states_of(poses(LEGS)), {0: BODY}, 30.0, 0.0)
    assert set(both[0].feet.values()) == {(True,) * 4} and len(both[0].feet) == 20
    one = standing_feet(states_of(poses(LEGS, 1.3)), {0: BODY}, 30.0, 0.0)
    assert set(one[0].feet.values()) == {(True, True, False, False)}


def test_who_is_high_above_the_floor_stands_on_something_else():
    assert set(standing_feet(states_of(poses(LEGS + 0.3)), {0: BODY}, 30.0, 0.0)[0].feet.values()) == {(False,) * 4}
    assert set(standing_feet(states_of(poses(LEGS + 0.3)), {0: BODY}, 30.0, 0.3)[0].feet.values()) == {(True,) * 4}


@pytest.mark.parametrize("raised_m, lost_m", [(0.06, 0.0), (0.06, 0.02), (0.09, 0.01)])
def test_who_stands_on_a_beam_or_a_mat_stands_on_that(raised_m, lost_m):
    stands, lifts = poses(LEGS + raised_m + lost_m), poses(LEGS + raised_m + lost_m, 1.3)
    found = standing_feet(states_of([*stands, *lifts]), {0: BODY}, 30.0, 0.0)[0]
    assert found.ground_z == pytest.approx(raised_m, abs=0.015)
    assert {found.feet[3], found.feet[35]} == {(True,) * 4, (True, True, False, False)}


@pytest.mark.parametrize("lost_m", [0.0, 0.02, 0.03])
def test_soles_that_silhouettes_lose_are_on_the_floor_all_the_same(lost_m):
    assert standing_feet(states_of(poses(LEGS + lost_m)), {0: BODY}, 30.0, 0.0)[0].ground_z == 0.0
    few = np.full(4, 0.09)
    assert ground_under(few, 0.02) == 0.02 and ground_under(np.tile(few, 4), 0.02) == pytest.approx(0.075)


def test_who_kneels_may_have_the_feet_anywhere():
    state = neutral_state()
    state[2] = BODY.dimensions["thigh"] + 0.12  # on a mat
    state[dof_index("r_knee_y", "l_knee_y")], state[dof_index("r_ankle_y", "l_ankle_y")] = np.radians(85), np.radians(45)
    assert abs(foot_points(BODY, state)[:, 2].min()) < 0.1  # soles no farther from the floor than of who stands
    assert set(standing_feet(states_of([state] * 20), {0: BODY}, 30.0, 0.0)[0].feet.values()) == {(False,) * 4}


def test_of_who_stands_on_tiptoe_nothing_is_said_unless_nothing_shows_the_feet():
    state = neutral_state()
    state[dof_index("l_ankle_y")] = np.radians(40)
    state[2] = LEGS
    lowest = foot_points(BODY, state)[:2, 2].min()
    assert lowest < -0.08  # through the floor by its toes: legs of which silhouettes lose the feet
    assert set(standing_feet(states_of([state] * 20), {0: BODY}, 30.0, 0.0)[0].feet.values()) == {(True,) * 4}
    state[2] -= lowest  # the toes' end on the floor; and the other foot beside it in the air, within what a floor may be off
    found = set(standing_feet(states_of([state] * 20), {0: BODY}, 30.0, 0.0)[0].feet.values())
    assert len(found) == 1 and next(iter(found))[:2] == (False, False)
    state[dof_index("l_ankle_y")] = np.radians(5)  # a heel that is hardly raised stands
    state[2] = LEGS
    assert set(standing_feet(states_of([state] * 20), {0: BODY}, 30.0, 0.0)[0].feet.values()) == {(True,) * 4}


def test_frames_without_a_pose_tell_nothing():
    lost = [*poses(LEGS, n=5), np.full(N_DOF, np.nan), *poses(LEGS, n=5)]
    found = standing_feet(states_of(lost), {0: BODY}, 30.0, 0.0)[0].feet
    assert sorted(found) == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10] and set(found.values()) == {(True,) * 4}


def test_a_heel_that_rises_is_not_held_and_the_ball_is():
    """The ankle rolls on at .6 m/s while its ball stays, as before each step."""
    times = np.arange(0, 2, 1 / 30)
    ankles = np.zeros((len(times), 1, 3))
    ankles[:, 0, 0] = np.interp(times, [0, 1, 1.2, 1.5], [0, 0, 0.12, 1.0])
    found = standing_frames(times, ankles)[:, 0]
    assert found[times < 0.9].all()
    rolls = (times > 1.05) & (times < 1.12)
    assert rolls.any() and not found[rolls, 0].any() and found[rolls, 1].all()
