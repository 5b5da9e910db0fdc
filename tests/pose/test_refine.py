"""Local refinement: residuals and their derivatives against the cost and finite differences, and recovery of rendered people's poses."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose
from posed import COST, body_of, crossed_arms, mean_error, true_state, with_cylinders

from hmc.body.joints import N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.penetration import axis_points
from hmc.pose.objectives.residuals import residual_rows
from hmc.pose.objectives.symmetric import BodyPoints, Symmetric, SymmetricSettings, thinned
from hmc.pose.steps.refine import RefineSettings, refine, refine_all, refine_best
from hmc.pose.views.rays import points_to_cover

GROUPS = ("outside", "uncovered", "depth", "posture")


@pytest.fixture(scope="module", params=[0.0, 0.7], ids=["hull", "rays"])
def scene(request):
    """A person who gestures: body, its points, frame, what is to be covered, the true state."""
    return who_gestures(act("gesture"), request.param)


@pytest.fixture(scope="module", params=[0.0, 0.7], ids=["hull", "rays"])
def fine_scene(request):
    """The same in voxels of 2 cm."""
    return who_gestures(act("gesture", voxel_m=0.02), request.param)


def who_gestures(acted, rays: float):
    body, points = body_of(acted.height_m)
    hull = points_to_cover(np.random.default_rng(0), acted.targets[0], 600, rays)
    return body, points, acted.targets[0], hull, true_state(body, acted)


def placed(state: np.ndarray, like: np.ndarray) -> np.ndarray:
    """A state moved to where another one stands."""
    out = state.copy()
    out[:6] = like[:6]
    return out


def groups(points: BodyPoints, hull: np.ndarray) -> dict[str, slice]:
    edges = np.cumsum([0, len(points.surface.points), len(hull), len(points.axes.points), N_DOF])
    return {name: slice(a, b) for name, a, b in zip(GROUPS, edges[:-1], edges[1:], strict=True)}


def smooth_derivatives(function, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Central differences, and which rows are free of kinks: two steps agree there."""
    measured = []
    for step in (1e-6, 3e-6):
        columns = [(function(state + step * unit) - function(state - step * unit)) / (2 * step) for unit in np.eye(N_DOF)]
        measured.append(np.stack(columns, axis=1))
    agree = np.abs(measured[0] - measured[1]).max(1) < 1e-6 + 1e-3 * np.abs(measured[0]).max(1)
    return measured[0], agree


def poses(scene) -> list[np.ndarray]:
    true = scene[-1]
    rng = np.random.default_rng(2)
    return [true + rng.normal(0, 0.1, N_DOF), placed(crossed_arms(), true) + rng.normal(0, 0.02, N_DOF)]


@pytest.mark.parametrize("pose", [0, 1], ids=["near", "arms crossed"])
def test_derivatives_are_exact_for_cylinders(scene, pose):
    body, points, target, hull, _ = scene
    body = with_cylinders(body)
    points = BodyPoints(points.surface, axis_points(body))
    state = poses(scene)[pose]
    _, jacobian = residual_rows(Symmetric(body, points, target, hull, COST).linearise(state))
    measured, smooth = smooth_derivatives(lambda s: residual_rows(Symmetric(body, points, target, hull, COST).linearise(s))[0], state)
    for name, rows in groups(points, hull).items():
        assert smooth[rows].mean() > 0.95
        fine = np.flatnonzero(smooth)
        fine = fine[(fine >= rows.start) & (fine < rows.stop)]
        exact = np.isclose(jacobian[fine], measured[fine], rtol=0, atol=1e-6 * max(1.0, np.abs(measured[fine]).max())).all(axis=1)
        # Past a flat end, the place of a ray that is nearest to the axis is not quite the nearest to the cylinder.
        assert exact.mean() > 0.7 if name == "uncovered" and hull[:, 3:].any() else exact.all(), name
        if name != "depth" or pose == 1:
            assert np.abs(measured[fine]).max() > 1e-4  # there was something to test


