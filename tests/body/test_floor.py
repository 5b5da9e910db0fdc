"""The floor under the feet, and the loose hull that reaches down to it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import approx_fprime

from hmc.body.feet import foot_points
from hmc.body.flesh import flesh_points, place_points, surface_coordinates
from hmc.body.floor import AIR_M, HANG_M, SINK_M, STANDING_M, floor_gap, lowest_support, sole_places
from hmc.body.joints import N_DOF, SEGMENTS, dof_index
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.model import neutral_state
from hmc.body.proportions import canton_body, default_body, stature
from hmc.pose.objectives.residuals import residual_rows
from hmc.pose.objectives.symmetric import Symmetric, SymmetricSettings, body_points
from hmc.pose.steps.refine import RefineSettings, refine
from hmc.pose.views.hull_target import LOOSE_M, distance_at, make_target
from hmc.voxels.grid import VoxelGrid

BODY = default_body(1.8)
GRID = VoxelGrid(np.zeros(3), 0.05, (40, 40, 40))


def standing(pelvis_z):
    state = neutral_state()
    state[:3] = (1.0, 1.0, pelvis_z)
    return state


def leg_length():
    return sum(BODY.dimensions[name] for name in ("thigh", "shank", "ankle_height"))


@pytest.mark.parametrize(
    "lift, gap",
    [
        (0.0, 0.0),
        (HANG_M, 0.0),
        (HANG_M + 0.02, 0.02 / np.sqrt(1 + (0.02 / AIR_M) ** 2)),
        (HANG_M + 5e4, AIR_M),
        (-SINK_M, 0.0),
        (-0.3, -0.3 + SINK_M),
    ],
)
def test_gap_is_how_far_the_soles_are_off_the_floor_and_in_the_air_no_more_than_so_much(lift, gap):
    rotations, positions = segment_transforms(BODY, standing(0.2 + leg_length() + lift)[None])
    assert_allclose(floor_gap(BODY, rotations, positions, 0.2), [gap], atol=1e-11)


def test_lowest_of_soles_and_knees_carries():
    states = np.repeat(standing(1.0)[None], 3, axis=0)
    states[1, dof_index("l_hip_y", "l_knee_y")] = np.radians([-90, 90])  # the left foot is lifted
    states[2, dof_index("r_knee_y", "l_knee_y")] = np.radians(120)  # kneeling
    rotations, positions = segment_transforms(BODY, states)
    height, point, segment = lowest_support(BODY, rotations, positions)
    knee = 1.0 - BODY.dimensions["thigh"]
    assert_allclose(height, [1.0 - leg_length(), 1.0 - leg_length(), knee], atol=1e-12)
    assert_allclose(point[:, 2], height)
    assert [SEGMENTS[k].name[2:] for k in segment] == ["foot", "foot", "shank"] and SEGMENTS[segment[1]].name == "r_foot"


def test_a_foot_that_points_down_bears_on_its_ball_and_one_that_is_lifted_on_its_heel():
    states = np.repeat(standing(1.0)[None], 2, axis=0)
    states[0, dof_index("r_ankle_y")], states[1, dof_index("r_ankle_y", "l_ankle_y")] = np.radians(30), np.radians(-20)
    rotations, positions = segment_transforms(BODY, states)
    height, point, segment = lowest_support(BODY, rotations, positions)
    ankles = positions[np.arange(2), segment]  # a foot begins at its ankle
    assert [SEGMENTS[k].name[2:] for k in segment] == ["foot", "foot"] and SEGMENTS[segment[0]].name == "r_foot"
    assert point[0, 0] > ankles[0, 0] + 0.05 and point[1, 0] < ankles[1, 0]
    assert np.all(height < 1.0 - leg_length())


@pytest.mark.parametrize("height", [1.5, 1.2, 0.5])
def test_floor_row_against_finite_differences(height):
    box = np.argwhere(np.ones((4, 4, 8), bool)) + [18, 18, 12]
    target = make_target(GRID, box, box, None, 0.0)
    points = body_points(BODY, surface_coordinates(BODY, 60))
    objective = Symmetric(BODY, points, target, target.surface, SymmetricSettings(floor_weight=1.0))
    state = standing(height)
    state[dof_index("r_hip_y", "l_hip_y", "root_ry")] = (-0.3, 0.2, 0.1)
    row = -1 - N_DOF  # before the rows of the posture
    values, jacobian = residual_rows(objective.linearise(state))
    assert abs(values[row]) > 0.02
    for dof in range(N_DOF):
        step = np.zeros(N_DOF)
        step[dof] = 1e-6
        up, down = (residual_rows(objective.linearise(state + s))[0][row] for s in (step, -step))
        assert_allclose(jacobian[row, dof], (up - down) / 2e-6, atol=1e-6)


def test_hanging_costs_and_standing_does_not():
    box = np.argwhere(np.ones((4, 4, 8), bool)) + [18, 18, 12]
    with_floor, without = (make_target(GRID, box, box, None, floor) for floor in (0.0, None))
    points = body_points(BODY, surface_coordinates(BODY, 60))
    states = np.stack([standing(leg_length()), standing(leg_length() + 0.5)])
    extra = [Symmetric(BODY, points, target, box * 0.05).cost(states) for target in (with_floor, without)]
    gap = 0.5 - HANG_M
    assert_allclose(extra[0] - extra[1], [0, SymmetricSettings().floor_weight * gap**2 / (1 + (gap / AIR_M) ** 2)], atol=1e-9)


def test_who_jumps_is_where_the_hull_is():
    """Half a metre over the floor, of which nothing hides: the floor moves nobody by more than a centimetre."""
    grid = VoxelGrid(np.zeros(3), 0.03, (66, 66, 90))
    body = default_body(1.7)
    state = neutral_state()
    state[:3] = (1.0, 1.0, 0.5 + sum(body.dimensions[name] for name in ("thigh", "shank", "ankle_height")))
    flesh = flesh_points(body, 0.015)
    hull = np.unique(grid.index_of(place_points(*segment_transforms(body, state), flesh.points, flesh.segment)), axis=0)
    target = make_target(grid, hull, hull, None, 0.0)
    points = body_points(body, surface_coordinates(body, 300))
    found, _ = refine(Symmetric(body, points, target, target.surface), state, RefineSettings())
    assert np.linalg.norm(landmarks(body, found) - landmarks(body, state), axis=1).mean() < 0.01


def on_one_foot(feet):
    """An objective of somebody of whom these feet stand, and a pose with a lifted right foot."""
    box = np.argwhere(np.ones((4, 4, 8), bool)) + [18, 18, 12]
    target = replace(make_target(GRID, box, box, None, 0.0), standing=feet)
    points = body_points(BODY, surface_coordinates(BODY, 60))
    state = standing(leg_length() + 0.04)
    state[dof_index("r_hip_y", "r_knee_y", "r_ankle_y", "l_ankle_y")] = (-0.6, 0.7, 0.2, -0.1)
    return Symmetric(BODY, points, target, target.surface), state


def test_heel_and_ball_lie_between_the_ends_of_the_sole():
    states = np.random.default_rng(0).uniform(-0.5, 0.5, (5, N_DOF))
    soles, carriers = sole_places(BODY, *segment_transforms(BODY, states))
    ends = foot_points(BODY, states).reshape(5, 2, 2, 3)
    for foot in range(2):
        heel, toe = ends[:, foot, 0], ends[:, foot, 1]
        assert_allclose(soles[:, 2 * foot], heel + 0.1 * (toe - heel), atol=1e-12)
        assert_allclose(soles[:, 2 * foot + 1], heel + 0.75 * (toe - heel), atol=1e-12)
    assert [SEGMENTS[k].name for k in carriers] == ["l_foot", "l_foot", "r_foot", "r_foot"]


@pytest.mark.parametrize("feet", [(True, True, False, False), (False, False, False, True), (True,) * 4])
def test_feet_that_stand_cost_what_their_soles_are_off_the_floor(feet):
    objective, state = on_one_foot(feet)
    nobody, _ = on_one_foot((False,) * 4)
    heights = sole_places(BODY, *segment_transforms(BODY, state[None]))[0][0, np.array(feet), 2]
    off = [max(0.0, abs(height) - STANDING_M) for height in heights]
    assert max(off) > 0.02
    extra = objective.settings.standing_weight * sum(one**2 for one in off)
    assert_allclose(objective.cost(state[None]) - nobody.cost(state[None]), extra, rtol=1e-3)


@pytest.mark.parametrize("feet", [(False, True, False, False), (True,) * 4])
def test_the_pull_of_feet_that_stand_is_the_slope_of_what_they_cost(feet):
    objective, state = on_one_foot(feet)
    nobody, _ = on_one_foot((False,) * 4)

    def squares(one):
        residuals, jacobian = residual_rows(one.linearise(state))
        return 2 * jacobian.T @ residuals

    slope = approx_fprime(state, lambda x: float(extra_of(objective, nobody, x)), 1e-7)
    assert_allclose(squares(objective) - squares(nobody), slope, atol=1e-3 * np.abs(slope).max())


def extra_of(objective, nobody, state):
    one, other = (residual_rows(each.linearise(state))[0] for each in (objective, nobody))
    return one @ one - other @ other


def test_loose_hull_is_cheap_and_reaches_the_floor():
    trunk = np.argwhere(np.ones((4, 4, 8), bool)) + [18, 18, 20]
    loose = np.zeros(GRID.shape, bool)
    loose[18:22, 18:22, :20] = True
    target = make_target(GRID, trunk, trunk, loose, 0.0)
    inside = np.array([[1.0, 1.0, 0.3], [1.0, 1.0, 0.1]])
    assert_allclose(distance_at(target, inside), LOOSE_M, atol=1e-6)
    beside = np.array([[1.5, 1.0, 0.3]])
    assert distance_at(target, beside)[0] > 0.1
    hard = make_target(GRID, trunk, trunk, None, 0.0)
    assert (distance_at(hard, inside) > 0.1).all()


@pytest.mark.parametrize("floor_z", [0.0, 0.2])
def test_below_the_floor_hulls_say_what_they_say_right_above_it(floor_z):
    lowest = round(floor_z / 0.05)
    foot = np.argwhere(np.ones((4, 6, 3), bool)) + [18, 17, lowest]
    on_floor, in_air = (make_target(GRID, foot, foot, None, floor) for floor in (floor_z, None))
    beside = np.array([0.0, 0.1, 0.2])[:, None] * [1.0, 0, 0] + [1.05, 1.0, floor_z + 0.025]
    above = distance_at(on_floor, beside)
    assert above[0] == 0 and above[1] > 0.04
    for depth in (0.03, 0.1, 0.2):
        below = beside - [0, 0, depth]
        assert_allclose(distance_at(on_floor, below), above, atol=1e-6)
        assert distance_at(in_air, below)[0] > depth - 0.051


def test_stature_follows_the_lengths():
    assert stature(BODY.dimensions) == pytest.approx(1.8)
    assert stature(canton_body(1.7).dimensions) == pytest.approx(1.7)
    longer = BODY.dimensions | {name: 1.1 * BODY.dimensions[name] for name in ("trunk", "head", "thigh", "shank")}
    assert stature(longer) == pytest.approx(1.98)
