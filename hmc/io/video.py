"""Writing videos: H.264, which every browser plays, where an encoder is there."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.ffmpeg import ffmpeg_path
from hmc.io.files import sibling

__all__ = ["check_written", "write_video"]

#: Quality of H.264 (constant rate factor: 0 is lossless, 18 hardly to be told from that, 51 worst), and how long it may look for it.
CRF, SPEED = 20, "veryfast"
NO_ENCODER = (
    "no H.264 encoder; the video is MPEG-4 Part 2, which browsers do not play: install ffmpeg, or the package imageio-ffmpeg "
    "(the extra `video`)"
)


def write_video(path: str | Path, pictures: Iterable[np.ndarray], fps: float, on_problem: Callable[[str], None] | None = None) -> None:
    """Write pictures of one size as a video that appears under its name when it is complete.

    An .mp4 is H.264 in yuv420p with its index in front, by the ffmpeg program (`hmc.io.ffmpeg.ffmpeg_path`), or by OpenCV where its build
    can; MPEG-4 Part 2 where neither can. An .avi is Motion JPEG.

    Parameters
    ----------
    path : path
        .mp4 or .avi.
    pictures : iterable of ndarray, shape (h, w, 3), uint8 BGR
        H.264 has even sides: of an odd one the last row or column is written twice.
    fps : float
    on_problem : callable, optional
        Called with one line where the video is one that browsers do not play.

    Raises
    ------
    InputError
        When the file cannot be written, or there are no pictures.
    """
    path, pictures = Path(path), iter(pictures)
    first = next(pictures, None)
    if first is None:
        raise InputError(f"{path}: there are no frames to show")
    stream = _with_first(first, pictures)
    program = ffmpeg_path() if path.suffix.lower() == ".mp4" else None
    with sibling(path) as temporary:
        if program is not None and _has_h264(program):
            _by_ffmpeg(program, path, temporary, stream, fps)
        else:
            _by_opencv(path, temporary, stream, fps, on_problem)


def _with_first(first: np.ndarray, others: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
    yield first
    yield from others


def _even(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[:2]
    return np.ascontiguousarray(np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), "edge") if height % 2 or width % 2 else picture)


def _has_h264(program: str) -> bool:
    """Whether the ffmpeg program runs and has an encoder of H.264 in it."""
    try:
        told = subprocess.run([program, "-hide_banner", "-encoders"], capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return " libx264 " in told.stdout


def _by_ffmpeg(program: str, path: Path, temporary: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    """Frames go to the program as they are, one after the other; it makes the file."""
    first = _even(next(pictures))
    height, width = first.shape[:2]
    source = ["-f", "rawvideo", "-pix_fmt", "bgr24", "-s", f"{width}x{height}", "-r", f"{fps:.6f}", "-i", "-"]
    target = ["-an", "-c:v", "libx264", "-preset", SPEED, "-crf", str(CRF), "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = [program, "-hide_banner", "-loglevel", "error", "-nostdin", "-y", *source, *target, str(temporary)]
    written = 0
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said)
        pipe = process.stdin
        try:
            if pipe is not None:
                with suppress(BrokenPipeError):  # why it ended is told below
                    for picture in _with_first(first, pictures):
                        pipe.write(_even(picture).data)
                        written += 1
                    pipe.close()
            process.wait()
        except BaseException:
            process.kill()
            raise
        finally:
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()
            process.wait()
        if process.returncode:
            said.seek(0)
            words = said.read().decode(errors="replace").strip().splitlines()
            raise InputError(f"{path}: cannot be written as a video ({words[-1] if words else f'ffmpeg ended with {process.returncode}'})")
    check_written(path, temporary, written)


def _by_opencv(path: Path, temporary: Path, pictures: Iterator[np.ndarray], fps: float, on_problem: Callable[[str], None] | None) -> None:
    first = _even(next(pictures))
    size = first.shape[1], first.shape[0]
    writer = None
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(0)  # an encoder that is not there is told in words of ours
    try:
        for codec in ("avc1", "mp4v") if path.suffix.lower() == ".mp4" else ("MJPG",):
            writer = cv2.VideoWriter(str(temporary), cv2.VideoWriter.fourcc(*codec), fps, size)
            if writer.isOpened():
                break
            writer.release()
        else:
            raise InputError(f"{path}: cannot be written as a video")
    finally:
        cv2.utils.logging.setLogLevel(level)
    if codec == "mp4v" and on_problem is not None:
        on_problem(f"{path}: {NO_ENCODER}")
    written = 0
    try:
        for picture in _with_first(first, pictures):
            writer.write(_even(picture))
            written += 1
    finally:
        writer.release()
    check_written(path, temporary, written)


def check_written(path: str | Path, temporary: str | Path, n: int) -> None:
    """Whether a video has all its frames: on a disk that is full OpenCV ends without a word, and ffmpeg, where its index is what it has no
    room for, as if all were well.

    Parameters
    ----------
    path, temporary : path
        The video's name, and where it is.
    n : int
        Frames that were written.

    Raises
    ------
    InputError
    """
    capture = cv2.VideoCapture(str(temporary))
    try:
        found = 0
        while found < n and capture.grab():
            found += 1
    finally:
        capture.release()
    if found < n:
        raise InputError(f"{path}: cannot be written (of {n} frames {found} arrived; is the disk full?); make room, and start it again")
