"""Recordings as their cameras and programs left them: other units and axes, other file names, other image sizes."""

import re
import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest
from conftest import write_images, write_video
from numpy.testing import assert_allclose

from hmc.camera.coverage import estimate_room
from hmc.camera.model import Rig, project
from hmc.camera.world import moved_camera
from hmc.check import check_recording, inspect_recording
from hmc.errors import InputError
from hmc.io.calibration import read_calibration, write_calibration
from hmc.io.naming import tokens_of
from hmc.io.recording import background_frames, iterate_frames, open_recording, read_rig
from hmc.io.sizes import fit_size
from hmc.io.world import UPS, world_of


def written_in(world, rig):
    """The rig as a program has it that works in this world."""
    return Rig(
        tuple(replace(camera, rotation=camera.rotation @ world.rotation, translation=camera.translation / world.scale) for camera in rig)
    )


@pytest.mark.parametrize("up", UPS)
def test_worlds_are_turned_and_not_mirrored(ring, up):
    axis = np.eye(3)["xyz".index(up[-1])] * (-1 if up.startswith("-") else 1)
    assert_allclose(UPS[up] @ axis, [0, 0, 1], atol=0)
    assert np.linalg.det(UPS[up]) == 1
    world = world_of({"units": 0.0254, "up": up})
    points = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 2], (40, 3))
    theirs = points @ UPS[up] / world.scale
    for camera, own in zip(ring, written_in(world, ring), strict=True):
        assert_allclose(project(own, theirs)[0], project(camera, points)[0], atol=1e-9)
        ours = moved_camera(own, world)
        assert_allclose(ours.projection, camera.projection, atol=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        'units = "mm"\nup = "y"\n',
        'units = "cm"\nup = "-y"\n',
        "units = 0.0254\n",
        'up = "-z"\n',
        'units = "mm"\nup = "x"\nroom = [[-1, -2, 0], [1, 2, 2.2]]\n',
    ],
)
def test_a_rig_in_its_own_world_is_the_same_recording(recording_folder, ring, text):
    """The same cameras, room and findings as in metres with z up; `room` is in metres with z up."""
    before, world = inspect_recording(recording_folder), world_of(tomllib.loads(text))
    write_calibration(recording_folder / "calibration.toml", written_in(world, ring))
    (recording_folder / "recording.toml").write_text(text)
    recording = open_recording(recording_folder)
    for camera, again, third in zip(ring, recording.rig, read_calibration(recording_folder), strict=True):
        assert_allclose(again.projection, camera.projection, atol=1e-8)
        assert_allclose(third.projection, camera.projection, atol=1e-8)
    assert_allclose(read_rig(recording_folder).centres, ring.centres, atol=1e-9)
    assert_allclose(recording.room, [[-1, -2, 0], [1, 2, 2.2]] if "room" in text else estimate_room(ring), atol=1e-9)
    after = inspect_recording(recording_folder)
    assert_allclose(after.rig.centres, before.rig.centres, atol=1e-9)
    assert {f.severity for f in after.findings} <= {f.severity for f in before.findings}


def test_hulls_are_the_same(recording_folder, ring):
    """Silhouettes of a box, carved in either world."""
    from hmc.voxels.carving import carve, make_tables
    from hmc.voxels.grid import VoxelGrid

    world = world_of({"units": "mm", "up": "-y"})
    corners = np.stack(np.meshgrid([-0.3, 0.3], [-0.2, 0.2], [0.2, 1.7], indexing="ij"), axis=-1).reshape(-1, 3)
    masks = []
    for camera in ring:
        mask = np.zeros(camera.size[::-1], np.uint8)
        cv2.fillConvexPoly(mask, cv2.convexHull(project(camera, corners)[0].round().astype(np.int32)), 1)
        masks.append(mask.astype(bool))
    write_calibration(recording_folder / "calibration.toml", written_in(world, ring))
    (recording_folder / "recording.toml").write_text('units = "mm"\nup = "-y"\n')
    rig = open_recording(recording_folder).rig
    grid = VoxelGrid.from_room(np.array([[-1, -1, 0], [1, 1, 2]]), 0.05)
    one, other = (carve(make_tables(grid, cameras), masks) for cameras in (ring, rig))
    assert one.any() and (one != other).mean() < 1e-4


