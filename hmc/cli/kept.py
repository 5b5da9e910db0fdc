"""The silhouettes of a run: kept with its result, and taken from another's."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from hmc.cli.common import selected_workers
from hmc.io.files import real_path

__all__ = [
    "MASKS", "add_silhouette_options", "given_silhouettes", "leave_silhouettes", "leaving_silhouettes", "silhouettes_source",
    "take_silhouettes",
]  # fmt: skip

#: Silhouettes of a run that is not finished, which its stages share.
MASKS = ".masks"


def add_silhouette_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--silhouettes`` and ``--silhouettes-from``."""
    parser.add_argument(
        "--silhouettes",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="keep the silhouettes in DIR/silhouettes (default; 1 to 10 kB a frame and camera), or leave them out",
    )
    parser.add_argument(
        "--silhouettes-from",
        type=Path,
        metavar="RESULT",
        help="use the silhouettes that another run of this recording kept, in place of making them anew",
    )


def given_silhouettes(args: argparse.Namespace, recording, wanted: bool):
    """What ``--silhouettes-from`` names, or None.

    Parameters
    ----------
    args : Namespace
    recording : Recording
    wanted : bool
        Whether the method uses silhouettes.

    Raises
    ------
    InputError
        When there are none, not all that the recording's selection needs, or the method has no use for them.
    """
    from hmc.errors import InputError
    from hmc.io.silhouettes import open_silhouettes

    folder = args.silhouettes_from
    if folder is None:
        return None
    if not wanted:
        raise InputError(f"--silhouettes-from {folder}: the method makes no use of silhouettes; leave it out")
    if real_path(folder) == real_path(args.out):
        raise InputError(f"--silhouettes-from {folder}: is what --out {args.out} would overwrite; choose another folder")
    found = open_silhouettes(folder)
    if found is None:
        raise InputError(f"--silhouettes-from {folder}: holds no silhouettes; give the folder of a result that kept them (silhouettes/)")
    lacks = found.missing(recording)
    if lacks:
        raise InputError(f"--silhouettes-from {folder}: has {lacks}; leave it out, or choose with --cameras, --start and --frames")
    return found


def silhouettes_source(given) -> dict[str, Any]:
    """What a result says of the silhouettes it was given: nothing where there are none."""
    if given is None:
        return {}
    run = given.directory / "run.toml"
    return {"silhouettes": real_path(given.directory), "silhouettes_changed": str(run.stat().st_mtime_ns)}


def take_silhouettes(given, recording, masks: Path, key: str, on_problem: Callable[[str], None]) -> None:
    """Put given silhouettes where the stages of a run look for those that were made before; nothing where they are there already."""
    from hmc.io.masks import keep_masks, kept_masks

    first, last = recording.start, recording.start + recording.n_frames
    if given is None or kept_masks(masks, key, first, last) is not None:
        return
    for _ in keep_masks(masks, key, first, given.steps(recording, range(first, last)), on_problem):
        pass


def leave_silhouettes(args: argparse.Namespace, recording, key: str, on_problem: Callable[[str], None]) -> None:
    """Leave the silhouettes of a run that is over in its folder, unless they are not wanted."""
    from hmc.io.masks import kept_frames, kept_masks
    from hmc.io.silhouettes import SILHOUETTES, remove_silhouettes, write_silhouettes

    if real_path(args.out) == real_path(recording.path):
        if args.silhouettes:
            on_problem(f"{args.out / SILHOUETTES}: is the recording's own; silhouettes are not kept; give --out another folder")
        return
    first, last = recording.start, recording.start + recording.n_frames
    masks, workers = args.out / MASKS, selected_workers(args)
    if args.silhouettes and kept_masks(masks, key, first, last) is not None:
        lots = [kept_frames(masks, key, range(first + k, last, workers)) or () for k in range(workers)]
        write_silhouettes(args.out, recording, lots, workers)
        return
    remove_silhouettes(args.out)
    if args.silhouettes:
        on_problem(f"{args.out / SILHOUETTES}: not kept, as the run did not hold all of them")


@contextmanager
def leaving_silhouettes(args: argparse.Namespace, recording, key: str, on_problem: Callable[[str], None]) -> Iterator[Callable[[], object]]:
    """`leave_silhouettes` for a run that goes on: call what it gives when that is over. Silhouettes that are all there by now are written
    meanwhile."""
    from hmc.io.masks import kept_frames, kept_masks
    from hmc.io.silhouettes import silhouettes_ahead

    leave = partial(leave_silhouettes, args, recording, key, on_problem)
    frames, masks = range(recording.start, recording.start + recording.n_frames), args.out / MASKS
    there = args.silhouettes and kept_masks(masks, key, frames.start, frames.stop) is not None
    if not there or real_path(args.out) == real_path(recording.path):
        yield leave
        return
    with silhouettes_ahead(args.out, recording, lambda: kept_frames(masks, key, frames) or (), selected_workers(args)) as finish:
        yield finish
