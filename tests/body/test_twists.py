"""Exponential maps against SciPy's matrix exponential and rotations, and the thesis's closed forms (appendix A)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from hmc.body.twists import chain_map, cross_matrices, exponential_maps, moved, rotations_about, twists


def drawn(seed, n):
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(n, 3))
    return axes / np.linalg.norm(axes, axis=1, keepdims=True), rng.normal(size=(n, 3)), rng.uniform(-7, 7, n)


def test_a_cross_matrix_is_the_cross_product():
    axes, points, _ = drawn(0, 5)
    assert_allclose((cross_matrices(axes) @ points[..., None])[..., 0], np.cross(axes, points), atol=1e-12)


def test_a_twist_is_a_point_s_velocity():
    """Eq. A.1 against A.2 and A.3, and against differences of the map."""
    axes, centres, _ = drawn(1, 6)
    points = np.random.default_rng(2).normal(size=(6, 3))
    velocity = (twists(axes, centres) @ np.append(points, np.ones((6, 1)), axis=1)[..., None])[..., 0]
    assert_allclose(velocity, np.append(np.cross(axes, points - centres), np.zeros((6, 1)), axis=1), atol=1e-12)
    ahead, behind = (moved(exponential_maps(axes, centres, np.full(6, step)), points) for step in (1e-5, -1e-5))
    assert_allclose((ahead - behind) / 2e-5, velocity[:, :3], atol=1e-8)


@given(st.integers(0, 10_000))
def test_maps_are_matrix_exponentials(seed):
    axes, centres, angles = drawn(seed, 4)
    expected = np.array([expm(twist * angle) for twist, angle in zip(twists(axes, centres), angles, strict=True)])
    assert_allclose(exponential_maps(axes, centres, angles), expected, atol=1e-10)
    assert_allclose(rotations_about(axes, angles), Rotation.from_rotvec(axes * angles[:, None]).as_matrix(), atol=1e-12)


def test_equation_a_7_as_printed():
    (w,), (q,), (angle,) = drawn(3, 1)
    rotation, v = rotations_about(w, angle), -np.cross(w, q)
    expected = (np.eye(3) - rotation) @ np.cross(w, v) + np.outer(w, w) @ v * angle
    assert_allclose(exponential_maps(w, q, angle)[:3, 3], expected, atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_the_world_s_axes_in_closed_form(axis):
    """Eq. A.11 to A.13, in which (x, y, z) is the centre."""
    (x, y, z), angle = np.array([0.3, -1.2, 0.7]), 0.9
    c, s = np.cos(angle), np.sin(angle)
    printed = [
        [[1, 0, 0, 0], [0, c, -s, z * s + y * (1 - c)], [0, s, c, -y * s + z * (1 - c)], [0, 0, 0, 1]],
        [[c, 0, s, -z * s + x * (1 - c)], [0, 1, 0, 0], [-s, 0, c, x * s + z * (1 - c)], [0, 0, 0, 1]],
        [[c, -s, 0, y * s + x * (1 - c)], [s, c, 0, -x * s + y * (1 - c)], [0, 0, 1, 0], [0, 0, 0, 1]],
    ][axis]
    assert_allclose(exponential_maps(np.eye(3)[axis], np.array([x, y, z]), angle), printed, atol=1e-12)


def test_a_chain_is_turned_joint_by_joint_from_its_end():
    """Eq. A.10 and A.14 against turning the last link first, each turn carrying all beyond its joint; the order counts."""
    axes, centres, angles = drawn(4, 5)
    point = np.array([0.1, 0.2, 0.3])
    expected = point
    for axis, centre, angle in reversed(list(zip(axes, centres, angles, strict=True))):
        expected = centre + Rotation.from_rotvec(axis * angle).apply(expected - centre)
    assert_allclose(moved(chain_map(axes, centres, angles), point), expected, atol=1e-12)
    other = chain_map(axes[::-1], centres[::-1], angles[::-1])
    assert np.abs(other - chain_map(axes, centres, angles)).max() > 0.1


def test_many_poses_of_a_chain_at_once():
    axes, centres, _ = drawn(5, 3)
    angles = np.random.default_rng(6).normal(size=(2, 7, 3))
    maps = chain_map(axes, centres, angles)
    assert maps.shape == (2, 7, 4, 4)
    assert_allclose(maps[1, 4], chain_map(axes, centres, angles[1, 4]))
