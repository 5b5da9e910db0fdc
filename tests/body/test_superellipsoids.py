"""Superellipsoids, their contours and what hides what, against closed forms and dense sampling."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.body.contours import contour_points, hidden, make_strips
from hmc.body.joints import default_limits
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body, make_body
from hmc.body.solid_samples import draw_samples, surface_grid
from hmc.body.solids import CHAINS, FREE_NAMES, GROUPS, solid_body, to_world
from hmc.body.superellipsoids import Superellipsoids, inside_outside, normals_at, points_at
from hmc.pose.objectives.cue_rows import pose_body


@pytest.fixture(scope="module")
def body():
    return solid_body(default_body(1.78))


def random_state(rng):
    limits = default_limits()
    state = neutral_state("down")
    low, high = np.maximum(limits.low, -3), np.minimum(limits.high, 3)
    state[3:] = low[3:] + rng.random(len(state) - 3) * (high - low)[3:]
    state[6:9] = 0
    return state


@settings(max_examples=50, deadline=None)
@given(st.floats(0.2, 1.9), st.floats(0.2, 1.9), st.floats(0.3, 1.9), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1), st.integers(0, 2**32 - 1))
def test_points_lie_on_the_surface_and_scaling_decides_the_side(eps_low, eps_high, eps2, eta, omega, seed):
    axes = np.random.default_rng(seed).uniform(0.05, 0.5, 4)
    solids = Superellipsoids(axes[None, :2], axes[None, 2:], np.array([[eps_low, eps_high]]), np.array([eps2]))
    index = np.zeros(1, int)
    point = points_at(solids, index, np.array([eta]), np.array([omega]))
    assert inside_outside(solids, index, point) == pytest.approx(1, rel=1e-6)
    assert inside_outside(solids, index, 0.97 * point) < 1 < inside_outside(solids, index, 1.03 * point)


def test_normals_are_those_of_the_gradient_of_the_inside_outside_function(body):
    rng = np.random.default_rng(0)
    index = rng.integers(len(body.solids), size=200)
    eta, omega = rng.uniform(-1.3, 1.3, 200), rng.uniform(-3, 3, 200)
    points, normals = points_at(body.solids, index, eta, omega), normals_at(body.solids, index, eta, omega)
    step = 1e-6
    slope = np.stack(
        [inside_outside(body.solids, index, points + step * e) - inside_outside(body.solids, index, points - step * e) for e in np.eye(3)],
        axis=1,
    )
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    away = (np.abs(points) > 1e-3).all(axis=1)
    np.testing.assert_allclose(slope[away], normals[away], atol=1e-4)


def test_body_has_24_degrees_of_freedom_in_a_trunk_and_five_chains(body):
    assert len(FREE_NAMES) == 24
    assert sorted(np.concatenate(CHAINS)) == list(range(6, 24))
    assert [len(chain) for chain in CHAINS] == [2, 4, 4, 4, 4]
    np.testing.assert_allclose(np.linalg.det(body.axes), 1)


def test_samples_are_even_over_the_area(body):
    """On the forearm, whose radius varies: shares of points between heights are the shares of area by quadrature."""
    grid = surface_grid(body, per_group=6000)
    k = body.names.index("l_forearm")
    local = (grid.points[grid.solid == k] - body.origin[k]) @ body.axes[k]
    reach = body.solids.along[k, 1]
    cuts = np.array([0.3, 0.5, 0.7, 0.9]) * reach
    eta = np.linspace(0, np.pi / 2, 20001)
    rim = points_at(body.solids, np.full(eta.shape, k), eta, np.zeros_like(eta))
    strip = np.pi * (rim[1:, 0] + rim[:-1, 0]) * np.hypot(np.diff(rim[:, 0]), np.diff(rim[:, 2]))
    area = np.histogram((rim[1:, 2] + rim[:-1, 2]) / 2, cuts, weights=strip)[0]
    found = np.histogram(local[:, 2], cuts)[0]
    np.testing.assert_allclose(found / found.sum(), area / area.sum(), atol=0.03)


def test_draws_are_from_the_groups_without_repeats(body):
    grid = surface_grid(body)
    counts = (60, 20, 20, 20, 20, 20)
    first, second = (draw_samples(np.random.default_rng(seed), grid, counts) for seed in (1, 2))
    assert len(np.unique(first)) == 160
    np.testing.assert_array_equal(np.bincount(grid.group[first]), counts)
    assert len(np.intersect1d(first, second)) < 80


def test_solids_are_as_long_as_their_side_and_lie_where_the_flesh_does():
    usual = default_body(1.7)
    other = solid_body(make_body(usual.dimensions | {"arms_longer_left": 0.06, "legs_longer_left": -0.04, "pelvis_flesh_forward": 0.02}))
    before = solid_body(usual)
    ratio = dict(zip(other.names, (other.solids.along / before.solids.along)[:, 1], strict=True))
    moved = dict(zip(other.names, (other.origin - before.origin)[:, 0], strict=True))
    for side, sign in (("l", 1), ("r", -1)):
        assert (ratio[f"{side}_upper_arm"], ratio[f"{side}_thigh"]) == pytest.approx((1 + 0.03 * sign, 1 - 0.02 * sign))
        assert moved[f"{side}_thigh"] == pytest.approx(0.02) and moved[f"{side}_shank"] == 0
    assert moved["pelvis"] > moved["chest"] > 0 == moved["head"]


def test_contour_of_a_sphere_is_the_circle_of_tangents():
    """Every limb's solid replaced by a sphere: rim points r satisfy n . (r - c) = 0, known in closed form."""
    body = solid_body(default_body(1.7))
    n, radius = len(body.solids), 0.2
    spheres = Superellipsoids(np.full((n, 2), radius), np.full((n, 2), radius), np.ones((n, 2)), np.ones(n))
    body = type(body)(body.skeleton, spheres, body.names, body.segment, body.group, body.has_edges, body.origin, body.axes)
    strips = make_strips(body)
    turns, centres = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    camera = np.array([1.1, 0.4, 0.35])
    chosen = np.arange(len(strips.solid))
    found = contour_points(body, strips, chosen, turns, centres, np.tile(camera, (len(chosen), 1)))
    points = found.points[found.found]
    assert found.found.mean() > 0.5
    np.testing.assert_allclose(points @ camera, radius**2, atol=2e-3)  # tangent plane: n . c = radius
    np.testing.assert_allclose(np.linalg.norm(points, axis=-1), radius)


