"""Multi-cue descent: gradients against finite differences, the descent against closed forms, SciPy as the judge, and a whole recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from hmc.body.joints import N_DOF, default_limits, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.body.solids import CHAINS, FREE
from hmc.camera.color_edges import ColorEdgeSettings
from hmc.camera.model import look_at, project
from hmc.camera.stacked import project_in, stack_views
from hmc.io.recording import open_recording
from hmc.io.results import TrackTable, read_joints
from hmc.pose.follow import FollowOptions, follow
from hmc.pose.methods.smd import SMD_PRESETS, smd_method
from hmc.pose.objectives.color_cue import ColorSettings, color_fits, learn_colors, update_colors
from hmc.pose.objectives.cue_rows import evaluate, gauss_newton_product, jacobian, leclerc, pose_body
from hmc.pose.objectives.edge_cue import edge_maps, match_edges, shown_contours
from hmc.pose.objectives.multicue import CueSettings, draw_of_groups
from hmc.pose.objectives.surface_cue import match_surface, match_voxels, nearest_voxels, place, voxel_cloud
from hmc.pose.starts.da_vinci import find_da_vinci
from hmc.pose.starts.spectral import spectral_poses
from hmc.pose.steps.descent.levenberg import robust_residuals
from hmc.pose.steps.descent.tracker import evaluation, make_cue_frame, make_tracker, track_init, track_step
from hmc.pose.views.skin import Crop, Skin, crop_images
from hmc.search.meta_descent import Evaluation, SmdSettings, converged, curvature_axes, smd_init, smd_run, smd_step

PLACES = [(3.0, 0.2, 1.6), (-0.4, 3.0, 1.5), (-2.8, -1.0, 1.4), (0.4, -2.9, 1.7)]
TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
CAMERAS = [look_at(f"c{k}", (320, 240), at, (0, 0, 1.0), 50, (-0.15, 0.03, 0.001, -0.002)) for k, at in enumerate(PLACES)]


@pytest.fixture(scope="module")
def tracker():
    return make_tracker(default_body(1.78), SMD_PRESETS["default"])


def state_of(rng, spread=0.3):
    """A random pose about standing with the arms half raised; the waist straight."""
    state = neutral_state("down")
    state[dof_index("r_shoulder_x", "l_shoulder_x")] = np.radians([40, -40])
    state[:3] = (0.1, -0.1, 0.95)
    state[3:] += spread * rng.normal(size=N_DOF - 3)
    limits = default_limits()
    state = np.clip(state, limits.low, limits.high)
    state[6:9] = 0
    return state


def placed(tracker, state):
    return place(pose_body(tracker.body, state), tracker.grid.points, tracker.grid.segment)


def images_of(tracker, state):
    """Every solid as the hull of its points in its own color, over grey."""
    points = placed(tracker, state)
    images = []
    for camera in CAMERAS:
        uv = project(camera, points)[0].astype(np.float32)
        image = np.full((*camera.size[::-1], 3), (150, 150, 150), np.uint8)
        for solid in range(len(tracker.body.solids)):
            hull = cv2.convexHull(uv[tracker.grid.solid == solid]).round().astype(np.int32)
            cv2.fillConvexPoly(image, hull, (40 + 15 * solid, 220 - 12 * solid, 60 + 60 * (solid % 3)))
        images.append(image)
    return images


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_gradient_of_the_surface_cue_is_the_slope_of_the_objective(tracker, seed):
    """Central differences over all 24 degrees of freedom, with the matches held."""
    rng = np.random.default_rng(seed)
    body, grid = tracker.body, tracker.grid
    state = state_of(rng)
    cloud = voxel_cloud(placed(tracker, state_of(rng))[::3])
    chosen = rng.permutation(len(grid.points))[:80]
    posed = pose_body(body, state)
    matches = match_surface(body, grid, chosen, posed, cloud, 1.0)
    rows = jacobian(posed, matches)
    value, gradient, _ = evaluate(matches, rows, 0.5)
    index, _ = nearest_voxels(cloud, place(posed, grid.points[chosen], grid.segment[chosen]))
    diameter = body.diameter[grid.solid[chosen]]

    def objective(at):
        points = place(pose_body(body, at), grid.points[chosen], grid.segment[chosen])
        error = 0.5 * (np.linalg.norm(points - cloud.points[index], axis=1) / diameter) ** 2
        return np.mean(1 - np.exp(-error / 0.5))

    assert value == pytest.approx(objective(state))
    step = 1e-6
    for k, dof in enumerate(FREE):
        move = step * (np.arange(N_DOF) == dof)
        assert gradient[k] == pytest.approx((objective(state + move) - objective(state - move)) / (2 * step), abs=1e-6)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1))
@example(6230)
def test_rows_of_the_edge_cue_are_the_slopes_of_its_residuals(tracker, seed):
    """A pair's middle and single points, through distorted lenses; the projection is OpenCV's."""
    rng = np.random.default_rng(seed)
    body, strips = tracker.body, tracker.strips
    state = state_of(rng)
    images = images_of(tracker, state_of(rng, 0.35))
    views, posed = stack_views(CAMERAS), pose_body(body, state)
    crops = [Crop(image, 0, 0) for image in images]
    maps = edge_maps(views, crops, shown_contours(tracker, posed, views), ColorEdgeSettings())
    n = 240  # of which few have an edge in reach
    chosen, view = rng.integers(len(strips.solid), size=n), rng.integers(len(CAMERAS), size=n)
    matches = match_edges(tracker, posed, maps, chosen, view, 0.08, 1.0)
    rows = jacobian(posed, matches)
    found = np.flatnonzero(matches.weight > 0)
    assert len(found) > 5
    assert (matches.weight[found] > 1.5 / (2 * n)).any(), "some pairs"
    # Whatever the wrenches act on moves as a rigid part of its segment: residual' = W twist', twist from differences of segments.
    step = 1e-6
    for k, dof in enumerate(FREE):
        move = step * (np.arange(N_DOF) == dof)
        ahead, behind = pose_body(body, state + move), pose_body(body, state - move)
        turn = (ahead.rotations - behind.rotations) / (2 * step) @ posed.rotations.swapaxes(1, 2)
        spin = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
        shift = (ahead.positions - behind.positions) / (2 * step) - np.cross(spin, posed.positions)
        twist = np.concatenate([spin, shift], axis=1)[matches.segment]
        np.testing.assert_allclose(rows[:, :, k], np.einsum("nij,nj->ni", matches.wrenches, twist), atol=1e-6)
    assert matches.missing.sum() + matches.weight.sum() == pytest.approx(1.0)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_projection_and_its_slopes(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.6, 0.6, (40, 3)) + [0, 0, 1]
    index = rng.integers(len(CAMERAS), size=40)
    uv, slopes, valid = project_in(stack_views(CAMERAS), index, points)
    assert valid.all()
    step = 1e-6
    for n, k in enumerate(index):
        camera = CAMERAS[k]
        rotation = cv2.Rodrigues(camera.rotation)[0]

        def by_opencv(point, camera=camera, rotation=rotation):
            return cv2.projectPoints(point[None], rotation, camera.translation, camera.matrix, camera.distortions)[0].ravel()

        np.testing.assert_allclose(uv[n], by_opencv(points[n]), atol=1e-6)
        numeric = [(by_opencv(points[n] + step * e) - by_opencv(points[n] - step * e)) / (2 * step) for e in np.eye(3)]
        np.testing.assert_allclose(slopes[n], np.array(numeric).T, atol=2e-3)


def test_matched_edges_of_the_true_pose_are_near_and_lead_back(tracker):
    """Of the true pose, pairs find edges within 2 pixels of their middles, and from a pose beside it the cue falls on the way back."""
    body, strips = tracker.body, tracker.strips
    state = state_of(np.random.default_rng(5), 0.1)
    views = stack_views(CAMERAS)
    maps_of = [Crop(image, 0, 0) for image in images_of(tracker, state)]
    values = []
    for degrees in (0, 6, 12):
        off = state.copy()
        off[dof_index("r_shoulder_x", "l_hip_x")] += np.radians([degrees, degrees])
        posed = pose_body(body, off)
        maps = edge_maps(views, maps_of, shown_contours(tracker, posed, views), ColorEdgeSettings())
        circles = np.concatenate(strips.circles)
        chosen, view = np.tile(circles, 4), np.repeat(np.arange(4), len(circles))
        matches = match_edges(tracker, posed, maps, chosen, view, 0.08, 1.0)
        found = matches.weight > 0
        error = 0.5 * (matches.residuals**2).sum(axis=1)
        values.append(float(error[found].mean()))
    assert values[0] < values[1] < values[2]
    assert np.sqrt(2 * values[0]) < 0.25  # of the limb's diameter


def test_nearest_voxels_are_those_of_a_tree_and_of_the_right_color():
    rng = np.random.default_rng(0)
    voxels, points = rng.uniform(-1, 1, (500, 3)), rng.uniform(-1, 1, (60, 3))
    index, found = nearest_voxels(voxel_cloud(voxels), points)
    distance, _ = cKDTree(voxels).query(points)
    np.testing.assert_allclose(np.linalg.norm(voxels[index] - points, axis=1), distance, atol=1e-5)
    assert found.all()
    fits = rng.random((3, 500)) < 0.2
    fits[2] = False
    patches = rng.integers(3, size=60)
    index, found = nearest_voxels(voxel_cloud(voxels, fits), points, patches)
    np.testing.assert_array_equal(found, patches < 2)
    for n in np.flatnonzero(found):
        own = np.flatnonzero(fits[patches[n]])
        assert np.linalg.norm(voxels[index[n]] - points[n]) == pytest.approx(
            np.linalg.norm(voxels[own] - points[n], axis=1).min(), abs=1e-5
        )


def test_voxels_pull_the_nearest_part(tracker):
    state = state_of(np.random.default_rng(2))
    posed = pose_body(tracker.body, state)
    points = placed(tracker, state)
    cloud = voxel_cloud(points + np.random.default_rng(3).normal(0, 0.03, points.shape))
    candidates, voxels = np.arange(0, len(points), 2), np.arange(0, len(points), 7)
    matches = match_voxels(tracker.body, tracker.grid, candidates, posed, cloud, voxels, 0.5)
    distance, nearest = cKDTree(points[candidates]).query(cloud.points[voxels])
    assert matches.weight.sum() == pytest.approx(0.5)
    scale = tracker.body.diameter[tracker.grid.solid[candidates[nearest]]]
    np.testing.assert_allclose(np.linalg.norm(matches.residuals, axis=1), distance / scale, atol=1e-4)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_gauss_newton_product_is_that_of_the_formed_matrix(tracker, seed):
    rng = np.random.default_rng(seed)
    rows, slopes, vector = rng.normal(size=(30, 3, 24)), rng.random(30), rng.normal(size=24)
    flat = rows.reshape(-1, 24)
    matrix = flat.T @ np.diag(np.repeat(slopes, 3)) @ flat
    np.testing.assert_allclose(gauss_newton_product(rows, slopes, vector), matrix @ vector, rtol=1e-9)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_robust_residuals_square_to_the_objective_and_have_its_slopes(tracker, seed):
    rng = np.random.default_rng(seed)
    state = state_of(rng)
    cloud = voxel_cloud(placed(tracker, state_of(rng))[::3])
    posed = pose_body(tracker.body, state)
    matches = match_surface(tracker.body, tracker.grid, np.arange(0, 1500, 20), posed, cloud, 1.0)
    rows = jacobian(posed, matches)
    residuals, slopes = robust_residuals(matches, rows, 0.5)
    value, gradient, _ = evaluate(matches, rows, 0.5)
    assert 0.5 * residuals @ residuals == pytest.approx(value)
    np.testing.assert_allclose(slopes.T @ residuals, gradient, atol=1e-9)


@given(st.floats(0, 50), st.floats(0.05, 5))
def test_leclerc_is_bounded_and_rises(error, width):
    assert 0 <= leclerc(error, width) <= 1
    assert leclerc(error, width) <= leclerc(error + 0.1, width)


def quadratic(matrix, goal):
    def objective(at, going):
        gradient = matrix @ (at - goal)
        return Evaluation(float(0.5 * (at - goal) @ gradient), gradient, lambda v: matrix @ v, lambda: matrix)

    return objective


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_descent_finds_the_minimum_of_a_quadratic(seed, by_curvature):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(5, 5))
    # Steps for each parameter alone suit it, and its values are below 1, as the robust objective's are.
    matrix = 0.01 * (root @ root.T + 5 * np.diag(rng.uniform(0.5, 5, 5)))
    goal, wide = rng.normal(size=5), np.full(5, np.inf)
    chosen = SmdSettings(first_step=0.5, meta_step=3e-4, iterations=2000, reach=1e6, by_curvature=by_curvature)
    found, info = smd_run(quadratic(matrix, goal), np.zeros(5), (-wide, wide), np.full(5, 1e-7), chosen)
    np.testing.assert_allclose(found, goal, atol=1e-4)
    assert info.iterations[0] < 2000


def test_step_sizes_grow_where_gradients_agree_and_halve_at_most():
    state = smd_init(np.zeros(2), np.full(2, 0.1), np.array([1.0, 1.0]))
    wide, chosen = np.full(2, np.inf), SmdSettings(memory=0.3)
    first = Evaluation(0.0, np.array([1.0, 1.0]), lambda v: 0 * v, lambda: np.eye(2))
    state = smd_step(state, first, -wide, wide, chosen)
    np.testing.assert_allclose(state.trace, 0.1)  # v = a g
    again = Evaluation(0.0, np.array([1.0, -100.0]), lambda v: 0 * v, lambda: np.eye(2))
    after = smd_step(state, again, -wide, wide, chosen)
    np.testing.assert_allclose(after.steps, [0.1 * (1 + 0.1), 0.05])
    sure = smd_step(replace(state, meta=np.full(2, 1000.0)), again, -wide, wide, chosen)
    np.testing.assert_allclose(sure.steps, [0.2, 0.05])  # and double at most


@pytest.mark.parametrize("seed", range(5))
def test_the_printed_descent_is_equations_17_to_23(seed):
    """Written down once more, a component at a time, with step sizes that grow without bound and parameters put back into limits."""
    rng = np.random.default_rng(seed)
    preset = SMD_PRESETS["kehl2006"]
    descent = replace(preset.descent, growth=np.inf)
    hessian = np.diag(rng.uniform(1, 3, 4)) + 0.3
    low, high = np.full(4, -0.5), np.full(4, 0.8)
    p, a, v, mu = rng.uniform(-0.4, 0.7, 4), rng.uniform(0.1, 0.4, 4), np.zeros(4), rng.uniform(1, 60, 4)
    state = smd_init(p, a, mu)
    for _ in range(6):
        g = hessian @ (p - [0.9, 0, -0.2, 0.3]) + 0.1 * rng.normal(size=4)
        state = smd_step(state, Evaluation(0.0, g, lambda x: hessian @ x, lambda: hessian), low, high, descent)
        hv = hessian @ v
        for k in range(4):
            a[k] *= max(0.5, 1 + mu[k] * v[k] * g[k])  # Eq. 18
            to = min(max(p[k] - a[k] * g[k], low[k]), high[k])  # Eq. 17, 22
            constrained = (p[k] - to) / a[k]  # Eq. 23
            v[k] = 0.3 * v[k] + a[k] * (constrained - 0.3 * hv[k])  # Eq. 19
            p[k] = to
        np.testing.assert_allclose(state.parameters, p)
        np.testing.assert_allclose(state.steps, a)
        np.testing.assert_allclose(state.trace, v)
    assert (preset.descent.average, preset.descent.iterations, preset.tolerance_m, preset.tolerance_deg) == (3, 40, 0.02, 2.0)
    assert preset.refine_share == 0.5


def test_the_descent_does_not_depend_on_the_units():
    """Degrees for radians, with step sizes learnt in degrees either way: the same path."""
    matrix, goal, wide = np.diag([1.0, 4.0]), np.array([0.3, -0.2]), np.full(2, np.inf)
    factor, chosen = np.degrees(1.0), SmdSettings(iterations=12, first_step=0.05, by_curvature=False)
    tight = np.full(2, 1e-9)
    _, radians = smd_run(quadratic(matrix, goal), np.zeros(2), (-wide, wide), tight, replace(chosen, reach=1e9), None, 1 / factor)
    scaled = quadratic(matrix / factor**2, goal * factor)
    _, degrees = smd_run(scaled, np.zeros(2), (-wide, wide), factor * tight, replace(chosen, reach=1e9), None, 1.0)
    np.testing.assert_allclose(degrees.path, factor * radians.path, rtol=1e-6, atol=1e-9)
    _, fixed = smd_run(
        quadratic(matrix, goal), np.zeros(2), (-wide, wide), tight, replace(chosen, reach=1e9, meta_step=0.0), None, 1 / factor
    )
    assert np.linalg.norm(radians.path[-1] - goal) < 0.9 * np.linalg.norm(fixed.path[-1] - goal)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_along_the_curvatures_axes_the_descent_does_not_depend_on_the_parameters(seed):
    """Other parameters for the same thing: the same path, for step sizes that stay; and a step of one leads to the minimum."""
    rng = np.random.default_rng(seed)
    root, goal, start = rng.uniform(-1, 1, (4, 4)), rng.normal(size=4), np.zeros(4)
    mixed = np.eye(4) + 0.2 * rng.uniform(-1, 1, (4, 4))
    matrix, wide, tight = 0.1 * (root @ root.T + np.eye(4)), np.full(4, np.inf), np.full(4, 1e-2)
    chosen = SmdSettings(first_step=0.4, iterations=6, meta_step=0.0, damping=0.0, reach=1e9)
    other = np.linalg.inv(mixed)
    _, one = smd_run(quadratic(matrix, goal), start, (-wide, wide), tight, chosen)
    _, two = smd_run(quadratic(other.T @ matrix @ other, mixed @ goal), start, (-wide, wide), tight, chosen)
    np.testing.assert_allclose(two.path @ other.T, one.path, atol=1e-3)
    _, quick = smd_run(quadratic(matrix, goal), start, (-wide, wide), tight, replace(chosen, first_step=1.0))
    np.testing.assert_allclose(quick.path[1], goal, atol=1e-3)


def test_axes_make_the_curvature_the_unit_matrix_group_by_group():
    root = np.random.default_rng(4).normal(size=(5, 8))
    matrix, groups = root @ root.T, [np.array([0, 3]), np.array([1, 2])]
    axes = curvature_axes(matrix, groups, np.full(5, 1.0), 0.0)
    product = axes.T @ matrix @ axes
    for group in groups:
        np.testing.assert_allclose(product[np.ix_(group, group)], np.eye(2), atol=1e-3)
    np.testing.assert_array_equal(axes[4], np.eye(5)[4])
    assert not axes[np.ix_(groups[0], groups[1])].any()
    assert np.isfinite(curvature_axes(np.zeros((5, 5)), groups, np.full(5, 0.02), 0.1)).all()


def test_the_average_of_the_last_states_is_nearer_than_the_last():
    """Every gradient is off by chance; what is found is the mean of the states that the moving average is over."""
    goal, wide, tight, errors = np.array([0.3, -0.2]), np.full(2, np.inf), np.full(2, 1e-6), []
    for seed in range(60):
        rng = np.random.default_rng(seed)

        def objective(at, going, rng=rng):
            return Evaluation(0.0, at - goal + 0.3 * rng.normal(size=2), lambda v: v, lambda: np.eye(2))

        found, info = smd_run(objective, np.zeros(2), (-wide, wide), tight, SmdSettings(first_step=1.0, iterations=12, reach=1e9))
        np.testing.assert_allclose(found, info.path[-4:].mean(axis=0))
        errors.append([np.linalg.norm(found - goal), np.linalg.norm(info.path[-1] - goal)])
    averaged, last = np.mean(errors, axis=0)
    assert averaged < 0.7 * last


def test_limits_hold_and_the_constrained_gradient_leads_to_them():
    low, high = np.array([-1.0, -1.0]), np.array([0.05, 1.0])
    found = Evaluation(0.0, np.array([-1.0, -1.0]), lambda v: 0 * v, lambda: np.eye(2))
    state = smd_step(smd_init(np.zeros(2), np.full(2, 0.1), np.zeros(2)), found, low, high, SmdSettings())
    np.testing.assert_allclose(state.parameters, [0.05, 0.1])
    # Eq. 23: the trace is the change that was made, with its sign.
    np.testing.assert_allclose(state.trace, [-0.05, -0.1])
    goal = np.array([2.0, 0.5])
    at, _ = smd_run(
        quadratic(np.eye(2), goal), np.zeros(2), (low, high), np.full(2, 1e-6), SmdSettings(iterations=300, reach=1e5, first_step=0.5)
    )
    np.testing.assert_allclose(at, [0.05, 0.5], atol=1e-4)


def test_moving_average_decides():
    state = replace(smd_init(np.zeros(1), np.ones(1), np.zeros(1)), history=tuple(np.array([x]) for x in (0.0, 5.0, -5.0, 2.9)))
    assert converged(state, np.ones(1), SmdSettings(average=3))  # |2.9 - 0| / 3 below 1
    assert not converged(replace(state, history=state.history[:3]), np.ones(1), SmdSettings(average=3))
    late = replace(state, history=(*state.history[:3], np.array([3.1])))
    assert not converged(late, np.ones(1), SmdSettings(average=3))


def test_chains_together_are_the_chains_one_by_one():
    """Groups that share no term go the same way together as alone, and each stops by itself."""
    matrix = np.diag([1.0, 2.0, 5.0, 0.5])
    matrix[:2, :2] += 0.3
    goal, wide, groups = np.arange(4.0), np.full(4, np.inf), [np.array([0, 1]), np.array([2]), np.array([3])]
    chosen = SmdSettings(iterations=100, first_step=0.5, reach=20.0)
    together, info = smd_run(quadratic(matrix, goal), np.zeros(4), (-wide, wide), np.full(4, 0.01), chosen, groups)
    for group, count in zip(groups, info.iterations, strict=True):
        alone, one = smd_run(quadratic(matrix, goal), np.zeros(4), (-wide, wide), np.full(4, 0.01), chosen, [group])
        np.testing.assert_allclose(together[group], alone[group])
        assert one.iterations[0] == count
    assert len(set(info.iterations)) > 1


def test_colors_are_learnt_and_confine(tracker):
    state = state_of(np.random.default_rng(1), 0.1)
    posed = pose_body(tracker.body, state)
    points = placed(tracker, state)
    colors = np.where((tracker.grid.group == 2)[:, None], [80.0, 30.0, 0.0], [150.0, -20.0, 40.0])
    cloud = voxel_cloud(points)
    model = learn_colors(tracker.grid, posed, cloud, colors, ColorSettings())
    fits = color_fits(model, colors, ColorSettings())
    arm = tracker.grid.patch[(tracker.grid.solid == tracker.body.names.index("r_forearm"))][0]
    leg = tracker.grid.patch[(tracker.grid.solid == tracker.body.names.index("l_shank"))][0]
    np.testing.assert_array_equal(fits[arm], tracker.grid.group == 2)
    np.testing.assert_array_equal(fits[leg], tracker.grid.group != 2)
    darker = update_colors(model, tracker.grid, posed, cloud, colors - [10, 0, 0], ColorSettings(rate=0.3))
    known = np.isfinite(model.mean[:, 0])
    np.testing.assert_allclose(darker.mean[known, 0], model.mean[known, 0] - 3.0)
    assert color_fits(model, np.full((1, 3), np.nan), ColorSettings()).all()


def test_samples_of_some_groups_pull_as_they_do_among_all(tracker):
    """Without what stays, the gradient on the chains that still move is the same."""
    rng = np.random.default_rng(6)
    state, seen = state_of(rng, 0.2), seen_of(tracker, state_of(rng, 0.2))
    scene = make_cue_frame(tracker, seen, state[FREE])
    drawn = scene.draw(rng, trunk=False)
    wanted = np.array([False, False, True, False, False, True])
    fewer = draw_of_groups(drawn, tracker, wanted)
    assert len(fewer.surface) == 40
    assert len(fewer.strips) == len(drawn.strips) // 2
    gradients = [evaluation(*scene.match(state[FREE], one), 1.0).gradient for one in (drawn, fewer)]
    moving = np.concatenate([CHAINS[1], CHAINS[4]])
    np.testing.assert_allclose(gradients[1][moving], gradients[0][moving], rtol=1e-6, atol=1e-12)
    assert np.abs(gradients[0][CHAINS[2]] - gradients[1][CHAINS[2]]).max() > 1e-4


def seen_of(tracker, state):
    points = placed(tracker, state)
    images = images_of(tracker, state)
    views = stack_views(CAMERAS)
    return Skin(points, None, views, crop_images(views, images, points))


@pytest.mark.parametrize("optimiser", ["smd", "deterministic", "lm"])
def test_a_moved_body_is_found_again(tracker, optimiser):
    rng = np.random.default_rng(7)
    state = state_of(rng, 0.15)
    moved = state.copy()
    moved[FREE] += np.r_[0.04, -0.03, 0.02, 0.1 * rng.normal(size=21)]
    moved = np.clip(moved, tracker.body.skeleton.limits.low, tracker.body.skeleton.limits.high)
    one = replace(tracker, preset=replace(tracker.preset, optimiser=optimiser))
    seen, now = seen_of(tracker, state), track_init(moved)
    for _ in range(3):
        now, info = track_step(rng, one, replace(now, velocity=0 * now.velocity), seen)
    before, after = (
        np.linalg.norm(landmarks(tracker.body.skeleton, at) - landmarks(tracker.body.skeleton, state), axis=1).mean()
        for at in (moved, now.state)
    )
    assert info.status == "fitted"
    assert len(info.views) == 3
    # Samples that stay for the frame, and a descent that stops early, leave more of it.
    assert after < (0.5 if optimiser == "deterministic" else 0.35) * before
    assert np.all(now.state[6:9] == 0)


def test_the_same_numbers_for_the_same_seed(tracker):
    state = state_of(np.random.default_rng(8), 0.1)
    seen = seen_of(tracker, state)
    first, second = (track_step(np.random.default_rng(3), tracker, track_init(state), seen)[0].state for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_who_is_not_seen_stays(tracker):
    state = state_of(np.random.default_rng(9))
    after, info = track_step(np.random.default_rng(0), tracker, track_init(state), None)
    np.testing.assert_array_equal(after.state, state)
    assert info.status == "too little of the hull"


def test_a_lost_arm_is_found(tracker):
    """From an arm that hangs while it is raised: without the search it stays down."""
    state = state_of(np.random.default_rng(4), 0.0)
    state[dof_index("r_shoulder_x", "r_elbow_z")] = np.radians([5, 10])
    lost = state.copy()
    lost[dof_index("r_shoulder_x")] = np.radians(85)
    seen = seen_of(tracker, state)
    off = {}
    for rescue in (tracker.preset.rescue, None):
        preset = replace(tracker.preset, rescue=rescue, cues=CueSettings(edge_weight=0.0, colors=None, voxel_points=0))
        now = track_init(lost)
        for k in range(4):
            now, _ = track_step(np.random.default_rng(k), replace(tracker, preset=preset), now, seen)
        places = [landmarks(tracker.body.skeleton, at)[8] for at in (now.state, state)]
        off[rescue is None] = float(np.linalg.norm(places[0] - places[1]))
    assert off[False] < 0.1 < off[True]


@settings(max_examples=8, deadline=None)
@given(st.floats(1.5, 2.0), st.floats(-3.1, 3.1), st.floats(0.9, 1.1))
def test_da_vinci_is_recognised_with_heading_and_arms(height, heading, arms):
    dimensions = dict(default_body(height).dimensions)
    from hmc.body.proportions import make_body

    for name in ("upper_arm", "forearm", "hand"):
        dimensions[name] *= arms
    one = make_tracker(make_body(dimensions), SMD_PRESETS["default"])
    state = neutral_state("sideways")
    state[dof_index("r_hip_x", "l_hip_x")] = np.radians([-14, 14])
    state[3] = heading
    points = placed(one, state)
    state[2] = -points[:, 2].min()
    found = find_da_vinci(placed(one, state), 0.02, 0.0)
    assert found is not None
    turn = (found.state[3] - heading + np.pi) % (2 * np.pi) - np.pi
    assert abs(turn) < np.radians(12)
    assert np.linalg.norm(landmarks(found.body, found.state) - landmarks(one.body.skeleton, state), axis=1).mean() < 0.08


def test_other_poses_are_not_da_vincis(tracker):
    state = neutral_state("down")
    state[2] = 0.95
    assert find_da_vinci(placed(tracker, state), 0.02, 0.0) is None


def test_without_voxels_at_the_soles_nobody_is_da_vinci(tracker):
    """The feet tell which way he faces."""
    state = neutral_state("sideways")
    state[dof_index("r_hip_x", "l_hip_x")] = np.radians([-14, 14])
    state[2] = -placed(tracker, state)[:, 2].min()
    points = placed(tracker, state)
    assert find_da_vinci(points, 0.02, 0.0) is not None
    assert find_da_vinci(points[points[:, 2] > 0.1], 0.02, 0.0) is None


def test_chains_and_trunk_share_nothing():
    assert all((chain >= 6).all() for chain in CHAINS)


@pytest.mark.slow
def test_who_does_not_stand_like_da_vinci_is_found_by_the_spectral_route(monkeypatch):
    """The tiny recording begins with arms down: the first pose comes from the voxels' skeleton, and is followed from there.

    Which leg is the left one takes half a second of walking.
    """
    recording = open_recording(TINY, frames=8)
    truth = read_joints(TINY / "truth" / "joints.csv").of(0)
    tracks = TrackTable(truth.frames[:8], np.zeros(8, int), truth.positions[:8, 0])
    asked = []

    def spy(*args, **kwargs):
        asked.append(args[2])
        return spectral_poses(*args, **kwargs)

    monkeypatch.setattr("hmc.pose.starts.candidates.spectral_poses", spy)
    found = follow(recording, tracks, smd_method(SMD_PRESETS["default"]), FollowOptions(0.04, height_m=1.76))
    assert asked
    assert found.notes == ()
    error = np.linalg.norm(found.poses.positions - truth.positions[:8], axis=2)
    assert error.mean() < 0.05
