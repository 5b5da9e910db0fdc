"""Clinical angles: poses that SciPy's rotations turn by known angles, mirrored, moved, with gaps; the command; displays of a notebook."""

from dataclasses import replace
from xml.etree import ElementTree

import cv2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hmc.body.joints import dof_index
from hmc.cli import main
from hmc.errors import InputError
from hmc.io.door import read_image
from hmc.io.results import PoseTable, write_joints, write_pose
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.motion.clinical import CLINICAL_ANGLES, clinical_angles, doubtful_angles

FORWARD, LEFT, UP = np.eye(3)
FROM_LANDMARKS = [name for name in CLINICAL_ANGLES if not any(word in name for word in ("tilt", "ankle", "foot"))]
MIRROR = {name: {"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:] for name in FROM_LANDMARKS}
#: Angles of the middle that change their sign in a mirror.
ODD = ("pelvis_rotation_deg", "pelvis_obliquity_deg", "trunk_lateral_flexion_deg", "trunk_rotation_deg")

angle = st.floats(-40, 40)
bend = st.floats(20, 120)


def turn(axes, *degrees):
    return Rotation.from_euler(axes, degrees, degrees=True).as_matrix()


def stand(trunk=(0, 0, 0), pelvis=(0, 0), hip=None, shoulder=None, knee=40.0, elbow=50.0):
    """Landmarks, shape (15, 3), of a person who is turned joint by joint, by the conventions of ISB written with intrinsic rotations.

    Axes are ours: x forward, y left, z up; ISB's are x forward, y up, z right. A turn about ISB's z is one about our -y.
    """
    hip, shoulder = hip or {}, shoulder or {}
    at = {"pelvis": np.array([0.3, -0.2, 0.95])}
    carrier = turn("ZX", *pelvis)
    chest = carrier @ turn("YXZ", *trunk)
    at["neck"] = at["pelvis"] + chest @ (0.5 * UP)
    at["head_top"] = at["neck"] + chest @ (0.25 * UP)
    for side, sign in (("l", 1), ("r", -1)):
        flexion, adduction, inward = hip.get(side, (0, 0, 0))
        thigh = carrier @ turn("YXZ", -flexion, -sign * adduction, -sign * inward)
        at[f"{side}_hip"] = at["pelvis"] + carrier @ (0.09 * sign * LEFT)
        at[f"{side}_knee"] = at[f"{side}_hip"] - thigh @ (0.42 * UP)
        at[f"{side}_ankle"] = at[f"{side}_knee"] - thigh @ turn("Y", knee) @ (0.4 * UP)
        plane, elevation, inward = shoulder.get(side, (30, 40, 0))
        # Wu et al. (2005): about y, x and y of a right arm whose elevation is negative; a left arm is its mirror image.
        arm = Rotation.from_euler("YXY", [plane, -elevation, inward], degrees=True).as_matrix()
        isb = np.array([FORWARD, UP, -sign * -1 * LEFT])  # rows: axes forward, up and outward of this arm, in ours
        upper = isb.T @ arm @ [0, -1, 0]
        lower = isb.T @ arm @ Rotation.from_euler("Z", elbow, degrees=True).as_matrix() @ [0, -1, 0]
        at[f"{side}_shoulder"] = at["neck"] + chest @ (0.18 * sign * LEFT)
        at[f"{side}_elbow"] = at[f"{side}_shoulder"] + chest @ (0.3 * upper)
        at[f"{side}_wrist"] = at[f"{side}_elbow"] + chest @ (0.25 * lower)
    return np.array([at[name] for name in LANDMARKS])


def angles_of(points):
    return {name: float(values[0]) for name, values in clinical_angles(points[None]).items()}


def same(first, second):
    return abs((first - second + 180) % 360 - 180) < 1e-6


def test_what_landmarks_do_not_show_is_left_to_the_states():
    assert list(clinical_angles(np.zeros((2, 15, 3)))) == FROM_LANDMARKS


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(angle, angle, angle), st.tuples(st.floats(-179, 179), st.floats(-20, 20)), st.tuples(angle, angle, angle),
    st.tuples(st.floats(-80, 120), st.floats(20, 150), st.floats(-80, 80)), bend, bend,
)  # fmt: skip
def test_angles_are_those_by_which_it_was_turned(trunk, pelvis, hip, shoulder, knee, elbow):
    found = angles_of(stand(trunk, pelvis, {"l": hip}, {"r": shoulder}, knee, elbow))
    expected = {
        "pelvis_rotation": pelvis[0], "pelvis_obliquity": pelvis[1],
        "l_knee_flexion": knee, "r_knee_flexion": knee, "l_elbow_flexion": elbow, "r_elbow_flexion": elbow,
        "r_shoulder_plane_of_elevation": shoulder[0], "r_shoulder_elevation": shoulder[1], "r_shoulder_internal_rotation": shoulder[2],
        "l_shoulder_plane_of_elevation": 30, "l_shoulder_elevation": 40, "l_shoulder_internal_rotation": 0,
        "trunk_flexion": trunk[0], "trunk_lateral_flexion": trunk[1], "trunk_rotation": trunk[2],
        "l_hip_flexion": hip[0], "l_hip_adduction": hip[1], "l_hip_internal_rotation": hip[2],
        "r_hip_flexion": 0, "r_hip_adduction": 0, "r_hip_internal_rotation": 0,
    }  # fmt: skip
    assert {f"{name}_deg" for name in expected} == set(found)
    wrong = {name: (found[f"{name}_deg"], value) for name, value in expected.items() if not same(found[f"{name}_deg"], value)}
    assert not wrong


def test_positive_directions_in_plain_geometry():
    """Each stands by itself, without a matrix: which way something goes when its angle is positive."""
    at = {name: stand()[k] for k, name in enumerate(LANDMARKS)}

    def with_moved(**moved):
        return angles_of(np.array([at[name] + moved.get(name, np.zeros(3)) for name in LANDMARKS]))

    assert with_moved(l_knee=0.1 * FORWARD, l_ankle=0.1 * FORWARD)["l_hip_flexion_deg"] > 5
    assert with_moved(l_knee=-0.1 * LEFT, l_ankle=-0.1 * LEFT)["l_hip_adduction_deg"] > 5
    assert with_moved(r_knee=0.1 * LEFT, r_ankle=0.1 * LEFT)["r_hip_adduction_deg"] > 5
    # A bent shank that goes outwards turns the thigh inwards.
    assert with_moved(r_ankle=-0.1 * LEFT)["r_hip_internal_rotation_deg"] > 5
    assert with_moved(l_ankle=0.1 * LEFT)["l_hip_internal_rotation_deg"] > 5
    assert with_moved(l_hip=0.05 * UP)["pelvis_obliquity_deg"] > 5
    assert with_moved(neck=0.1 * FORWARD)["trunk_flexion_deg"] > 5
    assert with_moved(neck=-0.1 * LEFT)["trunk_lateral_flexion_deg"] > 5
    assert with_moved(l_shoulder=-0.05 * FORWARD, r_shoulder=0.05 * FORWARD)["trunk_rotation_deg"] > 5
    for side, outward in (("l", LEFT), ("r", -LEFT)):
        shoulder, elbow = f"{side}_shoulder", f"{side}_elbow"
        ahead = {elbow: at[shoulder] + 0.3 * FORWARD - at[elbow], f"{side}_wrist": at[shoulder] + [0.3, 0, 0.25] - at[f"{side}_wrist"]}
        found = with_moved(**ahead)
        assert found[f"{side}_shoulder_plane_of_elevation_deg"] == pytest.approx(90)
        assert found[f"{side}_shoulder_elevation_deg"] == pytest.approx(90)
        assert found[f"{side}_shoulder_internal_rotation_deg"] == pytest.approx(-90)
        sideways = {
            elbow: at[shoulder] + 0.3 * outward - at[elbow],
            f"{side}_wrist": at[shoulder] + 0.3 * outward - 0.25 * UP - at[f"{side}_wrist"],
        }
        found = with_moved(**sideways)
        assert found[f"{side}_shoulder_plane_of_elevation_deg"] == pytest.approx(0, abs=1e-9)
        assert found[f"{side}_shoulder_internal_rotation_deg"] == pytest.approx(90)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31))
