"""Epipolar geometry against its definition, a closed form and OpenCV."""

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hmc.camera.epipolar import (
    epipolar_lines,
    fundamental_matrices,
    generalised_epipolar_distance,
    symmetric_epipolar_distance,
    undistorted_pixels,
)
from hmc.camera.model import Camera, Rig, look_at, project


def image_points(rig, points):
    """Undistorted pixels, (n_points, n_cameras, 2)."""
    return np.stack([undistorted_pixels(camera, project(camera, points)[0]) for camera in rig], axis=1)


def test_points_satisfy_the_epipolar_constraint(ring):
    points = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 1.8], (40, 3))
    uv = image_points(ring, points)
    fundamental = fundamental_matrices(ring)
    assert fundamental.shape == (5, 5, 3, 3)
    for i in range(5):
        assert_allclose(fundamental[i, i], 0, atol=1e-12)
        for j in range(5):
            if i != j:
                assert_allclose(symmetric_epipolar_distance(fundamental[i, j], uv[:, i], uv[:, j]), 0, atol=1e-6)
                assert_allclose(fundamental[i, j], fundamental[j, i].T, atol=1e-12)
                assert abs(np.linalg.det(fundamental[i, j])) < 1e-12


def test_fundamental_matrix_from_projection_matrices(ring):
    """Hartley and Zisserman's form, F = [e']_x P' P^+, is the same up to scale."""
    fundamental = fundamental_matrices(ring)
    for i, j in ((0, 1), (1, 4), (3, 2)):
        epipole = ring[j].projection @ [*ring[i].centre, 1]
        cross = np.array([[0, -epipole[2], epipole[1]], [epipole[2], 0, -epipole[0]], [-epipole[1], epipole[0], 0]])
        theirs = cross @ ring[j].projection @ np.linalg.pinv(ring[i].projection)
        ours = fundamental[i, j] / np.linalg.norm(fundamental[i, j])
        theirs = theirs / np.linalg.norm(theirs)
        assert_allclose(ours * np.sign((ours * theirs).sum()), theirs, atol=1e-8)


def test_lines_are_opencvs(ring):
    fundamental = fundamental_matrices(ring)[0, 1]
    points = np.random.default_rng(1).uniform(0, 120, (20, 2))
    theirs = cv2.computeCorrespondEpilines(points[:, None], 1, fundamental)[:, 0]
    ours = epipolar_lines(fundamental, points)
    assert_allclose(np.hypot(ours[:, 0], ours[:, 1]), 1)
    assert_allclose(ours * np.sign((ours * theirs).sum(axis=1, keepdims=True)), theirs, rtol=1e-4, atol=1e-4)


def test_distance_in_a_rectified_pair():
    """Two parallel cameras side by side: lines are rows, so the distance is sqrt(2) times the difference of rows."""
    matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
    left = Camera("l", (640, 480), matrix, [0], np.zeros(3), [0, 0, 0])
    right = Camera("r", (640, 480), matrix, [0], np.zeros(3), [-0.2, 0, 0])
    fundamental = fundamental_matrices(Rig((left, right)))
    distance = symmetric_epipolar_distance(fundamental[0, 1], np.array([100.0, 50]), np.array([[90.0, 53], [300, 50], [0, 46]]))
    assert_allclose(distance, np.sqrt(2) * np.array([3, 0, 4]), atol=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_generalised_distance_is_the_loop_over_pairs(ring, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 120, (6, 5, 2))
    points[rng.random((6, 5)) < 0.4] = np.nan
    fundamental = fundamental_matrices(ring)
    ours = generalised_epipolar_distance(fundamental, points)
    for k in range(6):
        there = [i for i in range(5) if not np.isnan(points[k, i, 0])]
        total = 0.0
        for a, i in enumerate(there):
            for j in there[a + 1 :]:
                one = np.array([*points[k, i], 1])
                two = np.array([*points[k, j], 1])
                algebraic = float(two @ fundamental[i, j] @ one) ** 2
                forth, back = fundamental[i, j] @ one, fundamental[i, j].T @ two
                total += algebraic / (forth[0] ** 2 + forth[1] ** 2) + algebraic / (back[0] ** 2 + back[1] ** 2)
        if len(there) < 2:
            assert np.isnan(ours[k])
        else:
            assert_allclose(ours[k], np.sqrt(total))


def test_no_line_through_an_epipole_or_between_cameras_in_one_place(ring):
    fundamental = fundamental_matrices(ring)
    assert np.isnan(epipolar_lines(fundamental[0, 0], np.array([10.0, 10]))).all()
    twins = Rig((look_at("a", (64, 48), [0, -3, 1], [0, 0, 1], 60), look_at("b", (64, 48), [0, -3, 1], [1, 0, 1], 60)))
    assert_allclose(fundamental_matrices(twins), 0, atol=1e-15)
