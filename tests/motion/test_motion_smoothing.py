"""Smoothing of finished results: SciPy's own transfer function, closed forms, gaps."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, savgol_filter, sosfiltfilt

from hmc.body.joints import dof_index
from hmc.body.kinematics import landmarks
from hmc.errors import InputError
from hmc.motion.smoothing import (
    DEGREE,
    Smoothing,
    butterworth,
    local_polynomial,
    smooth_positions,
    smooth_trajectory,
    stretches,
    window_too_short,
)
from hmc.motion.trajectory import Trajectory


def test_half_of_the_power_is_left_at_the_cutoff():
    t = np.arange(2000) / 100
    wave = np.sin(2 * np.pi * 6 * t)
    smooth = butterworth(wave[:, None], 100, 6.0)[:, 0]
    middle = slice(500, 1500)
    assert np.mean(smooth[middle] ** 2) / np.mean(wave[middle] ** 2) == pytest.approx(0.5, abs=0.01)
    # Without delay: no part of it is out of step.
    assert abs(np.mean(smooth[middle] * np.cos(2 * np.pi * 6 * t[middle]))) < 1e-3


def test_the_filter_is_that_of_scipy_in_another_form():
    values = np.random.default_rng(0).normal(size=(300, 3))
    raised = 5.0 / (np.sqrt(2) - 1) ** 0.25
    other = sosfiltfilt(butter(2, raised, fs=60, output="sos"), values, axis=0, padlen=9)
    assert np.allclose(butterworth(values, 60, 5.0), other)


@given(st.integers(0, 2**32 - 1), st.integers(5, 60), st.floats(0.17, 0.6))
@settings(max_examples=25, deadline=None)
def test_the_polynomial_is_that_of_scipy(seed, n, window_s):
    values = np.random.default_rng(seed).normal(size=(n, 2, 3))
    window = 2 * round(window_s * 30 / 2) + 1
    other = savgol_filter(values, window, DEGREE, axis=0) if n >= window else values
    assert np.allclose(local_polynomial(values, 30, window_s), other, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(9, 40))
@settings(max_examples=25, deadline=None)
def test_cubic_paths_stay_as_they_are(seed, n):
    times = np.arange(n)[:, None, None] / 30
    coefficients = np.random.default_rng(seed).normal(size=(4, 15, 3))
    path = sum(c * times**k for k, c in enumerate(coefficients))
    assert np.allclose(smooth_positions(path, 30, Smoothing("polynomial", window_s=0.3)), path, atol=1e-9)


def test_noise_shrinks_and_a_window_of_few_frames_does_nothing():
    noise = np.random.default_rng(1).normal(0, 0.01, (200, 15, 3))
    assert smooth_positions(noise, 30, Smoothing("polynomial", window_s=0.3)).std() < 0.7 * noise.std()
    assert np.array_equal(smooth_positions(noise, 30, Smoothing("polynomial", window_s=0.06)), noise)


def test_nothing_is_smoothed_over_a_gap():
    rng = np.random.default_rng(1)
    positions = rng.normal(size=(80, 15, 3))
    positions[30:33, 4] = np.nan
    one = Trajectory(0, 30.0, np.arange(80), positions)
    smooth = smooth_trajectory(one, Smoothing("butterworth", 4.0)).positions
    assert (np.isnan(smooth) == np.isnan(positions)).all()
    alone = smooth_trajectory(replace(one, frames=np.arange(30), positions=positions[:30]), Smoothing("butterworth", 4.0)).positions
    assert np.allclose(smooth[:30, 4], alone[:, 4]) and not np.allclose(smooth[:30, 3], alone[:, 3])
    step = np.zeros((64, 15, 3))
    step[20:] = 1.0  # elsewhere after a frame that is not known
    step[19] = np.nan
    assert np.allclose(smooth_positions(step, 30, Smoothing("polynomial", window_s=0.3)), step, atol=1e-12, equal_nan=True)
    assert [part.tolist() for part in stretches(np.array([1, 1, 0, 1], bool))] == [[0, 1], [3]]


def test_bones_keep_their_lengths_and_jitter_goes():
    from test_exports import moving

    people = moving(n=60)
    (still,) = people.trajectories()
    states = still.states + 0.02 * np.random.default_rng(2).normal(size=still.states.shape)
    shaken = replace(
        people, poses=replace(people.poses, positions=landmarks(still.body, states)), states=replace(people.states, states=states)
    )
    smooth = shaken.smoothed("butterworth", cutoff_hz=3.0)
    errors = [np.linalg.norm(one.positions - people.positions, axis=-1).mean() for one in (shaken, smooth)]
    assert errors[1] < 0.6 * errors[0]
    assert np.allclose(landmarks(still.body, smooth.states.states), smooth.positions, atol=1e-9)


def test_feet_and_tilt_are_smoothed_too():
    """What the fifteen landmarks do not show, and an angle that passes the half turn."""
    from test_exports import moving

    (still,) = moving(n=60).trajectories()
    whole = still.states.copy()
    yaw, feet = dof_index("root_rz")[0], dof_index("l_ankle_y", "r_ankle_z")
    whole[:, yaw] = np.linspace(np.radians(150), np.radians(210), 60)
    shaken = whole + 0.02 * np.random.default_rng(2).normal(size=whole.shape)
    shaken[:, yaw] = (shaken[:, yaw] + np.pi) % (2 * np.pi) - np.pi
    one = replace(still, states=shaken, positions=landmarks(still.body, shaken))
    found = smooth_trajectory(one, Smoothing("butterworth", 3.0)).states
    for k in (*feet, dof_index("root_ry")[0], yaw):
        left, before = ((np.unwrap(states[:, k]) - whole[:, k] + np.pi) % (2 * np.pi) - np.pi for states in (found, shaken))
        assert left[5:-5].std() < 0.6 * before[5:-5].std()
    assert np.abs(found[:, yaw] - shaken[:, yaw]).max() < 0.2


@pytest.mark.parametrize(("fps", "window_s"), [(5, 0.4), (4, 0.7), (24, 0.1)])
def test_a_window_that_smooths_nothing_is_told_with_one_that_does(fps, window_s):
    noise = np.random.default_rng(0).normal(0, 0.01, (60, 15, 3))
    assert np.array_equal(smooth_positions(noise, fps, Smoothing("polynomial", window_s=window_s)), noise)
    told = re.fullmatch(r"a window of (\S+) s has (\d) frames? at .* smooths 5 or more: give (\S+) s", window_too_short(fps, window_s))
    assert float(told[1]) == window_s and int(told[2]) < 5
    assert window_too_short(fps, float(told[3])) == ""
    assert not np.array_equal(smooth_positions(noise, fps, Smoothing("polynomial", window_s=float(told[3]))), noise)


def test_wrong_input():
    with pytest.raises(InputError, match="needs more than"):
        butterworth(np.zeros((50, 3)), 12, 6.0)
    with pytest.raises(InputError, match="there are butterworth and polynomial"):
        Smoothing("mean")
    with pytest.raises(InputError, match="above 0"):
        Smoothing("polynomial", window_s=0.0)