def test_pairs_are_symmetric_to_the_axis(body):
    strips = make_strips(body)
    posed = pose_body(body, random_state(np.random.default_rng(4)))
    turns, centres = to_world(body, posed.rotations, posed.positions)
    circles = np.concatenate(strips.circles)
    camera = np.tile([3.0, 1.0, 1.5], (len(circles), 1))
    found = contour_points(body, strips, circles, turns, centres, camera)
    solid = strips.solid[circles]
    local = np.einsum("nkj,nji->nki", found.points - centres[solid][:, None], turns[solid])[found.found]
    np.testing.assert_allclose(local[:, 0, 2], local[:, 1, 2], atol=1e-9)  # the same height
    # The camera's direction across the axis halves the angle between them.
    seen = np.einsum("nj,nji->ni", camera - centres[solid], turns[solid])[found.found, :2]
    sides = [np.cross(np.append(seen, 0 * seen[:, :1], 1), np.append(local[:, k, :2], 0 * seen[:, :1], 1))[:, 2] for k in (0, 1)]
    np.testing.assert_allclose(sides[0], -sides[1], atol=2e-3)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_hidden_agrees_with_walking_along_every_ray(seed):
    body = solid_body(default_body(1.78))
    rng = np.random.default_rng(seed)
    posed = pose_body(body, random_state(rng))
    turns, centres = to_world(body, posed.rotations, posed.positions)
    grid = surface_grid(body, per_group=40)
    solid = grid.solid
    points = (posed.rotations[grid.segment] @ grid.points[..., None])[..., 0] + posed.positions[grid.segment]
    camera = rng.normal(size=3)
    camera = 3.5 * camera / np.linalg.norm(camera)
    found = hidden(body, turns, centres, solid, points, np.tile(camera, (len(points), 1)))
    shares = np.linspace(0, 1, 1500)
    least = np.full(len(points), np.inf)
    for k in range(len(body.solids)):
        at = points[:, None] + shares[:, None] * (camera - points)[:, None]
        value = inside_outside(body.solids, np.full(at.shape[:2], k), (at - centres[k]) @ turns[k]).min(axis=1)
        least = np.where(solid == k, least, np.minimum(least, value))
    # Rays that graze a solid may pass between the places that are asked.
    clear = (least > 1.0) | (least < 0.9)
    np.testing.assert_array_equal(found[clear], least[clear] <= 1)
    assert (found & (least > 1)).sum() == 0
    assert (found != (least <= 1)).mean() < 0.05


def test_groups_have_the_solids_that_belong_to_them(body):
    assert [body.names[k] for k in np.flatnonzero(body.group == GROUPS.index("l_arm"))] == ["l_upper_arm", "l_forearm"]
    assert not body.has_edges[body.group < 2].any()
