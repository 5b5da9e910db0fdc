"""The hull's distance field and the symmetric cost against SciPy, plain loops and rendered people."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from posed import COST, body_of, crossed_arms, true_state, with_cylinders
from scipy import ndimage
from scipy.spatial import cKDTree

from hmc.body.cones import cone_distance
from hmc.body.flesh import place_points
from hmc.body.joints import DOF_NAMES, N_DOF, dof_index
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.model import neutral_state
from hmc.body.penetration import penetration_depth
from hmc.body.prior import POSTURE, posture_spread
from hmc.errors import InputError
from hmc.landmarks import landmark_index
from hmc.pose.objectives.symmetric import Symmetric, SymmetricSettings, body_distance, outside_distance
from hmc.pose.views.hull_target import FAR_M, HullTarget, distance_at, distance_gradient, make_target, sample_points
from hmc.pose.views.near_distance import near_distance, near_squares
from hmc.voxels.grid import VoxelGrid

GRID = VoxelGrid(np.array([-1.0, 2.0, 0.0]), 0.04, (50, 40, 60))


def ball(centre, radius: float) -> np.ndarray:
    return np.argwhere(np.linalg.norm(GRID.centres() - centre, axis=-1) <= radius)


@pytest.fixture(scope="module")
def balls() -> HullTarget:
    return make_target(GRID, ball([0, 2.8, 1.2], 0.3), ball([0, 2.8, 1.2], 0.4))


def random_target(seed: int) -> HullTarget:
    rng = np.random.default_rng(seed)
    voxel = np.zeros((1, 3), int)
    return replace(
        make_target(GRID, voxel, voxel), distance=rng.random((7, 6, 8)).astype(np.float32), origin=rng.normal(0, 2, 3), voxel_size_m=0.05
    )


@settings(max_examples=20)
@given(seed=st.integers(0, 2**31))
def test_look_ups_equal_map_coordinates(seed):
    target = random_target(seed)
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, np.array(target.distance.shape) - 1, (200, 3))
    points = target.origin + target.voxel_size_m * places
    trilinear, _ = distance_gradient(target, points)
    expected = ndimage.map_coordinates(target.distance.astype(float), places.T, order=1)
    assert_allclose(trilinear, expected, atol=1e-6)
    sure = np.abs(places % 1 - 0.5).min(1) > 1e-3  # not between two voxels
    nearest = ndimage.map_coordinates(target.distance, np.rint(places).T, order=0)
    assert_allclose(distance_at(target, points)[sure], nearest[sure])
    assert_allclose(distance_at(target, points.astype(np.float32).reshape(20, 10, 3)).ravel()[sure], nearest[sure])


def test_the_gradient_is_that_of_the_interpolation():
    target = random_target(4)
    rng = np.random.default_rng(4)
    places = rng.integers(0, np.array(target.distance.shape) - 1, (200, 3)) + rng.uniform(0.05, 0.95, (200, 3))
    points = target.origin + target.voxel_size_m * places
    _, gradient = distance_gradient(target, points)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        measured = (distance_gradient(target, points + step)[0] - distance_gradient(target, points - step)[0]) / 2e-6
        assert_allclose(gradient[:, axis], measured, rtol=1e-5, atol=1e-5)


def test_beyond_the_crop_the_distance_goes_on_growing(balls):
    out = balls.origin - [[0.5, 0, 0], [0.5, 0.5, 0.5], [0, 0, 3.0]]
    border = balls.distance[0, 0, 0]
    for look_up in (distance_at(balls, out), distance_gradient(balls, out)[0]):
        assert_allclose(look_up, border + np.array([0.5, 0.5 * np.sqrt(3), 3.0]), atol=1e-4)


def test_the_field_is_nothing_inside_both_hulls_and_the_distance_outside(balls):
    """Between the hulls a share of the distance to the strict one may count; far out, the nearest tolerant voxel does."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.7, 2.1, 0.5], [0.7, 3.5, 1.9], (3000, 3))
    away = np.linalg.norm(points - [0, 2.8, 1.2], axis=1)
    found = distance_at(balls, points)
    assert np.all(found[away < 0.26] == 0)
    assert np.all(np.diff([found[(away > a) & (away < a + 0.05)].mean() for a in (0.2, 0.3, 0.4, 0.5)]) > 0)
    tree = cKDTree(GRID.centres(ball([0, 2.8, 1.2], 0.4)))
    exact = np.maximum(tree.query(points)[0] - GRID.voxel_size_m / 2, 0)
    far = (away > 0.45) & (away < 0.4 + FAR_M)
    more = found[far] - exact[far]
    assert more.min() > -0.04 and more.max() < 0.08  # a voxel's rounding, and what the strict hull may add
    assert np.abs(found[far] - exact[far] - np.median(more)).max() < 0.04


