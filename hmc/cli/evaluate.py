"""``hmc evaluate DIR RECORDING``: the scores of a result against the truth."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from hmc.cli.common import made_from, unlike_its_run, whole_number

__all__ = ["add_parser", "run"]


def add_parser(subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "evaluate",
        help="score a result against the truth",
        description="Score a result against the truth: mean error, deviation, MMTP and MMTA a landmark and overall, MOTP and MOTA of the "
        "tracks; with --angles the angles of the joints, with --offsets the errors without what is constant in them, with --images the "
        "landmarks in the images. Prints them and writes metrics.csv, angles.csv, offsets.csv, images.csv and metrics.toml into DIR.",
    )
    parser.add_argument("directory", type=Path, metavar="DIR", help="folder of the result, with joints.csv or tracks.csv")
    parser.add_argument("recording", type=Path, nargs="?", metavar="RECORDING", help="folder of the recording, with truth/")
    parser.add_argument(
        "--truth",
        type=Path,
        metavar="FILE",
        help="table of true joints or centroids, in place of the recording's; or of landmarks marked in images "
        "(frame,camera,person,joint,u,v), against which the poses are projected with the recording's calibration",
    )
    parser.add_argument("--start", type=whole_number, metavar="N", help="first frame that counts (default: as the result was made)")
    parser.add_argument("--frames", type=whole_number, metavar="N", help="how many frames count (default: as the result was made)")
    parser.add_argument(
        "--threshold",
        type=_threshold,
        nargs="+",
        metavar="T",
        help="largest error of a matched landmark, millimetres (against landmarks marked in images: pixels), or auto: chosen from the "
        "errors, by Lilliefors and by R^2 (default: 100 50; in images 10 5)",
    )
    parser.add_argument("--angles", action="store_true", help="errors of the joints' angles, read as one reference body, where matched")
    parser.add_argument(
        "--offsets",
        action="store_true",
        help="errors also without each joint's constant offset along the true trunk, which is how other definitions of joints differ",
    )
    parser.add_argument("--images", action="store_true", help="errors in the images too, of the true joints projected into all cameras")
    parser.add_argument("--quiet", action="store_true", help="print the overall figures and the notes only")


def _threshold(text: str) -> float | str:
    """argparse type: ``auto``, or a number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if text != "auto" and not (0 < value < math.inf):
        raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor a number above 0")
    return "auto" if text == "auto" else value


def run(args: argparse.Namespace) -> int:
    """Read what is compared, score, print, write."""
    from hmc.cli.evaluate_input import read_compared
    from hmc.cli.evaluate_scores import all_scores, write_rows
    from hmc.io.files import write_toml

    compared = read_compared(args.directory, args.recording, args.truth, args.start, args.frames, args.images)
    scores = all_scores(compared, args.threshold, args.angles, args.offsets)
    notes = [note for score in scores for note in score.notes] + unlike_its_run(args.directory) + made_from(args.directory, args.recording)
    lines = [line for score in scores for line in (score.brief if args.quiet else score.lines)] + [f"note: {note}" for note in notes]
    print("\n".join(lines))
    for score in scores:
        if score.rows:
            write_rows(args.directory / score.file, score.rows)
    report = {score.name: score.summary for score in scores if score.summary} | {"notes": notes}
    counted = {"truth": str(args.truth or args.recording), "start": compared.start, "frames": compared.n_frames}
    write_toml(args.directory / "metrics.toml", counted | report)
    return 0
