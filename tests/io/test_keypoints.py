"""Keypoints of other programs: every form is read alike, ordinary gaps are no errors, and what is broken is one line."""

import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from conftest import write_images
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import hmc
from hmc.errors import InputError
from hmc.io.calibration import write_calibration
from hmc.io.keypoints import KEYPOINTS, open_keypoints, write_openpose
from hmc.io.keypoints.csv_forms import read_csv_table
from hmc.io.keypoints.json_forms import last_number, read_json_frame, read_json_table
from hmc.io.keypoints.layouts import BODY_25, COCO_17, HALPE_26, LAYOUTS, MEDIAPIPE_33, keypoint_named
from hmc.io.recording import reduced

L_HIP, NOSE, NECK = (KEYPOINTS.index(name) for name in ("l_hip", "nose", "neck"))


def person(n=25, at=(50.0, 40.0)):
    """x, y, confidence of n points in a row, all different."""
    return [[at[0] + k, at[1] + 0.5 * k, 0.5 + 0.01 * k] for k in range(n)]


def flat(points):
    return [number for point in points for number in point]


def openpose(*people):
    return json.dumps({"version": 1.3, "people": [{"pose_keypoints_2d": flat(one)} for one in people]})


def put(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "name", ["cam_00_000000000012_keypoints.json", "12.json", "frame_000012.json", "cam_00.000012.json", "take2_cam_1_000012.json"]
)
def test_openpose_folders(recording_folder, name):
    put(recording_folder / "keypoints" / "cam_01" / name, openpose(person(), person(at=(90, 20))))
    put(recording_folder / "keypoints" / "cam_03" / "3.json", openpose())
    source = open_keypoints(hmc.open_recording(recording_folder))
    assert source.cameras == tuple(f"cam_{k:02d}" for k in range(5)) and source.present == (False, True, False, True, False)
    views = source.frame(12)
    assert [view.shape for view in views] == [(0, 26, 3), (2, 26, 3), (0, 26, 3), (0, 26, 3), (0, 26, 3)]
    assert_allclose(views[1][0, L_HIP], person()[12])
    assert np.isnan(views[1][0, KEYPOINTS.index("head_top"), :2]).all() and views[1][0, KEYPOINTS.index("head_top"), 2] == 0
    assert all(len(view) == 0 for view in source.frame(3))


def test_keypoints_of_smaller_images(recording_folder):
    """They are in the pixels of the recording's rig, also those that files give as shares of the image; changes are made as recorded."""
    recording = hmc.open_recording(recording_folder)
    put(recording_folder / "keypoints" / "cam_01" / "0.json", openpose(person()))
    put(recording_folder / "keypoints" / "cam_03" / "0.json", openpose([[(u + 0.5) / 160, (v + 0.5) / 120, c] for u, v, c in person()]))
    full = open_keypoints(recording)
    small = open_keypoints(reduced(recording, (1, 2, 1, 3, 1)))
    for c, factor in ((1, 2), (3, 3)):
        whole, people = full.frame(0)[c], small.frame(0)[c]
        assert_allclose(whole[0, L_HIP], person()[12], atol=1e-9)
        assert_allclose(people[..., :2], (whole[..., :2] + 0.5) / factor - 0.5)
        assert_allclose(people[..., 2], whole[..., 2])
        assert_allclose(full.reduced(small.factors).frame(0)[c], people)
        assert_allclose(small.reduced(full.factors).frame(0)[c], whole)
    seen = []
    changed = small.changed(lambda index, people: seen.append(people) or people)
    assert_allclose(changed.frame(0)[3], small.frame(0)[3])
    assert_allclose(seen[0][3], full.frame(0)[3])


@pytest.mark.parametrize("folder", ["pose/cam_02_json", "pose/cam_02", "keypoints/cam_02_json"])
def test_folders_of_pose2sim(recording_folder, folder):
    put(recording_folder / folder / "cam_02_000004.json", openpose(person(26)))
    (own,) = open_keypoints(hmc.open_recording(recording_folder)).frame(4)[2]
    assert_allclose(own[KEYPOINTS.index("head_top")], person(26)[17])


