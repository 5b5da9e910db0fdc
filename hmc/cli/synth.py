"""``hmc synth RECIPE --out RECORDING``: render people in a room, with truth."""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from shlex import quote

from hmc.cli.common import output_path, positive_float, whole_number

__all__ = ["add_parser", "run"]


def add_parser(subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "synth",
        help="render a recording with truth from a recipe",
        description="Render people in a room, seen by a rig of cameras, into a recording with exact truth.",
    )
    parser.add_argument(
        "recipe",
        metavar="RECIPE",
        help="a TOML file, the name of a shipped recipe (data/synthetic), such as demo, or varied-N: drawn at random",
    )
    parser.add_argument(
        "--out", type=output_path, required=True, metavar="RECORDING", help="folder to make; a rendered recording there is replaced"
    )
    parser.add_argument("--seed", type=whole_number, default=None, metavar="N", help="in place of the recipe's seed")
    parser.add_argument("--fps", type=positive_float, default=None, metavar="F", help="frames a second in place of the recipe's")
    parser.add_argument(
        "--silhouette-every",
        type=whole_number,
        default=None,
        metavar="N",
        help="true silhouettes of every Nth frame, in place of the recipe's",
    )
    parser.add_argument("--workers", type=whole_number, default=None, metavar="N", help="processes (default: one a core)")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def run(args: argparse.Namespace) -> int:
    """Render, and tell what was written."""
    from tqdm import tqdm

    from hmc.io.calibration import read_calibration
    from hmc.io.results import read_joints
    from hmc.synthetic.recipe import check_recipe, load_recipe
    from hmc.synthetic.render import render_recording
    from hmc.synthetic.truth import through_one_another

    recipe = load_recipe(args.recipe)
    changes = {"fps": args.fps, "silhouette_every": args.silhouette_every}
    recipe = replace(recipe, **{name: value for name, value in changes.items() if value is not None})
    check_recipe(recipe, recipe.name)
    total = recipe.n_frames + recipe.background_frames
    with tqdm(total=total, desc=f"rendering {recipe.name}", unit="frame", dynamic_ncols=True, disable=args.quiet) as bar:
        render_recording(
            recipe, args.out, args.seed, args.workers or os.cpu_count() or 1, on_progress=lambda done, _: bar.update(done - bar.n)
        )
    for line in through_one_another(read_joints(args.out / "truth" / "joints.csv")):
        print(f"note: {line}")
    print(f"{args.out}: a recording of {len(read_calibration(args.out))} cameras, {recipe.n_frames} frames each, with truth")
    print(f"next: hmc check {quote(str(args.out))}")
    return 0
