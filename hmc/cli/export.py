"""``hmc export RESULT --to FORMAT``: a finished result in a format of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from hmc.cli.common import output_path, positive_float, print_problems, unlike_its_run, whole_number
from hmc.io.own_files import refuse_result_file

__all__ = ["add_parser", "add_result_options", "read_result_asked", "run"]

#: Said here too, so that an explanation needs no numbers (a test holds them against `hmc.motion.export.FORMATS`).
FORMATS = ("trc", "c3d", "bvh", "mot", "glb", "csv", "parquet")


def add_parser(subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "export",
        help="write a result in a format of other programs",
        description="Write a finished result as TRC or C3D (landmarks), BVH, GLB or an OpenSim motion with its model (the moving body), "
        "CSV or Parquet (a table), with times. docs/exports.md says units, axes and gaps of each. Takes seconds.",
    )
    add_result_options(parser)
    parser.add_argument("--to", required=True, choices=FORMATS, help="the format; mot writes the .osim beside it")
    parser.add_argument(
        "--out", type=output_path, metavar="FILE", help="(default: motion.FORMAT in RESULT; one a person where a file holds one)"
    )
    parser.add_argument("--fill", choices=("none", "linear", "spline"), default="none", help="fill gaps (default: none)")
    parser.add_argument("--max-gap", type=positive_float, metavar="S", help="fill no longer gaps than this, seconds (default: all)")


def add_result_options(parser: argparse.ArgumentParser) -> None:
    """Add the result itself, ``--person``, ``--fps`` and the options of smoothing."""
    parser.add_argument("result", type=Path, metavar="RESULT", help="folder of the result, with joints.csv")
    parser.add_argument("--person", type=whole_number, metavar="N", help="this person alone (default: all)")
    parser.add_argument("--fps", type=positive_float, metavar="F", help="frames a second (default: as run.toml says)")
    parser.add_argument("--smooth", choices=("butterworth", "polynomial"), help="smooth the trajectories first (default: as they are)")
    parser.add_argument("--cutoff", type=positive_float, metavar="HZ", help="of the Butterworth filter, without delay (default: 6)")
    parser.add_argument("--window", type=positive_float, metavar="S", help="of the polynomial, seconds (default: 0.4)")


def read_result_asked(args: argparse.Namespace):
    """The trajectories that the options of `add_result_options` ask for.

    Raises
    ------
    InputError
        When there are none, or an option has nothing to act on.
    """
    import numpy as np

    from hmc.errors import InputError
    from hmc.motion.smoothing import Smoothing, smooth_trajectory, window_too_short
    from hmc.motion.trajectory import read_trajectories

    for option, value, way in (("--cutoff", args.cutoff, "butterworth"), ("--window", args.window, "polynomial")):
        if value is not None and args.smooth != way:
            raise InputError(f"{option} is of --smooth {way}: give that too, or take it out")
    found = read_trajectories(args.result, args.fps, args.person)
    print_problems(unlike_its_run(args.result))
    if args.smooth is None:
        return found
    given = {"cutoff_hz": args.cutoff, "window_s": args.window}
    how = Smoothing(args.smooth, **{name: value for name, value in given.items() if value is not None})
    smoothed = [smooth_trajectory(one, how) for one in found]
    if all(np.array_equal(a.positions, b.positions, equal_nan=True) for a, b in zip(found, smoothed, strict=True)):
        short = window_too_short(found[0].fps, how.window_s) if how.kind == "polynomial" else ""
        print_problems([f"nothing was smoothed: {short or 'no stretch without gaps is long enough'}"])
    return smoothed


def run(args: argparse.Namespace) -> int:
    """Read, fill, smooth, write."""
    from hmc.motion.export import export_trajectories
    from hmc.motion.gaps import check_fill, fill_trajectory

    check_fill(args.fill, args.max_gap)
    if args.out is not None:
        refuse_result_file(args.out, args.result)
    found = [fill_trajectory(one, args.fill, args.max_gap) for one in read_result_asked(args)]
    written = export_trajectories(found, args.out or args.result / f"motion.{args.to}", args.to)
    print_problems(written.notes)
    for path in written.paths:
        print(f"wrote {path}")
    return 0