@pytest.mark.parametrize("factor, unit", [(1000, "mm"), (100, "cm")])
def test_what_looks_like_other_units_proposes_them(recording_folder, ring, factor, unit):
    write_calibration(recording_folder / "calibration.toml", written_in(world_of({"units": 1 / factor}), ring))
    with pytest.raises(InputError, match=rf'cameras stand .* m from the origin.* write units = "{unit}"') as caught:
        open_recording(recording_folder)
    (recording_folder / "recording.toml").write_text(re.search(r'units = "\w+"', str(caught.value))[0] + "\n")
    assert_allclose(open_recording(recording_folder).rig.centres, ring.centres, atol=1e-9)


def rename(folder, names):
    for place, name in enumerate(names):
        for kind in ("videos", "background"):
            (folder / kind / f"cam_{place:02d}.avi").rename(folder / kind / name)


def levels(recording):
    frame = next(iter(iterate_frames(recording)))
    return [None if image is None else round(float(image.mean())) for image in frame.images]


@pytest.fixture
def told_apart(recording_folder, ring):
    """Each camera's video has a brightness of its own."""
    for place, camera in enumerate(ring):
        write_video(recording_folder / "videos" / f"{camera.name}.avi", 4, camera.size, lambda index, place=place: 50 + 30 * place)
    return recording_folder


def assert_right_videos(recording):
    assert_allclose(levels(recording), [50 + 30 * int(name[-1]) for name in recording.rig.names], atol=2)


def test_names_in_pieces():
    assert tokens_of("Camera_01") == tokens_of("cam1") == tokens_of("CAM-1") == tokens_of("port_1") == ("cam", "1")
    assert tokens_of("2111234") == ("2111234",) and tokens_of("00_01") == ("0", "1") and tokens_of("_") == ()


@pytest.mark.parametrize("pattern", ["cam{}.avi", "Camera{}.avi", "CAM_{}.avi", "cam-000{}.avi", "walk_cam_0{}_2024.avi", "t1.cam{}.avi"])
def test_names_that_differ_a_little_are_taken_and_told(told_apart, pattern):
    rename(told_apart, [pattern.format(place) for place in range(5)])
    recording = open_recording(told_apart)
    assert_right_videos(recording)
    assert all(len(list(background_frames(recording, camera))) == 4 for camera in range(5))
    assert len([note for note in recording.problems if "taken for camera 'cam_0" in note]) == 10
    assert_right_videos(open_recording(told_apart, cameras=["cam_03", "cam_01"]))
    findings = check_recording(told_apart)
    assert [f.severity for f in findings if "taken for camera" in f.sentence] == ["note"] * 10
    assert not any("not used" in f.sentence for f in findings)


def test_exact_names_come_first(told_apart):
    """Others with the name in theirs are left alone, as ever."""
    write_video(told_apart / "videos" / "old_cam_01.avi", 2, (160, 120))
    write_video(told_apart / "videos" / "cam1.avi", 2, (160, 120))
    recording = open_recording(told_apart)
    assert_right_videos(recording)
    assert recording.problems == ()


def test_no_guess_goes_before_images_by_name(told_apart):
    """Nor is a guess made for some cameras only."""
    rename(told_apart, [f"preview_cam{place}.avi" for place in range(5)])
    (told_apart / "videos" / "preview_cam4.avi").unlink()
    with pytest.raises(InputError, match="no videos/"):
        open_recording(told_apart)
    write_video(told_apart / "videos" / "late_cam0.avi", 2, (160, 120))
    for place in range(5):
        write_images(told_apart / "images" / f"cam_0{place}", range(3), (160, 120), lambda index, place=place: 50 + 30 * place)
    recording = open_recording(told_apart)
    assert_right_videos(recording)
    assert recording.n_frames == 3 and not any("videos" in problem for problem in recording.problems)


