"""``hmc view DIR RECORDING --out FILE``: a picture, a video or a page of a result over its recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from hmc.cli.common import (
    add_selection_options,
    made_from,
    open_selected,
    output_path,
    positive_float,
    print_problems,
    progress,
    unlike_its_run,
    whole_number,
)
from hmc.errors import InputError
from hmc.io.own_files import refuse_own_file

__all__ = ["add_parser", "run"]


def add_parser(subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "view",
        help="draw a result over its recording",
        description="Draw the fitted bodies into every camera's image, beside a 3-D panel with the voxels; left limbs orange, right "
        "limbs blue. What a 2-D keypoint detector left in the recording is drawn as crosses. Of tracks alone, draw every person as an "
        "ellipsoid with a number, beside the room from above. A video shows all selected frames (by default those of the run), a picture "
        "one of them (the middle one) or those of --frame, one below the other. A page, for any browser and without a network, has the "
        "room to turn with the mouse, some moments' images and voxels, curves and a time line.",
    )
    parser.add_argument("directory", type=Path, metavar="DIR", help="folder of the result, with joints.csv or tracks.csv")
    add_selection_options(parser, of_run=True)
    parser.add_argument(
        "--out", type=output_path, required=True, metavar="FILE", help="FILE.mp4 (video), .png (picture), .html (page) or .rrd (Rerun)"
    )
    parser.add_argument("--frame", type=whole_number, nargs="+", metavar="N", help="frames of a picture")
    parser.add_argument("--voxel", type=positive_float, default=0.04, metavar="M", help="voxel size in the panel, metres (default: 0.04)")
    parser.add_argument("--no-voxels", action="store_true", help="no voxels in the panel: quicker, as nothing is segmented")
    parser.add_argument("--no-outlines", action="store_true", help="stick figures only, without the outline of the flesh")
    parser.add_argument("--no-keypoints", action="store_true", help="without the keypoints that a 2-D detector left in the recording")


def run(args: argparse.Namespace) -> int:
    """Draw and write."""
    from hmc.io.places import places_of
    from hmc.io.results import run_selection
    from hmc.view.mosaic import read_result
    from hmc.view.write import PAGES, VIDEOS, write_view

    if args.frame and args.out.suffix.lower() in VIDEOS + PAGES:
        raise InputError("--frame is for pictures; a video or a page shows the frames of --start and --frames")
    if not args.directory.is_dir():
        raise InputError(f"{args.directory}: no such folder; a result is the folder that `hmc pose` or `hmc track` wrote")
    result = read_result(args.directory)
    args.start, args.frames = run_selection(args.directory, args.start, args.frames)
    recording = open_selected(args)
    refuse_own_file(args.out, places_of(recording))
    problems = [*recording.problems, *unlike_its_run(args.directory), *made_from(args.directory, args.recording)]
    write_view(
        args.out,
        recording,
        result,
        args.frame or (),
        None if args.no_voxels else args.voxel,
        not args.no_outlines,
        (problems.append, lambda pictures, total: progress(pictures, total, "view", args.quiet)),
        not args.no_keypoints,
    )
    print(f"wrote {args.out}")
    print_problems(problems)
    return 0