@pytest.mark.parametrize("n", sorted(LAYOUTS))
def test_layouts_are_told_by_their_number(tmp_path, n):
    points = read_json_frame(put(tmp_path / "1.json", openpose(person(n)))).points[0]
    for place, name in enumerate(LAYOUTS[n]):
        if name is not None:
            assert_allclose(points[KEYPOINTS.index(name)], person(n)[place])
    assert (points[:, 2] > 0).sum() == sum(name is not None for name in LAYOUTS[n])


def test_the_layouts_hold_what_their_programs_say():
    assert BODY_25[8] == "pelvis" and BODY_25[21] == "l_heel" and BODY_25[22] == "r_big_toe" and COCO_17[15] == "l_ankle"
    assert HALPE_26[17:20] == ("head_top", "neck", "pelvis") and HALPE_26[25] == "r_heel"
    assert MEDIAPIPE_33[11] == "l_shoulder" and MEDIAPIPE_33[24] == "r_hip" and MEDIAPIPE_33[32] == "r_big_toe"


@pytest.mark.parametrize("name", ["l_hip", "LHip", "left_hip", "LEFT_HIP", "left hip", "leftHip", "hip_left", "LeftHip", "lefthip"])
def test_names_of_other_programs(name):
    assert keypoint_named(name) == L_HIP


def test_names_that_are_none_of_ours():
    assert keypoint_named("left_eye_inner") == keypoint_named("tail") == keypoint_named("") == -1
    assert KEYPOINTS[keypoint_named("MidHip")] == KEYPOINTS[keypoint_named("Hip")] == "pelvis"
    assert KEYPOINTS[keypoint_named("left_foot_index")] == "l_big_toe"
    assert all(keypoint_named(name) == place for place, name in enumerate(KEYPOINTS))


def scored(n=17):
    return {"keypoints": [point[:2] for point in person(n)], "keypoint_scores": [point[2] for point in person(n)]}


@pytest.mark.parametrize(
    ("document", "frame"),
    [
        ([{"frame_id": 0, "instances": []}, {"frame_id": 3, "instances": [scored()]}], 3),
        ({"meta_info": {}, "instance_info": [{"frame_id": 4, "instances": [scored()]}]}, 3),
        ([[], [], [], [scored()]], 3),
        ([{"image_id": "000003.jpg", "category_id": 1, "keypoints": flat(person(17)), "score": 2.7}], 3),
        ({"frames": [{"frame": 3, "keypoints": [[p[:2] for p in person(17)]], "scores": [[p[2] for p in person(17)]]}]}, 3),
        ({"3": [scored()]}, 3),
        ([{"frame": 3, "people": [{"pose_keypoints_2d": flat(person(17))}]}], 3),
        ([{"frame": 3, "keypoints": {name: [*point] for name, point in zip(COCO_17, person(17), strict=True)}}], 3),
        (
            [
                {
                    "frame": 3,
                    "landmarks": [{"name": n, "x": x, "y": y, "visibility": c} for n, (x, y, c) in zip(COCO_17, person(17), strict=True)],
                }
            ],
            3,
        ),
    ],
)
def test_json_of_a_camera(recording_folder, document, frame):
    put(recording_folder / "keypoints" / "cam_00.json", json.dumps(document))
    source = open_keypoints(hmc.open_recording(recording_folder))
    (own,) = source.frame(frame)[0]
    assert_allclose(own[L_HIP], person(17)[11])
    assert np.isnan(own[NECK, 0]) and not len(source.frame(frame + 1)[0])


def test_shares_of_the_image_become_pixels(recording_folder):
    landmarks = [{"x": (k + 1) / 40, "y": 0.5, "z": -0.1, "visibility": 0.9} for k in range(33)]
    put(recording_folder / "keypoints" / "cam_00.json", json.dumps([{"frame": 0, "pose_landmarks": landmarks}]))
    (own,) = open_keypoints(hmc.open_recording(recording_folder)).frame(0)[0]
    assert_allclose(own[NOSE], [160 / 40 - 0.5, 59.5, 0.9])


