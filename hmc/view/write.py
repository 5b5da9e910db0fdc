"""Overlay pictures and videos as files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.camera_turns import as_posed
from hmc.io.files import atomic_write
from hmc.io.keypoints import open_keypoints
from hmc.io.recording import Recording
from hmc.io.video import write_video
from hmc.view.mosaic import Result, stream_mosaics
from hmc.view.page.write import write_page
from hmc.view.rerun_file import write_rrd

__all__ = ["PAGES", "PICTURES", "VIDEOS", "choose_frames", "write_view"]

#: Endings of pictures, of videos, and of what is turned with the mouse: pages, files of Rerun.
PICTURES, VIDEOS, PAGES = (".png", ".jpg", ".jpeg"), (".mp4", ".avi"), (".html", ".rrd")


def write_view(
    path: str | Path,
    recording: Recording,
    result: Result,
    frames: Sequence[int] = (),
    voxel_size_m: float | None = 0.04,
    outlines: bool = True,
    how: tuple[Callable[[str], None] | None, Callable[[Iterable, int], Iterable] | None] = (None, None),
    keypoints: bool = True,
) -> None:
    """Draw a result over the images of a recording.

    Parameters
    ----------
    path : path
        A picture (.png, .jpg) of some frames, or a video (.mp4, .avi) of all (`hmc.io.video.write_video`), or a page for a
        browser (.html, `hmc.view.page.write.write_page`), or a file of Rerun (.rrd, `hmc.view.rerun_file.write_rrd`).
    recording : Recording
    result : Result
    frames : sequence of int
        Of a picture; by default the middle one of those with a result.
    voxel_size_m : float or None
        Of the voxels in the panel; None: none are shown, and nothing is segmented.
    outlines : bool
        Draw the outline of the flesh.
    how : tuple
        Called with every problem; and what shows progress, ``progress(pictures, total)``. Each None: nothing.
    keypoints : bool
        Draw what a 2-D detector left in the recording, where it did.

    Raises
    ------
    InputError
        When the ending is of neither, a frame is not in the selection, keypoints cannot be read, or the file cannot be written.
    """
    path, (report, progress), recording = Path(path), how, as_posed(recording, result.turned)
    suffix = path.suffix.lower()
    if suffix not in PICTURES + VIDEOS + PAGES:
        raise InputError(f"{path}: must end in .png (a picture), .mp4 (a video), .html (a page to turn) or .rrd (for Rerun)")
    if suffix in PAGES:
        write = write_page if suffix == ".html" else write_rrd
        write(path, recording, result, voxel_size_m, outlines, report, progress)
        return

    found = open_keypoints(recording) if keypoints else None

    def draw(**selection):
        return stream_mosaics(
            recording, result, voxel_size_m=voxel_size_m, outlines=outlines, keypoints=found, on_problem=report, **selection
        )

    if suffix in PICTURES:
        wanted = choose_frames(list(frames), recording.start, recording.n_frames, result.frames)
        pictures = [next(draw(first=frame, last=frame + 1))[1] for frame in wanted]
        with atomic_write(path, "wb") as file:
            file.write(cv2.imencode(suffix, np.concatenate(pictures))[1].tobytes())
        return
    stream: Iterable = (picture for _, picture in draw())
    write_video(path, progress(stream, recording.n_frames) if progress else stream, recording.fps, report)


def choose_frames(asked: list[int], start: int, n_frames: int, known) -> list[int]:
    """The frames of a picture: those asked for, else the middle one of those with a result, else of the selection.

    Raises
    ------
    InputError
        When a frame is not in the selection.
    """
    for frame in asked:
        if not start <= frame < start + n_frames:
            raise InputError(f"frame {frame} is not among the selected frames {start} to {start + n_frames - 1}")
    inside = [int(frame) for frame in known if start <= frame < start + n_frames]
    return asked or [inside[len(inside) // 2] if inside else start + n_frames // 2]
