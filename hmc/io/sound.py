"""The sound track of a video, in pieces: read by the ffmpeg program, as OpenCV reads pictures alone."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hmc.io.ffmpeg import ffmpeg_path

__all__ = ["SAMPLE_RATE", "read_sound", "video_begins"]

#: Samples a second that are handed out, of one channel, and how long a piece is, seconds.
SAMPLE_RATE, PIECE_S = 8000, 4.0


def read_sound(file: Path, seconds: float) -> Iterator[np.ndarray]:
    """The sound of a video from its beginning on.

    Parameters
    ----------
    file : Path
    seconds : float
        At most so much.

    Yields
    ------
    ndarray of float32, shape (n,)
        Pieces that follow one another, `SAMPLE_RATE` samples a second, one channel, from -1 to 1. Nothing where there is no ffmpeg, no
        sound track, or none that can be read. Gaps in it are silence.
    """
    program = ffmpeg_path()
    if program is None:
        return
    words = [program, "-v", "error", "-nostdin", "-i", f"file:{file}", "-map", "0:a:0", "-af", "aresample=async=1"]
    words += ["-ac", "1", "-ar", str(SAMPLE_RATE), "-t", f"{seconds:.3f}", "-f", "f32le", "-"]
    size = 4 * round(PIECE_S * SAMPLE_RATE)
    with subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            while piece := process.stdout.read(size):  # type: ignore[union-attr]
                samples = np.frombuffer(piece[: len(piece) // 4 * 4], "<f4")
                yield np.where(np.isfinite(samples), samples, np.float32(0))
        finally:
            process.kill()


def video_begins(file: Path) -> float:
    """When a video's first frame is to be shown, seconds after its first sound; 0 where that cannot be told."""
    picture, sound = (_first_stamp(file, words) for words in (("0:v:0", "-c", "copy"), ("0:a:0", "-c:a", "pcm_s16le")))
    return 0.0 if picture is None or sound is None else picture - sound


def _first_stamp(file: Path, track: tuple[str, ...]) -> float | None:
    """The presentation time of a track's first packet, seconds."""
    program = ffmpeg_path()
    if program is None:
        return None
    words = [program, "-v", "error", "-nostdin", "-copyts", "-i", f"file:{file}", "-map", *track, "-frames", "1", "-f", "framecrc", "-"]
    told = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False).stdout
    base, stamp = ["1"], None
    for line in told.splitlines():
        if line.startswith("#tb 0:"):
            base = line.split(":", 1)[1].split("/")
        elif line and not line.startswith("#"):
            stamp = line.split(",")[2]
    try:
        return int(stamp) * int(base[0]) / int(base[1])  # type: ignore[arg-type]
    except (TypeError, ValueError, IndexError, ZeroDivisionError):
        return None
