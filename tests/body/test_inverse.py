"""Inverse kinematics: landmarks of known states are met, within the joint limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import canton_body, default_body
from hmc.landmarks import LANDMARKS, landmark_index

BODY = default_body(1.75)


def displaced(seed: int, spread: float, body=BODY) -> tuple[np.ndarray, np.ndarray]:
    """A state and another one near it, both within the limits."""
    rng = np.random.default_rng(seed)
    state = neutral_state("down", body.limits) + rng.normal(0, 0.3, N_DOF)
    state = np.clip(state, body.limits.low, body.limits.high)
    return state, np.clip(state + rng.normal(0, spread, N_DOF), body.limits.low, body.limits.high)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31))
def test_landmarks_of_a_near_state_are_met(seed):
    state, start = displaced(seed, 0.25)
    found, error = fit_landmarks(BODY, landmarks(BODY, state), start)
    assert np.all((found >= BODY.limits.low) & (found <= BODY.limits.high))
    assert error < 0.01
    miss = landmarks(BODY, found) - landmarks(BODY, state)
    assert error == pytest.approx(np.sqrt((miss**2).sum(1).mean()))


def test_a_far_start_far_away_still_arrives():
    state, _ = displaced(3, 0)
    start = neutral_state("down", BODY.limits)
    start[:3], start[3] = (2.0, -1.5, 0.5), 1.2
    _, error = fit_landmarks(BODY, landmarks(BODY, state), start, iterations=100)
    assert error < 0.02


@pytest.mark.parametrize("side", ["l", "r"])
@pytest.mark.parametrize(
    ("upper", "fore"),
    [
        pytest.param((-0.35, 0.3, -0.89), (-0.3, -0.9, -0.3), id="hands clasped behind the back"),
        pytest.param((-0.55, 0.6, -0.6), (-0.1, -0.9, -0.4), id="hands on the loins"),
        pytest.param((-0.5, 0.85, -0.1), (-0.3, -0.2, -0.93), id="an elbow raised backward"),
        pytest.param((-0.8, 0.4, -0.45), (-0.85, 0.1, -0.5), id="a throw from below"),
        pytest.param((-0.3, 0.7, -0.65), (0.3, -0.7, -0.65), id="arms akimbo"),
        pytest.param((0.7, 0.0, -0.7), (0.3, -0.9, 0.3), id="a hand on the other shoulder"),
    ],
)
def test_an_arm_that_hangs_comes_to_where_people_bring_theirs(side, upper, fore):
    """Step by step, as a tracker follows; directions of upper arm and forearm: forward, outward and up."""
    state = neutral_state("down", BODY.limits)
    points = landmarks(BODY, state)
    arm = [landmark_index(f"{side}_{joint}") for joint in ("shoulder", "elbow", "wrist")]
    outward = [1, 1 if side == "l" else -1, 1]
    bones = np.diff(points[arm], axis=0)
    for share in np.linspace(0, 1, 11)[1:]:
        target = points.copy()
        for k, (bone, end) in enumerate(zip(bones, (upper, fore), strict=True)):
            length = np.linalg.norm(bone)
            way = (1 - share) * bone / length + share * np.array(end) * outward
            target[arm[k + 1]] = target[arm[k]] + length * way / np.linalg.norm(way)
        state, _ = fit_landmarks(BODY, target, state)
    assert np.linalg.norm(landmarks(BODY, state) - target, axis=1).max() < 0.01


def test_the_exact_state_stays():
    state, _ = displaced(1, 0)
    found, error = fit_landmarks(BODY, landmarks(BODY, state), state)
    assert_allclose(found, state, atol=1e-6)
    assert error < 1e-6


def test_unknown_landmarks_are_left_out():
    state, start = displaced(5, 0.2)
    points = landmarks(BODY, state)
    hidden = [landmark_index(name) for name in ("l_elbow", "l_wrist", "head_top")]
    points[hidden] = np.nan
    found, error = fit_landmarks(BODY, points, start)
    known = [k for k in range(len(LANDMARKS)) if k not in hidden]
    assert error < 0.01
    assert_allclose(landmarks(BODY, found)[known], points[known], atol=0.02)


def test_angles_that_no_landmark_shows_stay_where_they_were():
    """A straight arm's twist moves no landmark."""
    state = neutral_state("sideways", BODY.limits)
    start = state.copy()
    twist = [f"{side}_shoulder_y" for side in "lr"]
    start[dof_index(*twist)] = 0.4
    found, error = fit_landmarks(BODY, landmarks(BODY, state), start)
    assert_allclose(found[dof_index(*twist)], 0.4, atol=0.02)
    assert error < 1e-3


def test_what_the_limits_forbid_is_met_as_well_as_they_allow():
    body = canton_body(1.75)
    state = neutral_state("sideways", body.limits)
    knee = dof_index("l_knee_y")
    state[knee] = -0.6  # bent forward
    found, error = fit_landmarks(body, landmarks(body, state), neutral_state("sideways", body.limits))
    assert np.all((found >= body.limits.low) & (found <= body.limits.high))
    start_error = np.sqrt(((landmarks(body, neutral_state("sideways", body.limits)) - landmarks(body, state)) ** 2).sum(1).mean())
    assert 0.005 < error < start_error


def test_a_start_outside_the_limits_is_no_harm():
    state, _ = displaced(8, 0)
    found, error = fit_landmarks(BODY, landmarks(BODY, state), state + np.r_[np.zeros(6), np.full(N_DOF - 6, 9.0)], iterations=200)
    assert np.all((found >= BODY.limits.low) & (found <= BODY.limits.high))
    assert np.isfinite(error)