def test_a_person_at_the_border_of_the_grid():
    voxels = np.argwhere(np.ones((4, 5, 3), bool))
    target = make_target(GRID, voxels, voxels)
    assert_allclose(target.surface.min(0), GRID.origin + 0.02)
    assert_allclose(target.volume_m3, 60 * 0.04**3)
    outside = GRID.origin - [[0.2, 0, 0], [0, 0, 0.08], [0.34, 0, 0]]
    *near, far = distance_at(target, outside)
    assert_allclose(near, [0.2, 0.08], atol=0.03)
    assert FAR_M <= far < 0.34


def test_surface_voxels_have_a_free_neighbour(balls):
    strict = {tuple(v) for v in ball([0, 2.8, 1.2], 0.3)}
    sides = [side * np.eye(3, dtype=int)[axis] for axis in range(3) for side in (-1, 1)]
    expected = {v for v in strict if any(tuple(np.add(v, s)) not in strict for s in sides)}
    assert {tuple(v) for v in GRID.index_of(balls.surface)} == expected
    assert balls.volume_m3 == pytest.approx(len(strict) * 0.04**3)


def test_a_missing_hull_is_replaced_by_the_other_one():
    nothing, some = np.zeros((0, 3), int), ball([0, 2.8, 1.2], 0.3)
    both = make_target(GRID, some, some)
    for strict, tolerant in ((nothing, some), (some, nothing)):
        one = make_target(GRID, strict, tolerant)
        assert_allclose(one.distance, both.distance)
        assert_allclose(one.surface, both.surface)
    assert make_target(GRID, nothing, nothing) is None
    single = make_target(GRID, np.array([[3, 4, 5]]), nothing)
    assert len(single.surface) == 1 and np.isfinite(single.distance).all()


@given(m=st.integers(1, 60), n=st.integers(1, 40))
def test_sampled_points_are_spread_over_the_whole(m, n):
    points = np.repeat(np.arange(m, dtype=float)[:, None], 3, axis=1)
    chosen = sample_points(np.random.default_rng(m * n), points, n)[:, 0]
    assert len(chosen) == min(m, n)
    if n < m:  # one from each of n equal runs
        runs = np.linspace(0, m, n + 1)
        assert np.all(chosen + 1 > runs[:-1]) and np.all(chosen < runs[1:])


def random_states(seed: int, n: int) -> np.ndarray:
    states = np.random.default_rng(seed).normal(0, 0.4, (n, N_DOF))
    states[:, 2] += 1.0
    return states


def loop_body_distance(body, states, points) -> np.ndarray:
    out = np.empty((len(states), len(points)))
    for n, state in enumerate(states):
        rotations, positions = segment_transforms(body, state)
        for k, point in enumerate(points):
            local = [rotations[s].T @ (point - positions[s]) for s in body.cones.segment]
            out[n, k] = min(cone_distance(body.cones, c, at) for c, at in enumerate(local))
    return out


