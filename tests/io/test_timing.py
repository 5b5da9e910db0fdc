"""Frames matched by time: mixed rates, dropped frames, rates that vary, and files of times."""

import json
import re
import shutil
import struct
import subprocess
import tomllib

import cv2
import numpy as np
import pytest
from conftest import write_images, write_video
from hypothesis import given
from hypothesis import strategies as st

from hmc.errors import InputError
from hmc.io import footage
from hmc.io.ffmpeg import ffmpeg_path
from hmc.io.keypoints import open_keypoints
from hmc.io.new_timing import with_first_frames, write_new_timing
from hmc.io.places import RecordingPlaces
from hmc.io.recording import iterate_frames, open_recording
from hmc.io.timing import nearest_frames, read_times, times_file, write_times


def levels(folder, **selection):
    """Of every frame, each camera's brightness as the number of its frame at 25 a second; None without an image."""
    recording = open_recording(folder, **selection)
    problems = []
    found = [
        [None if image is None else (float(image[..., 1].mean()) - 40) / 5 for image in frame.images]
        for frame in iterate_frames(recording, on_problem=problems.append)
    ]
    assert problems == []
    return recording, found


def rising(values):
    return np.cumsum(values)


@given(st.lists(st.floats(0.01, 5), min_size=1, max_size=60), st.floats(-20, 20))
def test_each_frame_is_the_nearest_or_none(steps, begin):
    times = begin + rising(steps)
    found = nearest_frames(times)
    taken = found[found >= 0]
    assert len(set(taken)) == len(taken) and (np.diff(taken) > 0).all()
    for frame, place in enumerate(found):
        least = np.abs(times - frame).min()
        if place < 0:
            assert least >= 0.5 - 1e-9
        else:
            assert abs(times[place] - frame) <= min(0.5, least) + 1e-9
    assert len(found) == 0 or found[-1] >= 0


@given(st.integers(1, 50), st.integers(-5, 5))
def test_even_times_are_frames_counted(n, first):
    np.testing.assert_array_equal(
        nearest_frames(np.arange(n) - first), np.r_[[-1] * max(0, -first), np.arange(max(0, first), n)][: max(0, n - first)]
    )


def test_unknown_times_are_left_out():
    np.testing.assert_array_equal(nearest_frames([0, np.nan, 1.4, 1.9, 4.0]), [0, 2, 3, -1, 4])


def test_rates_that_differ_are_matched_by_time(recording_folder):
    write_video(recording_folder / "videos" / "cam_02.avi", 23, (160, 120), lambda index: 40 + 2.5 * index, fps=50)
    recording, found = levels(recording_folder)
    assert (recording.fps, recording.n_frames) == (25, 12)
    for index, row in enumerate(found):
        np.testing.assert_allclose(row, index, atol=0.3)
    recording, found = levels(recording_folder, cameras=["cam_02"], start=3)
    assert recording.fps == 25  # whatever cameras are read
    np.testing.assert_allclose(np.ravel(found), range(3, 12), atol=0.3)


@pytest.mark.parametrize("fps", [25.1, 50])
@pytest.mark.parametrize("where", ["pattern", "table", "guessed", "session"])
def test_the_rate_is_of_all_cameras_wherever_their_videos_lie(recording_folder, where, fps):
    """Whichever cameras are read: a result is looked at with some of them alone."""
    videos, raw = recording_folder / "videos", recording_folder / "raw"
    write_video(videos / "cam_02.avi", 24, (160, 120), fps=fps)
    if where == "guessed":
        for camera in range(5):
            (videos / f"cam_{camera:02d}.avi").rename(videos / f"trial_cam_{camera:02d}_x.avi")
    else:
        videos.rename(raw)
    if where == "pattern":
        (recording_folder / "recording.toml").write_text('videos = "raw/{camera}.*"\n')
    elif where == "table":
        lines = [f'cam_{camera:02d} = "raw/cam_{camera:02d}.avi"\n' for camera in range(5)]
        (recording_folder / "recording.toml").write_text("[videos]\n" + "".join(lines))
    pattern = str(raw / "{camera}.avi") if where == "session" else None
    places = RecordingPlaces(recording_folder, videos=pattern)
    assert {open_recording(places, cameras=cameras).fps for cameras in (None, ["cam_02"], ["cam_02", "cam_01"], ["cam_03"])} == {25}


