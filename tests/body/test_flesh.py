"""The body's flesh: voxels and surface samples against plain loops and closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hmc.body.cones import cone_distance
from hmc.body.flesh import flesh_points, place_points, surface_coordinates, surface_samples
from hmc.body.joints import N_DOF, SEGMENTS
from hmc.body.kinematics import segment_transforms
from hmc.body.model import PARTS, Cones
from hmc.body.proportions import canton_body, default_body

BODY = default_body(1.75)


def one_cone(start, end, radius_start, radius_end, across) -> Cones:
    radii = np.array([[np.broadcast_to(radius_start, 2), np.broadcast_to(radius_end, 2)]], float)
    return Cones(np.zeros(1, int), np.zeros(1, int), np.array([start], float), np.array([end], float), radii, np.array([across], float))


@given(along=st.floats(-2, 3), lateral=st.floats(0, 2), angle=st.floats(0, 6.28), first=st.floats(0.05, 0.5), second=st.floats(0.05, 0.5))
def test_distance_to_a_circular_cone_in_closed_form(along, lateral, angle, first, second):
    """The axis lies along (0, 3, 4) / 5; by symmetry only the place along it and the distance from it matter."""
    axis, across = np.array([0, 0.6, 0.8]), np.array([1.0, 0, 0])
    start, length = np.array([0.3, -0.2, 0.5]), 1.4
    cones = one_cone(start, start + length * axis, first, second, across)
    third = np.cross(axis, across)
    point = start + along * axis + lateral * (np.cos(angle) * across + np.sin(angle) * third)
    radius = first + (second - first) * min(max(along / length, 0), 1)
    beyond = max(-along, along - length, 0)
    expected = np.hypot(max(lateral - radius, 0), beyond)
    assert cone_distance(cones, 0, point) == pytest.approx(expected, abs=1e-9)


def test_points_of_an_elliptic_cone():
    cones = one_cone([0, 0, 0], [0, 0, 2], (0.3, 0.1), (0.3, 0.1), [1, 0, 0])
    points = [[0.3, 0, 1], [0.5, 0, 1], [0, 0.1, 1], [0, 0.4, 1], [0.29, 0, 1.9], [0, 0, 2.5], [0.21, 0.07, 0.5], [0.5, 0, -0.2]]
    expected = [0, 0.2, 0, 0.3, 0, 0.5, 0, np.hypot(0.2, 0.2)]
    assert_allclose(cone_distance(cones, 0, np.array(points)), expected, atol=1e-12)
    # Along the ray from the axis: the surface lies where the ray meets the ellipse.
    ray = np.array([np.cos(0.7), np.sin(0.7)])
    reach = 1 / np.hypot(ray[0] / 0.3, ray[1] / 0.1)
    assert cone_distance(cones, 0, np.append((reach + 0.25) * ray, 1.0)) == pytest.approx(0.25)


@pytest.mark.parametrize(("make", "spacing"), [(default_body, 0.03), (canton_body, 0.045)])
def test_flesh_fills_the_cones_and_nothing_else(make, spacing):
    """Every voxel of a lattice around a segment: in the table once if a cone of the part holds it, else not."""
    body = make(1.7)
    table = flesh_points(body, spacing)
    assert table.spacing_m == spacing
    cones = body.cones
    for part in range(len(PARTS)):
        for segment in range(len(SEGMENTS)):
            rows = (table.part == part) & (table.segment == segment)
            members = np.flatnonzero((cones.part == part) & (cones.segment == segment))
            if not members.size:
                assert not rows.any()
                continue
            lattice = table.points[rows] / spacing
            found = {tuple(v) for v in np.rint(lattice).astype(int)}
            assert_allclose(lattice, np.rint(lattice), atol=1e-9)
            assert len(found) == rows.sum()
            reach = int(0.6 / spacing)
            around = np.floor(cones.start[members].mean(0) / spacing)
            wide = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 3, indexing="ij"), -1).reshape(-1, 3) + around
            inside = np.any([cone_distance(cones, m, wide * spacing) <= 0 for m in members], axis=0)
            assert {tuple(v) for v in wide[inside].astype(int)} == found
            for voxel, flag in zip(np.rint(lattice).astype(int)[::7], table.is_surface[rows][::7], strict=True):
                neighbours = [tuple(voxel + side * np.eye(3, dtype=int)[axis]) for axis in range(3) for side in (-1, 1)]
                assert flag == any(n not in found for n in neighbours)
    # No part is without flesh, and there is about as much of it as of a person.
    assert np.bincount(table.part, minlength=len(PARTS)).min() > 0
    assert 0.03 < len(table.points) * spacing**3 < 0.12


@pytest.mark.parametrize("part", PARTS)
def test_samples_lie_on_the_surface_with_outward_normals(part):
    coordinates = surface_coordinates(BODY, 300)
    samples = surface_samples(BODY, coordinates)
    cones, (cone, along, _) = BODY.cones, coordinates
    for k in np.flatnonzero(samples.part == PARTS.index(part)):
        point, normal = samples.points[k], samples.normals[k]
        assert samples.segment[k] == cones.segment[cone[k]] and samples.part[k] == cones.part[cone[k]]
        assert cone_distance(cones, cone[k], point) < 1e-6
        inside, outside = point - 1e-3 * normal, point + 1e-3 * normal
        if 0.05 < along[k] < 0.95:
            assert cone_distance(cones, cone[k], inside) == 0 < cone_distance(cones, cone[k], outside)
    assert_allclose(np.linalg.norm(samples.normals, axis=1), 1)


def test_no_sample_is_buried_in_another_cone():
    cone, along, angle = surface_coordinates(BODY, 400)
    samples = surface_samples(BODY, (cone, along, angle))
    rotations, positions = segment_transforms(BODY, np.zeros(N_DOF))
    world = place_points(rotations, positions, samples.points, samples.segment)
    for k, point in enumerate(world):
        for other, segment in enumerate(BODY.cones.segment):
            if other != cone[k]:
                local = rotations[segment].T @ (point - positions[segment])
                assert cone_distance(BODY.cones, other, local) > 0
    assert set(samples.part) == set(range(len(PARTS)))


def test_samples_follow_the_dimensions_smoothly():
    coordinates = surface_coordinates(BODY, 200)
    samples = surface_samples(BODY, coordinates)
    bigger = surface_samples(default_body(1.75 * 1.001), coordinates)
    assert_allclose(bigger.points, 1.001 * samples.points, atol=1e-9)


def test_samples_are_shared_out_by_area():
    cone, _, _ = surface_coordinates(BODY, 3000, least=1)
    counts = np.bincount(cone, minlength=len(BODY.cones.part))
    trunk = counts[BODY.cones.part == PARTS.index("torso")].sum()
    forearm = counts[BODY.cones.part == PARTS.index("l_forearm")].sum()
    assert 2 < trunk / forearm < 12
    few, _, _ = surface_coordinates(BODY, 1, least=8)
    assert len(few) > len(PARTS)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_points_are_carried_by_their_segments(kind):
    rng = np.random.default_rng(0)
    states = rng.normal(0, 1, (2, 3, N_DOF))
    rotations, positions = segment_transforms(BODY, states)
    points, segment = rng.normal(0, 0.2, (17, 3)), rng.integers(0, len(SEGMENTS), 17)
    placed = place_points(rotations.astype(kind), positions.astype(kind), points, segment)
    assert placed.dtype == kind and placed.shape == (2, 3, 17, 3)
    for index in np.ndindex(2, 3):
        for k in range(17):
            expected = rotations[index][segment[k]] @ points[k] + positions[index][segment[k]]
            assert_allclose(placed[index][k], expected, atol=2e-6 if kind is np.float32 else 1e-12)


def test_a_cone_is_worked_out_from_its_ends():
    cones = BODY.cones
    for k in range(len(cones.part)):
        axis = cones.end[k] - cones.start[k]
        assert cones.lengths[k] == pytest.approx(np.sqrt(axis @ axis))
        assert_allclose(cones.bases[k, 2], axis / np.sqrt(axis @ axis))
        assert_allclose(cones.bases[k, 0], cones.across[k])
