"""`hmc check`: each fault is told, several are told together, and a good recording has nothing to tell."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from conftest import write_images, write_video
from drawn import draw_recording, post, walk
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import hmc
from hmc.camera.model import Camera, Rig, look_at, project
from hmc.camera.rig_picture import _free_offset, draw_rig, draw_view, rig_figure, view_cone
from hmc.check import check_recording, inspect_recording
from hmc.check.hull import coarse_grid, fine_hull
from hmc.cli import main
from hmc.io.calibration import write_calibration
from hmc.io.files import write_figure
from hmc.io.places import RecordingPlaces
from hmc.io.recording import iterate_frames, open_recording


def sentences(findings, severity):
    return [finding.sentence for finding in findings if finding.severity == severity]


@pytest.fixture
def body_folder(tmp_path, ring):
    """A recording of silhouettes: an upright ellipsoid the size of a person, 0.4 m off the middle."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(20000, 3))
    points = directions / np.linalg.norm(directions, axis=1, keepdims=True) * [0.25, 0.25, 0.85] + [0.4, 0.2, 0.9]
    write_calibration(tmp_path / "calibration.toml", ring)
    for camera in ring:
        uv, _ = project(camera, points)
        hull = cv2.convexHull(np.round(uv).astype(np.int32))
        mask = cv2.fillConvexPoly(np.zeros((120, 160), np.uint8), hull, 255)
        folder = tmp_path / "silhouettes" / camera.name
        folder.mkdir(parents=True)
        cv2.imwrite(str(folder / "000000.png"), mask)
    return tmp_path


def test_a_good_recording_has_only_notes(recording_folder, body_folder):
    assert {finding.severity for finding in check_recording(recording_folder)} <= {"note"}
    assert sentences(check_recording(body_folder), "warning") == []


def test_an_open_recording_is_looked_at_as_it_was_opened(recording_folder, tmp_path):
    """Of its cameras alone, and in its session, which has the calibration."""
    four = [f"cam_{k:02d}" for k in range(4)]
    (recording_folder / "videos" / "cam_04.avi").write_bytes(b"")
    (rest := tmp_path / "rig").mkdir()
    (recording_folder / "calibration.toml").rename(rest / "calibration.toml")
    recording = open_recording(RecordingPlaces(recording_folder, calibration=rest), cameras=four)
    assert sentences(hmc.check(recording), "error") == []
    (recording_folder / "videos" / "cam_04.avi").unlink()
    write_video(recording_folder / "videos" / "cam_04.avi", 12, (160, 120))
    write_video(recording_folder / "videos" / "lobby.avi", 12, (160, 120))
    recording = open_recording(recording.places)
    assert any("lobby.avi: no camera of this name" in note for note in sentences(hmc.check(recording), "note"))
    (rest / "calibration.toml").unlink()
    assert "no calibration found" in hmc.check(recording)[0].sentence


def test_images_in_memory_are_looked_at_too(body_folder, ring):
    masks = [[frame.silhouettes[c] for frame in iterate_frames(open_recording(body_folder))] for c in range(5)]
    found = hmc.check(hmc.recording_of(ring, silhouettes=masks))
    assert [(one.severity, one.sentence) for one in found] == [("note", "no `room` is given; it is estimated from the rig")]
    moved = Rig(tuple(turned(camera, 7) if camera.name == "cam_03" else camera for camera in ring))
    (warning,) = sentences(hmc.check(hmc.recording_of(moved, silhouettes=masks)), "warning")
    assert warning.startswith("camera 'cam_03': its silhouettes do not fit the calibration")
    assert "hmc sync" not in warning or warning.endswith("(once these images lie in a recording's folder)")
    elsewhere = hmc.recording_of(ring, silhouettes=masks, room=[[0, 0, 100], [2, 2, 102]])
    assert any("no camera sees anything of the room" in error for error in sentences(hmc.check(elsewhere), "error"))


@pytest.mark.parametrize(
    "spoil", [lambda mask: 255 - mask, lambda mask: np.dstack([np.full_like(mask, 255)] * 3 + [mask]), lambda mask: np.maximum(mask, 16)]
)
@pytest.mark.parametrize("cameras", [["cam_02"], [f"cam_0{k}" for k in range(5)]])
def test_silhouettes_that_fill_images_are_told(body_folder, cameras, spoil):
    """Inverted, with people in the alpha channel, or grey where nobody is."""
    for camera in cameras:
        file = body_folder / "silhouettes" / camera / "000000.png"
        cv2.imwrite(str(file), spoil(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)))
    found = sentences(check_recording(body_folder), "warning")
    assert [sentence.split(": its silhouettes fill ")[0] for sentence in found] == [f"camera '{camera}'" for camera in cameras]


