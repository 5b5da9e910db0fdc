"""Recordings on disk: what is read, what is survived, what is refused and in which words."""

import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from conftest import write_images, write_video
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.io.calibration import write_calibration
from hmc.io.recording import background_frames, for_voxels, iterate_frames, only_cameras, open_recording, reduced, whole_recording

GIVEN_ONCE = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def indices(frame):
    """Which frame each camera's image is, by its brightness; None where there is none."""
    return [None if image is None else round((float(image.mean()) - 40) / 5) for image in frame.images]


def read_all(folder, **selection):
    problems = []
    recording = open_recording(folder, **selection)
    frames = list(iterate_frames(recording, on_problem=problems.append))
    return recording, frames, [*recording.problems, *problems]


def test_a_good_recording(recording_folder, ring):
    recording, frames, problems = read_all(recording_folder)
    assert recording.name == "take_1" and recording.fps == 25 and recording.n_frames == 12 and recording.start == 0
    assert recording.rig.names == ring.names and recording.persons is None and recording.subject_height_m == ()
    assert recording.room.shape == (2, 3) and recording.room_is_estimated
    assert recording.has_images and not recording.has_silhouettes
    assert [frame.index for frame in frames] == list(range(12))
    assert all(indices(frame) == [frame.index] * 5 for frame in frames)
    assert frames[0].images[0].shape == (120, 160, 3) and frames[0].images[0].dtype == np.uint8
    assert frames[0].silhouettes is None and problems == []
    background = list(background_frames(recording, 1))
    assert len(background) == 4 and recording.n_background_frames == (4,) * 5
    assert_allclose(background[0].mean(), 20, atol=2)
    assert len(list(background_frames(recording, 1, limit=2))) == 2


@given(st.integers(0, 11), st.integers(1, 20), st.integers(0, 14), st.integers(0, 14))
@GIVEN_ONCE
def test_parts_are_exact(recording_folder, start, count, first, last):
    recording = open_recording(recording_folder, cameras=["cam_03", "cam_01"], start=start, frames=count)
    selection = list(range(12))[start : start + count]
    assert recording.rig.names == ("cam_03", "cam_01") and recording.n_frames == len(selection) and recording.start == start
    frames = list(iterate_frames(recording, first, last))
    assert [frame.index for frame in frames] == [i for i in selection if first <= i < last]
    assert all(indices(frame) == [frame.index] * 2 for frame in frames)


