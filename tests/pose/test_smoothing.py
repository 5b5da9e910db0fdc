"""Smoothing of finished poses: bones keep their lengths, joints their limits."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from hmc.body.joints import DOF_NAMES, default_limits
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.io.results import PoseStates, PoseTable
from hmc.landmarks import landmark_index
from hmc.pose.follow import PosedPeople

FPS = 30.0


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
    smooth = people.smoothed("polynomial", window_s=0.4, fps=FPS, limits=default_limits())
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