def test_a_hull_of_the_whole_room_is_made_of_fewer_voxels(ring, monkeypatch):
    grid = coarse_grid(ring, np.array([[-1.0, -1, 0], [1, 1, 2]]))
    masks = [np.ones((120, 160), bool)] * len(ring)
    monkeypatch.setattr("hmc.check.hull.MOST_FINE", len(grid.points))
    assert len(fine_hull(ring, masks, grid).points) <= len(grid.points)


def turned(camera: Camera, degrees: float) -> Camera:
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    return replace(camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation)


def test_a_camera_that_has_moved_is_named(body_folder, ring):
    moved = Rig(tuple(turned(camera, 7) if camera.name == "cam_03" else camera for camera in ring))
    write_calibration(body_folder / "calibration.toml", moved)
    (warning,) = sentences(check_recording(body_folder), "warning")
    assert warning.startswith("camera 'cam_03': its silhouettes do not fit the calibration")


@pytest.mark.parametrize(("camera", "degrees"), [("cam_01", 2.0), ("cam_04", -2.5)])
def test_a_camera_that_is_a_few_pixels_off_is_named(tmp_path, ring, camera, degrees):
    """About its vertical axis: 2 degrees are 4 pixels of a focal length of 114."""
    folder = draw_recording(tmp_path / "walk", ring, walk(6), silhouettes=True)
    write_calibration(folder / "calibration.toml", Rig(tuple(turned(c, degrees) if c.name == camera else c for c in ring)))
    (warning,) = sentences(check_recording(folder), "warning")
    assert warning.startswith(f"camera '{camera}': ") and "of its silhouettes lie outside what the other cameras see" in warning
    pixels, way = re.search(r"moved (\d+) px (left|right)", warning).groups()
    assert 2 <= int(pixels) <= 6 and way == ("right" if degrees > 0 else "left")


def test_a_video_that_is_late_is_named(tmp_path, ring, capsys):
    folder = draw_recording(tmp_path / "a walk", ring, walk(12), silhouettes=True)
    assert sentences(check_recording(folder), "warning") == []
    pose = f"hmc pose '{folder}' --out 'a walk-result'\n"
    assert main(["check", str(folder), "--out", str(tmp_path / "rig.png")]) == 0 and f"\nnext: {pose}" in capsys.readouterr().out
    late = folder / "silhouettes" / "cam_02"
    for index in range(11, 0, -1):
        (late / f"{index:06d}.png").write_bytes((late / f"{max(0, index - 2):06d}.png").read_bytes())
    (warning,) = sentences(check_recording(folder), "warning")
    assert warning.startswith("camera 'cam_02': ") and "early or late" in warning and warning.endswith(f"finds: hmc sync '{folder}'")
    assert main(["check", str(folder), "--out", str(tmp_path / "rig.png")]) == 0
    assert f"\nnext: hmc sync '{folder}'\nthen: {pose}" in capsys.readouterr().out


def test_legs_behind_a_table_are_nobody_s_fault(tmp_path, ring):
    folder = draw_recording(tmp_path / "walk", ring, walk(6), silhouettes=True)
    for camera in ("cam_01", "cam_03"):
        for file in (folder / "silhouettes" / camera).iterdir():
            mask = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
            rows = np.flatnonzero(mask.any(axis=1))
            mask[int(rows[0] + 0.6 * len(rows)) :] = 0
            cv2.imwrite(str(file), mask)
    assert sentences(check_recording(folder), "warning") == []


@pytest.mark.parametrize("depth", [0.1, 0.18])
def test_feet_below_the_floor_are_told(body_folder, ring, depth):
    """Posts, as an ellipsoid has no feet."""
    circle = np.linspace(0, 2 * np.pi, 90)
    post = np.concatenate([np.stack([0.12 * np.cos(circle), 0.12 * np.sin(circle), np.full(90, z)], axis=-1) for z in (0.0, 1.7)])
    for camera in ring:
        hull = cv2.convexHull(np.round(project(camera, post)[0]).astype(np.int32))
        mask = cv2.fillConvexPoly(np.zeros((120, 160), np.uint8), hull, 255)
        cv2.imwrite(str(body_folder / "silhouettes" / camera.name / "000000.png"), mask)
    assert sentences(check_recording(body_folder), "warning") == []
    lower = [replace(camera, translation=camera.translation + camera.rotation[:, 2] * depth) for camera in ring]
    write_calibration(body_folder / "calibration.toml", lower)
    (warning,) = sentences(check_recording(body_folder), "warning")
    told = int(re.match(r"people's feet are (\d+) cm below the floor", warning).group(1))
    assert 100 * depth - 5 <= told <= 100 * depth + 3


