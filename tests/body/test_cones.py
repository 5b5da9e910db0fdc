"""Distances to truncated cones and depths in them, against dense samples of each cone, whatever the form in which they are asked for."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hmc.body.cones import cone_depth, cone_distance, cone_shapes, squared_distance, way_out
from hmc.body.joints import N_DOF, SEGMENTS
from hmc.body.model import Cones
from hmc.body.nearest_cone import part_distances
from hmc.body.proportions import default_body

FINE = 20001


def random_cones(rng, n: int, round_: bool = False) -> Cones:
    start, axis, other = rng.normal(0, 0.3, (n, 3)), rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    across = np.cross(axis, other)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    radii = rng.uniform(0.02, 0.2, (n, 2, 1 if round_ else 2)).repeat(2 if round_ else 1, axis=2)
    return Cones(np.zeros(n, int), np.zeros(n, int), start, start + rng.uniform(0.1, 0.6, (n, 1)) * axis, radii, across)


def coordinates(cones: Cones, points: np.ndarray) -> np.ndarray:
    """Of points (m, 3) in every cone, (3, n_cones, m), one by one."""
    return np.array([[cones.bases[c] @ (p - cones.start[c]) for p in points] for c in range(len(cones.part))]).transpose(2, 0, 1)


def ellipse(cones: Cones, c: int, along: float) -> np.ndarray:
    t = np.clip(along / cones.lengths[c], 0, 1)
    return (1 - t) * cones.radii[c, 0] + t * cones.radii[c, 1]


def sampled_distance(cones: Cones, c: int, local: np.ndarray) -> float:
    """To the nearest of dense samples: those of the cross-section beside the point that lie on its ray from the axis."""
    x, y, along = local
    a, b = ellipse(cones, c, along)
    share = np.linspace(0, 1, FINE)
    inside = (share * x / a) ** 2 + (share * y / b) ** 2 <= 1
    ray = share[inside, None] * [x, y, 0] + [0, 0, np.clip(along, 0, cones.lengths[c])]
    return np.linalg.norm(ray - local, axis=1).min()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_all_forms_of_the_distance_are_that_to_dense_samples(seed):
    rng = np.random.default_rng(seed)
    cones, points = random_cones(rng, 3), rng.normal(0, 0.4, (8, 3))
    local = coordinates(cones, points)
    expected = np.array([[sampled_distance(cones, c, local[:, c, m]) for m in range(8)] for c in range(3)])
    for c in range(3):
        found = cone_distance(cones, c, points.reshape(2, 4, 3))
        assert found.shape == (2, 4)
        assert_allclose(found.ravel(), expected[c], atol=2e-4)
        assert abs(cone_distance(cones, c, points[0]) - found[0, 0]) < 1e-12
    offsets = local.copy()
    way_out(offsets, *cone_shapes(cones, float))
    assert_allclose(np.linalg.norm(offsets, axis=0), expected, atol=2e-4)
    for dtype, atol in ((np.float32, 2e-6), (float, 1e-12)):
        squared = np.empty((3, 8), dtype)
        squared_distance(local.astype(dtype), *cone_shapes(cones, dtype), squared)
        assert_allclose(np.sqrt(squared), np.linalg.norm(offsets, axis=0), atol=atol)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_way_out_ends_on_the_cone(seed):
    rng = np.random.default_rng(seed)
    cones, points = random_cones(rng, 1), rng.normal(0, 0.5, (20, 3))
    local = coordinates(cones, points)
    offsets = local.copy()
    way_out(offsets, *cone_shapes(cones, float))
    for foot in (local - offsets)[:, 0].T:
        assert -1e-12 <= foot[2] <= cones.lengths[0] + 1e-12
        assert np.sum((foot[:2] / ellipse(cones, 0, foot[2])) ** 2) <= 1 + 1e-9


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_beside_a_round_cylinder_it_is_the_distance_to_the_nearest_of_all_its_points(seed):
    rng = np.random.default_rng(seed)
    cones = random_cones(rng, 1, round_=True)
    cones = Cones(cones.segment, cones.part, cones.start, cones.end, cones.radii[:, :1].repeat(2, axis=1), cones.across)
    radius, length = cones.radii[0, 0, 0], cones.lengths[0]
    r, angle, along = np.meshgrid(np.linspace(0, radius, 30), np.linspace(0, 2 * np.pi, 90), np.linspace(0, length, 60), indexing="ij")
    solid = np.stack([r * np.cos(angle), r * np.sin(angle), along], axis=-1).reshape(-1, 3) @ cones.bases[0] + cones.start[0]
    for point in rng.normal(0, 0.5, (5, 3)):
        assert abs(cone_distance(cones, 0, point) - np.linalg.norm(solid - point, axis=1).min()) < 0.015


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_depth_is_where_the_distance_is_zero_and_by_the_narrower_radius(seed):
    rng = np.random.default_rng(seed)
    cones, points = random_cones(rng, 3), rng.normal(0, 0.25, (10, 3))
    local = coordinates(cones, points)
    for dtype, atol in ((np.float32, 1e-6), (float, 1e-12)):
        found = cone_depth(local.astype(dtype), *cone_shapes(cones, dtype))
        assert found.dtype == dtype
        for c in range(3):
            for m in range(10):
                x, y, along = local[:, c, m]
                a, b = ellipse(cones, c, along)
                level = np.hypot(x / a, y / b)
                expected = max(0.0, (1 - level) * min(a, b)) if 0 < along < cones.lengths[c] else 0.0
                assert abs(found[c, m] - expected) < atol
                assert expected == 0 or cone_distance(cones, c, points[m]) == 0


def test_a_point_of_a_cone_without_thickness_is_as_far_as_it_is():
    thin = Cones(
        np.zeros(1, int), np.zeros(1, int), np.zeros((1, 3)), np.array([[0, 0, 1.0]]), np.zeros((1, 2, 2)), np.array([[1.0, 0, 0]])
    )
    assert_allclose(cone_distance(thin, 0, np.array([[0.3, 0.4, 0.5], [0, 0, 1.25]])), [0.5, 0.25], atol=2e-6)


def test_parts_are_as_far_as_their_nearest_cone():
    body, points = default_body(1.7), np.random.default_rng(0).normal(0, 0.5, (30, 3))
    found = part_distances(body, np.zeros(N_DOF), points)
    for part in range(10):
        expected = np.full(30, np.inf)
        for c in np.flatnonzero(body.cones.part == part):
            chain, segment = np.zeros(3), body.cones.segment[c]  # all angles are zero: no frame is turned
            while segment >= 0:
                chain += body.offsets[segment]
                segment = SEGMENTS[segment].parent
            expected = np.minimum(expected, cone_distance(body.cones, c, points - chain))
        assert_allclose(found[part], expected, atol=2e-6)