def test_a_detector_that_saw_another_size(recording_folder):
    document = {"image_size": [320, 240], "people": [{"pose_keypoints_2d": flat(person())}]}
    put(recording_folder / "keypoints" / "cam_00" / "0.json", json.dumps(document))
    (own,) = open_keypoints(hmc.open_recording(recording_folder)).frame(0)[0]
    assert_allclose(own[NOSE, :2], [(50.5) / 2 - 0.5, (40.5) / 2 - 0.5])


@pytest.mark.parametrize("table", [True, False])
def test_points_of_a_larger_image_are_told(recording_folder, table):
    """Most of them lie far outside of the recording's images, and are left out."""
    for k in range(12):
        points = [[4 * x, 4 * y, c] for x, y, c in person(at=(10.0 + 2 * k, 30.0))]
        if not table:
            put(recording_folder / "keypoints" / "cam_01" / f"{k}.json", openpose(points))
        put(recording_folder / "keypoints" / "cam_00" / f"{k}.json", openpose(person()))
    rows = [f"{k},{name},{4 * (10 + k)},{4 * (30 + k)}" for k in range(12) for name in ("nose", "l_hip", "r_hip")]
    if table:
        put(recording_folder / "keypoints" / "cam_01.csv", "\n".join(["frame,keypoint,x,y", *rows]))
    missing, outside = open_keypoints(hmc.open_recording(recording_folder)).notes
    assert missing.endswith("no keypoints of cam_02, cam_03, cam_04; those of the other cameras are used")
    assert "cam_01" in outside and "% of its points are far outside of the images of 'cam_01' (160 x 120) and left out" in outside


def test_points_that_are_not_given(recording_folder):
    points = person()
    points[0] = [0, 0, 0]
    points[1] = [5000, 40, 0.9]  # far outside
    points[12] = [30, 40, 1.02]  # a detector's slack
    put(recording_folder / "keypoints" / "cam_00" / "0.json", openpose(points, [[0, 0, 0]] * 25))
    (own,) = open_keypoints(hmc.open_recording(recording_folder)).frame(0)[0]
    assert np.isnan(own[[NOSE, NECK], :2]).all() and not own[[NOSE, NECK], 2].any() and own[L_HIP, 2] == 1


def long_csv(rows, head="frame,person,keypoint,x,y,confidence"):
    return "\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n"


def test_long_csv(recording_folder):
    rows = [(2, 0, "left_hip", 30, 40, 0.8), (2, 1, "LHip", 60, 40, 0.7), (2, 0, "left_pinky", 1, 1, 1), (5, 0, "nose", "", "", "")]
    put(recording_folder / "keypoints" / "cam_02.csv", long_csv(rows[:1] + rows[2:]))
    source = open_keypoints(hmc.open_recording(recording_folder))
    assert_allclose(source.frame(2)[2][0, L_HIP], [30, 40, 0.8])
    assert len(source.frame(2)[2]) == 1 and not len(source.frame(5)[2])
    put(recording_folder / "keypoints" / "cam_02.csv", long_csv(rows[:2]))
    with pytest.raises(InputError, match=r"cam_02\.csv: 'left_hip' and 'LHip' mean one point"):
        open_keypoints(hmc.open_recording(recording_folder))


def test_long_csv_of_numbered_landmarks(tmp_path):
    rows = [(0, k, k / 40, 0.5, 0.9) for k in range(33)]
    people = read_csv_table(put(tmp_path / "a.csv", long_csv(rows, "frame,landmark,x,y,visibility")))
    assert_allclose(people[0].points[0, L_HIP], [23 / 40, 0.5, 0.9])