def test_seeking_is_exact_where_frames_depend_on_each_other(recording_folder, ring):
    """MPEG-4 with few key frames and noise: a part is, bit by bit, what reading from the start gives."""
    rng = np.random.default_rng(0)
    for camera in ring:
        (recording_folder / "videos" / f"{camera.name}.avi").unlink()
        writer = cv2.VideoWriter(str(recording_folder / "videos" / f"{camera.name}.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 25, camera.size)
        for _ in range(40):
            writer.write(rng.integers(0, 255, (120, 160, 3), np.uint8))
        writer.release()
    _, whole, _ = read_all(recording_folder)
    _, part, _ = read_all(recording_folder, start=29, frames=3)
    assert len(whole) == 40 and [frame.index for frame in part] == [29, 30, 31]
    for frame in part:
        for image, expected in zip(frame.images, whole[frame.index].images, strict=True):
            np.testing.assert_array_equal(image, expected)


@pytest.mark.parametrize("kind", ["videos", "images"])
def test_chosen_frames_are_those_of_reading_all_and_others_are_not_missed(recording_folder, ring, kind):
    if kind == "images":
        shutil.rmtree(recording_folder / "videos")
        for camera in ring:
            write_images(recording_folder / "images" / camera.name, range(12), camera.size)
    problems = []
    recording = open_recording(recording_folder)
    chosen = list(iterate_frames(recording, 1, 8, problems.append, only={2, 3, 7, 11}))
    assert [frame.index for frame in chosen] == [2, 3, 7] and not problems
    assert [indices(frame) for frame in chosen] == [[k] * len(ring) for k in (2, 3, 7)]


def test_settings_are_read(recording_folder):
    (recording_folder / "recording.toml").write_text(
        'name = "walk"\nfps = 50\nframes = 9\nunits = "m"\nup = "z"\npersons = 2\n'
        "subject_height_m = [1.77, 1.6]\nroom = [[-1, -2, 0], [1, 2, 2.5]]\n"
    )
    recording = open_recording(recording_folder)
    assert (recording.name, recording.fps, recording.n_frames, recording.persons) == ("walk", 50, 9, 2)
    assert recording.subject_height_m == (1.77, 1.6) and not recording.room_is_estimated
    assert_allclose(recording.room, [[-1, -2, 0], [1, 2, 2.5]])


def test_images_and_silhouettes_by_number(tmp_path, ring):
    """Numbers count from 1 here and some are missing; silhouettes bear the same numbers."""
    write_calibration(tmp_path / "calibration.toml", ring.select(["cam_00", "cam_01"]))
    write_images(tmp_path / "images" / "cam_00", [1, 2, 3, 5], (160, 120), lambda n: 35 + 5 * n, "shot_2_{:d}.png")
    write_images(tmp_path / "images" / "cam_01", range(1, 12), (160, 120), lambda n: 35 + 5 * n, "{:d}.jpg")
    write_images(tmp_path / "silhouettes" / "cam_00", [2, 3], (160, 120), lambda n: n - 2)
    recording, frames, problems = read_all(tmp_path)
    assert recording.n_frames == 5  # two cameras see the first five
    assert [indices(frame) for frame in frames] == [[0, 0], [1, 1], [2, 2], [None, 3], [4, 4]]
    masks = [frame.silhouettes for frame in frames]
    assert all(mask is not None and mask[1] is None for mask in masks)
    assert masks[0][0] is None and not masks[1][0].any() and masks[2][0].all() and masks[2][0].dtype == bool
    assert masks[2][0].shape == (120, 160)
    assert len(problems) == 2 and "cam_00: 1 of 5 images are missing, the first is frame 3" in problems[0]
    assert "cameras differ in length (cam_00 5, cam_01 11); 5 frames are used" in problems[1]


@pytest.mark.parametrize("lengths", [(6, 9, 9), (9, 9, 6), (6, 6, 9)])
def test_videos_of_one_name_have_a_length_each(tmp_path, ring, lengths):
    names = ["cam_00", "cam_01", "cam_02"]
    write_calibration(tmp_path / "calibration.toml", ring.select(names))
    for name, n in zip(names, lengths, strict=True):
        write_video(tmp_path / "videos" / name / "take.mp4", n, (160, 120))
    recording = open_recording(tmp_path)
    assert recording.n_frames == sorted(lengths)[1]
    told = ", ".join(f"{name} {n}" for name, n in zip(names, lengths, strict=True))
    assert any(f"cameras differ in length ({told}); {sorted(lengths)[1]} frames are used" in line for line in recording.problems)


def test_numbers_count_from_the_first_of_all_cameras(tmp_path, ring):
    """cam_01 starts two frames late; that is so too when it is read alone."""
    write_calibration(tmp_path / "calibration.toml", ring.select(["cam_00", "cam_01"]))
    write_images(tmp_path / "images" / "cam_00", range(100, 106), (160, 120), lambda n: 40 + 5 * (n - 100))
    write_images(tmp_path / "images" / "cam_01", range(102, 106), (160, 120), lambda n: 40 + 5 * (n - 100))
    _, frames, problems = read_all(tmp_path)
    assert [indices(frame) for frame in frames] == [[0, None], [1, None], [2, 2], [3, 3], [4, 4], [5, 5]]
    assert len(problems) == 1 and "cam_01: 2 of 6 images are missing, the first is frame 0" in problems[0]
    _, frames, _ = read_all(tmp_path, cameras="cam_01")
    assert [indices(frame) for frame in frames] == [[None], [None], [2], [3], [4], [5]]


def test_videos_and_images_may_be_mixed(recording_folder):
    (recording_folder / "videos" / "cam_01.avi").unlink()
    write_images(recording_folder / "images" / "cam_01", range(12), (160, 120))
    _, frames, problems = read_all(recording_folder)
    assert all(indices(frame) == [frame.index] * 5 for frame in frames) and problems == []


def test_calibration_in_another_format(recording_folder, ring):
    """HumanEva's form, without sizes, in a folder of its own; sizes come from the videos."""
    (recording_folder / "calibration.toml").unlink()
    (recording_folder / "calibration").mkdir()
    for camera in ring:
        k, t = camera.matrix, 1000 * camera.translation
        numbers = [k[0, 0], k[1, 1], k[0, 2], k[1, 2], 0, *camera.distortions, *camera.rotation.ravel(), *t]
        (recording_folder / "calibration" / f"{camera.name}.cal").write_text(" ".join(map(repr, map(float, numbers))))
    recording = open_recording(recording_folder)
    assert recording.rig.names == ring.names and recording.rig[3].size == (160, 120)
    assert_allclose(recording.rig.centres, ring.centres, atol=1e-9)


def test_silhouettes_alone(tmp_path, ring):
    write_calibration(tmp_path / "calibration.toml", ring)
    for camera in ring:
        write_images(tmp_path / "silhouettes" / camera.name, range(3), camera.size, lambda n: 127 + n, "{:04d}.jpg")
    recording, frames, problems = read_all(tmp_path)
    assert recording.n_frames == 3 and not recording.has_images and recording.has_silhouettes and recording.fps == 30 and problems == []
    assert frames[0].images == (None,) * 5
    assert [bool(frame.silhouettes[4].all()) for frame in frames] == [False, True, True]


def test_unreadable_image_in_the_middle(recording_folder, ring, caplog):
    folder = write_images(recording_folder / "images" / "cam_00", range(4), (160, 120))
    (folder / "000002.png").write_bytes(b"not an image")
    for camera in ring[1:]:
        write_images(recording_folder / "images" / camera.name, range(4), (160, 120))
    write_images(recording_folder / "images" / "cam_01", [1], (80, 60))
    for file in (recording_folder / "videos").iterdir():
        file.unlink()
    (recording_folder / "videos").rmdir()
    recording, frames, problems = read_all(recording_folder)
    assert [indices(frame)[:2] for frame in frames] == [[0, 0], [1, None], [None, 2], [3, 3]]
    assert problems == [
        "cam_01: frame 1 is 80 x 60 and not 160 x 120; left out",
        "cam_00: frame 2 cannot be read; left out",
    ]
    list(iterate_frames(recording))  # without a callback it is logged
    assert [record.name for record in caplog.records] == ["hmc", "hmc"]


def test_unreadable_images_at_the_end(recording_folder, ring):
    folder = write_images(recording_folder / "images" / "cam_00", range(5), (160, 120))
    for camera in ring[1:]:
        write_images(recording_folder / "images" / camera.name, range(5), (160, 120))
    for number in (2, 3, 4):
        (folder / f"{number:06d}.png").write_bytes(b"not an image")
    for file in (recording_folder / "videos").iterdir():
        file.unlink()
    (recording_folder / "videos").rmdir()
    assert read_all(recording_folder)[2] == ["cam_00: frames 2 to 4 cannot be read; left out"]
    assert read_all(recording_folder, frames=3)[2] == ["cam_00: frame 2 cannot be read; left out"]
    # The last frame's loss is known with the frame; what was lost so far is known to who stops before the end.
    problems: list[str] = []
    frames = iterate_frames(open_recording(recording_folder, frames=3), on_problem=problems.append)
    for _ in range(3):
        next(frames)
    assert problems == ["cam_00: frame 2 cannot be read; left out"]
    frames = iterate_frames(open_recording(recording_folder), on_problem=problems.append)
    for _ in range(4):
        next(frames)
    frames.close()
    assert problems[1:] == ["cam_00: frames 2 to 3 cannot be read; left out"]


def test_a_camera_drops_out(recording_folder):
    write_video(recording_folder / "videos" / "cam_02.avi", 5, (160, 120))
    recording, frames, problems = read_all(recording_folder)
    assert recording.n_frames == 12
    assert indices(frames[4])[2] == 4 and indices(frames[5]) == [5, 5, None, 5, 5]
    assert len(problems) == 1 and "cam_02 5" in problems[0]
    _, frames, _ = read_all(recording_folder, start=7)
    assert indices(frames[0]) == [7, 7, None, 7, 7]


def test_longer_than_the_others(recording_folder):
    write_video(recording_folder / "videos" / "cam_02.avi", 30, (160, 120))
    assert open_recording(recording_folder).n_frames == 12
    assert open_recording(recording_folder, cameras=["cam_02"]).n_frames == 30


def test_truncated_video(recording_folder):
    path = recording_folder / "videos" / "cam_01.avi"
    data = path.read_bytes()
    chunks = data[: data.index(b"idx1")].split(b"00dc")
    path.write_bytes(b"00dc".join(chunks[:8]))
    recording, frames, problems = read_all(recording_folder)
    assert recording.n_frames == len(frames) == 12
    seen = [indices(frame)[1] for frame in frames]
    n = 12 - seen.count(None)
    assert 2 < n < 12 and seen[: n - 1] == list(range(n - 1))  # the last one may be half a picture
    assert seen[n:] == [None] * (12 - n)
    assert any("cam_01.avi" in problem for problem in problems)


def test_damage_in_the_middle_does_not_shift_the_rest(recording_folder):
    """A damaged stretch of an MPEG-4 video: what comes after it keeps its place."""
    path = recording_folder / "videos" / "cam_01.mp4"
    (recording_folder / "videos" / "cam_01.avi").unlink()
    rng = np.random.default_rng(0)
    scenes = [cv2.resize(rng.integers(0, 255, (6, 8, 3), np.uint8), (160, 120)) for _ in range(60)]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 25, (160, 120))
    for scene in scenes:
        writer.write(scene)
    writer.release()
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 3000] = bytes([0xAA]) * 3000
    path.write_bytes(data)
    recording, frames, _ = read_all(recording_folder, cameras=["cam_01"])
    assert recording.n_frames == 60

    def error(image, scene):
        return np.abs(image.astype(float) - scene).mean()

    for frame in (*frames[:20], *frames[-12:]):
        (image,) = frame.images
        assert image is not None and np.argmin([error(image, scene) for scene in scenes]) == frame.index


