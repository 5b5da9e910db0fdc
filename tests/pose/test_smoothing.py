"""Smoothing of finished poses: polynomials stay as they are, noise shrinks, gaps are not bridged, bones and limits hold."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from hmc.body.joints import DOF_NAMES, default_limits
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.io.results import PoseStates, PoseTable
from hmc.landmarks import landmark_index
from hmc.pose.follow import PosedPeople
from hmc.pose.smoothing import smooth_landmarks, smooth_people

FPS = 30.0


@given(st.integers(0, 2**32 - 1), st.integers(9, 40))
@settings(max_examples=25, deadline=None)
def test_cubic_paths_stay_as_they_are(seed, n):
    times = np.arange(n)[:, None, None] / FPS
    coefficients = np.random.default_rng(seed).normal(size=(4, 15, 3))
    path = sum(c * times**k for k, c in enumerate(coefficients))
    assert_allclose(smooth_landmarks(np.arange(n), path, FPS, 0.3), path, atol=1e-9)


def test_noise_shrinks_and_a_window_of_few_frames_does_nothing():
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 0.01, (200, 15, 3))
    smooth = smooth_landmarks(np.arange(200), noise, FPS, 0.3)
    assert smooth.std() < 0.7 * noise.std()
    assert_array_equal(smooth_landmarks(np.arange(200), noise, FPS, 0.06), noise)


def test_gaps_and_missing_frames_are_not_bridged():
    frames = np.r_[0:20, 30:50, 60:64]
    step = np.zeros((len(frames), 15, 3))
    step[20:] = 1.0  # the person is elsewhere after the gap
    assert_allclose(smooth_landmarks(frames, step, FPS, 0.3), step, atol=1e-12)
    step[10] = np.nan
    smooth = smooth_landmarks(frames, step, FPS, 0.3)
    assert np.isnan(smooth[10]).all() and np.isfinite(np.delete(smooth, 10, 0)).all()
    assert_allclose(np.delete(smooth, 10, 0), np.delete(step, 10, 0), atol=1e-12)


def people_of(states: np.ndarray, body) -> PosedPeople:
    frames, persons = np.arange(len(states)), np.full(len(states), 3)
    return PosedPeople(
        PoseTable(frames, persons, landmarks(body, states)),
        PoseStates(frames, persons, states, DOF_NAMES, {3: body.dimensions}),
        np.ones(len(states)),
        (),
    )


def test_smoothed_poses_are_poses_of_the_same_body():
    rng = np.random.default_rng(2)
    body = default_body(1.75)
    true = np.tile(neutral_state("down", body.limits), (40, 1))
    true[:, 2] = 0.95
    true[:, DOF_NAMES.index("r_shoulder_x")] = 0.4 + 0.5 * np.sin(np.arange(40) / 8)
    noisy = np.clip(true + rng.normal(0, 0.04, true.shape), body.limits.low, body.limits.high)
    noisy[5] = np.nan  # a frame without a fit
    people = people_of(np.where(np.isnan(noisy), true, noisy), body)
    people = replace(
        people, poses=replace(people.poses, positions=np.where(np.isnan(noisy).any(1)[:, None, None], np.nan, people.poses.positions))
    )
    smooth = smooth_people(people, default_limits(), FPS, 0.4)
    assert np.isnan(smooth.poses.positions[5]).all()
    kept = np.delete(np.arange(40), 5)
    truth = landmarks(body, true)[kept]
    before, after = (np.linalg.norm(one.poses.positions[kept] - truth, axis=-1).mean() for one in (people, smooth))
    assert after < 0.8 * before
    assert_allclose(landmarks(body, smooth.states.states[kept]), smooth.poses.positions[kept], atol=1e-12)
    assert np.all((smooth.states.states >= body.limits.low) & (smooth.states.states <= body.limits.high))
    shin = [landmark_index(name) for name in ("l_knee", "l_ankle")]
    lengths = np.linalg.norm(np.diff(smooth.poses.positions[kept][:, shin], axis=1), axis=-1)
    assert_allclose(lengths, lengths[0, 0], rtol=1e-9)
    assert smooth.states.bodies == people.states.bodies
