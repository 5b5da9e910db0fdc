"""The ffmpeg program, where there is one: for sound, and for videos that OpenCV does not write."""

from __future__ import annotations

import shutil

__all__ = ["ffmpeg_path"]


def ffmpeg_path() -> str | None:
    """Where the ffmpeg program is.

    Returns
    -------
    str or None
        That of the package imageio-ffmpeg (``pip install imageio-ffmpeg``), else the one on ``PATH``; None where there is neither.
    """
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return shutil.which("ffmpeg")