def test_a_mirror_exchanges_left_and_right(seed):
    points = stand() + 0.05 * np.random.default_rng(seed).normal(size=(15, 3))
    other = [landmark_index({"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]) for name in LANDMARKS]
    found, mirrored = angles_of(points), angles_of((points * [1, -1, 1])[other])
    for name in FROM_LANDMARKS:
        value = -mirrored[MIRROR[name]] if name in ODD else mirrored[MIRROR[name]]
        assert np.isnan(found[name]) == np.isnan(value) and (np.isnan(value) or same(found[name], value)), name


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.floats(-180, 180), st.floats(-5, 5))
def test_where_a_person_is_and_faces_changes_only_the_rotation_of_the_pelvis(seed, yaw, shift):
    points = stand() + 0.05 * np.random.default_rng(seed).normal(size=(15, 3))
    found, moved = angles_of(points), angles_of(points @ turn("Z", yaw).T + shift)
    assert same(moved.pop("pelvis_rotation_deg"), found.pop("pelvis_rotation_deg") + yaw)
    for name, value in found.items():
        assert np.isnan(moved[name]) == np.isnan(value) and (np.isnan(value) or same(moved[name], value)), name


def test_what_is_missing_or_not_shown_is_empty():
    points = np.tile(stand(), (3, 1, 1))
    points[1, landmark_index("l_knee")] = np.nan
    found = clinical_angles(points)
    empty = {name for name, values in found.items() if np.isnan(values[1])}
    assert empty == {f"l_{name}_deg" for name in ("hip_flexion", "hip_adduction", "hip_internal_rotation", "knee_flexion")}
    assert all(np.isfinite(values[[0, 2]]).all() for values in found.values())

    straight = angles_of(stand(knee=14, elbow=14))
    assert {name for name, value in straight.items() if np.isnan(value)} == {name for name in FROM_LANDMARKS if "internal_rotation" in name}
    hanging = angles_of(stand(shoulder={"l": (30, 9, 0), "r": (30, 11, 0)}))
    assert {name for name, value in hanging.items() if np.isnan(value)} == {
        "l_shoulder_plane_of_elevation_deg", "l_shoulder_internal_rotation_deg",
    }  # fmt: skip
    on_the_side = angles_of(stand() @ turn("X", 85).T)
    assert all(np.isnan(on_the_side[name]) == ("pelvis" in name or "trunk" in name or "hip" in name) for name in FROM_LANDMARKS)
    with pytest.raises(InputError, match="positions"):
        clinical_angles(np.zeros((15, 3)))


def people_with_views():
    from test_exports import moving

    people = moving(n=12, persons=(0, 1))
    views = np.full(people.positions.shape[:2], 4.0)
    views[3, landmark_index("l_ankle")] = 1
    return replace(people, poses=replace(people.poses, views=views))


def test_tilt_and_feet_are_those_of_the_states():
    people = people_with_views()
    frame = people.clinical_angles()
    states = np.degrees(people.states.states)
    assert frame["pelvis_tilt_deg"].to_numpy() == pytest.approx(states[:, dof_index("root_ry")[0]])
    # The angle of the sole to the shank, by points on it and joint centres, of feet that are not turned out.
    still = replace(people, states=replace(people.states, states=people.states.states.copy()))
    still.states.states[:, dof_index("r_ankle_z", "l_ankle_z")] = 0
    sole, joints = still.feet.positions[:, 3] - still.feet.positions[:, 2], still.poses.positions
    shank = joints[:, landmark_index("r_knee")] - joints[:, landmark_index("r_ankle")]
    between = np.arccos((sole * shank).sum(axis=1) / np.linalg.norm(sole, axis=1) / np.linalg.norm(shank, axis=1))
    assert frame["r_ankle_dorsiflexion_deg"].to_numpy() == pytest.approx(90 - np.degrees(between), abs=1e-6)
    assert frame["r_foot_turning_out_deg"].to_numpy() == pytest.approx(-states[:, dof_index("r_ankle_z")[0]])
    turned = frame["l_foot_turning_out_deg"].to_numpy()
    assert np.flatnonzero(np.isnan(turned)).tolist() == [3]
    assert np.delete(turned, 3) == pytest.approx(np.delete(states[:, dof_index("l_ankle_z")[0]], 3))

    held = people.states.states.copy()
    held[:, dof_index("l_ankle_y", "l_ankle_z")] = 0
    frame = replace(people, states=replace(people.states, states=held)).clinical_angles()
    assert frame["l_ankle_dorsiflexion_deg"].isna().all() and frame["r_ankle_dorsiflexion_deg"].notna().all()


def write_result(people, folder):
    folder.mkdir()
    write_joints(folder / "joints.csv", people.poses)
    write_pose(folder / "pose.npz", people.states)


def test_the_command_writes_a_table_and_a_plot(tmp_path, capsys):
    people = people_with_views()
    write_result(people, tmp_path / "result")
    assert main(["angles", str(tmp_path / "result"), "--fps", "50", "--plot", str(tmp_path / "angles.png")]) == 0
    table = pd.read_csv(tmp_path / "result" / "clinical_angles.csv")
    assert list(table) == ["frame", "time_s", "person", *CLINICAL_ANGLES]
    # joints.csv has tenths of millimetres or better
    pd.testing.assert_frame_equal(table, people.clinical_angles(), check_dtype=False, atol=0.1)
    assert read_image(tmp_path / "angles.png").std() > 5
    assert main(["angles", str(tmp_path / "result"), "--fps", "50", "--person", "1", "--out", str(tmp_path / "one.csv")]) == 0
    assert set(pd.read_csv(tmp_path / "one.csv")["person"]) == {1}
    assert main(["angles", str(tmp_path / "result"), "--fps", "50", "--plot", str(tmp_path / "angles.jpg")]) == 2
    assert "a plot is one of" in capsys.readouterr().err


def test_plots_and_animations_of_a_notebook():
    people = people_with_views()
    figure = people.plot_angles(["knee_flexion", "pelvis_tilt"])
    assert [ax.get_title() for ax in figure.axes] == ["pelvis tilt", "knee flexion"]
    frame = people.clinical_angles()
    drawn = [line.get_ydata() for line in figure.axes[1].get_lines()[:4:2]]  # each is followed by its part that is sure
    own = frame[frame["person"] == 0]
    assert np.allclose(drawn[0], own["l_knee_flexion_deg"]) and np.allclose(drawn[1], own["r_knee_flexion_deg"])
    shown = cv2.imdecode(np.frombuffer(figure._repr_png_(), np.uint8), cv2.IMREAD_COLOR)  # a notebook without pyplot asks for this
    assert shown.std() > 5
    doubted = replace(people, poses=replace(people.poses, trust=np.where(people.frames[:, None] < 8, 0.5, np.ones(15))))
    figure = doubted.plot_angles(["knee_flexion"])
    assert len({line.get_linewidth() for line in figure.axes[0].get_lines() if len(line.get_xdata()) > 2}) == 1
    page = figure.bbox.width
    figure.draw_without_rendering()
    box = figure._supxlabel.get_window_extent()
    assert box.x0 >= 0 and box.x1 <= page  # the line below one narrow panel is not cut off
    with pytest.raises(InputError, match="no angle 'nose'"):
        people.plot_angles(["nose"])

    animation = people.animate(step=3)
    assert list(animation.new_frame_seq()) == [5, 8, 11, 14]
    assert "frame 14" not in animation._fig.axes[0].get_title()
    page = animation.to_jshtml()
    assert page.count("data:image/png;base64") == 4
    lines = animation._fig.axes[0].collections[0]
    assert len(lines._segments3d) == 2 * (len(LANDMARKS) - 1)
    frames = np.arange(1000)
    from hmc.view.motion_plots import animate_sticks

    long = animate_sticks(frames, frames * 0, np.tile(stand(), (1000, 1, 1)), 30.0)
    assert len(list(long.new_frame_seq())) == 250
    long._draw_was_started = True  # it is not to be drawn
    with pytest.raises(InputError, match="step"):
        people.animate(step=0)


def test_a_small_table_is_shown():
    people = people_with_views()
    people = replace(people, costs=np.full(len(people.costs), 8.437e-5))
    lines = repr(people).splitlines()
    assert lines[0] == "PosedPeople:" and len(lines) == 3
    assert lines[1].startswith("  person 0, frames 5–16, with a pose 12, stature (m) 1.71,")
    heads, *rows = [[cell.text for cell in row] for row in ElementTree.fromstring(people._repr_html_())]
    table = pd.DataFrame(rows, columns=heads)
    assert table["person"].tolist() == ["0", "1"] and table["with a pose"].tolist() == ["12", "12"]
    assert table["frames"].tolist() == ["5–16", "5–16"] and table["stature (m)"].tolist() == ["1.71", "1.71"]
    assert table["mean cost"].tolist() == ["8.44e-05", "8.44e-05"]
    assert table["mean views"].tolist() == ["3.98", "4.00"] and table["mean trust"].tolist() == ["–", "–"]


def test_angles_that_rest_on_doubtful_landmarks_are_told():
    """The left wrist of frame 1 alone is doubtful: the left elbow and the upper arm's rotation there, and nothing else."""
    trust = np.ones((2, 15))
    trust[1, landmark_index("l_wrist")] = 0.5
    poses = PoseTable(np.array([3, 4]), np.array([0, 0]), np.zeros((2, 15, 3)), np.full((2, 15), 3), trust=trust)
    table = {"frame": np.array([2, 3, 4]), "person": np.zeros(3, int)} | {name: np.zeros(3) for name in CLINICAL_ANGLES}
    told = {name: rows.tolist() for name, rows in doubtful_angles(table, poses).items() if rows.any()}
    assert told == {"l_elbow_flexion_deg": [False, False, True], "l_shoulder_internal_rotation_deg": [False, False, True]}
    # the other shoulder is in the chest's frame: all of both arms that is told in it, and the trunk's rotation
    trust[1] = np.where(np.arange(15) == landmark_index("r_shoulder"), 0.5, 1.0)
    told = [name for name, rows in doubtful_angles(table, poses).items() if rows.any()]
    arms = [name for name in CLINICAL_ANGLES if "shoulder" in name]
    assert sorted(told) == sorted(["trunk_rotation_deg", "r_elbow_flexion_deg", *arms])


def test_each_angle_has_the_least_trust_of_what_it_rests_on(tmp_path):
    people = people_with_views()
    assert not [name for name in people.clinical_angles() if name.endswith("_trust")]
    trust = np.full(people.positions.shape[:2], 0.95)
    trust[3, landmark_index("l_wrist")] = 0.4
    people = replace(people, poses=replace(people.poses, trust=trust))
    frame = people.clinical_angles()
    columns = [name.replace("_deg", "_trust") for name in CLINICAL_ANGLES]
    assert list(frame) == ["frame", "time_s", "person", *CLINICAL_ANGLES, *columns]
    low = {name for name in columns if (frame[name] == 0.4).any()}
    assert "l_elbow_flexion_trust" in low <= {"l_elbow_flexion_trust", "l_shoulder_internal_rotation_trust"}
    row = frame.index[(frame["person"] == people.persons[3]) & (frame["frame"] == people.frames[3])]
    assert (frame.index[frame["l_elbow_flexion_trust"] == 0.4] == row).all()
    for angle, column in zip(CLINICAL_ANGLES, columns, strict=True):  # empty together
        assert (frame[angle].isna() == frame[column].isna()).all(), angle
    smooth = people.smoothed().clinical_angles()[columns]  # its angles may be shown in other frames
    assert ((smooth == frame[columns]) | smooth.isna() | frame[columns].isna()).all(axis=None)
    write_result(people, tmp_path / "result")
    assert main(["angles", str(tmp_path / "result"), "--fps", "50"]) == 0
    written = pd.read_csv(tmp_path / "result" / "clinical_angles.csv")
    assert written["l_elbow_flexion_trust"].tolist() == frame["l_elbow_flexion_trust"].tolist()