@pytest.mark.parametrize("pose", [0, 1], ids=["near", "arms crossed"])
def test_derivatives_for_flesh_point_the_right_way(scene, pose):
    """Elliptic and tapered cones may be treated as round and straight: descent needs the direction."""
    body, points, target, hull, _ = scene
    state = poses(scene)[pose]
    _, jacobian = residual_rows(Symmetric(body, points, target, hull, COST).linearise(state))
    measured, smooth = smooth_derivatives(lambda s: residual_rows(Symmetric(body, points, target, hull, COST).linearise(s))[0], state)
    for name, rows in groups(points, hull).items():
        fine = smooth[rows] & (np.linalg.norm(measured[rows], axis=1) > 1e-9)
        a, b = jacobian[rows][fine], measured[rows][fine]
        cosine = (a * b).sum(1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
        if cosine.size:
            assert np.quantile(cosine, 0.1) > 0.9 and np.median(cosine) > 0.97, name
            assert cosine.min() > (0.0 if hull[:, 3:].any() else 0.7), name
        assert not np.any(jacobian[rows][smooth[rows] & ~fine])  # what does not change has no derivative


@pytest.mark.parametrize("settings", [COST, SymmetricSettings(cap_m=0.08, uncovered_weight=0.4, overlap_weight=3.0, posture_weight=1e-4)])
def test_residuals_square_to_the_cost(fine_scene, settings):
    """The refinement interpolates the distance field, the particles take the nearest voxel: the same up to the voxel's size."""
    body, points, target, hull, true = fine_scene
    objective = Symmetric(body, points, target, hull, settings)
    for state in (true, *poses(fine_scene)):
        residuals, _ = residual_rows(objective.linearise(state))
        assert residuals @ residuals == pytest.approx(objective.cost(state[None])[0], rel=0.05)
        assert_allclose(objective.linearise(state).residuals, residuals, atol=1e-5)


def test_nothing_pulls_beyond_the_cap(scene):
    body, points, target, hull, true = scene
    far = true.copy()
    far[2] += 50.0
    residuals, jacobian = residual_rows(Symmetric(body, points, target, hull, COST).linearise(far))
    both = slice(0, len(points.surface.points) + len(hull))
    assert not jacobian[both].any()
    assert residuals[both] @ residuals[both] == pytest.approx((1 + COST.uncovered_weight) * COST.cap_m**2, rel=1e-6)


def test_hands_outside_cost_and_pull_no_more_than_their_own_cap(scene):
    body, points, target, hull, true = scene
    far = true.copy()
    far[2] += 50.0
    hands = points.surface.hand.mean()
    assert 0.01 < hands < 0.1
    for hand_cap_m in (0.0, 0.01):
        objective = Symmetric(body, points, target, hull, replace(COST, hand_cap_m=hand_cap_m))
        residuals, jacobian = residual_rows(objective.linearise(far))
        outside = slice(0, len(points.surface.points))
        assert not jacobian[outside].any()
        expected = (1 - hands) * COST.cap_m**2 + hands * hand_cap_m**2
        assert residuals[outside] @ residuals[outside] == pytest.approx(expected, rel=1e-6)
        rest = Symmetric(body, points, target, hull, COST).cost(far[None])[0] - objective.cost(far[None])[0]
        assert rest == pytest.approx(hands * (COST.cap_m**2 - hand_cap_m**2), rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_the_cost_never_rises_and_limits_hold(scene, seed):
    body, points, target, hull, true = scene
    start = true + np.random.default_rng(seed).normal(0, [0.1] * 3 + [0.4] * (N_DOF - 3))
    last = np.inf
    for iterations in (1, 2, 4, 8):
        state, info = refine(Symmetric(body, points, target, hull, COST), start, RefineSettings(iterations=iterations))
        assert np.all((state >= body.limits.low) & (state <= body.limits.high))
        assert info.cost_after <= info.cost_before and info.cost_after <= last
        assert info.evaluations >= 1
        residuals, _ = residual_rows(Symmetric(body, points, target, hull, COST).linearise(state))
        assert residuals @ residuals <= info.cost_after + 1e-12  # the rest is the hold on the start
        last = info.cost_after


def test_only_free_degrees_move(scene):
    body, points, target, hull, true = scene
    start = np.clip(true + np.random.default_rng(1).normal(0, 0.15, N_DOF), body.limits.low, body.limits.high)
    free = np.zeros(N_DOF, bool)
    free[dof_index("l_shoulder_x", "l_shoulder_z", "l_elbow_z")] = True
    state, info = refine(Symmetric(body, points, target, hull, COST), start, RefineSettings(), free=free)
    assert_allclose(state[~free], start[~free])
    assert np.abs(state[free] - start[free]).max() > 1e-3 and info.cost_after < info.cost_before
    state, info = refine(Symmetric(body, points, target, hull, COST), start, RefineSettings(), free=np.zeros(N_DOF, bool))
    assert_allclose(state, start)
    assert info.cost_after == info.cost_before


def test_a_strong_hold_keeps_the_pose(scene):
    body, points, target, hull, true = scene
    start = np.clip(true + np.random.default_rng(4).normal(0, 0.1, N_DOF), body.limits.low, body.limits.high)
    weak, _ = refine(Symmetric(body, points, target, hull, COST), start, RefineSettings(stay_weight=1e-7))
    strong, _ = refine(Symmetric(body, points, target, hull, COST), start, RefineSettings(stay_weight=10.0))
    assert np.abs(strong - start).max() < 0.01 * np.abs(weak - start).max()
    # The hold pulls to the anchor, where one is given.
    anchored, _ = refine(Symmetric(body, points, target, hull, COST), start, RefineSettings(iterations=40, stay_weight=10.0), anchor=true)
    assert np.abs(anchored - np.clip(true, body.limits.low, body.limits.high)).max() < 0.02


@pytest.mark.parametrize("motion", ["gesture", "walk"])
def test_displaced_poses_of_rendered_people_are_recovered(motion):
    """The hull is carved from silhouettes of a mesh: the pose nearest to the truth is found again from some way off."""
    acted = act(motion)
    body, points = body_of(acted.height_m)
    gains = []
    for frame in (0, 5):
        target = acted.targets[frame]
        true = true_state(body, acted, frame)
        rng = np.random.default_rng(frame)
        for _ in range(3):
            start = np.clip(true + rng.normal(0, [0.05] * 3 + [0.08] * 3 + [0.2] * (N_DOF - 6)), body.limits.low, body.limits.high)
            state, _ = refine(Symmetric(body, points, target, target.surface[::3], COST), start, RefineSettings(iterations=20))
            before, after = (mean_error(landmarks(body, s), acted.landmarks[frame]) for s in (start, state))
            gains.append((before, after))
    before, after = np.mean(gains, axis=0)
    assert before > 0.08
    assert after < 0.055 and after < 0.6 * before


def test_of_several_starts_the_best_goes_to_the_end(scene):
    body, points, target, hull, _ = scene
    near, far = poses(scene)
    settings = RefineSettings(iterations=12)
    alone, info = refine(Symmetric(body, points, target, hull, COST), near, settings)
    best, both = refine_best(Symmetric(body, points, target, hull, COST), [far, near], settings, trial_steps=4)
    assert_allclose(best, alone, atol=0.02)
    assert both.cost == pytest.approx(info.cost, rel=0.02) and both.evaluations > info.evaluations
    seen = []

    def stop_early(state, cost):
        seen.append((state, cost))
        return True

    left, given_up = refine_best(Symmetric(body, points, target, hull, COST), [far, near], settings, trial_steps=2, stop_early=stop_early)
    assert given_up.cost > info.cost and given_up.evaluations < both.evaluations
    np.testing.assert_array_equal(seen[0][0], left)
    assert seen[0][1] == pytest.approx(given_up.cost_after)


def test_starts_that_come_to_the_same_place_are_not_refined_twice(scene):
    body, points, target, hull, _ = scene
    near, far = poses(scene)
    settings = RefineSettings(iterations=12)
    alone = [refine(Symmetric(body, points, target, hull, COST), start, settings) for start in (near, far)]
    on_its_way = (near + alone[0][0]) / 2
    together = refine_all(Symmetric(body, points, target, hull, COST), [near, far, on_its_way], settings, trial_steps=4)
    for (state, info), (expected, expected_info) in zip(together, alone, strict=False):
        assert_allclose(state, expected, atol=0.02)
        assert info.cost == pytest.approx(expected_info.cost, rel=0.02)
    # The third comes to where the first one ended, and is left there.
    assert together[2][1].evaluations < together[0][1].evaluations
    assert np.linalg.norm(landmarks(body, together[2][0]) - landmarks(body, together[0][0]), axis=1).max() < 0.03


def test_thinned_points_cost_nearly_the_same(scene):
    body, points, target, hull, _ = scene
    few = thinned(points, 120)
    assert 80 < len(few.surface.points) < 180 and set(few.surface.segment) == set(points.surface.segment)
    states = np.stack(poses(scene))
    full, rough = (Symmetric(body, p, target, hull).cost(states) for p in (points, few))
    assert_allclose(rough, full, rtol=0.35)