@pytest.mark.parametrize("height", [0.4, -1.0])
def test_a_floor_that_is_elsewhere_is_told(tmp_path, ring, height):
    """Poses are held to the floor: who stood half a metre above it came out 88 mm wrong in place of 17, without a word."""
    folder = draw_recording(tmp_path / "walk", ring, walk(6), silhouettes=True, shape=post)
    assert sentences(check_recording(folder), "warning") == []
    moved = [replace(camera, translation=camera.translation - camera.rotation[:, 2] * height) for camera in ring]
    write_calibration(folder / "calibration.toml", moved)
    inspection = inspect_recording(folder)
    (warning,) = sentences(inspection.findings, "warning")
    told = re.match(r"people stand (\S+) m (above|below) z = 0", warning)
    assert float(told[1]) == pytest.approx(abs(height), abs=0.08) and told[2] == ("above" if height > 0 else "below")
    assert warning.endswith(f"hmc world {folder}") and inspection.floor[..., 2].mean() == pytest.approx(height, abs=0.08)
    (folder / "recording.toml").write_text(f"room = [[-2.0, -2.0, {height}], [2.0, 2.0, {height + 2.2}]]\n")
    assert sentences(check_recording(folder), "warning") == []


def test_people_beyond_a_wall_are_told(tmp_path, ring):
    folder = draw_recording(tmp_path / "walk", ring, walk(3), silhouettes=True)
    (folder / "recording.toml").write_text("room = [[-2.0, -2.0, 0.0], [0.8, 2.0, 1.5]]\n")
    warnings = sentences(check_recording(folder), "warning")
    assert len(warnings) == 2 and "beyond the room's limit x = 0.8 m" in warnings[0] and "z = 1.5 m" in warnings[1]
    assert all("widen `room`" in warning for warning in warnings)


def test_swapped_cameras_are_noticed(body_folder):
    (body_folder / "silhouettes" / "cam_00").rename(body_folder / "x")
    (body_folder / "silhouettes" / "cam_01").rename(body_folder / "silhouettes" / "cam_00")
    (body_folder / "x").rename(body_folder / "silhouettes" / "cam_01")
    (error,) = sentences(check_recording(body_folder), "error")  # of such hulls nothing is left, and nobody would be found
    assert error.startswith("silhouettes and calibration disagree") and error.endswith(f"That finds: hmc sync {body_folder}")


def test_of_seven_cameras_two_may_fail(tmp_path):
    """A run leaves them out, so that the recording can be used."""
    angles = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    rig = [look_at(f"cam_{k:02d}", (160, 120), [3.5 * np.cos(a), 3.5 * np.sin(a), 2.0], [0, 0, 0.9], 60) for k, a in enumerate(angles)]
    folder = draw_recording(tmp_path / "walk", Rig(tuple(rig)), [[(0.9, -0.6)]] * 2, silhouettes=True)
    names = [folder / "silhouettes" / name for name in ("cam_01", "cam_03", "x")]
    for one, other in ((names[0], names[2]), (names[1], names[0]), (names[2], names[1])):
        one.rename(other)
    findings = check_recording(folder)
    assert not sentences(findings, "error") and any("silhouettes" in one for one in sentences(findings, "warning"))


def test_many_faults_at_once(recording_folder):
    """The first fault does not hide the others."""
    (recording_folder / "recording.toml").write_text("fsp = 25\n")
    (recording_folder / "videos" / "cam_01.avi").unlink()
    (recording_folder / "videos" / "cam_02.avi").write_bytes(b"")
    write_video(recording_folder / "videos" / "cam_04.avi", 3, (80, 60))
    write_video(recording_folder / "videos" / "cam_77.avi", 3, (80, 60))
    text = (recording_folder / "calibration.toml").read_text()
    (recording_folder / "calibration.toml").write_text(text.replace("translation = [", "translation = [nan, 0, 0]\n#", 1))
    findings = check_recording(recording_folder)
    errors = sentences(findings, "error")
    for words in (
        "unknown key `fsp`; did you mean `fps`?",
        "camera 'cam_00': `translation` holds a number that is not finite",
        "camera 'cam_01' of the calibration has no video",
        "cam_02.avi: this video cannot be read",
        "cam_04.avi: images are 80 x 60 but the calibration of 'cam_04' says 160 x 120",
    ):
        assert sum(words in error for error in errors) == 1, words
    assert len(errors) == 5
    assert any("cam_77.avi: no camera of this name" in note for note in sentences(findings, "note"))
    severities = [finding.severity for finding in findings]
    assert severities == sorted(severities, key=["error", "warning", "note"].index)


