"""Layouts of files that laboratories have: read as they are, or refused with the one line of recording.toml that mends it."""

import re
import unicodedata
from dataclasses import replace

import cv2
import numpy as np
import pytest
from conftest import write_video

from hmc.check import inspect_recording
from hmc.errors import InputError
from hmc.io.calibration import read_calibration, write_calibration
from hmc.io.recording import iterate_frames, open_recording
from hmc.io.sizes import size_cure

N = 3


@pytest.fixture
def bare(tmp_path, ring):
    """Folder and rig of a recording without any images."""
    folder = tmp_path / "a lab"
    folder.mkdir()
    write_calibration(folder / "calibration.toml", ring)
    return folder, ring


def videos_at(folder, rig, place):
    """A video a camera at a place, each of its own grey."""
    for k, camera in enumerate(rig):
        path = folder / place.format(camera.name)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_video(path, N, camera.size, lambda index, k=k: 20 + 30 * k)


def assert_each_its_own(recording):
    frame = next(iter(iterate_frames(recording)))
    assert [image.mean() for image in frame.images] == pytest.approx([20 + 30 * k for k in range(len(recording.rig))], abs=8)


def line_of(error):
    """What the message says to write in recording.toml."""
    return re.search(r"write in recording\.toml: (.*)$", str(error.value))[1]


def test_a_camera_folder_may_hold_its_one_video(bare):
    videos_at(*bare, "videos/{}/GX010021.avi")
    assert_each_its_own(open_recording(bare[0]))


@pytest.mark.parametrize("kind", ["videos", "silhouettes"])
def test_a_pattern_that_fits_nothing_is_told(bare, kind):
    folder, rig = bare
    videos_at(folder, rig, "videos/{}.avi")
    (folder / "recording.toml").write_text(f'{kind} = "other/{{camera}}_*.avi"\n')
    with pytest.raises(InputError, match=rf'recording.toml: `{kind}` = "other/.*" fits no file of any camera; correct or remove it'):
        open_recording(folder)


def test_an_empty_scene_whose_pattern_fits_nothing_is_told(bare):
    folder, rig = bare
    for place in ("videos/{}.avi", "background/{}.avi"):
        videos_at(folder, rig, place)
    (folder / "recording.toml").write_text('background = "empty/{camera}.avi"\n')
    (problem,) = (one for one in open_recording(folder).problems if "background" in one)
    assert "fits no file of any camera" in problem and problem.endswith("going on without background")


def test_images_of_floating_point_are_refused(bare):
    folder, rig = bare
    for camera in rig:
        (folder / "images" / camera.name).mkdir(parents=True)
        width, height = camera.size
        cv2.imwrite(str(folder / "images" / camera.name / "0000.tif"), np.full((height, width, 3), 0.5, np.float32))
    with pytest.raises(InputError, match="its values are float32, as no camera has them; convert its images to 8 or 16 bits"):
        open_recording(folder)


def test_two_videos_in_a_camera_folder_are_told(bare):
    for name in ("one", "two"):
        videos_at(*bare, f"videos/{{}}/{name}.avi")
    with pytest.raises(InputError, match=r"2 videos in a camera's folder \(one.avi, two.avi\); leave one, or join them"):
        open_recording(bare[0])


@pytest.mark.parametrize("place", ["{}.avi", "{}/video.avi", "{}_take1.avi", "trial/{}.avi"])
def test_videos_elsewhere_are_proposed_by_a_pattern_that_works(bare, place):
    folder, _ = bare
    videos_at(*bare, place)
    with pytest.raises(InputError) as error:
        open_recording(folder)
    (folder / "recording.toml").write_text(line_of(error))
    assert_each_its_own(open_recording(folder))


@pytest.mark.parametrize("place", ["images/{}_{:05d}.png", "{}/{:05d}.png"])
def test_numbered_images_are_proposed_by_a_pattern_that_works(bare, place):
    folder, rig = bare
    write_numbered(folder, rig, place)
    with pytest.raises(InputError) as error:
        open_recording(folder)
    (folder / "recording.toml").write_text(line_of(error))
    recording = open_recording(folder)
    assert recording.n_frames >= N
    assert_each_its_own(recording)


def write_numbered(folder, rig, place, n=N):
    for k, camera in enumerate(rig):
        for frame in range(n):
            path = folder / place.format(camera.name, frame)
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), np.full((*camera.size[::-1], 3), 20 + 30 * k, np.uint8))


def test_many_files_of_nobody_are_one_note(bare):
    folder, rig = bare
    write_numbered(folder, rig, "images/{}_{:05d}.png", 20)
    notes = [finding.sentence for finding in inspect_recording(folder).findings if finding.severity == "note"]
    assert len([note for note in notes if "not used" in note]) == 1


def test_videos_numbered_from_another_number_are_proposed_all(bare):
    folder, rig = bare
    later = type(rig)(tuple(replace(camera, name=f"cam_{k + 1:02d}") for k, camera in enumerate(rig)))
    write_calibration(folder / "calibration.toml", later)
    videos_at(folder, [replace(camera, name=f"cam_{k:02d}") for k, camera in enumerate(rig)], "videos/{}.avi")
    with pytest.raises(InputError, match="numbered from different numbers") as error:
        open_recording(folder)
    (folder / "recording.toml").write_text(line_of(error))
    assert_each_its_own(open_recording(folder))


def test_umlauts_in_two_signs_are_the_same_name(bare):
    folder, rig = bare
    named = type(rig)(tuple(replace(camera, name=f"Kamera Tür {k}") for k, camera in enumerate(rig)))
    write_calibration(folder / "calibration.toml", named)
    videos_at(folder, [replace(camera, name=unicodedata.normalize("NFD", camera.name)) for camera in named], "videos/{}.avi")
    assert_each_its_own(open_recording(folder))


def test_sizes_with_width_and_height_exchanged_are_called_so():
    assert "write size = [640, 480] (width, height)" in size_cure((480, 640), (640, 480), (318.0, 242.0))
    assert "turned by 90 degrees" in size_cure((480, 640), (640, 480), (238.0, 321.0))


def test_commands_that_are_proposed_can_be_pasted(bare):
    folder, rig = bare
    far = type(rig)(tuple(replace(camera, translation=camera.translation * 1000) for camera in rig))
    write_calibration(folder / "calibration.toml", far)
    videos_at(folder, rig, "videos/{}.avi")
    with pytest.raises(InputError, match=f"hmc world '{re.escape(str(folder))}'$"):
        open_recording(folder)


def test_names_of_any_signs_are_written_and_read_again(bare):
    folder, rig = bare
    names = ["Kamera Tür links", "cam.1", 'the "old" one', "100 % 'new'"]
    named = type(rig)(tuple(replace(camera, name=name) for camera, name in zip(rig, names, strict=False)))
    write_calibration(folder / "calibration.toml", named)
    assert set(read_calibration(folder / "calibration.toml").names) == set(named.names)