def test_a_rate_that_is_given_is_the_recording_s(recording_folder):
    write_video(recording_folder / "videos" / "cam_02.avi", 24, (160, 120), lambda index: 40 + 2.5 * index, fps=50)
    (recording_folder / "recording.toml").write_text("fps = 50\nfirst_frame = { cam_02 = 4, cam_00 = 2 }\n")
    recording, found = levels(recording_folder)
    assert recording.fps == 50
    for index, row in enumerate(found[:16]):
        np.testing.assert_allclose(row[2], index / 2 + 2, atol=0.3)
        assert [value is None for value in row] == [index % 2 == 1, index % 2 == 1, False, index % 2 == 1, index % 2 == 1]
        if index % 2 == 0:
            np.testing.assert_allclose(row[:2], [index / 2 + 2, index / 2], atol=0.3)


def variable(path, counts):
    """Let the frames of an MP4 last so many times as long as before: another list of times in its header."""
    data = path.read_bytes()
    at = data.index(b"stts") - 4
    size, kind, flags, entries, number, delta = struct.unpack(">I4sIIII", data[at : at + 24])
    assert (entries, number) == (1, len(counts)) and data.rindex(b"mdat") < at
    table = b"".join(struct.pack(">II", 1, delta * count) for count in counts)
    own = struct.pack(">I4sII", 16 + len(table), kind, flags, len(counts)) + table
    head = bytearray(data[:at])
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        place = head.rindex(box) - 4
        head[place : place + 4] = struct.pack(">I", struct.unpack(">I", head[place : place + 4])[0] + len(own) - size)
    edit = head.index(b"elst") + 12  # how much of it is shown, in thousandths
    head[edit : edit + 4] = struct.pack(">I", struct.unpack(">I", head[edit : edit + 4])[0] * sum(counts) // len(counts) + 1)
    path.write_bytes(bytes(head) + own + data[at + size :])


def test_frames_that_a_camera_of_variable_rate_left_out_are_none(recording_folder):
    (recording_folder / "videos" / "cam_01.avi").unlink()
    kept = [0, 1, 2, 3, 5, 6, 9, 10, 11]
    writer = cv2.VideoWriter(str(recording_folder / "videos" / "cam_01.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 25, (160, 120))
    for frame in kept:
        writer.write(np.full((120, 160, 3), 40 + 5 * frame, np.uint8))
    writer.release()
    variable(recording_folder / "videos" / "cam_01.mp4", [*np.diff(kept).tolist(), 1])
    (recording_folder / "recording.toml").write_text("fps = 25\n")
    recording, found = levels(recording_folder)
    assert recording.n_frames == 12 and recording.problems == ()
    assert [row[1] is not None for row in found] == [frame in kept for frame in range(12)]
    np.testing.assert_allclose([row[1] for row in found if row[1] is not None], kept, atol=0.6)


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "ts"])
def test_time_stamps_are_those_of_decoded_frames_without_decoding(tmp_path, monkeypatch, suffix):
    """A rate that varies, and frames that are shown in another order than that in which they are stored."""
    program = ffmpeg_path()
    if program is None:
        pytest.skip("needs an ffmpeg program")
    video = tmp_path / f"cam.{suffix}"
    source = ["-f", "lavfi", "-i", "testsrc=size=64x48:rate=60:duration=2", "-vf", r"select=not(eq(mod(n\,7)\,3))", "-fps_mode", "vfr"]
    done = subprocess.run([program, "-loglevel", "error", *source, "-c:v", "libx264", "-bf", "2", str(video)], check=False)
    if done.returncode:
        pytest.skip("this ffmpeg makes no such video")
    capture, decoded = cv2.VideoCapture(str(video)), []
    while capture.grab():
        decoded.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1000)
    monkeypatch.setattr(footage, "_decoded_times", lambda view: pytest.fail("decoded"))
    found = footage.stamps(footage.open_video(video))
    np.testing.assert_allclose(found, np.array(decoded) - decoded[0], atol=1e-9)
    np.testing.assert_allclose(found, [n / 60 for n in range(120) if n % 7 != 3], atol=1e-3)