@pytest.mark.parametrize("several", [False, True])
def test_deeplabcut(recording_folder, several):
    parts, people = ("nose", "left_hip", "tail"), ("one", "two") if several else ("",)
    columns = [(who, part, axis) for who in people for part in parts for axis in ("x", "y", "likelihood")]
    heads = [["scorer"] + ["DLC"] * len(columns), ["individuals", *(c[0] for c in columns)], ["bodyparts", *(c[1] for c in columns)]]
    heads = [heads[0], *([heads[1]] if several else []), heads[2], ["coords", *(c[2] for c in columns)]]
    values = [["7", "10", "11", ".9", "", "", "", "1", "2", ".5"] + ["20", "21", ".8", "30", "31", ".7", "", "", ""] * several]
    put(recording_folder / "keypoints" / "cam_00DLC_resnet50.csv", "\n".join(",".join(row) for row in heads + values))
    own = open_keypoints(hmc.open_recording(recording_folder)).frame(7)[0]
    assert len(own) == len(people)
    assert_allclose(own[0, NOSE], [10, 11, 0.9])
    assert np.isnan(own[0, L_HIP, 0]) and (not several or own[1, L_HIP, 1] == 31)


def test_frames_count_as_the_recording_does(recording_folder):
    put(recording_folder / "recording.toml", "first_frame = { cam_00 = 2 }\n")
    for camera in ("cam_00", "cam_01"):
        put(recording_folder / "keypoints" / camera / "2.json", openpose(person()))
    source = open_keypoints(hmc.open_recording(recording_folder, start=1))
    assert [len(view) for view in source.frame(0)] == [1, 0, 0, 0, 0] and [len(view) for view in source.frame(2)] == [0, 1, 0, 0, 0]
    assert last_number("cam_00_000000000012_keypoints") == 12 and last_number("cam") is None


@pytest.mark.parametrize(
    ("name", "first"), [("frame{:04d}_cam{camera}.png", 0), ("{:06d}.png", 1), ("{:06d}.png", 100), ("take_7_{:03d}_b.png", 3)]
)
def test_frames_count_as_images_are_counted(recording_folder, name, first):
    """By the images' numbers where those tell frames apart, else by their order: a camera's number in a name moves nothing."""
    shutil.rmtree(recording_folder / "videos")
    for camera in range(5):
        numbers = range(first, first + 4)
        folder = recording_folder / "images" / f"cam_{camera:02d}"
        write_images(folder, numbers, (160, 120), lambda number: 40, name=name.replace("{camera}", str(camera)))
        rows = [f"{number},{joint},{10 * (number - first) + 1},5,0.9" for number in numbers for joint in ("nose", "left_hip")]
        put(recording_folder / "keypoints" / f"cam_{camera:02d}.csv", "\n".join(["frame,keypoint,x,y,confidence", *rows]))
    for camera_first in (0, 2):
        put(recording_folder / "recording.toml", f"first_frame = {{ cam_01 = {camera_first} }}\n")
        source = open_keypoints(hmc.open_recording(recording_folder))
        for frame in range(4 - camera_first):
            shown = [10 * frame + 1, 10 * (frame + camera_first) + 1, *[10 * frame + 1] * 3]
            assert [view[0, NOSE, 0] for view in source.frame(frame)] == shown


def test_none(recording_folder):
    assert open_keypoints(hmc.open_recording(recording_folder)) is None
    (recording_folder / "keypoints").mkdir()
    put(recording_folder / "pose" / "joints.csv", "frame\n")  # somebody's result
    assert open_keypoints(hmc.open_recording(recording_folder)) is None
    put(recording_folder / "keypoints" / "cam_01" / "0.json", openpose())
    assert open_keypoints(hmc.open_recording(recording_folder, cameras=["cam_00", "cam_02"])) is None


