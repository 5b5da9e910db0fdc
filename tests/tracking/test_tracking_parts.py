"""Parts of the trackers: regions, features of blobs, ghosts, headings."""

import numpy as np
import pytest
from drawn import silhouette
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from hmc.tracking.blobs import blob_features, observe
from hmc.tracking.heading import arm_reach, facing_hypotheses, shoulder_axis, walking_direction
from hmc.tracking.likeness import looks_like_person
from hmc.tracking.region import person_radii, region_distance
from hmc.tracking.rules.ghosts import real_people
from hmc.tracking.settings import LifecycleSettings
from hmc.tracking.views import FrameViews
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid


def test_region_distance_against_a_loop():
    rng = np.random.default_rng(0)
    points, centres, radii = rng.normal(size=(20, 3)), rng.normal(size=(4, 3)), rng.uniform(0.2, 1, (4, 3))
    got = region_distance(points, centres, radii)
    for i, point in enumerate(points):
        for k in range(4):
            assert got[i, k] == pytest.approx(sum(((point[d] - centres[k, d]) / radii[k, d]) ** 2 for d in range(3)))


def test_radii_are_those_of_the_thesis():
    assert person_radii(np.array([1.0, 2.0, 0.9])) == pytest.approx([0.45, 0.45, 1.08])
    assert person_radii(np.array([[1.0, 2.0, 0.1]]), 1.0, 1.0)[0] == pytest.approx([0.3, 0.3, 0.6])


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.2))
def test_features_against_scipy(seed, size):
    rng = np.random.default_rng(seed)
    occupied = rng.random((9, 8, 7)) < 0.12
    grid = VoxelGrid(rng.normal(size=3), size, occupied.shape)
    observation = observe(grid, occupied)
    labels, n = ndimage.label(occupied, np.ones((3, 3, 3)))
    assert len(observation.blobs) == n
    ours = np.zeros(occupied.shape, int)
    ours[tuple(observation.indices.T)] = observation.labels + 1
    for b in range(n):
        theirs = labels == labels[tuple(observation.indices[observation.labels == b][0])]
        assert np.array_equal(ours == b + 1, theirs)
        points = grid.centres(np.argwhere(theirs))
        assert observation.blobs.volume_m3[b] == pytest.approx(theirs.sum() * size**3)
        assert observation.blobs.weight_kg[b] == pytest.approx(theirs.sum() * size**3 * 1100)
        assert observation.blobs.centroid[b] == pytest.approx(points.mean(axis=0))
        assert observation.blobs.top_m[b] == pytest.approx(points[:, 2].max() + size / 2)
        assert observation.blobs.height_m[b] == pytest.approx(np.ptp(points[:, 2]) + size)
        sides = np.ptp(points[:, :2], axis=0) + size
        assert observation.blobs.sides_m[b] == pytest.approx([sides.max(), sides.min()])


def test_features_of_nothing():
    blobs = blob_features(np.zeros((0, 3)), np.zeros(0, int), 2, 0.05)
    assert len(blobs) == 2 and not blobs.counts.any() and not blobs.highest.any()
    assert not looks_like_person(blobs, LifecycleSettings()).any()


def test_a_ghost_is_told_from_the_people_who_cast_it(ring):
    people = [(0.0, 0.7), (0.0, -0.7), (0.75, 0.0)]
    masks = [np.any([silhouette(camera, *place) for place in people], axis=0) for camera in ring]
    grid = VoxelGrid(np.array([-1.6, -1.6, 0.0]), 0.05, (64, 64, 40))
    hull = observe(grid, carve(make_tables(grid, ring), masks, tolerance=1))
    views = FrameViews(ring, masks)

    def standing_at(x, y):
        return hull.points[np.hypot(hull.points[:, 0] - x, hull.points[:, 1] - y) < 0.3]

    sets = [standing_at(*place) for place in people]
    away = hull.points[[np.hypot(*(point[:2] - np.array(people)).T).min() > 0.45 for point in hull.points]]
    crowd = [np.count_nonzero(np.hypot(*(away - point)[:, :2].T) < 0.2) for point in away]
    beside = away[np.hypot(*(away - away[np.argmax(crowd)])[:, :2].T) < 0.2]
    assert len(beside) > 20
    assert list(real_people(views, np.zeros((0, 3)), [beside, *sets], 0.05)) == [False, True, True, True]
    assert list(real_people(views, np.concatenate(sets), [beside], 0.05)) == [False]
    assert list(real_people(views, np.concatenate(sets[:2]), [sets[2], beside], 0.05)) == [True, False]
    assert len(real_people(views, hull.points, [], 0.05)) == 0


