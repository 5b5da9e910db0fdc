"""Pictures and videos of a result: what is drawn stands where an independent projection puts it, and odd input is survived."""

from __future__ import annotations

import shutil
from functools import partial

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.body.flesh import flesh_points, place_points
from hmc.body.joints import DOF_NAMES, SEGMENTS
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import look_at
from hmc.cli import main
from hmc.errors import InputError
from hmc.io.calibration import write_calibration
from hmc.io.keypoints import KEYPOINTS, write_openpose
from hmc.io.recording import open_recording
from hmc.io.results import PoseStates, PoseTable, TrackTable, read_pose, write_joints, write_pose, write_run, write_tracks
from hmc.landmarks import landmark_index
from hmc.motion.trajectory import read_trajectories
from hmc.view.mosaic import make_layout, people_in, read_result, stream_mosaics
from hmc.view.overlay import LEFT, RIGHT, draw_keypoints, draw_outline, draw_paths, draw_sticks, draw_track, person_color
from hmc.view.scene import BACKGROUND, draw_floor, draw_rig, draw_voxels, from_above, viewpoint
from hmc.voxels.grid import VoxelGrid

FRAMES = 3


def cv2_pixels(camera, points: np.ndarray) -> np.ndarray:
    uv, _ = cv2.projectPoints(points.reshape(-1, 1, 3), camera.rotation, camera.translation, camera.matrix, camera.distortions)
    return uv.reshape(-1, 2)


def standing(height_m: float = 1.75):
    body = default_body(height_m)
    state = neutral_state("sideways", body.limits)
    state[2] = 0.95
    return body, state, landmarks(body, state)