def test_millimetres(recording_folder, ring):
    write_calibration(recording_folder / "calibration.toml", [replace(camera, translation=1000 * camera.translation) for camera in ring])
    inspection = inspect_recording(recording_folder)
    assert any("looks like millimetres" in error for error in sentences(inspection.findings, "error"))
    assert not inspection.usable and inspection.rig is not None


def test_a_room_elsewhere(recording_folder):
    (recording_folder / "recording.toml").write_text("room = [[-1, -1, 30], [1, 1, 33]]\n")
    assert any("no camera sees anything of the room" in error for error in sentences(check_recording(recording_folder), "error"))


def rig_findings(folder, cameras, severity="warning"):
    """What is said of these cameras."""
    write_calibration(folder / "calibration.toml", cameras)
    return sentences(check_recording(folder), severity)


def test_odd_cameras(recording_folder, ring):
    def change(index, **values):
        return [replace(camera, **values) if i == index else camera for i, camera in enumerate(ring)]

    away = look_at("cam_00", (160, 120), ring[0].centre, 2 * ring[0].centre, 60)
    assert any("'cam_00' sees nothing of the room" in s for s in rig_findings(recording_folder, [away, *ring[1:]]))
    twin = replace(ring[1], name="cam_00")
    assert any("'cam_00' and 'cam_01' stand in one place" in s for s in rig_findings(recording_folder, [twin, *ring[1:]]))
    matrix = ring[2].matrix
    assert any("focal lengths" in s for s in rig_findings(recording_folder, change(2, matrix=matrix * [[2], [1], [1]])))
    off_centre = matrix + np.array([[0, 0, 70], [0, 0, 0], [0, 0, 0]])
    assert any("far from the middle" in s for s in rig_findings(recording_folder, change(2, matrix=off_centre)))
    assert any("does not fit 160 x 120" in s for s in rig_findings(recording_folder, change(2, matrix=matrix * [[30], [30], [1]])))
    folded = change(2, distortions=np.array([-1.5, 0, 0, 0, 0]))
    assert any("folds over inside the image" in s for s in rig_findings(recording_folder, folded))
    sunk = look_at("cam_00", (160, 120), [3, 0, -1], [0, 0, 1], 60)
    assert any("stands 1.0 m under the floor" in s for s in rig_findings(recording_folder, [sunk, *ring[1:]]))
    for degrees, words in ((180, "is mounted upside down"), (90, "lies on its side")):
        turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
        rolled = change(2, rotation=turn @ ring[2].rotation, translation=turn @ ring[2].translation)
        assert any(f"'cam_02' {words}" in s for s in rig_findings(recording_folder, rolled, "note"))
    overhead = look_at("cam_00", (160, 120), [0, 0, 4], [0, 0, 0], 80)
    assert not any("'cam_00'" in s for s in rig_findings(recording_folder, [overhead, *ring[1:]], "note"))


def test_few_cameras_and_a_large_room(recording_folder):
    (recording_folder / "recording.toml").write_text("room = [[-20, -20, 0], [20, 20, 2.4]]\n")
    warnings = sentences(check_recording(recording_folder, cameras=["cam_00", "cam_01"]), "warning")
    assert any("2 cameras cannot tell a body's shape" in warning for warning in warnings)
    assert any("of the room is seen by two cameras or more" in warning for warning in warnings)


def test_lengths_rates_gaps_and_dark_images(recording_folder, ring):
    write_video(recording_folder / "videos" / "cam_02.avi", 5, (160, 120), fps=50)
    write_video(recording_folder / "videos" / "cam_03.avi", 12, (160, 120), lambda index: 0)
    warnings = sentences(check_recording(recording_folder), "warning")
    for words in ("cameras differ in length", "'cam_03': its first image is black"):
        assert any(words in warning for warning in warnings), words
    notes = sentences(check_recording(recording_folder), "note")
    assert any("differ in frame rate (25 to 50 a second); their frames are matched by their time stamps" in note for note in notes)
    (recording_folder / "videos").rename(recording_folder / "x")
    for camera in ring:
        write_images(recording_folder / "images" / camera.name, [0, 1, 3, 4], (160, 120))
    (recording_folder / "images" / "cam_01" / "000001.png").write_bytes(b"")
    warnings = sentences(check_recording(recording_folder), "warning")
    assert any("1 of 5 images are missing, the first is frame 2" in warning for warning in warnings)
    assert "cam_01: frame 1 cannot be read; left out" in warnings


