"""Pose metrics against plain loops over the equations, the thesis's own example, and their invariances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.errors import InputError
from hmc.metrics.landmarks import landmark_errors, score


def poses(seed: int, n_frames: int = 20, n_joints: int = 15, d: int = 3, gaps: bool = True):
    rng = np.random.default_rng(seed)
    truth = rng.normal(0, 1, (n_frames, n_joints, d))
    estimate = truth + rng.normal(0, 0.06, truth.shape)
    if gaps:
        estimate[rng.random((n_frames, n_joints)) < 0.1] = np.nan
        truth[rng.random((n_frames, n_joints)) < 0.1] = np.nan
    return estimate, truth


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_overall_scores_equal_the_equations_written_as_loops(seed, d):
    estimate, truth = poses(seed, d=d)
    threshold = 0.1
    frame_means, matched, expected = [], [], 0
    for t in range(len(truth)):
        of_frame = []
        for m in range(truth.shape[1]):
            if np.isnan(truth[t, m]).any():
                continue
            expected += 1
            if np.isnan(estimate[t, m]).any():
                continue
            error = float(np.sqrt(sum((estimate[t, m, k] - truth[t, m, k]) ** 2 for k in range(d))))
            of_frame.append(error)
            if error <= threshold:
                matched.append(error)
        frame_means.append(sum(of_frame) / len(of_frame))
    scores = score(landmark_errors(estimate, truth), threshold)
    np.testing.assert_allclose(scores.mean, np.mean(frame_means))
    np.testing.assert_allclose(scores.deviation, np.std(frame_means))
    np.testing.assert_allclose(scores.mmtp, np.mean(matched))
    np.testing.assert_allclose(scores.sigma_mmtp, np.std(matched))
    np.testing.assert_allclose(scores.mmta, len(matched) / expected)
    assert scores.expected == expected


@pytest.mark.parametrize(("by", "axis"), [("joint", 0), ("frame", 1)])
def test_scores_by_joint_and_by_frame(by, axis):
    estimate, truth = poses(4, gaps=False)
    errors = np.linalg.norm(estimate - truth, axis=-1)
    scores = score(landmark_errors(estimate, truth), 0.1, by=by)
    np.testing.assert_allclose(scores.mean, errors.mean(axis=axis))
    np.testing.assert_allclose(scores.deviation, errors.std(axis=axis))
    masked = np.ma.masked_where(errors > 0.1, errors)
    np.testing.assert_allclose(scores.mmtp, masked.mean(axis=axis).filled(np.nan))
    np.testing.assert_allclose(scores.sigma_mmtp, masked.std(axis=axis).filled(np.nan))
    np.testing.assert_allclose(scores.mmta, (errors <= 0.1).mean(axis=axis))


def test_a_swap_moves_the_mean_and_not_the_precision():
    # The point of the thesis's figure 5.3: three of thirteen landmarks lost leave MMTP as it was and show in MMTA.
    errors = np.full((10, 13), 45.0)
    errors[:, :3] = 250.0
    poor, good = score(errors, 50.0), score(np.full((10, 13), 45.0), 50.0)
    assert (good.mmta, good.mmtp, good.mean) == (1.0, 45.0, 45.0)
    assert poor.mmtp == 45.0 and poor.mean > 90
    np.testing.assert_allclose(poor.mmta, 10 / 13)


def test_missing_estimates_lower_mmta_and_missing_truth_is_left_out():
    truth = np.zeros((2, 2, 3))
    estimate = np.zeros((2, 2, 3))
    estimate[0, 0] = np.nan
    truth[1, 1] = np.nan
    scores = score(landmark_errors(estimate, truth), 0.1)
    assert (scores.estimated, scores.expected, scores.mean) == (2, 3, 0)
    np.testing.assert_allclose(scores.mmta, 2 / 3)


def test_nothing_to_score_is_nan():
    scores = score(np.full((3, 2), np.nan), 0.1)
    assert np.isnan([scores.mean, scores.deviation, scores.mmtp, scores.mmta]).all() and scores.expected == 0
    assert score(np.zeros((0, 15)), 0.1).expected == 0
    assert np.isnan(score(np.full((3, 2), 7.0), 0.1).mmtp)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), low=st.floats(0.01, 0.2), more=st.floats(0, 0.2))
def test_a_wider_threshold_matches_more_and_order_does_not_matter(seed, low, more):
    estimate, truth = poses(seed)
    errors = landmark_errors(estimate, truth)
    narrow, wide = score(errors, low), score(errors, low + more)
    assert wide.mmta >= narrow.mmta
    assert not narrow.mmtp > low
    order = np.random.default_rng(seed).permutation(len(errors))
    again = score(errors[order], low)
    np.testing.assert_allclose(
        [again.mean, again.deviation, again.mmtp, again.mmta], [narrow.mean, narrow.deviation, narrow.mmtp, narrow.mmta]
    )


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), scale=st.floats(0.1, 1000), shift=st.floats(-5, 5))
def test_scores_are_in_the_unit_of_the_points(seed, scale, shift):
    estimate, truth = poses(seed)
    one = score(landmark_errors(estimate, truth), 0.1)
    other = score(landmark_errors(estimate * scale + shift, truth * scale + shift), 0.1 * scale)
    np.testing.assert_allclose([other.mean, other.mmtp, other.deviation], np.array([one.mean, one.mmtp, one.deviation]) * scale, rtol=1e-6)


def test_bad_arguments_are_named():
    with pytest.raises(InputError, match=r"got \(2, 15, 3\) and \(3, 15, 3\)"):
        landmark_errors(np.zeros((2, 15, 3)), np.zeros((3, 15, 3)))
    with pytest.raises(InputError, match="`threshold` must be above 0"):
        score(np.zeros((2, 15)), 0)
    with pytest.raises(InputError, match=r"`errors` must be \(n_frames, n_joints\)"):
        score(np.zeros(3), 0.1)
