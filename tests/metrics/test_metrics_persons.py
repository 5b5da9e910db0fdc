"""Matching of persons over a recording, exchanged sides, and the real-time factor."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.errors import InputError
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.metrics.persons import exchange_sides, match_persons, runs, swapped_frames
from hmc.metrics.timing import frames_per_second, real_time_factor


def crowd(n_persons: int, n_frames: int = 10, seed: int = 0):
    """Persons standing 1.5 m apart and swaying."""
    rng = np.random.default_rng(seed)
    frames, persons = (grid.ravel() for grid in np.mgrid[:n_frames, :n_persons])
    body = rng.normal(0, 0.4, (15, 3))
    points = body + np.stack([1.5 * persons, 0 * persons, 0 * persons], axis=1)[:, None] + rng.normal(0, 0.05, (len(frames), 1, 3))
    return frames, persons, points


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), n=st.integers(1, 4))
def test_renamed_persons_are_found_again(seed, n):
    frames, persons, points = crowd(n, seed=seed)
    names = np.random.default_rng(seed).permutation(20)[:n]
    found = match_persons(frames, persons, points, frames, names[persons], points + 0.02)
    assert found == {int(name): person for person, name in enumerate(names)}


def test_the_assignment_has_the_greatest_worth_of_all():
    rng = np.random.default_rng(5)
    frames, persons, points = crowd(3)
    guess = points + rng.normal(0, 0.6, (3, 1, 3))[persons]
    found = match_persons(frames, persons, points, frames, persons, guess)
    error = np.array(
        [[np.linalg.norm(points[persons == i] - guess[persons == j], axis=-1).mean(axis=1) for j in range(3)] for i in range(3)]
    )
    worth = np.maximum(1 - error, 0).sum(axis=-1)
    best = max(itertools.permutations(range(3)), key=lambda order: sum(worth[i, order[i]] for i in range(3)))
    assert found == {best[i]: i for i in range(3) if worth[i, best[i]] > 0}


def test_a_track_begun_anew_joins_its_person_and_a_double_does_not():
    frames, persons, points = crowd(1)
    broken = np.where(frames < 6, 3, 8)
    assert match_persons(frames, persons, points, frames, broken, points) == {3: 0, 8: 0}
    doubled = np.r_[frames, frames], np.r_[persons, persons + 1], np.r_[points, points + 0.1]
    assert match_persons(frames, persons, points, *doubled) == {0: 0}


def test_who_is_far_away_matches_nobody():
    frames, persons, points = crowd(2)
    assert match_persons(frames, persons, points, frames, persons, points + np.array([0, 3.0, 0])) == {}
    nothing = np.zeros(0, int), np.zeros(0, int), np.zeros((0, 15, 3))
    assert match_persons(frames, persons, points, *nothing) == {}
    assert match_persons(*nothing, frames, persons, points) == {}


def test_exchanging_sides_twice_changes_nothing_and_keeps_the_middle():
    points = np.random.default_rng(0).normal(size=(4, 15, 3))
    for limbs in (None, "arms", "legs"):
        np.testing.assert_array_equal(exchange_sides(exchange_sides(points, limbs), limbs), points)
    both = exchange_sides(points)
    for name in LANDMARKS:
        other = {"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]
        np.testing.assert_array_equal(both[:, landmark_index(name)], points[:, landmark_index(other)])
    legs = exchange_sides(points, "legs")
    np.testing.assert_array_equal(legs[:, landmark_index("l_wrist")], points[:, landmark_index("l_wrist")])


def test_swapped_legs_are_found_in_the_frames_in_which_they_are():
    rng = np.random.default_rng(1)
    truth = np.broadcast_to(rng.normal(0, 0.5, (15, 3)), (12, 15, 3))
    estimate = truth + rng.normal(0, 0.01, truth.shape)
    estimate[4:9] = exchange_sides(estimate[4:9], "legs")
    estimate[0] = np.nan
    swapped, as_is, exchanged = swapped_frames(estimate, truth, "legs")
    assert runs(np.flatnonzero(swapped)) == [(4, 8)]
    assert (exchanged[4:9] < as_is[4:9]).all() and np.isnan(as_is[0])
    assert not swapped_frames(estimate, truth, "arms")[0].any()


@given(st.sets(st.integers(0, 60)))
def test_runs_cover_the_frames_and_no_others(frames):
    found = runs(np.array(sorted(frames), int))
    assert {frame for first, last in found for frame in range(first, last + 1)} == frames
    assert all(b[0] > a[1] + 1 for a, b in itertools.pairwise(found))


def test_real_time_factor():
    assert frames_per_second(100, 4) == 25
    assert real_time_factor(100, 4) == 1
    # Over sequences, the totals count and not the mean of the rates (Eq. 4.26).
    assert frames_per_second([100, 100], [1, 3]) == 50
    assert real_time_factor([100, 100], [1, 3], fps=100) == 0.5
    with pytest.raises(InputError, match="total time above 0"):
        frames_per_second(10, 0)
    with pytest.raises(InputError, match="`fps` must be above 0"):
        real_time_factor(10, 1, fps=0)