@pytest.fixture(scope="module")
def recording(tmp_path_factory, ring):
    """A body of white points before grey walls, with ready-made silhouettes; the second image of the second camera is damaged."""
    folder = tmp_path_factory.mktemp("view") / "recording"
    body, state, _ = standing()
    flesh = flesh_points(body, 0.02)
    points = place_points(*segment_transforms(body, state), flesh.points, flesh.segment)
    folder.mkdir()
    write_calibration(folder / "calibration.toml", ring)
    for camera in ring:
        mask = np.zeros(camera.size[::-1], np.uint8)
        for u, v in cv2_pixels(camera, points):
            cv2.circle(mask, (round(u), round(v)), 2, 255, -1)
        for kind in ("images", "silhouettes"):
            (folder / kind / camera.name).mkdir(parents=True)
        for index in range(FRAMES):
            cv2.imwrite(str(folder / "silhouettes" / camera.name / f"{index:06d}.png"), mask)
            cv2.imwrite(str(folder / "images" / camera.name / f"{index:06d}.png"), np.repeat(90 + mask[..., None] // 3, 3, axis=2))
    (folder / "images" / "cam_01" / "000001.png").write_bytes(b"damaged")
    (folder / "recording.toml").write_text('name = "tiny"\nfps = 20\nroom = [[-1.2, -1.2, 0.0], [1.2, 1.2, 2.0]]\n')
    return folder


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("view") / "result"
    body, state, points = standing()
    frames, persons = np.arange(FRAMES), np.zeros(FRAMES, int)
    write_joints(folder / "joints.csv", PoseTable(frames, persons, np.repeat(points[None], FRAMES, axis=0)))
    write_tracks(folder / "tracks.csv", TrackTable(frames, persons, np.tile([0, 0, 0.95], (FRAMES, 1))))
    write_pose(folder / "pose.npz", PoseStates(frames, persons, np.tile(state, (FRAMES, 1)), DOF_NAMES, {0: body.dimensions}))
    return folder


def test_bodies_from_before_the_trunk_bent_are_drawn_as_they_were(result, tmp_path):
    shutil.copytree(result, tmp_path / "old")
    now = read_pose(result / "pose.npz")
    then = dict.fromkeys(("lumbar", "collar", "pelvis_flesh_forward", "arms_longer_left", "legs_longer_left"), 0.0)
    lengths = {name: value for name, value in now.bodies[0].items() if name not in then}
    write_pose(tmp_path / "old" / "pose.npz", PoseStates(now.frames, now.persons, now.states[:, :27], DOF_NAMES[:27], {0: lengths}))
    old = read_result(tmp_path / "old")
    assert old.states is not None and old.bodies[0].dimensions == old.bodies[0].dimensions | then
    assert {SEGMENTS[k].name for k in old.bodies[0].cones.segment}.isdisjoint({"chest", "l_clavicle", "r_clavicle"})
    np.testing.assert_allclose(landmarks(old.bodies[0], old.states.states[0]), standing()[2], atol=1e-9)


@pytest.mark.parametrize("value", [np.ones(2), np.ones((1, 1)), np.array(-1.0)])
def test_bodies_that_are_none_are_told_with_their_file(result, tmp_path, value):
    shutil.copytree(result, tmp_path / "odd")
    now = read_pose(result / "pose.npz")
    write_pose(
        tmp_path / "odd" / "pose.npz", PoseStates(now.frames, now.persons, now.states, now.dof_names, {0: now.bodies[0] | {"head": value}})
    )
    for read in (read_result, partial(read_trajectories, fps=30.0)):
        with pytest.raises(InputError, match=r"odd/pose\.npz: body dimension 'head'"):
            read(tmp_path / "odd")


@pytest.mark.parametrize("number", range(5))
def test_sticks_have_their_colors_where_opencv_projects_the_limbs(ring, number):
    camera = ring[number].scaled(4)
    image = np.zeros((*camera.size[::-1], 3), np.uint8)
    _, _, points = standing()
    draw_sticks(image, camera, points, 0)
    for a, b, color in [
        ("l_elbow", "l_wrist", LEFT),
        ("r_elbow", "r_wrist", RIGHT),
        ("l_knee", "l_ankle", LEFT),
        ("r_knee", "r_ankle", RIGHT),
    ]:
        # From somewhere along the bone: limbs may cross in an image, but not all along.
        middles = points[landmark_index(a)] + np.linspace(0.2, 0.8, 7)[:, None] * (points[landmark_index(b)] - points[landmark_index(a)])
        found = [tuple(image[round(v), round(u)].tolist()) for u, v in cv2_pixels(camera, middles)]
        assert color in found


def test_missing_landmarks_and_points_behind_the_camera_draw_nothing(ring):
    camera = ring[0]
    image = np.zeros((*camera.size[::-1], 3), np.uint8)
    draw_sticks(image, camera, np.full((15, 3), np.nan), 0)
    draw_track(image, camera, np.full(3, np.nan), 0)
    _, _, points = standing()
    draw_sticks(image, camera, points + 5 * (camera.centre - np.array([0, 0, 0.9])), 0)
    assert not image.any()
    one = points.copy()
    one[landmark_index("l_wrist")] = np.nan
    draw_sticks(image, camera, one, 0)
    assert image.any()


def test_a_chain_is_interrupted_where_it_is_not_seen(ring):
    camera = ring[0].scaled(4)
    chain = np.linspace([0, -1, 0.9], [0, 1, 0.9], 41)
    chain[18:23] = np.nan
    image = np.zeros((*camera.size[::-1], 3), np.uint8)
    draw_paths(image, camera, chain, (255, 255, 255), 1)
    lit = [image[round(v), round(u)].any() for u, v in cv2_pixels(camera, np.linspace([0, -1, 0.9], [0, 1, 0.9], 41))]
    assert all(lit[:18]) and all(lit[23:]) and not any(lit[19:22])


@pytest.mark.parametrize("number", [0, 2])
def test_the_outline_goes_around_the_flesh(ring, number):
    camera = ring[number].scaled(4)
    body, state, _ = standing()
    image = np.zeros((*camera.size[::-1], 3), np.uint8)
    draw_outline(image, camera, body, state, 0)
    line = image.any(axis=2)
    filled = cv2.morphologyEx(line.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    outside = cv2.floodFill(filled, None, (0, 0), 2)[1] == 2
    flesh = flesh_points(body, 0.03)
    uv = cv2_pixels(camera, place_points(*segment_transforms(body, state), flesh.points, flesh.segment)).round().astype(int)
    assert not outside[uv[:, 1], uv[:, 0]].any()
    # And near it: away from the flesh by more than the line, nothing is inside.
    mask = np.zeros(line.shape, np.uint8)
    mask[uv[:, 1], uv[:, 0]] = 1
    assert (outside | cv2.dilate(mask, np.ones((31, 31), np.uint8)).astype(bool)).all()


@settings(max_examples=40, deadline=None)
@given(st.tuples(*[st.floats(-5, 5)] * 3), st.tuples(*[st.floats(0.2, 8)] * 3), st.sampled_from([(640, 480), (300, 700), (960, 360)]))
def test_the_viewpoint_has_the_box_in_view_and_no_more(low, extent, size):
    bounds = np.stack([np.array(low), np.add(low, extent)])
    camera = viewpoint(bounds, size)
    corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    share = np.abs(cv2_pixels(camera, corners) - (np.array(size) - 1) / 2) / (np.array(size) / 2)
    assert share.max() == pytest.approx(0.94, abs=1e-6)


def test_voxels_are_drawn_where_they_are_and_the_nearer_one_hides_the_other():
    camera = look_at("view", (200, 200), [0, -3, 0.5], [0, 0, 0.5], 40)
    grid = VoxelGrid(np.array([-0.05, -1.0, 0.45]), 0.1, (1, 20, 1))
    pictures = []
    for chosen in ([3], [15], [3, 15]):
        occupied = np.zeros(grid.shape, bool)
        occupied[0, chosen, 0] = True
        image = np.zeros((200, 200, 3), np.uint8)
        draw_voxels(image, camera, grid, occupied)
        pictures.append(image)
    near, far, both = (picture.any(axis=2) for picture in pictures)
    rows, columns = np.nonzero(near)
    width = camera.matrix[0, 0] * 0.1 / 2.35  # of a cube 10 cm wide at that depth
    assert abs(rows.mean() - 99.5) < 1 and abs(columns.mean() - 99.5) < 1
    assert width <= np.ptp(columns) + 1 <= 1.2 * width + 2
    assert far.sum() < near.sum() and (both == near).all()
    np.testing.assert_array_equal(pictures[2], pictures[0])
    draw_voxels(image, camera, grid, np.zeros(grid.shape, bool))
    np.testing.assert_array_equal(image, pictures[2])


def test_floor_and_cameras_show_up_in_the_panel(ring):
    room = np.array([[-1.2, -1.2, 0.0], [1.2, 1.2, 2.0]])
    camera = viewpoint(np.array([[-4, -4, 0], [4, 4, 2.5]]), (600, 500))
    image = np.full((500, 600, 3), BACKGROUND, np.uint8)
    draw_floor(image, camera, room)
    after_floor = image.copy()
    for u, v in cv2_pixels(camera, np.array([[0, 0, 0], [1.2, -1.2, 0], [-1.2, 0.0, 0]])):
        assert (image[round(v), round(u)] != BACKGROUND).any()
    draw_rig(image, camera, ring)
    for u, v in cv2_pixels(camera, ring.centres):
        around = np.s_[round(v) - 2 : round(v) + 3, round(u) - 2 : round(u) + 3]
        assert (image[around] != after_floor[around]).any()


@given(st.lists(st.tuples(st.integers(64, 4000), st.integers(64, 4000)), min_size=1, max_size=12))
def test_the_layout_holds_every_camera_and_the_panel(sizes):
    layout = make_layout(sizes)
    width, height = layout.size
    assert width <= 1921 and height <= 1081 and width % 2 == 0 and height % 2 == 0
    left, top, panel_width, panel_height = layout.panel
    assert left + panel_width <= width and top + panel_height <= height
    assert panel_width >= layout.cell[0] and panel_height >= layout.cell[1]
    for k in range(len(sizes)):
        row, column = divmod(k, layout.columns)
        assert (column + 1) * layout.cell[0] <= width and (row + 1) * layout.cell[1] <= height
        assert (column + 1) * layout.cell[0] <= left or (row + 1) * layout.cell[1] <= top


def test_mosaics_show_people_voxels_and_a_missing_image(recording, result):
    opened = open_recording(recording)
    problems: list[str] = []
    mosaics = dict(stream_mosaics(opened, read_result(result), voxel_size_m=0.05, on_problem=problems.append))
    assert sorted(mosaics) == [0, 1, 2] and len({picture.shape for picture in mosaics.values()}) == 1
    bare = dict(stream_mosaics(opened, read_result(result), voxel_size_m=None, outlines=False, on_problem=problems.append))
    layout = make_layout(camera.size for camera in opened.rig)
    left, top, width, height = layout.panel
    panels = [shown[0][top : top + height, left : left + width] for shown in (mosaics, bare)]
    changed = (panels[0] != panels[1]).any(axis=2)
    assert changed.sum() > 300  # the voxels
    outlined = (mosaics[0] != bare[0]).any(axis=2)
    outlined[top:, left:] = False
    far = np.abs(mosaics[0][outlined].astype(int) - person_color(0)).max(axis=1)
    assert outlined.sum() > 100 and far.min() < 60  # thin lines are blended with what is below
    gap = mosaics[1][: layout.cell[1], layout.cell[0] : 2 * layout.cell[0]]
    assert np.ptp(gap.astype(int), axis=2).max() < 10  # grey, with grey words
    assert any("cam_01" in line for line in problems)


def test_people_come_from_whichever_table_has_them(result, tmp_path):
    person = people_in(read_result(result), 1)[0]
    assert person.landmarks is not None and person.body is not None and person.state is not None
    write_tracks(tmp_path / "tracks.csv", TrackTable(np.array([1]), np.array([4]), np.array([[0, 0, 1.0]])))
    only = people_in(read_result(tmp_path), 1)
    assert [person.number for person in only] == [4] and only[0].landmarks is None
    assert people_in(read_result(tmp_path), 0) == []


@pytest.mark.parametrize("place", [[2.5, -2.5, 2.3], [0.4, 0.1, 2.8], [-3.0, 0.2, 0.8]])
def test_a_track_is_the_outline_of_its_ellipsoid(place):
    camera = look_at("view", (640, 480), place, [0.1, 0.2, 0.7], 75)
    position = np.array([0.2, 0.1, 0.85])
    image = np.zeros((480, 640, 3), np.uint8)
    draw_track(image, camera, position, 2, 3.0)
    rows, columns = np.nonzero((image == person_color(2)).all(axis=2))
    # The image of a quadric is a conic: its dual is P Q* P^T (Hartley and Zisserman, section 8.3).
    to_world = np.eye(4)
    to_world[:3, 3] = position
    dual = camera.projection @ (to_world @ np.diag([0.3**2, 0.3**2, 0.85**2, -1]) @ to_world.T) @ camera.projection.T
    conic = np.linalg.inv(dual)
    pixels = np.stack([columns, rows, np.ones(len(rows))], axis=1)
    value, slope = np.einsum("ni,ij,nj->n", pixels, conic, pixels), 2 * pixels @ conic[:, :2]
    assert len(rows) > 60 and (np.abs(value) / np.linalg.norm(slope, axis=1)).max() < 3
    centre = dual[:2, 2] / dual[2, 2]
    angles = np.sort(np.arctan2(rows - centre[1], columns - centre[0]))
    assert np.diff(angles, append=angles[0] + 2 * np.pi).max() < 0.5  # it goes all around


def test_the_view_from_above_is_a_plan(ring):
    room = np.array([[-2.0, -1.0, 0.0], [3.0, 2.0, 2.6]])
    camera = from_above(room, (500, 400))
    low, high, right, up = cv2_pixels(camera, np.array([[1, 1, 0], [1, 1, 1.8], [2, 1, 0], [1, 2, 0.0]]))
    a_metre = np.linalg.norm(right - low)
    assert right[0] - low[0] == pytest.approx(a_metre) and low[1] - up[1] == pytest.approx(a_metre)
    assert np.linalg.norm(high - low) < 0.1 * a_metre
    corners = cv2_pixels(camera, np.array([[x, y, z] for x in room[:, 0] for y in room[:, 1] for z in room[:, 2]]))
    assert (corners > 0).all() and (corners < (500, 400)).all()


def test_tracks_alone_are_shown_from_above(recording, tmp_path):
    write_tracks(tmp_path / "tracks.csv", TrackTable(np.array([0]), np.array([4]), np.array([[0.4, -0.3, 0.9]])))
    opened = open_recording(recording)
    ((_, picture),) = stream_mosaics(opened, read_result(tmp_path), first=0, last=1, voxel_size_m=None)
    left, top, width, height = make_layout(camera.size for camera in opened.rig).panel
    camera = from_above(opened.room, (width, height))
    for turn in np.radians([0, 90, 180, 270]):
        ((u, v),) = cv2_pixels(camera, np.array([0.4 + 0.3 * np.cos(turn), -0.3 + 0.3 * np.sin(turn), 0.9]))
        around = picture[top + round(v) - 3 : top + round(v) + 4, left + round(u) - 3 : left + round(u) + 4]
        assert (around == person_color(4)).all(axis=2).any()


def test_a_person_who_could_not_be_fitted_is_an_ellipsoid(result, tmp_path):
    for name in ("tracks.csv", "pose.npz"):
        (tmp_path / name).write_bytes((result / name).read_bytes())
    write_joints(tmp_path / "joints.csv", PoseTable(np.arange(FRAMES), np.zeros(FRAMES, int), np.full((FRAMES, 15, 3), np.nan)))
    (person,) = people_in(read_result(tmp_path), 1)
    assert person.landmarks is None and person.state is None and person.position is not None


def test_view_writes_pictures_and_videos(recording, result, tmp_path, capsys):
    arguments = ["view", str(result), str(recording), "--quiet", "--voxel", "0.06"]
    assert main([*arguments, "--out", str(tmp_path / "new" / "one.png")]) == 0
    assert capsys.readouterr().out == f"wrote {tmp_path / 'new' / 'one.png'}\n"
    one = cv2.imread(str(tmp_path / "new" / "one.png"))
    assert main([*arguments, "--out", str(tmp_path / "two.png"), "--frame", "0", "1"]) == 0
    two = cv2.imread(str(tmp_path / "two.png"))
    assert two.shape == (2 * one.shape[0], *one.shape[1:])
    assert main([*arguments, "--out", str(tmp_path / "all.mp4"), "--start", "1", "--cameras", "cam_00,cam_03"]) == 0
    video = cv2.VideoCapture(str(tmp_path / "all.mp4"))
    frames = [video.read()[1] for _ in range(3)]
    assert frames[1] is not None and frames[2] is None and video.get(cv2.CAP_PROP_FPS) == pytest.approx(20)
    video.release()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.mp4", "new", "two.png"]
    among = recording / "images" / "cam_00" / "view.png"  # it would be a frame
    assert main([*arguments, "--out", str(among)]) == 2
    assert "the recording's own files" in capsys.readouterr().err and not among.exists()


def test_a_video_shows_the_frames_of_the_run(recording, result, tmp_path):
    for path in result.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    write_run(tmp_path / "run.toml", "x", {"start": 1, "frames": 1}, 0)
    for asked, n in (([], 1), (["--start", "0"], 2), (["--frames", "1"], 1)):
        assert main(["view", str(tmp_path), str(recording), "--quiet", "--no-voxels", "--out", str(tmp_path / "x.avi"), *asked]) == 0
        video = cv2.VideoCapture(str(tmp_path / "x.avi"))
        assert [video.read()[0] for _ in range(n + 1)] == [True] * n + [False]
        video.release()


def test_a_result_of_another_recording_is_told(recording, result, tmp_path, capsys):
    for path in result.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    for made, told in ((tmp_path / "elsewhere" / recording.name, False), (tmp_path / "other_take", True)):
        write_run(tmp_path / "run.toml", "x", {}, 0, recording=made)
        assert main(["view", str(tmp_path), str(recording), "--quiet", "--no-voxels", "--out", str(tmp_path / "x.png")]) == 0
        assert (f"the result was made from {made}" in capsys.readouterr().err) == told


def test_a_result_of_nobody_shows_the_room(recording, tmp_path):
    write_joints(tmp_path / "joints.csv", PoseTable(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 15, 3))))
    assert main(["view", str(tmp_path), str(recording), "--quiet", "--no-voxels", "--out", str(tmp_path / "x.png")]) == 0
    assert cv2.imread(str(tmp_path / "x.png")) is not None


def test_wrong_input_is_one_line_and_exit_code_2(recording, result, tmp_path, capsys):
    for arguments, says in [
        ([str(result), str(recording), "--out", "x.gif"], "x.gif: must end in .png"),
        ([str(result), str(recording), "--out", "x.mp4", "--frame", "1"], "--frame is for pictures"),
        ([str(result), str(recording), "--out", "x.png", "--frame", "7"], "frame 7 is not among the selected frames 0 to 2"),
        ([str(tmp_path / "none"), str(recording), "--out", "x.png"], "none: no such folder"),
        ([str(result), str(recording), "--no-voxels", "--out", str(result / "joints.csv" / "x.png")], "x.png: cannot be written"),
        ([str(result), str(recording), "--no-voxels", "--out", str(result / "joints.csv" / "x.mp4")], "x.mp4: cannot be written"),
        ([str(tmp_path), str(recording), "--out", "x.png"], "neither joints.csv nor tracks.csv"),
    ]:
        assert main(["view", "--quiet", *arguments]) == 2
        captured = capsys.readouterr()
        assert says in captured.err and captured.err.count("\n") == 1


def test_keypoints_are_crosses_of_their_side():
    image = np.zeros((60, 80, 3), np.uint8)
    points = np.full((1, len(KEYPOINTS), 3), (np.nan, np.nan, 0.0))
    at = {"l_wrist": (20, 30), "r_wrist": (60, 30), "nose": (40, 10)}
    for name, place in at.items():
        points[0, KEYPOINTS.index(name)] = *place, 0.8
    points[0, KEYPOINTS.index("l_hip")] = 1e12, 3, 0.9  # as far off as no picture is
    draw_keypoints(image, points)
    for name, color in (("l_wrist", LEFT), ("r_wrist", RIGHT), ("nose", (255, 255, 255))):
        x, y = at[name]
        assert np.abs(image[y, x].astype(int) - color).max() < 30
        assert image[y + 2, x + 2].any() and not image[y, x + 6].any()
    before = image.copy()
    draw_keypoints(image, np.zeros((0, len(KEYPOINTS), 3)))
    assert (image == before).all()


def test_keypoints_of_a_recording_are_drawn_unless_they_are_left_out(recording, result, tmp_path):
    folder = tmp_path / "recording"
    shutil.copytree(recording, folder)
    camera = open_recording(folder).rig[0]
    people = np.full((1, len(KEYPOINTS), 3), (np.nan, np.nan, 0.0))
    people[0, KEYPOINTS.index("l_wrist")] = 30, 20, 0.9
    for frame in range(FRAMES):
        write_openpose(folder / "keypoints", camera.name, frame, people)
    pictures = []
    for name, more in (("with", []), ("without", ["--no-keypoints"])):
        out = tmp_path / f"{name}.png"
        assert main(["view", str(result), str(folder), "--out", str(out), "--no-voxels", "--frame", "0", "--quiet", *more]) == 0
        pictures.append(cv2.imread(str(out)))
    changed = np.argwhere((pictures[0] != pictures[1]).any(axis=2))
    layout = make_layout(one.size for one in open_recording(folder).rig)
    factor = min(layout.cell[0] / camera.size[0], layout.cell[1] / camera.size[1])
    expected = (np.array([20, 30]) + 0.5) * factor - 0.5
    assert len(changed)
    np.testing.assert_allclose(changed.mean(axis=0), expected + [(layout.cell[1] - round(camera.size[1] * factor)) // 2, 0], atol=1.5)