@pytest.mark.parametrize("as_images", [False, True])
def test_dropped_frames_are_none_by_a_file_of_times(recording_folder, as_images):
    """Of videos and of numbered images, of silhouettes beside them and of keypoints."""
    kept = [1, 2, 3, 5, 6, 7, 8, 11]
    if as_images:
        shutil.rmtree(recording_folder / "videos")
        for camera in range(5):
            write_images(recording_folder / "images" / f"cam_{camera:02d}", range(12), (160, 120))
        shutil.rmtree(recording_folder / "images" / "cam_01")
        write_images(recording_folder / "images" / "cam_01", range(len(kept)), (160, 120), lambda index: 40 + 5 * kept[index])
    else:
        write_video(recording_folder / "videos" / "cam_01.avi", len(kept), (160, 120), lambda index: 40 + 5 * kept[index])
    (recording_folder / "keypoints" / "cam_01").mkdir(parents=True)
    for place, frame in enumerate(kept):
        people = {"people": [{"pose_keypoints_2d": [100 + frame, 50, 1] * 25}]}
        (recording_folder / "keypoints" / "cam_01" / f"cam_01_{place:012d}_keypoints.json").write_text(json.dumps(people))
    (recording_folder / "recording.toml").write_text("fps = 25\n")
    write_times(times_file(recording_folder, "cam_01"), np.array(kept) / 25 + 0.004)
    recording, found = levels(recording_folder)
    assert recording.n_frames == 12 and recording.problems == ()
    assert [row[1] is not None for row in found] == [frame in kept for frame in range(12)]
    np.testing.assert_allclose([row[1] for row in found if row[1] is not None], kept, atol=0.3)
    assert all(row[0] is not None for row in found)
    source = open_keypoints(recording)
    for frame in range(12):
        people = source.frame(frame)[1]
        assert len(people) == (frame in kept)
        assert not len(people) or np.nanmax(people[0, :, 0]) == 100 + frame
    parts = [[row[1] for row in levels(recording_folder, start=start, frames=3)[1]] for start in (2, 9)]
    assert [[value is None for value in part] for part in parts] == [[False, False, True], [True, True, False]]


def numbered_images(folder, first, rows, bearing=range(6)):
    """Two cameras' images, numbered from `first`, the second's with times of these rows: at 25 a second, row k at that of place k."""
    shutil.rmtree(folder / "videos")
    for camera, places in (("cam_00", range(6)), ("cam_01", bearing)):
        write_images(folder / "images" / camera, [first + k for k in places], (160, 120), lambda number: 40 + 5 * (number - first))
    (folder / "recording.toml").write_text("fps = 25\n")
    times = np.full(max(rows) + 1, np.nan)
    times[list(rows)] = np.arange(len(rows)) / 25
    write_times(times_file(folder, "cam_01"), times)


@pytest.mark.parametrize(
    ("first", "rows", "shown"),
    [
        (1, range(1, 7), range(6)),  # as the images are numbered
        (1, range(6), range(6)),  # from 0
        (1, range(2, 7), range(1, 6)),
        (1, range(5), range(5)),
        (3, range(3, 9), range(6)),
        (3, range(1, 6), range(1, 6)),
        (40, range(40, 46), range(6)),
        (40, range(6), range(6)),
        (40, range(42, 46), range(2, 6)),
    ],
)
def test_times_of_numbered_images_count_as_these_or_from_0(recording_folder, first, rows, shown):
    numbered_images(recording_folder, first, rows)
    found = levels(recording_folder, cameras=["cam_00", "cam_01"])[1]
    np.testing.assert_allclose([row[1] for row in found[: len(shown)]], shown, atol=0.3)


def test_times_that_may_count_either_way_count_as_more_images_do(recording_folder):
    """Of a camera without the first image of all: by its own numbers one row would have no image."""
    numbered_images(recording_folder, 1, range(1, 6), bearing=range(1, 6))
    found = levels(recording_folder, cameras=["cam_00", "cam_01"])[1]
    np.testing.assert_allclose([row[1] for row in found[:5]], range(1, 6), atol=0.3)


@pytest.mark.parametrize(
    ("first", "rows", "words"),
    [
        (
            1,
            range(1, 6),
            "frames 1 to 5, which may count from 0 or as the images are numbered, from 1; give the times of the first frame and",
        ),
        (1, range(7), "has times of frames 0 to 6, but the frames of "),
        (40, range(39, 45), "cam_01 are 0 to 5, or 40 to 45 as its images are numbered; count them so"),
        (0, range(1, 7), "cam_01 are 0 to 5; count them so"),
    ],
)
def test_times_of_frames_that_are_not_there_are_told(recording_folder, first, rows, words):
    numbered_images(recording_folder, first, rows)
    with pytest.raises(InputError, match=re.escape(words)):
        open_recording(recording_folder, cameras=["cam_00", "cam_01"])


