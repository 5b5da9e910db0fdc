"""``hmc experiments ...``: the papers' tables and figures, computed again; the same as ``python -m hmc.experiments ...``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

__all__ = ["add_parser", "hand_over", "run"]


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser("experiments", help="compute the papers' tables and figures again", add_help=False)
    parser.add_argument("words", nargs=argparse.REMAINDER)
    return parser


def hand_over(words: Sequence[str]) -> int:
    """Run what stands behind ``hmc experiments``, options for help too; returns the exit code."""
    from hmc.experiments.__main__ import main

    return main(list(words), "hmc experiments")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    return hand_over(args.words)