def test_one_of_two_sets_at_one_place_is_enough(ring):
    masks = [silhouette(camera, 0, 0) for camera in ring]
    grid = VoxelGrid(np.array([-1.0, -1.0, 0.0]), 0.05, (40, 40, 40))
    points = observe(grid, carve(make_tables(grid, ring), masks)).points
    assert real_people(FrameViews(ring, masks), np.zeros((0, 3)), [points, points[::2]], 0.05).sum() == 1


def body(angle, reach=0.0, rng=None):
    """Points in a trunk that is wider than deep, turned to `angle`, with an arm that reaches forwards so far."""
    rng = np.random.default_rng(0) if rng is None else rng
    points = rng.uniform((-0.12, -0.22, 0.0), (0.12, 0.22, 1.5), (4000, 3))
    head = rng.uniform((-0.1, -0.1, 1.5), (0.1, 0.1, 1.8), (400, 3))
    arm = rng.uniform((0.12, 0.1, 1.0), (0.12 + reach, 0.2, 1.1), (300 if reach else 0, 3))
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return np.concatenate([points, head, arm]) @ turn.T


def wrapped(angle):
    return abs((angle + np.pi) % (2 * np.pi) - np.pi)


@settings(deadline=None)
@given(st.floats(-np.pi, np.pi))
def test_the_shoulders_axis_is_at_right_angles_to_the_facing(angle):
    axis, sure = shoulder_axis(body(angle))
    assert abs(np.cos(axis - angle)) < 0.1
    assert 0 <= axis < np.pi and 0.5 < sure < 1


@settings(deadline=None)
@given(st.floats(-np.pi, np.pi))
def test_arms_tell_where_somebody_who_stands_faces(angle):
    angles, weights = facing_hypotheses(body(angle, reach=0.4), np.zeros(3))
    assert wrapped(angles[weights.argmax()] - angle) < 0.15
    assert weights.sum() == pytest.approx(1) and weights[2] == 0
    assert np.linalg.norm(arm_reach(body(angle, reach=0.4))) > 0.1


@settings(deadline=None)
@given(st.floats(-np.pi, np.pi))
def test_who_walks_faces_where_they_go(angle):
    angles, weights = facing_hypotheses(body(angle), 1.2 * np.array([np.cos(angle + 0.2), np.sin(angle + 0.2), 0]))
    assert wrapped(angles[weights.argmax()] - angle) < 0.15
    assert wrapped(angles[2] - angle - 0.2) < 1e-9
    assert (angles > -np.pi).all() and (angles <= np.pi).all()


def test_walking_direction_of_many():
    angle, sure = walking_direction(np.array([[0, 2.0, 0.1], [0, 0, 1.0], [-0.5, 0, 0]]))
    assert angle[[0, 2]] == pytest.approx([np.pi / 2, np.pi])
    assert sure == pytest.approx([1, 0, 0.5])


def test_headings_of_nobody_and_of_a_round_body():
    assert shoulder_axis(np.zeros((0, 3))) == (0.0, 0.0)
    assert not arm_reach(np.zeros((0, 3))).any()
    angles, weights = facing_hypotheses(np.zeros((0, 3)), np.zeros(3))
    assert np.isfinite(angles).all() and weights == pytest.approx([0.5, 0.5, 0])
    rng = np.random.default_rng(0)
    disc = rng.normal(size=(20000, 3)) * (0.1, 0.1, 0) + (0, 0, 1) + rng.uniform(0, 0.6, (20000, 1)) * (0, 0, 1)
    assert shoulder_axis(disc)[1] < 0.1