def test_of_other_cameras(recording_folder):
    put(recording_folder / "keypoints" / "left" / "0.json", openpose())
    with pytest.raises(InputError, match="holds keypoints of left, but the calibration's cameras are cam_00, cam_01") as told:
        open_keypoints(hmc.open_recording(recording_folder))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "not a JSON file"),
        ("[" * 100_000, "not a JSON file"),
        ("7", "a list of people was expected"),
        ('{"a": 1}', "no people in it"),
        (openpose(person(24)), "24 points a person; known are lists of 17"),
        (json.dumps({"people": [{"pose_keypoints_2d": [1, 2]}]}), "2 numbers are no list"),
        (json.dumps({"people": [{"pose_keypoints_2d": ["a"] * 75}]}), '"a" where a number must be'),
        (openpose([[float("nan"), 1, 1]] * 25), "not finite"),
        (openpose([[float("inf"), 1, 1]] * 25), "not finite"),
        (openpose([[1, 1, -0.5]] * 25), "a confidence of -0.5"),
        (openpose([[1, 1, 85]] * 25), "a confidence of 85"),
        (json.dumps({"people": [], "width": 0, "height": 4}), "is no size"),
        (" " * (8 * 2**20 + 1), "MB, more than the 8 MB"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line(recording_folder, text, told):
    file = put(recording_folder / "keypoints" / "cam_00" / "cam_00_000000000003_keypoints.json", text)
    source = open_keypoints(hmc.open_recording(recording_folder))
    with pytest.raises(InputError) as caught:
        source.frame(3)
    line = str(caught.value)
    assert line.startswith(f"{file}: ") and told in line and "\n" not in line


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "the header line has no column 'frame'"),
        ("frame,x,y\n", "no column 'keypoint'"),
        ("frame,keypoint,x,y\n1,nose,2\n", "line 2: 3 values where the header names 4"),
        ("frame,keypoint,x,y\n1,nose,two,3\n", "line 2: 'two' where a number must be"),
        ("frame,keypoint,x,y\n1,nose,nan,3\n", "line 2: 'nan' where a number"),
        ("frame,keypoint,x,y\n1.5,nose,2,3\n", "line 2: '1.5' is no number of a frame"),
        ("frame,keypoint,x,y\n1,tail,2,3\n", "no known name among its points (tail)"),
        ("frame,keypoint,x,y\n1,nose,2,3\n1,nose,2,3\n", "line 3: 'nose' of frame 1 a second time"),
        ("frame,keypoint,x,y,score\n1,nose,2,3,90\n", "a confidence of 90"),
        ("frame,keypoint,x,y\n1,40,2,3\n", "41 points a person"),
        ("scorer,a\nbodyparts,nose\ncoords,z\n", "`coords` must be x, y and likelihood; got 'z'"),
        ("scorer,a\nx,nose\n", "DeepLabCut's header has lines"),
        ("scorer,a\nbodyparts,nose\ncoords,x\n", "needs the columns x and y"),
    ],
)
def test_what_is_wrong_with_a_table_is_one_line(recording_folder, text, told):
    file = put(recording_folder / "keypoints" / "cam_00.csv", text)
    with pytest.raises(InputError) as caught:
        open_keypoints(hmc.open_recording(recording_folder))
    assert str(caught.value).startswith(str(file)) and told in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_say_one_thing_twice(recording_folder):
    put(recording_folder / "keypoints" / "cam_00" / "3.json", openpose())
    put(recording_folder / "keypoints" / "cam_00" / "0003.json", openpose())
    with pytest.raises(InputError, match=r"both 0003\.json and 3\.json are of frame 3"):
        open_keypoints(hmc.open_recording(recording_folder))
    (recording_folder / "keypoints" / "cam_00" / "3.json").rename(recording_folder / "keypoints" / "cam_00" / "all.json")
    with pytest.raises(InputError, match="no number of a frame in its name"):
        open_keypoints(hmc.open_recording(recording_folder))
    put(recording_folder / "keypoints" / "cam_00.csv", "")
    with pytest.raises(InputError, match=r"both cam_00 and cam_00\.csv hold keypoints of camera 'cam_00'"):
        open_keypoints(hmc.open_recording(recording_folder))


KEYS = st.sampled_from(
    ["people", "instances", "keypoints", "pose_keypoints_2d", "keypoint_scores", "frame_id", "frame", "landmarks", "x", "y", "name",
     "visibility", "image_size", "width", "height", "meta_info", "instance_info", "frames", "3", "pose_landmarks"]
)  # fmt: skip
LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 9),
    st.integers(),
    st.floats(),
    st.sampled_from(["nose", "a", "", "3", "x_12.png"]),
    st.text(max_size=3),
)
LISTS = st.sampled_from([person(17), flat(person(25)), flat(person(18)), person(24), [[1, 2, 0.5, 0.5]] * 33])
DOCUMENTS = st.recursive(
    LEAVES | LISTS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4), max_leaves=12
)


