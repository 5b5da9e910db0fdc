"""CLEAR MOT against py-motmetrics, against figures published with real tracks, and its invariances."""

from __future__ import annotations

from dataclasses import replace

import motmetrics
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.errors import InputError
from hmc.io.results import TrackTable
from hmc.metrics.mot import clear_mot, clear_mot_distances


def scene(seed: int, n_frames: int = 120, n_persons: int = 4, noise: float = 0.2):
    """Wandering persons that come and go, and an estimate with noise, gaps, exchanged identities and inventions."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.normal(0, 0.08, (n_frames, n_persons, 3)), axis=0) + rng.uniform(-1, 1, (n_persons, 3))
    there = rng.random((n_frames, n_persons)) < 0.9
    frames, persons = np.nonzero(there)
    truth = TrackTable(frames, persons, walk[there])
    names = np.stack([rng.permutation(n_persons) if rng.random() < 0.05 else np.arange(n_persons) for _ in range(n_frames)])
    kept = there & (rng.random(there.shape) < 0.85)
    est_frames, columns = np.nonzero(kept)
    positions = walk[kept] + rng.normal(0, noise, (kept.sum(), 3))
    extra = rng.random(n_frames) < 0.2
    est_frames = np.r_[est_frames, np.flatnonzero(extra)]
    ids = np.r_[names[kept.nonzero()[0], columns] + 10, np.full(extra.sum(), 99)]
    positions = np.r_[positions, rng.uniform(-2, 2, (extra.sum(), 3))]
    return truth, TrackTable(est_frames, ids, positions)


def oracle(truth, estimate, threshold: float):
    """py-motmetrics on our own distance matrices."""
    accumulator = motmetrics.MOTAccumulator(auto_id=False)
    for frame in np.union1d(truth.frames, estimate.frames):
        a, b = truth.where(truth.frames == frame), estimate.where(estimate.frames == frame)
        distances = np.linalg.norm(a.positions[:, None, :2] - b.positions[None, :, :2], axis=-1)
        distances[distances > threshold] = np.nan
        accumulator.update(a.persons, b.persons, distances, frameid=int(frame))
    return summary(accumulator)


def summary(accumulator):
    names = ["motp", "mota", "num_objects", "num_misses", "num_false_positives", "num_switches"]
    return motmetrics.metrics.create().compute(accumulator, metrics=names, name="x").loc["x"]


def assert_equal(ours, theirs) -> None:
    counts = [ours.objects, ours.misses, ours.false_positives, ours.mismatches]
    assert counts == [theirs.num_objects, theirs.num_misses, theirs.num_false_positives, theirs.num_switches]
    np.testing.assert_allclose([ours.motp, ours.mota], [theirs.motp, theirs.mota], atol=1e-9, rtol=0)


@pytest.mark.parametrize("seed", range(12))
def test_equals_motmetrics_on_random_scenes(seed):
    truth, estimate = scene(seed, n_frames=60 + 10 * (seed % 3), n_persons=1 + seed % 6, noise=0.05 + 0.05 * (seed % 5))
    threshold = (0.5, 0.3, 1.5)[seed % 3]
    theirs = oracle(truth, estimate, threshold)
    if seed == 11:
        assert theirs.num_switches > 0  # the scenes do hold what is to be counted
    assert_equal(clear_mot(truth, estimate, threshold_m=threshold), theirs)


def test_real_tracks_give_their_published_figures(shared_data):
    folder = shared_data / "mot" / "TUD-Campus"
    truth, estimate = (np.loadtxt(folder / name, delimiter=",")[:, :6] for name in ("gt.txt", "test.txt"))

    def iou_distance(a, b):
        p, q = truth[a, 2:], estimate[b, 2:]
        overlap = np.minimum(p[:, :2] + p[:, 2:], q[:, :2] + q[:, 2:]) - np.maximum(p[:, :2], q[:, :2])
        shared = np.prod(np.maximum(overlap, 0), axis=1)
        loss = 1 - shared / (np.prod(p[:, 2:], axis=1) + np.prod(q[:, 2:], axis=1) - shared)
        return np.where(loss <= 0.5, loss, np.nan)

    ids = [column.astype(int) for column in (truth[:, 0], truth[:, 1], estimate[:, 0], estimate[:, 1])]
    by_iou = clear_mot_distances(*ids, iou_distance)
    np.testing.assert_allclose([by_iou.mota, by_iou.motp], [0.526462, 0.277201], atol=1e-6)
    assert (by_iou.false_positives, by_iou.misses, by_iou.mismatches) == (13, 150, 7)
    centres = [np.pad(boxes[:, 2:4] + boxes[:, 4:6] / 2, ((0, 0), (0, 1))) for boxes in (truth, estimate)]
    by_centre = clear_mot(TrackTable(*ids[:2], centres[0]), TrackTable(*ids[2:], centres[1]), threshold_m=50)
    np.testing.assert_allclose([by_centre.mota, by_centre.motp], [0.571031, 13.2596], atol=1e-4)
    assert (by_centre.false_positives, by_centre.misses, by_centre.mismatches) == (5, 142, 7)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), shuffle=st.integers(0, 10_000))
def test_names_and_order_of_rows_do_not_matter(seed, shuffle):
    truth, estimate = scene(seed, n_frames=25, n_persons=3)
    before = clear_mot(truth, estimate)
    rng = np.random.default_rng(shuffle)
    new_truth_names, new_names = rng.permutation(1000)[truth.persons], rng.permutation(1000)[estimate.persons]
    order = rng.permutation(len(estimate.frames))
    after = clear_mot(replace(truth, persons=new_truth_names), replace(estimate, persons=new_names).where(order))
    assert (after.misses, after.false_positives, after.mismatches) == (before.misses, before.false_positives, before.mismatches)
    np.testing.assert_allclose([after.mota, after.motp], [before.mota, before.motp], atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), threshold=st.floats(0.05, 2.0))
def test_counts_add_up_and_matches_are_near(seed, threshold):
    truth, estimate = scene(seed, n_frames=25, n_persons=3)
    scores = clear_mot(truth, estimate, threshold_m=threshold)
    assert scores.misses + len(scores.matched) == scores.objects == len(truth.frames)
    assert scores.false_positives + len(scores.matched) == len(estimate.frames)
    rows, columns = scores.matched.T
    assert (truth.frames[rows] == estimate.frames[columns]).all()
    assert len(np.unique(rows)) == len(rows) and len(np.unique(columns)) == len(columns)
    assert (scores.distances <= threshold).all() and scores.mota <= 1


def test_a_match_is_kept_while_it_is_near_enough():
    # In the second frame the other estimate is nearer to each person, yet the first match stands.
    truth_x, x = [0, 0.3, 0, 0.3], [0, 0.3, 0.29, 0.01]
    frames, flat = np.array([0, 0, 1, 1]), np.zeros((4, 2))
    truth = TrackTable(frames, np.array([0, 1, 0, 1]), np.column_stack([truth_x, flat]))
    estimate = TrackTable(frames, np.array([5, 6, 5, 6]), np.column_stack([x, flat]))
    scores = clear_mot(truth, estimate)
    assert scores.mismatches == 0 and scores.mota == 1
    np.testing.assert_allclose(scores.motp, (0 + 0 + 0.29 + 0.29) / 4)


def test_perfect_tracks_empty_tracks_and_no_truth():
    truth, _ = scene(3)
    perfect = clear_mot(truth, replace(truth, persons=truth.persons + 7))
    assert perfect.mota == 1 and perfect.motp == 0
    nothing = TrackTable(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)))
    missed = clear_mot(truth, nothing)
    assert missed.mota == 0 and missed.misses == len(truth.frames) and np.isnan(missed.motp)
    invented = clear_mot(nothing, truth)
    assert invented.false_positives == len(truth.frames) and np.isnan(invented.mota)


def test_height_is_disregarded_unless_asked_for():
    low = TrackTable(np.array([0]), np.array([0]), np.array([[0, 0, 1.0]]))
    high = replace(low, positions=np.array([[0.3, 0, 1.7]]))
    assert clear_mot(low, high).misses == 0
    assert clear_mot(low, high, plane=False).misses == 1


def test_an_identity_twice_in_a_frame_is_refused():
    twice = TrackTable(np.array([4, 4]), np.array([1, 1]), np.zeros((2, 3)))
    once = twice.where(np.array([0]))
    with pytest.raises(InputError, match="truth: identity 1 stands twice in frame 4"):
        clear_mot(twice, once)
    with pytest.raises(InputError, match="estimate: identity 1"):
        clear_mot(once, twice)
