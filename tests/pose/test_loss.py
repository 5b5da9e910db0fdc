"""A pose that got lost as a whole: turned about or left behind, it is found again; a good one is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_array_equal
from posed import mean_error, subject_of, true_state, view_of

from hmc.body.exchange import swapped_pose
from hmc.body.kinematics import landmarks
from hmc.pose.method import begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.recovery import LossSettings, Recovery, loss_init, recalled
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.presets import PRESETS
from hmc.search.filters import AnnealedSettings

LEAN = replace(
    PRESETS["default"],
    annealed=AnnealedSettings(layers=2, particles=50, survival_rate=0.1, spread=0.5),
    search=SearchSettings(draws=40),
)
STEP = annealed_pose_step(LEAN)
SETTINGS = LossSettings(patience_s=0.2, turn_every_s=0.13, suspicion_s=0.13)


@pytest.fixture(scope="module")
def walker():
    """A walking person and their body."""
    acted = act("walk", frames=16)
    return acted, subject_of(acted, LEAN)


def run(walker, state, settings=SETTINGS, usual=None, velocity=True):
    """Follow from a pose; errors, and the states of the loss."""
    acted, subject = walker
    recover = Recovery(LEAN, settings)
    tracked = begin_tracking(subject, state, memory=recover.first(np.array([usual or 1e-4])))
    errors, losses = [], []
    for frame, target in enumerate(acted.targets):
        view = view_of(target, acted.velocities[frame] if velocity else None)
        stepped = STEP(np.random.default_rng([1, frame]), tracked, view)
        tracked, _ = recover(np.random.default_rng([2, frame]), tracked, stepped, view)
        errors.append(mean_error(landmarks(subject.body, tracked.state), acted.landmarks[frame]))
        losses.append(recalled(tracked.memory))
    return np.array(errors), losses


def test_a_pose_that_was_left_behind_is_found_again(walker):
    acted, subject = walker
    start = true_state(subject.body, acted)
    start[:2] += (3.0, 2.0)
    errors, losses = run(walker, start)
    assert errors[0] > 0.3
    assert errors[-3:].max() < 0.1
    assert max(loss.bad_s for loss in losses) > 0
    without, _ = run(walker, start, replace(SETTINGS, ratio=1e9, turn_limit=1e9))
    assert without[-3:].min() > 0.2


def test_a_body_that_faces_backwards_is_turned_about(walker):
    acted, subject = walker
    backwards = swapped_pose(subject.body, true_state(subject.body, acted), "all")
    by_turns = replace(SETTINGS, ratio=1e9)  # nobody is looked for anew
    errors, _ = run(walker, backwards, by_turns)
    assert errors[0] > 0.15
    assert errors[-3:].max() < 0.1
    without, _ = run(walker, backwards, replace(by_turns, turn_limit=1e9))
    assert without[-3:].min() > 0.15


def test_a_good_pose_is_left_alone(walker):
    acted, subject = walker
    start = true_state(subject.body, acted)
    errors, losses = run(walker, start)
    without, _ = run(walker, start, replace(SETTINGS, ratio=1e9, turn_limit=1e9))
    assert_array_equal(errors, without)
    assert losses[-1].turned == 0


def test_vain_attempts_become_rarer(walker, monkeypatch):
    acted, subject = walker
    tries = []
    monkeypatch.setattr(Recovery, "_fresh_start", lambda *rest: tries.append(1))
    recover, view = Recovery(LEAN, SETTINGS), view_of(acted.targets[0])
    tracked, info = STEP(np.random.default_rng(0), begin_tracking(subject, true_state(subject.body, acted)), view)
    bad = replace(info, cost=100 * info.cost)
    tracked, when = replace(tracked, memory={**tracked.memory, **recover.first(np.array([info.cost]))}), []
    for frame in range(60):
        seen = len(tries)
        tracked, _ = recover(np.random.default_rng(0), tracked, (tracked, bad), view)
        if len(tries) > seen:
            when.append(frame)
    assert when == [2, 8, 20, 44]  # after .2, .4, .8 and 1.6 s at 15 frames a second


def test_frames_without_a_fit_tell_nothing(walker):
    acted, subject = walker
    known = {"loss": np.array([0.0, 0.1, 0.2, 0.3, 0.4])}
    before = begin_tracking(subject, true_state(subject.body, acted), memory=known)
    tracked, info = STEP(np.random.default_rng(0), before, view_of(None))
    after, told = Recovery(LEAN, SETTINGS)(np.random.default_rng(0), before, (tracked, info), view_of(None))
    assert_array_equal(after.state, tracked.state)
    assert told is info and recalled(after.memory) == recalled(known)
    assert np.isnan(loss_init(np.array([np.nan]), SETTINGS).usual)


def test_recovery_draws_none_of_the_step_s_random_numbers(walker):
    """A part that comes after it finds the frame's numbers as they were."""
    acted, subject = walker
    view = view_of(acted.targets[0], acted.velocities[0])
    eager = replace(SETTINGS, turn_every_s=0.0)
    before = begin_tracking(subject, true_state(subject.body, acted), memory=Recovery(LEAN, eager).first(np.array([1e-4])))
    rng, alone = np.random.default_rng([1, 2]), np.random.default_rng([1, 2])
    stepped = STEP(rng, before, view)
    STEP(alone, before, view)
    after, _ = Recovery(LEAN, eager)(rng, before, stepped, view)
    assert recalled(after.memory).since_turn_s == 0  # it has refined the body turned about
    assert rng.integers(2**60) == alone.integers(2**60)