def test_what_is_not_clear_proposes_a_table(told_apart):
    rename(told_apart, [f"walk_cam{place}.avi" for place in range(5)])
    write_video(told_apart / "videos" / "run_cam3.avi", 2, (160, 120))
    with pytest.raises(InputError, match=r"camera 'cam_03' may be run_cam3.avi or walk_cam3.avi; say which in recording.toml: videos = \{"):
        open_recording(told_apart)
    assert any("camera 'cam_03' may be" in f.sentence and f.severity == "error" for f in check_recording(told_apart))
    (told_apart / "recording.toml").write_text('videos = { cam_03 = "videos/walk_cam3.avi" }\n')
    assert_right_videos(open_recording(told_apart))
    (told_apart / "recording.toml").write_text('videos = "videos/walk_cam*{camera}.avi"\n')
    with pytest.raises(InputError, match="fits no file of any camera"):
        open_recording(told_apart)
    table = ", ".join(f'cam_0{place} = "videos/walk_cam{place}.avi"' for place in range(5))
    (told_apart / "recording.toml").write_text(f"videos = {{ {table} }}\n")
    recording = open_recording(told_apart)
    assert_right_videos(recording)
    assert not any("videos" in problem for problem in recording.problems)


def test_one_file_for_two_cameras_is_not_clear(told_apart):
    rename(told_apart, ["cam_00_cam_01.avi", "b.avi", "c.avi", "d.avi", "e.avi"])
    with pytest.raises(InputError, match=r"cam_00_cam_01.avi may be camera 'cam_00' or 'cam_01'; say which"):
        open_recording(told_apart)


def test_no_name_at_all_proposes_a_table_that_works(told_apart):
    rename(told_apart, [f"GX01002{place}.avi" for place in range(5)])
    with pytest.raises(InputError, match=r'say whose is whose in recording.toml: videos = \{ "cam_00" = "videos/GX010020.avi"') as caught:
        open_recording(told_apart)
    assert "\n" not in str(caught.value)
    text = "[videos]\n" + "".join(f'cam_0{place} = "videos/GX01002{place}.avi"\n' for place in range(5))
    text += "[background]\n" + "".join(f'cam_0{place} = "background/GX01002{place}.avi"\n' for place in range(5))
    (told_apart / "recording.toml").write_text(text)
    recording = open_recording(told_apart)
    assert_right_videos(recording)
    assert recording.n_background_frames == (4,) * 5
    assert not [f for f in check_recording(told_apart) if "not used" in f.sentence]


def test_patterns(told_apart):
    """Beside the calibration, in folders a camera, and as numbered images."""
    rename(told_apart, [f"x{place}.avi" for place in range(5)])
    for place in range(5):
        (told_apart / "videos" / f"x{place}.avi").rename(told_apart / f"trial_cam_0{place}_GX{7 * place}.avi")
    (told_apart / "recording.toml").write_text('videos = "trial_{camera}_*.avi"\n')
    assert_right_videos(open_recording(told_apart))
    (told_apart / "recording.toml").write_text('videos = "*{camera}*"\n')
    assert_right_videos(open_recording(told_apart))
    write_video(told_apart / "trial_cam_02_again.avi", 2, (160, 120))
    with pytest.raises(InputError, match=r"`videos` = .* fits 2 files of camera 'cam_02' "):
        open_recording(told_apart)
    for place in range(5):
        write_images(told_apart / "shots", [3, 4, 5], (160, 120), lambda index, place=place: 50 + 30 * place, f"cam_0{place}_{{:04d}}.png")
        write_images(told_apart / "masks" / f"of_cam_0{place}", [3, 4, 5], (160, 120), lambda index: index - 3)
    (told_apart / "recording.toml").write_text('images = "shots/{camera}_*.png"\nsilhouettes = "masks/of_{camera}"\n')
    recording = open_recording(told_apart)
    assert recording.n_frames == 3 and recording.has_silhouettes
    assert_right_videos(recording)
    assert [bool(frame.silhouettes[4].any()) for frame in iterate_frames(recording)] == [False, True, True]


