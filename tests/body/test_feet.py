"""Ends of the soles: of the fitted body, and true ones of rendered actors."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.body.feet import foot_points
from hmc.body.joints import DOF_NAMES, N_DOF, dof_index, mirror_state
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import SOLE_PITCH, canton_body, default_body, sole_ends
from hmc.io.results import PoseTable, read_joints, write_joints
from hmc.landmarks import FOOT_POINTS, landmark_index
from hmc.metrics.scores.feet import feet_errors
from hmc.metrics.scores.poses import evaluate_pose

BODY = default_body(1.75)
TINY = Path(__file__).parents[2] / "data" / "synthetic" / "tiny"


def test_soles_at_a_right_angle_to_the_shanks_are_flat_below_the_ankles_and_as_long_as_feet_are():
    state = neutral_state("down")
    state[dof_index("l_ankle_y", "r_ankle_y")] = SOLE_PITCH
    points, ankles = foot_points(BODY, state), landmarks(BODY, state)[[landmark_index("l_ankle"), landmark_index("r_ankle")]]
    assert_allclose(points[:, 2], np.repeat(ankles[:, 2], 2) - BODY.dimensions["ankle_height"])
    # Winter (2009), figure 4.1: a foot is .152 of the stature; shoes and the cut of the sole's ends aside.
    assert_allclose(points[1::2, 0] - points[::2, 0], 0.152 * 1.75, rtol=0.1)
    assert np.all(points[::2, 0] < ankles[:, 0]) and np.all(points[1::2, 0] > ankles[:, 0])


@given(st.integers(0, 2**32 - 1))
def test_feet_turn_about_the_ankle_as_scipy_turns_them(seed):
    state = neutral_state("down")
    y, z = np.random.default_rng(seed).uniform(-0.5, 0.5, 2)
    state[dof_index("l_ankle_y", "l_ankle_z")] = y, z
    ankle = landmarks(BODY, state)[landmark_index("l_ankle")]
    still = foot_points(BODY, neutral_state("down"))[:2] - ankle
    turn = Rotation.from_euler("YZ", [y, z]).as_matrix()
    assert_allclose(foot_points(BODY, state)[:2] - ankle, still @ turn.T, atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_a_mirrored_pose_has_mirrored_feet(seed):
    state = np.where([name.startswith(("r_", "l_")) for name in DOF_NAMES], np.random.default_rng(seed).normal(0, 0.3, N_DOF), 0.0)
    assert_allclose(foot_points(BODY, mirror_state(state)), foot_points(BODY, state)[[2, 3, 0, 1]] * (1, -1, 1), atol=1e-12)


def test_a_body_without_feet_has_none():
    assert np.isnan(foot_points(canton_body(1.75), np.zeros((2, N_DOF)))).all()
    assert sole_ends(canton_body(1.75).dimensions)[0] < 0


def test_a_table_of_feet_is_read_as_it_was_written(tmp_path):
    rng = np.random.default_rng(1)
    table = PoseTable(np.arange(5), np.zeros(5, int), rng.normal(size=(5, 4, 3)), rng.integers(0, 4, (5, 4)), names=FOOT_POINTS)
    write_joints(tmp_path / "feet.csv", table)
    again = read_joints(tmp_path / "feet.csv", FOOT_POINTS)
    assert again.names == FOOT_POINTS and again.of(0).names == FOOT_POINTS
    assert_allclose(again.positions, table.positions, atol=1e-6)
    assert_allclose(again.views, table.views)


def test_errors_are_those_of_people_who_were_matched_by_their_joints():
    truth = read_joints(TINY / "truth" / "joints.csv")
    feet = read_joints(TINY / "truth" / "feet.csv", FOOT_POINTS)
    off = np.array([[0.03, 0, 0], [0, 0.05, 0], [0.03, 0, 0], [0, 0.05, 0]])
    found = PoseTable(truth.frames, truth.persons + 7, truth.positions)
    moved = PoseTable(feet.frames, feet.persons + 7, feet.positions + off, names=FOOT_POINTS)
    persons = evaluate_pose(found, truth).persons
    scores = feet_errors(moved, feet, persons)
    assert scores["heels_mm"] == pytest.approx(30) and scores["toes_mm"] == pytest.approx(50)
    assert scores["heels"] == scores["toes"] == 2 * len(feet.frames)
    elsewhere = PoseTable(feet.frames + 1000, feet.persons + 7, feet.positions, names=FOOT_POINTS)
    assert feet_errors(elsewhere, feet, persons) == {}


def test_true_soles_are_on_the_floor_where_somebody_stands_and_feet_are_rigid_but_for_the_toes():
    joints, feet = read_joints(TINY / "truth" / "joints.csv"), read_joints(TINY / "truth" / "feet.csv", FOOT_POINTS)
    ankles = joints.positions[:, [landmark_index(f"{side}_ankle") for side in "llrr"]]
    reach = np.linalg.norm(feet.positions - ankles, axis=2)
    assert np.ptp(reach[:, [0, 2]], axis=0).max() < 1e-5  # the heel is rigid with the foot
    assert 0.15 < reach[:, [1, 3]].min() and reach[:, [1, 3]].max() < 0.25
    assert feet.positions[..., 2].min() > -0.01  # nobody is in the floor
    assert np.all(feet.positions[..., 2].min(axis=1) < 0.03)  # and who walks has one foot on it