def test_distance_to_the_body_equals_a_loop_over_cones():
    body, _ = body_of()
    states = random_states(0, 4)
    points = np.random.default_rng(1).normal([0, 0, 1], 0.5, (40, 3))
    found = body_distance(body, states, points)
    assert found.shape == (4, 40)
    assert_allclose(found, loop_body_distance(body, states, points), atol=2e-5)
    assert (found == 0).any() and (found > 0.1).any()


def test_distance_to_many_bodies_far_from_the_origin():
    """More states than are worked on at a time, in a room whose numbers are large."""
    body, _ = body_of()
    states = random_states(2, 700)
    points = np.random.default_rng(3).normal([0, 0, 1], 0.4, (20, 3))
    near = body_distance(body, states, points)
    far = np.array([120.0, -80.0, 3.0])
    states[:, :3] += far
    assert_allclose(body_distance(body, states, points + far), near, atol=1e-4)
    assert_allclose(near[[5, 699]], loop_body_distance(body, random_states(2, 700)[[5, 699]], points), atol=2e-5)


def test_distance_to_cylinders_in_closed_form():
    body = with_cylinders(body_of()[0], 0.03)
    state = np.zeros((1, N_DOF))
    rotations, positions = segment_transforms(body, state[0])
    cones = body.cones
    start = np.array([rotations[s] @ a + positions[s] for s, a in zip(cones.segment, cones.start, strict=True)])
    end = np.array([rotations[s] @ b + positions[s] for s, b in zip(cones.segment, cones.end, strict=True)])
    points = np.random.default_rng(0).normal(0, 0.6, (200, 3))
    along = np.einsum("kcj,cj->kc", points[:, None] - start, (end - start) / ((end - start) ** 2).sum(1, keepdims=True))
    foot = start + np.clip(along, 0, 1)[..., None] * (end - start)
    lateral = np.linalg.norm(points[:, None] - (start + along[..., None] * (end - start)), axis=-1)
    beyond = np.linalg.norm(start + along[..., None] * (end - start) - foot, axis=-1)
    expected = np.hypot(np.maximum(lateral - 0.03, 0), beyond).min(1)
    assert_allclose(body_distance(body, state, points)[0], expected, atol=1e-5)


def test_outside_distance_equals_a_loop(balls):
    body, points = body_of()
    states = random_states(5, 3) + np.r_[0, 2.8, np.zeros(N_DOF - 2)]
    found = outside_distance(body, points.surface, states, balls)
    for n, state in enumerate(states):
        rotations, positions = segment_transforms(body, state)
        for k in range(0, len(points.surface.points), 11):
            segment = points.surface.segment[k]
            world = rotations[segment] @ points.surface.points[k] + positions[segment]
            place = (world - balls.origin) / balls.voxel_size_m
            voxel = np.rint(place).astype(int)
            held = np.clip(voxel, 0, np.array(balls.distance.shape) - 1)
            if np.abs(place % 1 - 0.5).min() > 1e-3:
                beyond = np.linalg.norm(place - np.clip(place, 0, np.array(balls.distance.shape) - 1)) * balls.voxel_size_m
                assert found[n, k] == pytest.approx(balls.distance[tuple(held)] + beyond, abs=1e-5)


@pytest.mark.parametrize("settings", [COST, SymmetricSettings(0.1, 0.5, 3.0, 1e-4)])
def test_the_cost_is_the_sum_of_its_parts(balls, settings):
    body, points = body_of()
    states = np.stack([crossed_arms(), *random_states(6, 3)])
    states[:, 1] += 2.8
    hull = balls.surface[::9]
    found = Symmetric(body, points, balls, hull, settings).cost(states)
    for n, state in enumerate(states):
        rotations, positions = segment_transforms(body, state)
        world = place_points(rotations, positions, points.surface.points, points.surface.segment)
        cost = np.mean([min(d, settings.cap_m) ** 2 for d in distance_at(balls, world)])
        cost += settings.uncovered_weight * np.mean(np.minimum(loop_body_distance(body, [state], hull), settings.cap_m) ** 2)
        cost += settings.overlap_weight * np.mean(penetration_depth(body, points.axes, rotations[None], positions[None]) ** 2)
        rest, spread = POSTURE[0], posture_spread(state)
        cost += settings.posture_weight * sum(((state[d] - rest[d]) / spread[d]) ** 2 for d in range(6, N_DOF))
        assert found[n] == pytest.approx(cost, rel=1e-2)


