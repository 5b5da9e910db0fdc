"""Videos as OpenCV and ffprobe read them."""

import os
import shutil
import subprocess

import cv2
import numpy as np
import pytest

from hmc.errors import InputError
from hmc.io import video
from hmc.io.ffmpeg import ffmpeg_path
from hmc.io.video import check_written, write_video

needs_encoder = pytest.mark.skipif(
    ffmpeg_path() is None or not video._has_h264(ffmpeg_path()), reason="there is no ffmpeg with an encoder of H.264"
)


def pictures(count=12, size=(65, 47)):
    """Grey pictures, brighter from one to the next, with a white corner; sides may be odd."""
    for index in range(count):
        picture = np.full((size[1], size[0], 3), 40 + 10 * index, np.uint8)
        picture[:16, :16] = 255
        yield picture


def read(path):
    capture = cv2.VideoCapture(str(path))
    found = []
    while (frame := capture.read())[0]:
        found.append(frame[1])
    told = int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode(), capture.get(cv2.CAP_PROP_FPS)
    capture.release()
    return found, *told


@needs_encoder
def test_an_mp4_is_h264_that_browsers_play(tmp_path):
    said = []
    write_video(tmp_path / "a.mp4", pictures(), 29.97, said.append)
    frames, codec, fps = read(tmp_path / "a.mp4")
    assert codec in ("avc1", "h264") and fps == pytest.approx(29.97, abs=0.01) and not said
    assert [frame.shape for frame in frames] == [(48, 66, 3)] * 12
    assert [frame[30, 40].mean() for frame in frames] == pytest.approx([40 + 10 * k for k in range(12)], abs=4)
    data = (tmp_path / "a.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")  # the index is in front: it plays while it is fetched
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


@needs_encoder
@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="there is no ffprobe")
def test_its_colors_are_stored_as_browsers_want_them(tmp_path):
    write_video(tmp_path / "a.mp4", pictures(), 25)
    words = ["ffprobe", "-v", "error", "-show_entries", "stream=codec_name,pix_fmt,nb_frames", "-of", "csv=p=0"]
    told = subprocess.run([*words, str(tmp_path / "a.mp4")], capture_output=True, text=True, check=True).stdout
    assert told.strip() == "h264,yuv420p,12"


def test_without_an_encoder_there_is_a_video_and_a_line_that_says_so(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(video, "ffmpeg_path", lambda: None)
    said = []
    write_video(tmp_path / "a.mp4", pictures(), 25, said.append)
    frames, codec, _ = read(tmp_path / "a.mp4")
    assert len(frames) == 12
    if codec not in ("avc1", "h264"):  # OpenCV's own build may have an encoder
        assert len(said) == 1 and "imageio-ffmpeg" in said[0]
    assert "cap_ffmpeg" not in capfd.readouterr().err  # OpenCV's words on the codec are not ours


def test_a_program_that_is_none_is_as_good_as_no_program(tmp_path, monkeypatch):
    monkeypatch.setattr(video, "ffmpeg_path", lambda: str(tmp_path / "missing"))
    write_video(tmp_path / "a.mp4", pictures(4), 25)
    assert len(read(tmp_path / "a.mp4")[0]) == 4


@needs_encoder
def test_nothing_is_left_of_a_video_that_failed(tmp_path):
    def failing():
        yield from pictures(3)
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_video(tmp_path / "a.mp4", failing(), 25)
    with pytest.raises(InputError, match=r"b\.mp4: there are no frames"):
        write_video(tmp_path / "b.mp4", [], 25)
    with pytest.raises(InputError, match=r"c\.mp4: cannot be written"):
        write_video(tmp_path / "c.mp4", pictures(3), 0.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("share", [0, 0.3, 0.95])
def test_a_video_of_opencv_that_ended_early_is_told(tmp_path, share):
    path = tmp_path / "a.avi"
    write_video(path, pictures(), 25)
    check_written(path, path, 12)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match=r"b\.avi: cannot be written \(of 12 frames \d+ arrived"):
        check_written(tmp_path / "b.avi", path, 12)


@pytest.mark.skipif(os.name == "nt", reason="a script stands in for the program")
def test_a_program_that_ends_well_without_its_video_is_told(tmp_path, monkeypatch):
    """As ffmpeg does where the disk has no room left for the index."""
    program = tmp_path / "ffmpeg"
    made = "case $last in *encoders) echo ' V..... libx264 ';; *) cat > /dev/null; echo cut > $last;; esac"
    program.write_text(f"#!/bin/sh\nfor last; do :; done\n{made}\n")
    program.chmod(0o755)
    monkeypatch.setattr(video, "ffmpeg_path", lambda: str(program))
    with pytest.raises(InputError, match=r"of 12 frames 0 arrived; is the disk full\?"):
        write_video(tmp_path / "a.mp4", pictures(), 25.0)
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


def test_an_avi_is_motion_jpeg(tmp_path):
    write_video(tmp_path / "a.avi", pictures(), 25)
    frames, codec, _ = read(tmp_path / "a.avi")
    assert len(frames) == 12 and codec == "MJPG"