def test_a_log_may_go_on_after_a_video_s_last_frame(recording_folder):
    write_times(times_file(recording_folder, "cam_01"), np.arange(20) / 25)
    assert open_recording(recording_folder).n_frames == 12


def test_times_of_a_video_that_count_from_1_are_told(recording_folder):
    write_times(times_file(recording_folder, "cam_01"), np.r_[np.nan, np.arange(12) / 25])
    with pytest.raises(InputError, match=re.escape("has times of frames 1 to 12, but the frames of ") + ".*are 0 to 11; count"):
        open_recording(recording_folder)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,0.0\n", "its first line must be `frame,time_s`"),
        ("frame,time_s\n0,zero\n", "line 2 is no frame and time in seconds"),
        ("frame,time_s\n", "must hold the times of frames from 0 on"),
        ("frame,time_s\n-1,0\n", "must hold the times of frames from 0 on"),
        ("frame,time_s\n0,nan\n", "must hold the times of frames from 0 on"),
        ("frame,time_s\n0,0\n1,0.2\n2,0.1\n", "that of frame 2 does not"),
        ("frame,time_s\n0,0\n1,0.1\n1,0.2\n", "line 4 has frame 1 once more"),
        ("frame,time_s\n0,-5\n1,-4\n", "no frame was taken from 0 s on"),
        ("frame,time_s\n0,0\n1,40\n2,80\n3,120\n", "its frames are 40 s apart, the recording's 0.04 s (25 a second); give seconds"),
        ("frame,time_s\n0,0\n1,0.00004\n2,0.00008\n", "its frames are 4e-05 s apart"),
        ("frame,time_s\n0,0\n1,99999999\n", "has a frame at 1e+08 s"),
        ("frame,time_s\n0,0\n1,1e308\n", "frames go to 10000000"),
    ],
)
def test_wrong_times_are_told(recording_folder, text, words):
    file = times_file(recording_folder, "cam_01")
    file.parent.mkdir()
    file.write_text(text)
    with pytest.raises(InputError, match=re.escape(words)):
        open_recording(recording_folder)


def test_times_that_all_begin_late_are_told(recording_folder):
    """Of a clock that ran before: else the recording has thousands of frames with nobody, and no word why."""
    for k in range(5):
        write_times(times_file(recording_folder, f"cam_{k:02d}"), 2 + (k + np.arange(12)) / 25)
    words = "no camera that is read has a frame before frame 50; times count from the recording's first frame"
    assert any(words in one for one in open_recording(recording_folder).problems)
    write_times(times_file(recording_folder, "cam_03"), np.arange(12) / 25)
    assert not any("no camera that is read" in one for one in open_recording(recording_folder).problems)


def test_times_and_a_first_frame_contradict_each_other(recording_folder):
    write_times(times_file(recording_folder, "cam_01"), np.arange(12) / 25)
    (recording_folder / "recording.toml").write_text("first_frame = { cam_01 = 2 }\n")
    with pytest.raises(InputError, match="and so does `first_frame`"):
        open_recording(recording_folder)


def test_times_are_read_as_written(tmp_path):
    times = np.array([0.1, np.nan, 0.25, 7.0])
    write_times(tmp_path / "a.csv", times)
    np.testing.assert_allclose(read_times(tmp_path / "a.csv"), times)
    assert read_times(tmp_path / "b.csv") is None


@pytest.mark.parametrize(
    "text",
    [
        "",
        'name = "a"  # first_frame = 1\nfps = 30\n',
        "first_frame = { cam_00 = 3 }  # by hand\nfps = 30\n",
        "fps = 30\nfirst_frame = {}\nroom = [[0, 0, 0],\n  [1, 1, 2]]",
        "fps = 30\n\n[first_frame]\ncam_00 = 3\n",
        "fps = 30\nfirst_frame.cam_00 = 3\nfirst_frame.cam_01 = 4\n",
        "fps = 30",
    ],
)
def test_only_the_first_frames_change(text):
    before = tomllib.loads(text)
    before.pop("first_frame", None)
    new = with_first_frames(text, {"cam_00": 0, "cam 1": 7})
    assert tomllib.loads(new) == before | {"first_frame": {"cam_00": 0, "cam 1": 7}}
    assert [line for line in new.splitlines() if "first_frame =" not in line] == [
        line for line in text.splitlines() if "first_frame" not in line.split("#")[0] and line != "cam_00 = 3"
    ] or "# first_frame" in text
    assert tomllib.loads(with_first_frames(text, {"cam_00": 0})) == before
    assert with_first_frames(new, {"cam_00": 0, "cam 1": 7}) == new
    assert tomllib.loads(with_first_frames(new, {"cam_00": 0}, zeros=True)) == {**before, "first_frame": {"cam_00": 0}}


