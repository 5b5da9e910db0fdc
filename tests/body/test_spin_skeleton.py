"""The skeleton of 23 parameters and a body of the same lengths: to and fro, and the thesis's skeleton as a body."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import N_CANTON, N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.body.spin_skeleton import (
    ANGLES,
    default_limits,
    model_of_body,
    model_of_height,
    skeleton_landmarks,
    skeleton_state,
    thesis_body,
    thesis_limits,
)
from hmc.landmarks import LANDMARKS

WAIST = dof_index("torso_x", "torso_y", "torso_z")
#: What the skeleton lacks beside the waist: thighs that turn about themselves.
TURNS = dof_index("r_hip_z", "l_hip_z")
HEAD = LANDMARKS.index("head_top")
BODIES = {"default": (default_body(1.75), False), "thesis": (thesis_body(1.68), True)}


def states_of(body, low, high, n=20):
    """Random poses of a straight waist, within the skeleton's ranges and the body's limits."""
    rng = np.random.default_rng(0)
    states = np.tile(neutral_state("down", default_body(1.7).limits), (n, 1))
    places = dof_index(*ANGLES)
    least, most = np.maximum(low, body.limits.low[places]), np.minimum(high, body.limits.high[places])
    states[:, places] = rng.uniform(least, most, (n, len(places)))
    states[:, :3] = rng.normal([0, 0, 1], 0.5, (n, 3))
    states[:, 3:6] = rng.uniform([-3, -0.6, -0.6], [3, 0.6, 0.6], (n, 3))
    states[:, [*WAIST, *TURNS]] = 0.0
    return states


@pytest.mark.parametrize("name", BODIES)
def test_a_pose_with_a_straight_waist_has_the_same_landmarks_on_both_sides(name):
    body, thesis = BODIES[name]
    model = model_of_body(body, thesis)
    for state in states_of(body, model.low, model.high):
        points = landmarks(body, state)
        there = skeleton_landmarks(model, skeleton_state(model, points, state))
        assert_allclose(np.delete(there, HEAD, 0), np.delete(points, HEAD, 0), atol=1e-6)
        # The skeleton's head goes straight up from the neck; a body's may lean forward, turned with it.
        assert np.linalg.norm(there[HEAD] - points[HEAD]) == pytest.approx(body.dimensions["head_forward"], abs=1e-6)


@pytest.mark.parametrize("name", BODIES)
def test_and_back_again(name):
    """From the skeleton's landmarks inverse kinematics finds the body's pose, whose skeleton is the one it came from."""
    body, thesis = BODIES[name]
    model = model_of_body(body, thesis)
    for state in states_of(body, 0.5 * model.low, 0.5 * model.high, 5):
        skeleton = skeleton_state(model, landmarks(body, state), state)
        back, _ = fit_landmarks(body, skeleton_landmarks(model, skeleton), state + 0.02, iterations=60)
        off = np.linalg.norm(landmarks(body, back) - skeleton_landmarks(model, skeleton), axis=1)
        assert np.delete(off, HEAD).max() < 0.01 and off[HEAD] < 0.01 + body.dimensions["head_forward"]


def test_a_bent_waist_goes_into_the_torso_s_axis_and_spin():
    body = default_body(1.75)
    model = model_of_body(body)
    state = states_of(body, *default_limits(), 1)[0]
    state[dof_index("torso_y")], state[dof_index("torso_z")] = 0.5, 0.4
    points = landmarks(body, state)
    there = skeleton_landmarks(model, skeleton_state(model, points, state))
    assert_allclose(there[:2].mean(0), points[:2].mean(0), atol=1e-9)  # pelvis and neck
    axis, own = there[1] - there[0], points[1] - points[0]
    assert axis @ own / np.linalg.norm(axis) / np.linalg.norm(own) == pytest.approx(1, abs=1e-9)
    assert np.linalg.norm(axis) == pytest.approx(model.torso)
    trunk = [LANDMARKS.index(f"{side}_{name}") for side in "lr" for name in ("shoulder", "hip")]
    assert np.linalg.norm(there - points, axis=1)[trunk].max() < 0.05  # arms and legs keep their angles


def test_angles_beyond_the_skeleton_s_ranges_are_led_to_them():
    body = default_body(1.75)
    model = model_of_body(body)
    state = neutral_state("down")
    state[dof_index("l_knee_y")] = 9.0
    found = skeleton_state(model, landmarks(body, state), state)
    assert np.all((found[7:] >= model.low) & (found[7:] <= model.high))
    assert found[7 + ANGLES.index("l_knee_y")] == model.high[ANGLES.index("l_knee_y")]


@pytest.mark.parametrize("thesis", [False, True])
def test_the_model_of_a_height_is_that_of_the_body_of_that_height(thesis):
    body = thesis_body(1.8) if thesis else default_body(1.8)
    one, other = model_of_height(1.8, thesis), model_of_body(body, thesis)
    for name in one.__dataclass_fields__:
        assert_array_equal(getattr(one, name), getattr(other, name))
    lengths = body.dimensions
    assert other.torso == lengths["trunk"] and other.forearm == lengths["forearm"] and other.shank == lengths["shank"]
    assert other.lower_arm == lengths["forearm"] + lengths["hand"] and other.calf == lengths["shank"] + lengths["ankle_height"]


def test_the_thesis_s_body_is_straight_and_has_the_printed_ranges():
    body, low, high = thesis_body(1.7), *thesis_limits()
    places = dof_index(*ANGLES)
    assert_array_equal(body.limits.low[places], low)
    assert_array_equal(body.limits.high[places], high)
    for k in (*WAIST, *TURNS, *range(N_CANTON, N_DOF)):
        assert body.limits.low[k] == body.limits.high[k] == 0
    rest = np.setdiff1d(np.arange(N_DOF), [*places, *WAIST, *TURNS, *range(N_CANTON, N_DOF)])
    assert np.isinf(body.limits.low[rest]).all() and set(rest) == set(range(6))
    points = landmarks(body, np.zeros(N_DOF))
    assert points[3, 2] == pytest.approx(points[1, 2])  # shoulders as high as the neck
    straight = {"shoulder_drop", "chest_forward", "head_forward", "head_flesh_back", "lumbar", "collar"}  # the rest is an average person's
    assert {name for name, value in default_body(1.7).dimensions.items() if body.dimensions[name] != value} == straight
