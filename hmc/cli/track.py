"""``hmc track``: where people are in every frame."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hmc.cli.common import add_selection_options, open_selected, positive_float, print_problems, progress, recording_source

__all__ = ["add_parser", "run"]

TRACKERS = ("naive",)
#: The journal of a run that is not finished.
JOURNAL = ".track.journal"


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "track",
        help="where people are in every frame",
        description="Find and follow everybody in a recording. Writes tracks.csv (frame, person, x, y, z of the centroid and of the head; "
        "metres) and run.toml. A run that was stopped goes on where it was when it is started again; a finished one is not repeated "
        "unless the recording or a parameter changed.",
    )
    add_selection_options(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the result")
    parser.add_argument("--tracker", choices=TRACKERS, default="naive", help="method (default: naive)")
    parser.add_argument("--voxel", type=positive_float, default=0.05, metavar="M", help="side of a voxel, metres (default: 0.05)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from hmc.errors import InputError
    from hmc.files import to_toml
    from hmc.frontend import FrontendSettings
    from hmc.results import read_run, read_tracks, write_run, write_tracks
    from hmc.tracking.naive import NaiveSettings
    from hmc.tracking.resumable import track_recording

    recording = open_selected(args)
    tracks_path, run_path, journal = args.out / "tracks.csv", args.out / "run.toml", args.out / JOURNAL
    if args.out.is_file():
        raise InputError(f"--out {args.out}: is a file; give a folder")
    if (args.out / "joints.csv").exists() or (args.out / "pose.npz").exists():
        raise InputError(f"--out {args.out}: holds poses, whose tracks must stay as they are; choose another folder")
    settings, frontend = NaiveSettings(), FrontendSettings()
    parameters: dict[str, Any] = {
        "voxel_size_m": args.voxel,
        "start": recording.start,
        "frames": recording.n_frames,
        "cameras": list(recording.rig.names),
        "room_m": recording.room,
        "fps": recording.fps,
        "tracker": settings,
        "frontend": frontend,
    }
    source = recording_source(recording)
    key = to_toml({"method": args.tracker, **source, "parameters": parameters})
    if run_path.exists() and tracks_path.exists():
        before = read_run(run_path)
        if to_toml({name: before.get(name) for name in ("method", *source, "parameters")}) == key:
            print(_summary(read_tracks(tracks_path), recording.n_frames))
            print(f"{tracks_path} was finished before, with the same parameters; delete it to compute it again")
            return 0
        print(f"{args.out}: its result has other parameters or another recording; starting anew")

    problems: list[str] = [*recording.problems]
    table = track_recording(
        recording,
        args.voxel,
        settings,
        frontend,
        journal=journal,
        key=key,
        on_problem=problems.append,
        progress=lambda steps, total: progress(steps, total, "track", args.quiet),
    )
    write_tracks(tracks_path, table)
    write_run(run_path, args.tracker, parameters, None, **source, problems=list(dict.fromkeys(problems)))
    journal.unlink(missing_ok=True)
    print(_summary(table, recording.n_frames))
    print(f"wrote {tracks_path}")
    print_problems(problems)
    return 0


def _summary(table, n_frames: int) -> str:
    import numpy as np

    persons, counts = np.unique(table.persons, return_counts=True)
    if len(persons) == 0:
        return f"nobody in {n_frames} frames"
    lines = [f"{len(persons)} person{'s' if len(persons) > 1 else ''} in {n_frames} frames"]
    for person, count in zip(persons[:20], counts, strict=False):
        frames = table.frames[table.persons == person]
        lines.append(f"  person {person}: {count} frames, from {frames.min()} to {frames.max()}")
    if len(persons) > 20:
        lines.append(f"  and {len(persons) - 20} more")
    return "\n".join(lines)
