"""``hmc view DIR RECORDING --out FILE``: a picture or a video of a result over its recording."""

from __future__ import annotations

import argparse
import functools
from collections.abc import Iterable
from pathlib import Path

from hmc.cli.common import add_selection_options, open_selected, positive_float, print_problems, progress, whole_number
from hmc.errors import InputError

__all__ = ["add_parser", "run"]

PICTURES, VIDEOS = (".png", ".jpg", ".jpeg"), (".mp4", ".avi")


def add_parser(subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "view",
        help="draw a result over its recording",
        description="Draw the fitted bodies into every camera's image, beside a 3-D panel with the voxels; left limbs orange, right "
        "limbs blue. Of tracks alone, draw everybody as an ellipsoid with a number, beside the room from above. "
        "A video shows all selected frames (by default those of the run), a picture one of them (the middle one) or those of --frame, one "
        "below the other.",
    )
    parser.add_argument("directory", type=Path, metavar="DIR", help="folder of the result, with joints.csv or tracks.csv")
    add_selection_options(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="FILE.mp4 (video) or FILE.png (picture)")
    parser.add_argument("--frame", type=whole_number, nargs="+", metavar="N", help="frames of a picture")
    parser.add_argument("--voxel", type=positive_float, default=0.04, metavar="M", help="voxel size in the panel, metres (default: 0.04)")
    parser.add_argument("--no-voxels", action="store_true", help="no voxels in the panel: quicker, as nothing is segmented")
    parser.add_argument("--no-outlines", action="store_true", help="stick figures only, without the outline of the flesh")


def run(args: argparse.Namespace) -> int:
    """Draw and write."""
    import cv2
    import numpy as np

    from hmc.io.files import atomic_write
    from hmc.io.results import run_selection
    from hmc.view.mosaic import read_result, stream_mosaics

    suffix = args.out.suffix.lower()
    if suffix not in PICTURES + VIDEOS:
        raise InputError(f"{args.out}: must end in .png (a picture) or .mp4 (a video)")
    if args.frame and suffix in VIDEOS:
        raise InputError("--frame is for pictures; a video shows the frames of --start and --frames")
    if not args.directory.is_dir():
        raise InputError(f"{args.directory}: no such folder; a result is the folder that `hmc pose` or `hmc track` wrote")
    result = read_result(args.directory)
    if not args.start and args.frames is None:
        args.start, args.frames = run_selection(args.directory)
    recording = open_selected(args)
    frames = choose_frames(args.frame, recording.start, recording.n_frames, result.frames)
    problems = list(recording.problems)
    draw = functools.partial(
        stream_mosaics,
        recording,
        result,
        voxel_size_m=None if args.no_voxels else args.voxel,
        outlines=not args.no_outlines,
        on_problem=problems.append,
    )
    if suffix in PICTURES:
        mosaics = [next(draw(first=frame, last=frame + 1)) for frame in frames]
        pictures = [picture for _, picture in mosaics]
        with atomic_write(args.out, "wb") as file:
            file.write(cv2.imencode(suffix, np.concatenate(pictures))[1].tobytes())
    else:
        stream = (picture for _, picture in draw())
        write_video(args.out, progress(stream, recording.n_frames, "view", args.quiet), recording.fps)
    print_problems(problems)
    return 0


def choose_frames(asked: list[int] | None, start: int, n_frames: int, known) -> list[int]:
    """The frames of a picture: those asked for, else the middle one of those with a result, else of the selection.

    Raises
    ------
    InputError
        When a frame is not in the selection.
    """
    for frame in asked or []:
        if not start <= frame < start + n_frames:
            raise InputError(f"frame {frame} is not among the selected frames {start} to {start + n_frames - 1}")
    inside = [int(frame) for frame in known if start <= frame < start + n_frames]
    return asked or [inside[len(inside) // 2] if inside else start + n_frames // 2]


def write_video(path: Path, pictures: Iterable, fps: float) -> None:
    """Write pictures of one size as a video that appears under its name when it is complete.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    import cv2

    from hmc.io.files import sibling

    codec = "mp4v" if path.suffix.lower() == ".mp4" else "MJPG"
    writer = None
    with sibling(path) as temporary:
        try:
            for picture in pictures:
                if writer is None:
                    height, width = picture.shape[:2]
                    writer = cv2.VideoWriter(str(temporary), cv2.VideoWriter.fourcc(*codec), fps, (width, height))
                    if not writer.isOpened():
                        raise InputError(f"{path}: cannot be written as a video")
                writer.write(picture)
        finally:
            if writer is not None:
                writer.release()
        if writer is None:
            raise InputError(f"{path}: there are no frames to show")
