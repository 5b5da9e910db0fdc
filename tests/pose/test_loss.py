"""A pose that got lost as a whole: turned about or left behind, it is found again; a good one is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_array_equal
from posed import body_of, mean_error, true_state

from hmc.body.exchange import swapped_pose
from hmc.body.kinematics import landmarks
from hmc.pose.recovery import LossSettings, LossState, loss_init, loss_step
from hmc.pose.starts.window import StartSettings
from hmc.pose.steps.annealed import make_filter, pose_init, pose_step
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.presets import PRESETS
from hmc.search.filters import AnnealedSettings

LEAN = replace(
    PRESETS["default"],
    annealed=AnnealedSettings(layers=2, particles=50, survival_rate=0.1, spread=0.5),
    search=SearchSettings(draws=40),
)
SETTINGS = LossSettings(patience_s=0.2, turn_every_s=0.13, suspicion_s=0.13)


@pytest.fixture(scope="module")
def walker():
    """A walking person, the filter, and the true states and costs of the first frames."""
    acted = act("walk", frames=16)
    filt = make_filter(body_of(acted.height_m)[0], LEAN, acted.fps, acted.grid.voxel_size_m, acted.grid.bounds)
    return acted, filt


def run(walker, state, settings=SETTINGS, usual=None, velocity=True):
    """Follow from a pose; errors, and the states of the loss."""
    acted, filt = walker
    pose, loss = pose_init(state), loss_init(np.array([usual or 1e-4]), settings)
    errors, losses = [], []
    for frame, target in enumerate(acted.targets):
        pose, info = pose_step(np.random.default_rng([1, frame]), filt, pose, target)
        speed = acted.velocities[frame] if velocity else np.zeros(3)
        rng = np.random.default_rng([2, frame])
        pose, info, loss = loss_step(rng, filt, acted.fps, pose, info, target, speed, loss, settings, StartSettings())
        errors.append(mean_error(landmarks(filt.body, pose.state), acted.landmarks[frame]))
        losses.append(loss)
    return np.array(errors), losses


def test_a_pose_that_was_left_behind_is_found_again(walker):
    acted, filt = walker
    start = true_state(filt.body, acted)
    start[:2] += (3.0, 2.0)
    errors, losses = run(walker, start)
    assert errors[0] > 0.3
    assert errors[-3:].max() < 0.1
    assert max(loss.bad_s for loss in losses) > 0
    without, _ = run(walker, start, replace(SETTINGS, ratio=1e9, turn_limit=1e9))
    assert without[-3:].min() > 0.2


def test_a_body_that_faces_backwards_is_turned_about(walker):
    acted, filt = walker
    backwards = swapped_pose(filt.body, true_state(filt.body, acted), "all")
    errors, _ = run(walker, backwards)
    assert errors[0] > 0.15
    assert errors[-3:].max() < 0.1
    without, _ = run(walker, backwards, replace(SETTINGS, turn_limit=1e9))
    assert without[-3:].min() > 0.15


def test_a_good_pose_is_left_alone(walker):
    acted, filt = walker
    start = true_state(filt.body, acted)
    errors, losses = run(walker, start)
    without, _ = run(walker, start, replace(SETTINGS, ratio=1e9, turn_limit=1e9))
    assert_array_equal(errors, without)
    assert losses[-1].turned == 0


def test_vain_attempts_become_rarer(walker, monkeypatch):
    acted, filt = walker
    tries = []
    monkeypatch.setattr("hmc.pose.recovery._fresh_start", lambda *rest: tries.append(1))
    pose, info = pose_step(np.random.default_rng(0), filt, pose_init(true_state(filt.body, acted)), acted.targets[0])
    bad = replace(info, cost=100 * info.cost)
    loss, when = loss_init(np.array([info.cost]), SETTINGS), []
    for frame in range(60):
        seen = len(tries)
        pose, _, loss = loss_step(
            np.random.default_rng(0), filt, acted.fps, pose, bad, acted.targets[0], np.zeros(3), loss, SETTINGS, StartSettings()
        )
        if len(tries) > seen:
            when.append(frame)
    assert when == [2, 8, 20, 44]  # after .2, .4, .8 and 1.6 s at 15 frames a second


def test_frames_without_a_fit_tell_nothing(walker):
    acted, filt = walker
    start = pose_init(true_state(filt.body, acted))
    state = LossState(0.0, 0.1, 0.2, 0.3, 0.4)
    pose, info = pose_step(np.random.default_rng(0), filt, start, None)
    after = loss_step(np.random.default_rng(0), filt, 15, pose, info, None, np.zeros(3), state, SETTINGS, StartSettings())
    assert after[0] is pose and after[1] is info and after[2] == state
    assert np.isnan(loss_init(np.array([np.nan]), SETTINGS).usual)
