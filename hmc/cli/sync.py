"""``hmc sync``: when each camera's frames were taken, found by what all cameras see."""

from __future__ import annotations

import argparse
from pathlib import Path

from hmc.cli.common import add_session_option, given_places, output_path, positive_float, whole_number
from hmc.io.files import real_path
from hmc.io.own_files import refuse_own_file

__all__ = ["add_parser", "run"]

#: Frames that are looked at, and moments of them in which hulls are compared.
FRAMES, MOMENTS = 900, 12


def add_parser(subparsers) -> None:
    """Add the command to the argument parser."""
    parser = subparsers.add_parser(
        "sync",
        help="find which frames of the cameras belong together, and write it into the recording",
        description="Find by how many frames each camera is early or late, whether its clock drifts and which frames it dropped: by "
        "silhouettes, whose extent across the planes through any two cameras must be the same in both, by 2-D keypoints where a "
        "detector left some, and, of cameras of which these do not tell, by the sound of their videos. Write it as `first_frame` of "
        "recording.toml, and as times/CAMERA.csv of cameras that drift or dropped frames; what was there is kept. Nothing is written "
        "where it is right already, or where there is too little to go by.",
    )
    parser.add_argument("recording", type=Path, help="folder of the recording")
    add_session_option(parser)
    parser.add_argument(
        "--search", type=positive_float, default=10.0, metavar="S", help="cameras are apart by this at most, seconds (default: %(default)g)"
    )
    parser.add_argument(
        "--frames", type=whole_number, default=FRAMES, metavar="N", help="look at so many frames from the start (default: %(default)s)"
    )
    parser.add_argument("--out", type=output_path, default=None, metavar="FILE.png", help="the picture (default: NAME_sync.png here)")
    parser.add_argument("--dry-run", action="store_true", help="tell and draw, and write nothing into the recording")


def run(args: argparse.Namespace) -> int:
    """Print what was found, write the picture and, where cameras are out of time, into the recording."""
    from hmc.check.cures import check_command, pose_command
    from hmc.check.sync import inspect_synchrony, sync_lines
    from hmc.check.sync.picture import save_sync_picture
    from hmc.check.sync.timing import new_timing
    from hmc.io.new_timing import write_new_timing
    from hmc.io.recording import open_recording

    places = given_places(args)
    if args.out is not None:
        refuse_own_file(args.out, places)
    recording = open_recording(places, frames=args.frames, any_world=True)
    found, shares = inspect_synchrony(recording, args.search, MOMENTS)
    name = real_path(args.recording).name
    first_frames, times = new_timing(recording, [one.course for one in found.cameras])
    for line in sync_lines(recording, found, shares, first_frames):
        print(line)
    picture = args.out or Path(f"{name}_sync.png")
    save_sync_picture(picture, recording.rig.names, found, name)
    print(f"picture: {picture}")
    if not found.known:
        print(f"{name}: too little to go by (do people move, and do two cameras or more see them?); nothing is written")
    elif found.in_time:
        print(f"{name}: {'its cameras are' if found.all_sure else 'those that can be told are'} in time already; nothing is written")
        print(f"next: {pose_command(places, f'{name}-result')}")
    elif args.dry_run:
        print(f"{name}: nothing is written (--dry-run)")
    else:
        for line in write_new_timing(args.recording, first_frames, times, "first_frame" in places.settings):
            print(line)
        if (args.recording / "truth").is_dir():
            print(f"{args.recording / 'truth'} still counts frames as before")
        print(f"next: {check_command(places)}")
    return 0
