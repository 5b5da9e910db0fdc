"""Parts of the trackers: regions, features of blobs, ghosts."""

import numpy as np
import pytest
from drawn import silhouette
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from hmc.tracking.blobs import blob_features, observe
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
