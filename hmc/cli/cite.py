"""``hmc cite [NAME|RESULT]...``: what to cite of what was run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hmc.cli.common import add_plugin_option, load_given_plugins

__all__ = ["add_parser", "run"]

#: Methods on a detector's keypoints, which is somebody's work too.
ON_KEYPOINTS = ("keypoints",)


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "cite",
        help="what to cite of what was run",
        description="Print the references of methods, trackers and papers' presets, or of all that a result was made with, as text and as "
        "BibTeX; the first is always this software.",
    )
    parser.add_argument(
        "what",
        nargs="*",
        metavar="NAME|RESULT",
        help="method (apf, smd, ...), tracker (sparse, ...), preset (kehl2006, ...), or the folder of a result, or its run.toml",
    )
    parser.add_argument("--bibtex", action="store_true", help="BibTeX alone, for a file")
    add_plugin_option(parser)
    return parser


def run(args: argparse.Namespace) -> int:
    """Print the references."""
    from hmc.citations import SOFTWARE, WORKS, bibtex, works_of, works_of_run
    from hmc.io.results import read_run

    load_given_plugins(args)
    keys, detector = set[str](), False
    for what in args.what:
        path = Path(what) / "run.toml" if Path(what).is_dir() else Path(what)
        if path.is_file() or Path(what).is_dir():
            table = read_run(path)
            works = works_of_run(table, path)
            detector |= "keypoints" in str(table.get("options", {}).get("cues") or table.get("parameters", {}).get("cues", ""))
            detector |= table.get("method") in ON_KEYPOINTS
        else:
            works = works_of(what)
            detector |= what in ON_KEYPOINTS
        keys |= {work.key for work in works}
    chosen = [SOFTWARE, *(work for work in WORKS.values() if work.key in keys)]
    if not args.bibtex:
        print("\n".join(work.text for work in chosen) + "\n")
    print("\n\n".join(bibtex(work) for work in chosen))
    if detector:
        print("note: the keypoints are another program's work: cite that too", file=sys.stderr)
    return 0
