"""``hmc world``: a room of metres, z up and the floor at 0, from a calibration of any world."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hmc.cli.common import add_session_option, given_places, output_path, positive_float
from hmc.io.files import real_path
from hmc.io.own_files import refuse_own_file

if TYPE_CHECKING:
    from hmc.camera.model import Rig
    from hmc.check.upright import Figure, Ground
    from hmc.io.recording import Frame, Recording

__all__ = ["add_parser", "run"]

#: Moments that are looked at.
MOMENTS = 16


def add_parser(subparsers) -> None:
    """Add the command to the argument parser."""
    parser = subparsers.add_parser(
        "world",
        help="find up, floor and scale of a calibration, and write it in metres with z up",
        description="Find out which way is up in a recording's calibration, where the floor is and what its unit is: by people who stand "
        "in it, or by points of the floor that are given. Draw the rig before and after, and write the calibration in metres, with z up "
        "and the floor at z = 0, as calibration.toml; what was there is kept. Nothing is written where it is so already.",
    )
    parser.add_argument("recording", type=Path, help="folder of the recording")
    add_session_option(parser)
    parser.add_argument(
        "--unit",
        type=positive_float,
        default=None,
        metavar="M",
        help="metres a unit of the calibration: 0.05 for a board's squares of 5 cm",
    )
    parser.add_argument("--distance", type=_distance, default=None, metavar="A,B,M", help="two cameras, and how many metres they are apart")
    parser.add_argument(
        "--height",
        type=positive_float,
        default=None,
        metavar="M",
        help="stature of who is in the recording (default: what recording.toml says)",
    )
    parser.add_argument(
        "--points", type=Path, default=None, metavar="FILE.csv", help="points of the floor: point,camera,u,v and, where known, x,y,z"
    )
    parser.add_argument(
        "--board",
        type=_board,
        default=None,
        metavar="NxM",
        help="a chessboard of so many inner corners lies on the floor in the first images",
    )
    parser.add_argument("--square", type=positive_float, default=None, metavar="M", help="side of that board's squares, metres")
    parser.add_argument("--out", type=output_path, default=None, metavar="FILE.png", help="the picture (default: NAME_world.png here)")
    parser.add_argument("--dry-run", action="store_true", help="tell and draw, and write no calibration")


def _distance(text: str) -> tuple[str, str, float]:
    try:
        one, other, metres = text.split(",")
        distance = float(metres)
    except ValueError:
        distance = 0.0
    if not 0 < distance < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not two cameras and how many metres they are apart, such as cam_00,cam_01,2.5")
    return one, other, distance


def _board(text: str) -> tuple[int, int]:
    try:
        columns, rows = (int(n) for n in text.lower().split("x"))
    except ValueError:
        columns = rows = 0
    if min(columns, rows) < 3:
        raise argparse.ArgumentTypeError(f"{text!r} is not the inner corners of a chessboard, 3 or more each way, such as 9x6")
    return columns, rows


def _people(recording: Recording, frames: Sequence[Frame], rig: Rig) -> tuple[Sequence[Figure], Ground | None, tuple[str, ...]]:
    """Who is seen in some frames of a recording, and what they say of a rig's world (`hmc.check.hidden.find_legs`)."""
    from hmc.check.hidden import find_legs
    from hmc.check.moments import probe_masks
    from hmc.check.upright import find_figures, find_ground

    masks = probe_masks(recording, frames, medians=True)
    figures = find_figures(rig, masks)
    return find_legs(rig, figures, masks, find_ground(rig, figures))


def run(args: argparse.Namespace) -> int:
    """Print what was found, write the picture and, where it is another world, the calibration."""
    from hmc.camera.coverage import estimate_room
    from hmc.camera.world import in_world
    from hmc.check.cures import check_command
    from hmc.check.find_world import Known, find_world
    from hmc.check.given_points import board_points, read_points
    from hmc.check.moments import knows_the_floor, moment_frames
    from hmc.check.world_picture import save_world_picture
    from hmc.errors import InputError
    from hmc.io.new_world import write_new_world, write_session_world
    from hmc.io.recording import background_frames, iterate_frames, open_recording

    if args.square is not None and args.board is None:
        raise InputError("--square is the side of a board's squares: give --board too, or take it out")
    places = given_places(args)
    if args.out is not None:
        refuse_own_file(args.out, places)
    recording = open_recording(places, any_world=True)
    rig = recording.rig
    if args.distance is not None:
        rig.select(args.distance[:2])
    first = next(iter(iterate_frames(recording)))
    images = [next(background_frames(recording, c, 1), image) for c, image in enumerate(first.images)]
    points = None
    if args.points is not None:
        points = read_points(args.points, rig)
    elif args.board is not None:
        points = board_points(rig, images, args.board, args.square)
    frames = moment_frames(recording, MOMENTS)
    known = Known(args.unit, args.distance, args.height or recording.known_height_m)
    shown, ground, hidden = _people(recording, frames, rig)
    try:
        found = find_world(rig, ground, points, known, hidden)
        if points is None and not found.as_it_was and knows_the_floor(recording):
            # Shadows on a floor that is elsewhere were taken for people, who then stand too low, and aslant.
            there = in_world(rig, found.world)
            shown, ground, hidden = _people(replace(recording, rig=there, room=estimate_room(there)), frames, rig)
            found = find_world(rig, ground, points, known, hidden)
    except InputError as error:
        raise InputError(f"{args.recording}: {error}") from None
    for line in found.lines:
        print(line)
    name = real_path(args.recording).name
    picture = args.out or Path(f"{name}_world.png")
    save_world_picture(picture, rig, found.world, shown, first.images, name)
    print(f"picture: {picture}")
    if found.as_it_was:
        print(f"{name}: the calibration is in metres with z up and the floor at 0 already; nothing is written")
    elif args.dry_run:
        print(f"{name}: nothing is written (--dry-run)")
    else:
        new = in_world(rig, found.world)
        if places.calibration is not None and places.calibration_place == places.calibration:
            written = write_session_world(args.session, new, places.settings)
        else:
            written = write_new_world(args.recording, new)
        for line in written:
            print(line)
        if (args.recording / "truth").is_dir():
            print(f"{args.recording / 'truth'} is still in the old world")
        print(f"next: {check_command(places)}")
    return 0