def test_two_people_with_another_ones_calibration(shared_data, tmp_path):
    """Videos cam01.mp4 ... and the serial numbers cam_01 ... of the same cameras in another export."""
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "c.qca.txt").write_text((shared_data / "balancing" / "original" / "Calib.qca.txt").read_text())
    (tmp_path / "videos").symlink_to(shared_data / "two_people" / "videos")
    recording = open_recording(tmp_path)
    assert recording.rig.names == ("cam_01", "cam_02", "cam_03", "cam_04")
    assert [view.path.name for view in recording._footage] == ["cam01.mp4", "cam02.mp4", "cam03.mp4", "cam04.mp4"]
    assert open_recording(shared_data / "two_people").rig.names == ("cam01", "cam02", "cam03", "cam04")


def resized(folder, ring, size):
    for camera in ring:
        write_video(folder / "videos" / f"{camera.name}.avi", 3, size)
        (folder / "background" / f"{camera.name}.avi").unlink(missing_ok=True)


@pytest.mark.parametrize("size", [(320, 240), (240, 180), (80, 60), (214, 160)])
def test_scaled_images(recording_folder, ring, size):
    resized(recording_folder, ring, size)
    with pytest.raises(InputError, match=rf"images are {size[0]} x {size[1]} but .* times as large: .* write image_size = \"scaled\" in"):
        open_recording(recording_folder)
    (recording_folder / "recording.toml").write_text('image_size = "scaled"\n')
    recording = open_recording(recording_folder)
    factor = size[0] / 160
    points = np.random.default_rng(0).uniform([-0.5, -0.5, 0.5], [0.5, 0.5, 1.5], (20, 3))
    for camera, calibrated in zip(recording.rig, ring, strict=True):
        assert camera.size == size
        uv = project(calibrated, points)[0]
        assert_allclose(project(camera, points)[0], (uv + 0.5) * factor - 0.5, atol=0.3)
    assert_allclose(read_rig(recording_folder)[0].projection, recording.rig[0].projection)
    assert not [f for f in check_recording(recording_folder) if f.severity == "error"]


@pytest.mark.parametrize("size", [(160, 128), (176, 128), (160, 112)])
def test_padded_images(recording_folder, ring, size):
    resized(recording_folder, ring, size)
    with pytest.raises(InputError, match=r'write image_size = "padded" in recording.toml'):
        open_recording(recording_folder)
    (recording_folder / "recording.toml").write_text('image_size = "padded"\n')
    recording = open_recording(recording_folder)
    for camera, calibrated in zip(recording.rig, ring, strict=True):
        assert camera.size == size
        assert_allclose(camera.matrix, calibrated.matrix)
    assert not [f for f in check_recording(recording_folder) if f.severity == "error"]
    (recording_folder / "recording.toml").write_text('image_size = "scaled"\n')
    with pytest.raises(InputError, match=r'image_size = "scaled", but images are .*: no factor makes'):
        open_recording(recording_folder)
    assert any("no factor makes" in f.sentence for f in check_recording(recording_folder))


def test_turned_images_are_called_so(recording_folder, ring):
    resized(recording_folder, ring, (120, 160))
    with pytest.raises(InputError, match=r"images are 120 x 160 but .* they are turned by 90 degrees"):
        open_recording(recording_folder)


@pytest.mark.parametrize(
    "calibrated, size, words",
    [
        ((1920, 1080), (1920, 1088), "padded"),
        ((1088, 1920), (1080, 1920), "padded"),
        ((1920, 1080), (1280, 720), "scaled"),
        ((1920, 1080), (960, 540), "scaled"),
        ((1920, 1080), (853, 480), "scaled"),
        ((1920, 1080), (1440, 1080), "correct `size` and `matrix`"),
        ((1920, 1080), (1080, 1920), "turned by 90"),
    ],
)
def test_the_cure_that_is_proposed_works(ring, calibrated, size, words):
    from hmc.io.sizes import size_cure

    cure = size_cure(calibrated, size, np.divide(calibrated, 2))
    assert words in cure
    fit = re.search(r'image_size = "(\w+)"', cure)
    if fit:
        assert fit_size(replace(ring[0], size=calibrated), size, fit[1]).size == size