@pytest.mark.parametrize(
    ("text", "new"),
    [
        ("room = [\n  [0, 0, 0],\n  [1, 1, 2],\n]\nfps = 30\n", "room = [\n  [0, 0, 0],\n  [1, 1, 2],\n]\nfps = 30\nFIRST"),
        (
            "room = [\n [0, 0, 0],\n [1, 1, 2],\n]\nfirst_frame = { a = 2 }\nfps = 30",
            "room = [\n [0, 0, 0],\n [1, 1, 2],\n]\nFIRSTfps = 30",
        ),
        ("fps = 30\n[first_frame]\na = 3\n[background]\na = 'x'\n", "fps = 30\nFIRST[background]\na = 'x'\n"),
        ("[background]\na = 'x'\n[first_frame]\na = 3\n", "FIRST[background]\na = 'x'\n"),
        ("[first_frame]\na = 3\n\n# the empty scene\n[background]\na = 'x'\n", "FIRST\n# the empty scene\n[background]\na = 'x'\n"),
        ("name = 'a # {b'\nfirst_frame.a = 3\nfps = 30\n", "name = 'a # {b'\nFIRSTfps = 30\n"),
        ('name = """\n[first_frame]\na = "b" # {\n"""\nfps = 30\n', 'name = """\n[first_frame]\na = "b" # {\n"""\nfps = 30\nFIRST'),
        ('name = "\\"[" # "\nfps = 30\n["videos"]\na = "b"\n', 'name = "\\"[" # "\nfps = 30\nFIRST["videos"]\na = "b"\n'),
        (
            "room = [ # ] of the room\n[0, 0, 0], [1, 1, 2]]\r\nfps = 30\r\n",
            "room = [ # ] of the room\n[0, 0, 0], [1, 1, 2]]\r\nfps = 30\r\nFIRST",
        ),
        ("[videos]\nfirst_frame = 'v.mp4'\n", "FIRST[videos]\nfirst_frame = 'v.mp4'\n"),
    ],
)
def test_first_frames_stand_before_the_first_table_and_in_no_array(tmp_path, text, new):
    """A row of an array was taken for a table, and a key behind the table `first_frame` for one of the next."""
    file = tmp_path / "recording.toml"
    file.write_bytes(text.encode())
    write_new_timing(tmp_path, {"a": 0, "b": 5}, {})
    assert file.read_bytes().decode() == new.replace("FIRST", "first_frame = { a = 0, b = 5 }\n")
    assert tomllib.loads(file.read_text()) == tomllib.loads(text) | {"first_frame": {"a": 0, "b": 5}}
    assert (tmp_path / "recording_before.toml").read_bytes() == text.encode()


def test_a_text_in_which_more_would_change_stays_as_it_is(tmp_path):
    text = '"first\\u005fframe" = { a = 2 }\nfps = 30\n'
    (tmp_path / "recording.toml").write_text(text)
    assert tomllib.loads(text)["first_frame"] == {"a": 2}
    words = r"recording\.toml: `first_frame` cannot be changed .* put this line before .*: first_frame = \{ a = 0, b = 5 \}$"
    with pytest.raises(InputError, match=words):
        write_new_timing(tmp_path, {"a": 0, "b": 5}, {"c": np.array([0.0, 0.1])})
    assert [file.name for file in tmp_path.iterdir()] == ["recording.toml"] and (tmp_path / "recording.toml").read_text() == text


def test_what_was_there_is_kept(tmp_path):
    (tmp_path / "recording.toml").write_text("fps = 30\n")
    lines = write_new_timing(tmp_path, {"a": 0, "b": 2}, {"c": np.array([0.0, 0.1])})
    assert len(lines) == 2 and (tmp_path / "recording_before.toml").read_text() == "fps = 30\n"
    assert (tmp_path / "recording.toml").read_text() == "fps = 30\nfirst_frame = { a = 0, b = 2 }\n"
    assert (tmp_path / "times" / "c.csv").read_text() == "frame,time_s\n0,0.000000\n1,0.100000\n"
    lines = write_new_timing(tmp_path, {"a": 0, "b": 2}, {"c": np.array([0.0, 0.2])})
    assert len(lines) == 1 and (tmp_path / "times" / "c_before.csv").is_file()
