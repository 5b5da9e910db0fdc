"""``hmc angles RESULT``: angles over time with clinical names, as a table and a plot."""

from __future__ import annotations

import argparse

from hmc.cli.common import output_path
from hmc.cli.export import add_result_options, read_result_asked
from hmc.io.own_files import refuse_result_file

__all__ = ["add_parser", "run"]


def add_parser(subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "angles",
        help="write the angles of a result over time",
        description="Write the angles of trunk, hips, knees, ankles, shoulders and elbows of a finished result over time, in degrees, "
        "with clinical names and signs. docs/angles.md says what each is. Takes seconds.",
    )
    add_result_options(parser)
    parser.add_argument("--out", type=output_path, metavar="FILE.csv", help="the table (default: clinical_angles.csv in RESULT)")
    parser.add_argument("--plot", type=output_path, metavar="FILE.png", help="draw the angles too")


def run(args: argparse.Namespace) -> int:
    """Read, smooth, write, draw."""
    from hmc.errors import InputError
    from hmc.io.export.tables import write_csv
    from hmc.motion.clinical import angle_table

    if args.out is not None:
        refuse_result_file(args.out, args.result)
    suffixes = (".png", ".pdf", ".svg")
    if args.plot is not None and args.plot.suffix.lower() not in suffixes:
        raise InputError(f"{args.plot}: a plot is one of {', '.join(suffixes)}")
    table = angle_table(read_result_asked(args))
    out = args.out or args.result / "clinical_angles.csv"
    write_csv(out, table)
    print(f"wrote {out}")
    if args.plot is not None:
        from hmc.io.files import atomic_write
        from hmc.io.results import read_joints
        from hmc.motion.clinical import doubtful_angles
        from hmc.view.motion_plots import draw_angles

        figure = draw_angles(table, doubtful=doubtful_angles(table, read_joints(args.result / "joints.csv")))
        with atomic_write(args.plot, "wb") as file:
            figure.savefig(file, format=args.plot.suffix[1:].lower(), dpi=110)
        print(f"wrote {args.plot}")
    return 0
