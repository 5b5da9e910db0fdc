"""Rays of silhouettes: against minimisation and sampling along the ray, and what they ask of a body where hulls are fat."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act, ring
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from posed import body_of, true_state
from scipy.optimize import minimize_scalar

from hmc.body.cones import slide_to_axis
from hmc.body.joints import N_DOF, dof_index
from hmc.body.model import neutral_state
from hmc.camera.model import project
from hmc.pose.objectives.symmetric import body_distance
from hmc.pose.views.rays import points_to_cover, silhouette_rays, with_rays
from hmc.voxels.carving import pixel_of_voxel


@settings(max_examples=50)
@given(seed=st.integers(0, 2**31), length=st.floats(0.01, 2))
def test_sliding_finds_the_place_nearest_to_the_axis(seed, length):
    rng = np.random.default_rng(seed)
    place, direction = rng.normal(0, 1, 3), rng.normal(size=3)
    direction /= np.linalg.norm(direction)

    def gap(t: float) -> float:
        point = place + t * direction
        return float(np.linalg.norm(point - [0, 0, np.clip(point[2], 0, length)]))

    local = place.reshape(3, 1).copy()
    moved = slide_to_axis(local, direction.reshape(3, 1), np.array([length]))[0]
    assert_allclose(local[:, 0], place + moved * direction, atol=1e-9)
    assert gap(moved) <= minimize_scalar(gap, bounds=(-30, 30), method="bounded", options={"xatol": 1e-9}).fun + 1e-6


def test_what_has_no_direction_stays_and_a_ray_along_the_axis_is_no_trouble():
    local = np.random.default_rng(0).normal(size=(3, 50))
    still = local.copy()
    assert not slide_to_axis(still, np.zeros((3, 50)), np.full(50, 0.4)).any()
    assert_array_equal(still, local)
    along = local.copy()
    slide_to_axis(along, np.tile([[0.0], [0.0], [1.0]], 50), np.full(50, 0.4))
    assert np.all(np.isfinite(along)) and np.all((along[2] >= -1e-6) & (along[2] <= 0.4 + 1e-6))


def test_a_ray_is_as_far_from_the_body_as_its_nearest_point():
    body, _ = body_of()
    rng = np.random.default_rng(1)
    states = neutral_state("down") + rng.normal(0, 0.2, (3, N_DOF))
    places, directions = rng.normal([0, 0, 0], 0.5, (60, 3)), rng.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[::5] = 0
    found = body_distance(body, states, np.concatenate([places, directions], axis=1))
    steps = np.linspace(-2.5, 2.5, 1001)
    sampled = np.min([body_distance(body, states, places + t * directions) for t in steps], axis=0)
    # The flesh is elliptic and tapered, with flat ends: the point nearest to the axis may lie a little farther from it.
    assert np.all(found > sampled - 0.003)
    assert np.quantile(found - sampled, 0.9) < 0.005 and np.max(found - sampled) < 0.05
    assert (found == 0).any() and (found > 0.1).any()
    assert_allclose(found[:, ::5], body_distance(body, states, places[::5]), atol=1e-6)


@pytest.fixture(scope="module")
def seen():
    """A ball of points, seen by a ring of five cameras."""
    points = np.stack(np.meshgrid(*[np.arange(-0.3, 0.31, 0.03)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    points = points[np.linalg.norm(points, axis=1) < 0.3] + [0, 0, 1.0]
    masks = []
    for camera in ring():
        mask = np.zeros(camera.size[::-1], bool)
        column, row = np.rint(project(camera, points)[0]).astype(int).T
        mask[row, column] = True
        masks.append(mask)
    return points, masks


def test_rays_come_from_the_cameras_and_fall_on_silhouettes(seen):
    points, masks = seen
    rays = silhouette_rays(ring(), masks, points, 0.03)
    first = 0
    for camera, mask in zip(ring(), masks, strict=True):
        own = silhouette_rays([camera], [mask], points, 0.03)
        assert_array_equal(rays[first : first + len(own)], own)
        first += len(own)
        offsets = own[:, :3] - camera.centre
        assert_allclose(np.cross(offsets, own[:, 3:]), 0, atol=1e-9)
        assert np.all((offsets * own[:, 3:]).sum(1) > 0)
        column, row = np.rint(project(camera, own[:, :3])[0]).astype(int).T
        assert mask[row, column].all()
        # One for each patch of 3 cm, so every point that is seen has one near it, and they are no more than the disc holds.
        uv, own_uv = project(camera, points)[0], project(camera, own[:, :3])[0]
        per_metre = camera.matrix[0, 0] / np.linalg.norm(camera.centre - [0, 0, 1.0])
        gaps = np.linalg.norm(uv[:, None] - own_uv, axis=-1).min(1)
        assert gaps.max() < 2.5 * 0.03 * per_metre
        assert len(own) < 1.6 * np.pi * 0.33**2 / 0.03**2
    assert first == len(rays)


def rays_by_sorting(rig, masks, points, spacing_m, others):
    """The first point of every patch, told by sorting the patches' numbers."""
    rays, points = [], points[np.random.default_rng(0).permutation(len(points))]
    for camera, mask in zip(rig, masks, strict=True):
        column, row, in_image = pixel_of_voxel(camera, points)
        here = points[in_image & mask[row, column]]
        if not len(here):
            continue
        per_patch = np.median((here @ camera.rotation.T + camera.translation)[:, 2]) / spacing_m

        def patches(some, camera=camera, per_patch=per_patch):
            x, y, depth = (some @ camera.rotation.T + camera.translation).T
            column, row = np.floor(np.stack([x, y]) / depth * per_patch).astype(np.int64)
            return column * 1_000_003 + row

        before = others[(others @ camera.rotation.T + camera.translation)[:, 2] > spacing_m]
        numbers, first = np.unique(patches(here), return_index=True)
        first = first[~np.isin(numbers, patches(before))]
        directions = here[first] - camera.centre
        rays.append(np.concatenate([here[first], directions / np.linalg.norm(directions, axis=1, keepdims=True)], axis=1))
    return np.concatenate(rays) if rays else np.zeros((0, 6))


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 400),
    spread_m=st.sampled_from([0.1, 0.5, 3.0]),
    share=st.sampled_from([0.0, 0.02, 0.7]),
)
def test_rays_are_the_first_points_of_patches_that_no_other_person_covers(seed, n, spread_m, share):
    rng = np.random.default_rng(seed)
    points = [0, 0, 1.0] + rng.uniform(-spread_m, spread_m, (n, 3))
    others = [0.2, 0, 1.0] + rng.uniform(-spread_m, spread_m, (int(rng.integers(0, 300)), 3))
    masks = [rng.random(camera.size[::-1]) < share for camera in ring()]
    assert_array_equal(silhouette_rays(ring(), masks, points, 0.05, others), rays_by_sorting(ring(), masks, points, 0.05, others))