def test_posture_is_free_for_the_root_and_restful_within_the_limits():
    rest, spread = POSTURE
    body, _ = body_of()
    assert np.all(np.isinf(spread[:6])) and np.all(np.isfinite(spread[6:])) and np.all(spread > 0)
    assert np.all((rest >= body.limits.low) & (rest <= body.limits.high))
    for k, name in enumerate(DOF_NAMES):
        if name.startswith("l_"):
            other = DOF_NAMES.index("r_" + name[2:])
            assert spread[k] == spread[other]
            assert rest[k] == pytest.approx(rest[other] * (1 if name.endswith("_y") else -1))


def test_crossed_legs_are_less_common_than_open_ones():
    body, _ = body_of()
    states = np.repeat(neutral_state("down", body.limits)[None], 2, axis=0)
    states[:, dof_index("r_hip_x", "l_hip_x")] = np.radians([[20, -20], [-20, 20]])
    pelvis, knees = landmark_index("pelvis"), [landmark_index("l_knee"), landmark_index("r_knee")]
    crossed, opened = (landmarks(body, state)[knees, 1] - landmarks(body, state)[pelvis, 1] for state in states)
    assert crossed[0] - crossed[1] < opened[0] - opened[1]
    hips = dof_index("r_hip_x", "l_hip_x")
    spread = posture_spread(states)
    costs = ((states / spread) ** 2)[:, hips].sum(1)
    assert costs[0] > 5 * costs[1]
    others = np.delete(np.arange(N_DOF), hips)
    assert np.array_equal(spread[:, others], np.tile(POSTURE[1][others], (2, 1)))


def test_the_true_pose_of_a_rendered_person_costs_least():
    acted = act("gesture")
    body, points = body_of(acted.height_m)
    rng = np.random.default_rng(0)
    for frame in (0, 4):
        true = true_state(body, acted, frame)
        spread = np.r_[np.full(3, 0.15), np.full(N_DOF - 3, 0.35)]
        others = np.clip(true + rng.normal(0, 1, (60, N_DOF)) * spread, body.limits.low, body.limits.high)
        target = acted.targets[frame]
        costs = Symmetric(body, points, target, target.surface[::4], COST).cost(np.stack([true, *others]))
        assert np.argmin(costs) == 0
        assert costs[0] < 0.3 * np.median(costs)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31), reach=st.integers(1, 17))
def test_near_distance_is_the_exact_transform_up_to_its_reach(seed, reach):
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, 24, 3)
    occupied = np.zeros(shape, bool)
    low = rng.integers(0, shape)  # what is occupied may lie anywhere, at the border too
    box = occupied[tuple(slice(a, a + 6) for a in low)]
    box[...] = rng.random(box.shape) < rng.choice([0.003, 0.05, 0.9])
    expected = np.full(occupied.shape, reach + 1.0)
    if occupied.any():
        expected = np.minimum(ndimage.distance_transform_edt(~occupied), reach + 1)
    assert_allclose(near_distance(occupied, reach), expected, atol=1e-5)
    np.testing.assert_array_equal(near_squares(occupied, reach), np.rint(expected**2))


@pytest.mark.parametrize("cap_m", [0.0, -0.1, 0.5])
def test_a_cap_beyond_the_distance_fields_is_refused(cap_m):
    with pytest.raises(InputError, match="cap_m"):
        SymmetricSettings(cap_m=cap_m)
