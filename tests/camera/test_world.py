"""A change of world leaves every point on its pixel."""

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.camera.model import project
from hmc.camera.triangulation import triangulate_pixels
from hmc.camera.world import World, in_world


def any_world(seed: int) -> World:
    rng = np.random.default_rng(seed)
    return World(Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3), float(np.exp(rng.normal(0, 3))))


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_points_fall_on_the_pixels_on_which_they_fell(ring, seed):
    world = any_world(seed)
    points = np.random.default_rng(seed).uniform(-0.8, 0.8, (20, 3))
    for camera, moved in zip(ring, in_world(ring, world), strict=True):
        before, _ = project(camera, points)
        after, _ = cv2.projectPoints(world.points(points), moved.rotation, moved.translation, moved.matrix, moved.distortions)
        assert_allclose(after[:, 0], before, atol=1e-6)
        assert_allclose(moved.centre, world.points(camera.centre), rtol=1e-9, atol=1e-6 * world.scale)


@given(st.integers(0, 10_000), st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_there_and_back_and_one_after_the_other(one, other):
    first, second = any_world(one), any_world(other)
    points = np.random.default_rng(one).normal(size=(5, 3))
    assert_allclose(first.old_points(first.points(points)), points, atol=1e-9)
    assert_allclose(second.after(first).points(points), second.points(first.points(points)), rtol=1e-6, atol=1e-6)


def test_points_come_from_distorted_pixels(ring):
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (10, 3))
    uv = np.stack([project(camera, points)[0] for camera in ring], axis=1)
    uv[3, :3] = np.nan
    uv[4, 1:] = np.nan
    found = triangulate_pixels(list(ring), uv)
    assert np.isnan(found[4]).all()
    others = np.delete(np.arange(10), 4)
    assert_allclose(found[others], points[others], atol=1e-6)