def read_or_refuse(read, path):
    try:
        return read(path)
    except InputError as error:
        assert str(error).startswith(str(path)) and "\n" not in str(error)


@settings(max_examples=300, deadline=None)
@given(DOCUMENTS)
def test_any_json_is_read_or_refused(document):
    with tempfile.TemporaryDirectory() as folder:
        path = put(Path(folder) / "1.json", json.dumps(document))
        for found in (read_or_refuse(read_json_frame, path), read_or_refuse(read_json_table, path)):
            for raw in () if found is None else [found] if hasattr(found, "points") else found[0].values():
                assert raw.points.shape[1:] == (26, 3) and ((raw.points[..., 2] >= 0) & (raw.points[..., 2] <= 1)).all()
                assert (np.isfinite(raw.points).all(axis=-1) == (raw.points[..., 2] > 0)).all()


CELLS = st.sampled_from(
    ["nose", "LHip", "scorer", "bodyparts", "coords", "individuals", "x", "y", "likelihood", "frame", "keypoint", "3", "0",
     "1e400", "-1", ".5", "nan", "", '"', "é", "²", "img_3.png"]
)  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(["", "frame,keypoint,x,y\n", "frame,keypoint,x,y,score\n", "scorer,a,a\nbodyparts,nose,nose\ncoords,x,y\n"]),
    st.lists(st.lists(CELLS, max_size=5), max_size=5),
    st.binary(max_size=4),
)
def test_any_table_is_read_or_refused(head, rows, tail):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_bytes(head.encode() + "\n".join(",".join(row) for row in rows).encode() + tail)
        read_or_refuse(read_csv_table, path)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=60), st.integers(0, 2000), st.integers(0, 3))
def test_a_damaged_file_is_read_or_refused(junk, place, cut):
    text = openpose(person(), person()).encode()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "1.json"
        path.write_bytes(text[:place] + junk + text[place + cut :])
        read_or_refuse(read_json_frame, path)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 3), frame=st.integers(0, 11))
def test_what_was_written_is_read_again(ring, seed, n, frame):
    rng = np.random.default_rng(seed)
    people = np.concatenate([rng.uniform(2, 118, (n, 26, 2)), rng.uniform(0.01, 1, (n, 26, 1))], axis=-1).round(3)
    people[rng.random((n, 26)) < 0.3] = (np.nan, np.nan, 0)
    people[:, KEYPOINTS.index("head_top")] = (np.nan, np.nan, 0)
    people[:, NOSE] = (50, 60, 0.9)
    with tempfile.TemporaryDirectory() as folder:
        path = write_openpose(folder, "cam_00", frame, people)
        assert last_number(path.stem) == frame
        assert_allclose(read_json_frame(path).points, people)


def test_writing_refuses_another_shape(tmp_path, ring):
    write_calibration(tmp_path / "calibration.toml", ring)
    with pytest.raises(InputError, match=r"`people` must be \(n, 26, 3\); got \(25, 3\)"):
        write_openpose(tmp_path, "cam_00", 0, np.zeros((25, 3)))


@pytest.mark.parametrize(("name", "seeing"), [("rendered/r1", (1,) * 7), ("rendered/r4", (0, 1, 1, 0, 0.05)), ("balancing", (1,) * 4)])
def test_a_real_detector(shared_data, name, seeing):
    recording = hmc.open_recording(shared_data / name)
    source = open_keypoints(recording)
    if source is None:
        pytest.skip("no keypoints beside these recordings")
    people = np.array([[len(view) for view in source.frame(index)] for index in range(0, recording.n_frames, 4)])
    assert people.max() == 1
    assert_allclose(people.mean(axis=0), seeing, atol=0.1)