@pytest.mark.parametrize("name", ["r1", "r2", "r3", "r4"])
@pytest.mark.slow
def test_good_recordings_of_another_program_are_quiet(shared_data, name):
    assert sentences(check_recording(shared_data / "rendered" / name), "warning") == []


def test_a_calibration_that_is_known_to_be_off_is_told(shared_data):
    (warning,) = sentences(check_recording(shared_data / "bodytrack"), "warning")
    assert warning.startswith("camera 'cam_03': ")


def test_settings_with_nothing_in_them_are_told(recording_folder):
    def told():
        return [note for note in sentences(check_recording(recording_folder), "note") if "recording.toml is empty" in note]

    file = recording_folder / "recording.toml"
    for text, n in (("fps = 20\n", 0), ("# room = 3\n", 0), (" \n", 1), ("", 1)):
        file.write_text(text)
        assert len(told()) == n
    file.unlink()
    assert told() == []


def test_background_is_told(recording_folder, ring):
    notes = sentences(check_recording(recording_folder), "note")
    assert any("fewer than 10 frames of the empty scene" in note for note in notes)
    (recording_folder / "background" / "cam_01.avi").unlink()
    assert any("cam_01 have no frames of the empty scene" in note for note in sentences(check_recording(recording_folder), "note"))
    for camera in ring:
        (recording_folder / "background" / f"{camera.name}.avi").unlink(missing_ok=True)
    assert any("temporal median" in note for note in sentences(check_recording(recording_folder), "note"))


def test_nothing_to_look_at(tmp_path):
    assert "no such folder" in check_recording(tmp_path / "x")[0].sentence
    assert "no calibration found" in check_recording(tmp_path)[0].sentence


def test_view_cone_of_a_camera_that_looks_down():
    """80 degrees from 3 m: the image's floor is 2 * 3 * tan 40 wide; the cone is its outline."""
    camera = look_at("top", (200, 100), [1, 2, 3], [1, 2, 0], 80)
    cone = view_cone(camera, 10)
    assert_allclose(np.ptp(cone[:, 0]), 2 * 3 * np.tan(np.radians(40)) * 199 / 200, rtol=1e-6)
    assert_allclose((cone.min(axis=0) + cone.max(axis=0)) / 2, [1, 2], atol=1e-6)
    level = view_cone(look_at("a", (200, 100), [0, 0, 1], [5, 0, 1], 90), 4)
    assert level[:, 0].min() > -0.01 and 3.9 < np.linalg.norm(level, axis=1).max() < 4.01


def test_picture(tmp_path, ring):
    room = np.array([[-1.5, -1.5, 0], [1.5, 1.5, 2.4]])
    image = np.full((120, 160, 3), 90, np.uint8)
    figure = rig_figure(ring, room, [image, None, image, image, image], "ring: a verdict\n" + "error: long " * 20 + "hmc world it")
    assert figure.get_suptitle().startswith("ring: a verdict\nerror: long ") and figure.get_suptitle().endswith(" hmc world it")
    endless = rig_figure(ring, room, [None] * 5, "ring: a verdict\n" + "error: long " * 90).get_suptitle().split("\n")
    assert len(endless) == 4 and endless[-1].endswith(" ...")
    write_figure(tmp_path / "rig.png", figure, dpi=90)
    picture = cv2.imread(str(tmp_path / "rig.png"))
    assert picture is not None and picture.shape[1] > 900
    drawn = draw_rig(ring, room)
    written = [text.get_text() for text in drawn.texts if text.get_text()]
    assert sorted(text.split()[0] for text in written) == sorted([*ring.names, "x", "y"])
    assert {"room", "origin"} <= {text.get_text() for text in drawn.get_legend().get_texts()}
    assert any(text.get_text() == "no image" for text in draw_view(ring[1], room, None).texts)


def test_names_of_cameras_do_not_cover_each_other():
    """Two at the top whose names both run inwards, as in a ring of seven."""
    taken = []
    offsets = [_free_offset("cam_0 (2.2 m)", np.array([x, 2.4]), side, 0.02, taken) for x, side in ((1.1, -1), (-1.2, 1), (1.1, -1))]
    assert len(set(offsets)) == 3
    for k, (low, high) in enumerate(taken):
        assert not any((low < other[1]).all() and (other[0] < high).all() for other in taken[:k])