def test_no_ray_without_a_silhouette_nor_where_somebody_else_may_be(seen):
    points, masks = seen
    whole = silhouette_rays(ring(), masks, points, 0.03)
    assert len(silhouette_rays(ring(), [None] * 5, points, 0.03)) == 0
    assert len(silhouette_rays(ring(), [np.zeros_like(mask) for mask in masks], points, 0.03)) == 0
    assert len(silhouette_rays(ring(), masks, points + [0, 0, 50.0], 0.03)) == 0  # out of every picture
    upper = [mask.copy() for mask in masks]
    for mask, camera in zip(upper, ring(), strict=True):
        mask[round(project(camera, np.array([[0, 0, 1.0]]))[0][0, 1]) :] = False
    assert 0.3 < len(silhouette_rays(ring(), upper, points, 0.03)) / len(whole) < 0.7
    beside = points[points[:, 0] > 0] + [0.02, 0, 0]
    without = silhouette_rays(ring(), masks, points, 0.03, beside)
    assert 0 < len(without) < 0.8 * len(whole)
    assert len(silhouette_rays(ring(), masks, points, 0.03, points + 1e-9)) == 0
    assert len(silhouette_rays(ring(), masks, points, 0.03, np.zeros((0, 3)))) == len(whole)


def test_shares_of_what_is_drawn():
    target = act("walk", frames=1).targets[0]
    rng = np.random.default_rng(0)
    for share in (0.0, 0.6, 1.0):
        drawn = points_to_cover(rng, target, 200, share)
        assert drawn.shape == (200, 6)
        assert np.count_nonzero(drawn[:, 3:].any(axis=1)) == round(200 * share)


def test_the_true_pose_covers_the_rays_of_few_cameras_and_not_their_hull():
    """Three cameras' hull has much that is nobody; every ray still hits the person."""
    acted = act("gesture", frames=1, cameras=3)
    body, _ = body_of(acted.height_m)
    target, state = acted.targets[0], true_state(body, acted)[None]
    hull, rays = body_distance(body, state, target.surface)[0], body_distance(body, state, target.rays)[0]
    assert (hull > 0.05).mean() > 4 * (rays > 0.05).mean()
    assert (rays > 0.05).mean() < 0.02
    away = state.copy()
    away[0, dof_index("r_shoulder_x", "l_shoulder_x")] += 0.7, -0.7
    assert body_distance(body, away, target.rays)[0].mean() > 1.2 * rays.mean()


def test_rays_ask_for_an_arm_that_one_camera_missed():
    """The strict hull lacks the arm then; the silhouettes of the others show it all the same."""
    acted = act("gesture", frames=1)
    target = acted.targets[0]
    wrist = acted.landmarks[0, [5, 8]]
    wrist = wrist[np.abs(wrist[:, :2] - acted.landmarks[0, 0, :2]).sum(1).argmax()]
    lacking = target.surface[np.linalg.norm(target.surface - wrist, axis=1) > 0.2]
    rays = with_rays(replace(target, surface=lacking), ring(), acted.masks[0]).rays
    gap = np.linalg.norm(np.cross(rays[:, :3] - wrist, rays[:, 3:]), axis=1)
    assert (gap < 0.05).sum() >= 4