def test_fewer_frames_than_stated(recording_folder):
    (recording_folder / "recording.toml").write_text("frames = 20\n")
    recording, _, problems = read_all(recording_folder)
    assert recording.n_frames == 12 and "says 20 frames, but there are 12" in problems[0]


def test_odd_background_is_reported_and_left_out(recording_folder):
    write_video(recording_folder / "background" / "cam_00.avi", 3, (80, 60))
    (recording_folder / "background" / "cam_01.avi").write_bytes(b"nothing")
    (recording_folder / "background" / "cam_02.avi").unlink()
    cv2.imwrite(str(recording_folder / "background" / "cam_02.png"), np.full((120, 160, 3), 9, np.uint8))
    recording = open_recording(recording_folder)
    assert recording.n_background_frames == (0, 0, 1, 4, 4)
    assert len(recording.problems) == 2 and "80 x 60" in recording.problems[0] and "cam_01.avi" in recording.problems[1]
    assert list(background_frames(recording, 0)) == []
    assert next(background_frames(recording, 2)).mean() == 9


def test_closing_early_is_fine(recording_folder):
    frames = iterate_frames(open_recording(recording_folder))
    next(frames)
    frames.close()


def edit(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize(
    "spoil, message",
    [
        (lambda f: (f / "calibration.toml").unlink(), "no calibration found"),
        (lambda f: (f / "videos" / "cam_01.avi").unlink(), "camera 'cam_01' of the calibration has no video"),
        (lambda f: (f / "videos" / "cam_01.avi").write_bytes(b""), r"cam_01.avi: this video cannot be read"),
        (lambda f: (f / "videos").rename(f / "films"), "no videos/, images/ or silhouettes/"),
        (
            lambda f: write_video(f / "videos" / "cam_01.avi", 3, (80, 60)),
            "are 80 x 60 but the calibration of 'cam_01' says 160 x 120",
        ),
        (lambda f: edit(f / "calibration.toml", "translation = [", "translation = [nan, "), "camera 'cam_00': `translation`"),
        (lambda f: edit(f / "calibration.toml", "rotation = [", "rotation = [nan, 0, 0]\n#"), "camera 'cam_00': `rotation` holds"),
        (lambda f: (f / "images" / "cam_01").mkdir(parents=True) or (f / "videos" / "cam_01.avi").unlink(), "no image in this folder"),
    ],
)
def test_what_cannot_be_used_is_refused(recording_folder, spoil, message):
    spoil(recording_folder)
    with pytest.raises(InputError, match=message) as caught:
        open_recording(recording_folder)
    assert "\n" not in str(caught.value) and str(recording_folder) in str(caught.value)


def test_millimetres_are_refused(recording_folder, ring):
    far = Rig(tuple(replace(camera, translation=1000 * camera.translation) for camera in ring))
    write_calibration(recording_folder / "calibration.toml", far)
    with pytest.raises(InputError, match='looks like millimetres; write units = "mm"'):
        open_recording(recording_folder)


@pytest.mark.parametrize(
    "selection, message",
    [
        ({"cameras": ["cam_00", "cam_09"]}, "no camera named 'cam_09'"),
        ({"start": 12}, "nothing to read from frame 12 on .*; it has 12 frames"),
        ({"start": -1}, "nothing to read"),
        ({"frames": 0}, "nothing to read"),
    ],
)
def test_wrong_selections(recording_folder, selection, message):
    with pytest.raises(InputError, match=message):
        open_recording(recording_folder, **selection)


def test_no_such_folder(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        open_recording(tmp_path / "nowhere")


@pytest.mark.parametrize(
    "text, message",
    [
        ("subject_heigth_m = [1.7]", r"unknown key `subject_heigth_m`; did you mean `subject_height_m`\?"),
        ("fps = 0", "`fps` must be a number above 0; got 0"),
        ("fps = nan", "`fps` must be"),
        ('fps = "25"', "`fps` must be"),
        ("frames = 0", "`frames` must be a whole number, 1 or more"),
        ("persons = -1", "`persons` must be a whole number"),
        ("persons = 1.5", "`persons` must be a whole number"),
        ("name = 3", "`name` must be a text"),
        ('units = "inch"', '`units` must be those of the calibration: "m", "cm", "mm" or metres a unit; got \'inch\''),
        ("units = 0", "`units` must be those"),
        ("units = inf", "`units` must be those"),
        ("units = true", "`units` must be those"),
        ('units = ["mm"]', "`units` must be those"),
        ('up = "w"', "`up` must be the calibration's axis that points up, one of z, -z, y, -y, x, -x"),
        ('up = ["y"]', "`up` must be"),
        ('image_size = "half"', "`image_size` must be one of scaled, padded"),
        ('videos = "videos/a.mp4"', r'`videos` must be a table \{ cam_00 = "videos/FILE" \} or a pattern'),
        ("videos = { cam_00 = 3 }", "`videos` must be a table"),
        ("silhouettes = []", "`silhouettes` must be a table"),
        ('videos = { cam_77 = "a.mp4" }', "`videos` names 'cam_77', no camera of the calibration"),
        ('videos = { cam_00 = "gone.mp4" }', "`videos` gives camera 'cam_00' the file .*gone.mp4, which is not there"),
        ('videos = "/{camera}.mp4"', "`videos` is no pattern"),
        ("subject_height_m = [177]", "`subject_height_m` must be statures in metres"),
        ("room = [[0, 0, 0], [1, 1]]", r"`room` must be \[\[x0"),
        ("room = [[0, 0, 0], [1, -1, 2]]", r"`room` must be \[\[x0"),
        ("room = [[0, 0, 0], [5000, 4000, 2200]]", "looks like millimetres"),
        ("room = [", "not a TOML file"),
    ],
)
def test_wrong_settings(recording_folder, text, message):
    (recording_folder / "recording.toml").write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        open_recording(recording_folder)
    assert "recording.toml" in str(caught.value)


@pytest.mark.parametrize(
    "name, n_cameras, n_frames", [("balancing", 4, 100), ("bodytrack", 4, 2), ("rendered/r1", 7, 92), ("rendered/r3", 5, 180)]
)
def test_real_recordings_open(shared_data, name, n_cameras, n_frames):
    recording = open_recording(shared_data / name)
    assert len(recording.rig) == n_cameras and recording.n_frames == n_frames and recording.problems == ()
    frame = next(iterate_frames(recording))
    for image, camera in zip(frame.images, recording.rig, strict=True):
        assert image.shape == (camera.size[1], camera.size[0], 3)
    assert recording.has_silhouettes == (name == "bodytrack")


def test_damaged_h264_loses_a_frame_and_keeps_the_rest_in_place(shared_data, tmp_path, monkeypatch):
    """The decoder fails once and then skips a frame without a word; brute force tells which frames are which."""
    monkeypatch.setenv("OPENCV_FFMPEG_LOGLEVEL", "-8")
    source = shared_data / "rendered" / "r3"
    whole = [frame.images[0] for frame in iterate_frames(open_recording(source, cameras=["cam_02"], frames=75))]
    (tmp_path / "calibration.toml").write_bytes((source / "calibration.toml").read_bytes())
    (tmp_path / "videos").mkdir()
    data = bytearray((source / "videos" / "cam_02.mp4").read_bytes())
    data[len(data) // 3 : len(data) // 3 + 4000] = bytes([0xAA]) * 4000
    (tmp_path / "videos" / "cam_02.mp4").write_bytes(data)
    recording, frames, problems = read_all(tmp_path, cameras=["cam_02"])
    assert recording.n_frames == 180 and len(frames) == 180
    lost = [frame.index for frame in frames if frame.images[0] is None]
    assert 1 <= len(lost) <= 3 and 45 < lost[0] < 70 and len(problems) >= 1 and "cannot be read; left out" in problems[0]
    for frame in frames[lost[-1] + 2 : 75]:
        errors = [np.abs(frame.images[0].astype(float) - image).mean() for image in whole[frame.index - 4 : frame.index + 5]]
        assert np.argmin(errors) == 4


def test_cameras_that_did_not_start_together(recording_folder):
    (recording_folder / "recording.toml").write_text("first_frame = { cam_01 = 4, cam_03 = 1 }\n")
    recording = open_recording(recording_folder)
    assert recording.n_frames == 12  # as long as two of the cameras last
    late = {"cam_01": 4, "cam_03": 1}
    for frame in iterate_frames(recording, first=2, last=9):
        for camera, image in zip(recording.rig, frame.images, strict=True):
            index = frame.index + late.get(camera.name, 0)
            assert (image is None) == (index >= 12)
            assert image is None or abs(float(image[..., 1].mean()) - (40 + 5 * index)) <= 1
    assert [frame.images[1] is None for frame in iterate_frames(recording)] == [False] * 8 + [True] * 4


def test_numbered_images_that_did_not_start_together(recording_folder, ring):
    shutil.rmtree(recording_folder / "videos")
    for camera in ring:
        write_images(recording_folder / "images" / camera.name, [k for k in range(3, 12) if k != 7], camera.size)
    (recording_folder / "recording.toml").write_text("first_frame = { cam_00 = 2 }\n")
    for frame in iterate_frames(open_recording(recording_folder)):
        for camera, image in zip(ring, frame.images, strict=True):
            number = 3 + frame.index + 2 * (camera.name == "cam_00")
            assert (image is None) == (number == 7 or number >= 12)
            assert image is None or abs(float(image.mean()) - (40 + 5 * number)) <= 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("first_frame = { cam_01 = 12 }", "cam_01.avi: has 12 frames, but `first_frame`"),
        ("first_frame = { cam_9 = 1 }", "names 'cam_9', no camera of"),
        ("first_frame = { cam_01 = -1 }", "`first_frame` must be a table of cameras"),
        ("first_frame = 3", "`first_frame` must be a table of cameras"),
        ("first_frame = { cam_01 = 1.5 }", "`first_frame` must be a table of cameras"),
    ],
)
def test_wrong_starts_are_told(recording_folder, text, words):
    (recording_folder / "recording.toml").write_text(text + "\n")
    with pytest.raises(InputError, match=re.escape(words)):
        open_recording(recording_folder)


def test_smaller_images_of_a_selection(recording_folder, ring):
    """Images, silhouettes and the empty scene are smaller, each camera's by its own factor; nothing else changes."""
    rng = np.random.default_rng(0)
    for camera in ring:
        folder = recording_folder / "silhouettes" / camera.name
        folder.mkdir(parents=True)
        for number in range(12):
            cv2.imwrite(str(folder / f"{number}.png"), 255 * np.kron(rng.integers(0, 2, (30, 40), np.uint8), np.ones((4, 4), np.uint8)))
    whole = open_recording(recording_folder, cameras=["cam_02", "cam_00", "cam_03"], start=2, frames=4)
    small = reduced(whole, (2, 1, 4))
    assert whole.factors == (1, 1, 1) and small.factors == (2, 1, 4)
    assert [camera.size for camera in small.rig] == [(80, 60), (160, 120), (40, 30)]
    assert_allclose(small.room, whole.room)
    for frame, full in zip(iterate_frames(small), iterate_frames(whole), strict=True):
        assert frame.index == full.index and indices(frame) == indices(full)
        for camera, image, mask, own in zip(small.rig, frame.images, frame.silhouettes, full.silhouettes, strict=True):
            side = 160 // camera.size[0]
            assert image.shape == (*mask.shape, 3) == (*camera.size[::-1], 3) and mask.dtype == bool
            np.testing.assert_array_equal(mask, own[::side, ::side])
    assert [next(background_frames(small, c)).shape[1::-1] for c in range(3)] == [camera.size for camera in small.rig]
    one = only_cameras(small, [2])
    assert one.factors == (4,) and next(iterate_frames(one)).images[0].shape == (30, 40, 3)
    every = whole_recording(small)
    assert every.n_frames == 12 and every.factors == small.factors and [camera.size for camera in every.rig][2] == (40, 30)
    assert reduced(small, (2, 2, 1)).factors == (4, 2, 4)


def test_the_whole_recording_is_that_which_is_opened_without_a_selection(recording_folder):
    write_video(recording_folder / "videos" / "cam_02.avi", 5, (160, 120))
    for text, names in (
        ("", None),
        ("frames = 9\n", None),
        ("frames = 9\n", ["cam_02", "cam_01"]),
        ("first_frame = { cam_01 = 4 }\n", None),
    ):
        (recording_folder / "recording.toml").write_text(text)
        whole = whole_recording(open_recording(recording_folder, cameras=names, start=2, frames=1))
        opened = open_recording(recording_folder, cameras=names)
        assert (whole.start, whole.n_frames, whole.rig.names) == (0, opened.n_frames, opened.rig.names)


def test_small_images_stay_as_they_are_for_any_voxels(recording_folder):
    recording = open_recording(recording_folder)
    assert for_voxels(recording, 0.5) is recording


def test_one_error_is_told_whichever_camera_is_opened_first(recording_folder):
    """Cameras are opened side by side; the first in order that is wrong is named."""
    for name in ("cam_03", "cam_01"):
        (recording_folder / "videos" / f"{name}.avi").write_bytes(b"")
    with pytest.raises(InputError, match=r"cam_01\.avi"):
        open_recording(recording_folder)


def test_a_link_that_goes_round_is_a_file_that_is_not_there(tmp_path):
    shutil.copytree(Path(__file__).parents[2] / "data" / "synthetic" / "tiny", tmp_path / "tiny")
    loop = tmp_path / "tiny" / "background" / "cam_00.mp4"
    loop.unlink()
    loop.symlink_to(loop.name)
    recording = open_recording(tmp_path / "tiny")
    assert [name for name in recording.rig.names if name in " ".join(recording.problems)] == ["cam_00"]  # the others have their empty scene


@pytest.mark.parametrize("other", ["cam_01.MP4", "cam_01.mov", "cam_01.png", "cam_01"])
def test_two_files_of_one_camera_are_told(recording_folder, other):
    """The first by name would be taken, whichever was meant."""
    video = recording_folder / "videos" / "cam_01.avi"
    if other == video.stem:
        (video.parent / other).mkdir()
    else:
        shutil.copy(video, video.parent / other)
    with pytest.raises(InputError, match=r"videos: both cam_01.* and cam_01.* are of camera 'cam_01'; leave one, or say which"):
        open_recording(recording_folder)
    (recording_folder / "recording.toml").write_text('videos = { cam_01 = "videos/cam_01.avi" }\n')
    assert open_recording(recording_folder).n_frames == 12


def test_a_camera_in_videos_and_in_images_is_told(recording_folder):
    """Its video would be taken, whichever was meant."""
    write_images(recording_folder / "images" / "cam_01", range(12), (160, 120))
    with pytest.raises(InputError, match=r"both videos/cam_01\.avi and images/cam_01 are of camera 'cam_01'; leave one, or say"):
        open_recording(recording_folder)
    assert open_recording(recording_folder, cameras=["cam_00", "cam_02"]).n_frames == 12
    (recording_folder / "recording.toml").write_text('videos = { cam_01 = "videos/cam_01.avi" }\n')
    assert open_recording(recording_folder).n_frames == 12
    (recording_folder / "recording.toml").unlink()
    shutil.rmtree(recording_folder / "images" / "cam_01")
    (recording_folder / "images" / "cam_01").mkdir()  # nothing in it: nothing is chosen
    assert open_recording(recording_folder).n_frames == 12


@pytest.mark.parametrize("link", [os.link, os.symlink, None])
def test_two_cameras_with_one_video_are_told(recording_folder, link):
    videos = recording_folder / "videos"
    if link is None:
        (recording_folder / "recording.toml").write_text('videos = { cam_01 = "videos/cam_03.avi" }\n')
    else:
        (videos / "cam_03.avi").unlink()
        link(videos / "cam_01.avi", videos / "cam_03.avi")
    with pytest.raises(InputError, match=r"cameras 'cam_01' and 'cam_03' have one video, .*cam_0[13]\.avi; give each its own"):
        open_recording(recording_folder)


@pytest.mark.parametrize("bits, dark", [(10, True), (12, True), (16, False)])
def test_images_of_ten_or_twelve_bits_are_told(recording_folder, ring, bits, dark):
    """As 8 bits they are black, and the camera shows nobody."""
    (recording_folder / "videos" / "cam_01.avi").unlink()
    (recording_folder / "images" / "cam_01").mkdir(parents=True)
    for k in range(12):
        image = np.full((ring[1].size[1], ring[1].size[0], 3), (40 + 5 * k) << (bits - 8), np.uint16)
        cv2.imwrite(str(recording_folder / "images" / "cam_01" / f"{k:06d}.png"), image)
    if dark:
        with pytest.raises(
            InputError, match=rf"000000\.png: 16 bits a value, but none above {40 << (bits - 8)}, .* convert them to 8 bits"
        ):
            open_recording(recording_folder)
    else:
        _, frames, _ = read_all(recording_folder)
        assert all(indices(frame) == [frame.index] * 5 for frame in frames)


def test_a_jpeg_that_is_cut_off_is_left_out(recording_folder, ring):
    """A decoder gives gray from there on."""
    (recording_folder / "videos" / "cam_01.avi").unlink()
    write_images(recording_folder / "images" / "cam_01", range(12), ring[1].size, name="{:06d}.jpg")
    file = recording_folder / "images" / "cam_01" / "000005.jpg"
    file.write_bytes(file.read_bytes()[:-200])
    with open(file.with_name("000006.jpg"), "ab") as other:
        other.write(bytes(999))  # what a camera adds behind it
    _, frames, problems = read_all(recording_folder)
    assert [frame.index for frame in frames if frame.images[1] is None] == [5] and problems == ["cam_01: frame 5 cannot be read; left out"]


@pytest.mark.parametrize("by", [0.005, 1 / 160])
def test_a_focal_length_that_is_no_number_of_pixels_is_told(recording_folder, ring, by):
    """In millimetres, or a share of the image: else nobody is found, or with a camera less without a word."""
    odd = replace(ring[2], matrix=ring[2].matrix * [[by], [by], [1]])
    write_calibration(recording_folder / "calibration.toml", Rig((*ring[:2], odd, *ring[3:])))
    with pytest.raises(InputError, match=r"camera 'cam_02': a focal length of .* for 160 x 120 pixels, which no lens has; .*millimetres"):
        open_recording(recording_folder)


def test_what_is_odd_in_a_calibration_is_a_problem_of_every_run(recording_folder, ring):
    """And not of `hmc check` alone."""
    far = replace(ring[4], translation=1000 * ring[4].translation)
    write_calibration(recording_folder / "calibration.toml", Rig((ring[0], replace(ring[0], name="cam_01"), *ring[2:4], far)))
    problems = open_recording(recording_folder).problems
    assert any("cameras 'cam_00' and 'cam_01' stand in one place" in one for one in problems)
    assert any(
        re.search(r"camera 'cam_04' stands \d,\d+ m from the origin and the others \d\.\d; is its place in another unit", one)
        for one in problems
    )
    assert open_recording(recording_folder, any_world=True).problems == ()
    alike = [replace(camera, rotation=ring[0].rotation) for camera in ring]
    write_calibration(recording_folder / "calibration.toml", Rig(tuple(alike)))
    assert any("all cameras look into one direction" in one for one in open_recording(recording_folder).problems)


def test_what_a_system_leaves_beside_files_is_no_footage(recording_folder, ring):
    write_images(recording_folder / "images" / "cam_00", range(12), ring[0].size, name="frame_{:03d}.png")
    (recording_folder / "videos" / "cam_00.avi").unlink()
    _, before, problems = read_all(recording_folder)
    for file in [*recording_folder.glob("*/*.*"), *recording_folder.glob("images/*/*")]:
        (file.parent / f"._{file.name}").write_bytes(b"\0\5\x16\7")
    _, after, more = read_all(recording_folder)
    assert [indices(frame) for frame in after] == [indices(frame) for frame in before] and problems == more


@pytest.mark.parametrize(
    "name, words",
    [("f_001 (1).png", r"f_001 \(1\)\.png and f_001\.png have one number"), ("cover.png", "cover.png has no number")],
)
def test_numbers_that_do_not_tell_frames_apart_are_told(recording_folder, ring, name, words):
    write_images(recording_folder / "images" / "cam_00", range(11), ring[0].size, name="f_{:03d}.png")
    (recording_folder / "videos" / "cam_00.avi").unlink()
    folder = recording_folder / "images" / "cam_00"
    shutil.copy(folder / "f_001.png", folder / name)
    (problem,) = [one for one in open_recording(recording_folder).problems if "number" in one]
    assert re.search(words, problem) and "in the order of their names" in problem


def test_two_images_of_one_frame_are_told(recording_folder, ring):
    write_images(recording_folder / "images" / "cam_00", range(12), ring[0].size, name="f_{:03d}.png")
    (recording_folder / "videos" / "cam_00.avi").unlink()
    shutil.copy(recording_folder / "images/cam_00/f_001.png", recording_folder / "images/cam_00/f_001.bmp")
    with pytest.raises(InputError, match=r"both f_001\.bmp and f_001\.png are of one frame; leave one"):
        open_recording(recording_folder)


@pytest.mark.parametrize("put", [lambda path: path.write_text("moved"), lambda path: path.symlink_to("/no/such/disk")])
@pytest.mark.parametrize("kind", ["videos", "images", "silhouettes", "times", "background"])
def test_what_is_no_folder_where_one_should_be_is_told(recording_folder, kind, put):
    """Such as a link to a disk that is not mounted: else it counts as not there, and results are others."""
    folder = recording_folder / kind
    shutil.rmtree(folder, ignore_errors=True)
    put(folder)
    if kind == "background":
        said = "\n".join(open_recording(recording_folder).problems)
    else:
        with pytest.raises(InputError) as error:
            open_recording(recording_folder)
        said = str(error.value)
    assert f"{folder}: a " in said and "where a folder should be; put the folder there, or remove it" in said


def test_a_list_of_other_files_is_no_video(recording_folder):
    """Decoders would open what it names, wherever that lies."""
    (recording_folder / "videos" / "cam_00.avi").write_text("ffconcat version 1.0\nfile cam_01.avi\n")
    with pytest.raises(InputError, match=r"cam_00\.avi: is text, no video"):
        open_recording(recording_folder)


def test_names_that_are_no_text_are_told(recording_folder, ring):
    """OpenCV ends the process on them."""
    video = recording_folder / "videos" / "cam_00.avi"
    video.rename(os.fsdecode(bytes(video.parent) + b"/cam_00\xff.avi"))
    with pytest.raises(InputError, match=r"cam_00\\udcff\.avi': its name is no text in UTF-8; rename it"):
        open_recording(recording_folder)
