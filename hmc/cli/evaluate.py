"""``hmc evaluate DIR RECORDING``: the scores of a result against the truth."""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

from hmc.cli.common import whole_number
from hmc.errors import InputError
from hmc.files import atomic_write, write_toml

__all__ = ["add_parser", "run"]


def add_parser(subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "evaluate",
        help="score a result against the truth",
        description="Score a result against the truth: mean error, deviation, MMTP and MMTA a landmark and overall, MOTP and MOTA of the "
        "tracks. Prints them and writes metrics.csv and metrics.toml into DIR.",
    )
    parser.add_argument("directory", type=Path, metavar="DIR", help="folder of the result, with joints.csv or tracks.csv")
    parser.add_argument("recording", type=Path, nargs="?", metavar="RECORDING", help="folder of the recording, with truth/")
    parser.add_argument("--truth", type=Path, metavar="FILE", help="table of true joints or centroids, in place of the recording's")
    parser.add_argument("--start", type=whole_number, metavar="N", help="first frame that counts (default: as the result was made)")
    parser.add_argument("--frames", type=whole_number, metavar="N", help="how many frames count (default: as the result was made)")
    parser.add_argument("--quiet", action="store_true", help="print the overall figures and the notes only")


def run(args: argparse.Namespace) -> int:
    """Score, print, write."""
    from hmc.evaluation import PoseEvaluation, evaluate_pose, evaluate_tracks, pelvis_tracks
    from hmc.metrics.mot import MotScores
    from hmc.results import read_centroids, read_joints, read_tracks, run_selection

    if not args.directory.is_dir():
        raise InputError(f"{args.directory}: no such folder; a result is the folder that `hmc pose` or `hmc track` wrote")
    truth_joints, truth_centroids = find_truth(args.recording, args.truth)
    joints_file, tracks_file = args.directory / "joints.csv", args.directory / "tracks.csv"
    start, frames = run_selection(args.directory) if args.start is None and args.frames is None else (args.start or 0, args.frames)

    def selected(table):
        return table.where((table.frames >= start) & (table.frames < (float("inf") if frames is None else start + frames)))

    poses: PoseEvaluation | None = None
    true_poses = None if truth_joints is None else selected(read_joints(truth_joints))
    if true_poses is not None and joints_file.exists():
        poses = evaluate_pose(selected(read_joints(joints_file)), true_poses)

    tracks: MotScores | None = None
    tracks_note = ""
    true_tracks = None if truth_centroids is None else selected(read_centroids(truth_centroids))
    if true_tracks is None and true_poses is not None:
        true_tracks, tracks_note = pelvis_tracks(true_poses), " (against the true pelvis, as there are no true centroids)"
    if true_tracks is not None and tracks_file.exists():
        tracks = evaluate_tracks(selected(read_tracks(tracks_file)), true_tracks)
    if poses is None and tracks is None:
        raise InputError(f"{args.directory}: neither joints.csv nor tracks.csv that the truth could be compared with")

    report: dict = {}
    if poses is not None:
        print_pose(poses, args.quiet)
        write_rows(args.directory / "metrics.csv", poses.rows)
        report["pose"] = poses.summary
    if tracks is not None:
        print(
            f"tracks: MOTP {tracks.motp * 1000:.1f} mm, MOTA {tracks.mota:.4f}, {tracks.misses} misses, {tracks.false_positives} false "
            f"positives, {tracks.mismatches} mismatches in {tracks.objects} person-frames{tracks_note}"
        )
        report["tracks"] = track_summary(tracks)
    notes = [*(poses.notes if poses is not None else ()), *made_from(args.directory, args.recording)]
    for note in notes:
        print(f"note: {note}")
    report["notes"] = notes
    write_toml(args.directory / "metrics.toml", {"truth": str(args.truth or args.recording), "start": start, "frames": frames, **report})
    return 0


def find_truth(recording: Path | None, truth: Path | None) -> tuple[Path | None, Path | None]:
    """The files of true joints and of true centroids; None for what there is not.

    Raises
    ------
    InputError
        When there is neither.
    """
    if truth is not None:
        if not truth.is_file():
            raise InputError(f"{truth}: no such file (--truth)")
        with open(truth, encoding="utf-8-sig", errors="replace") as file:
            has_joints = "joint" in [name.strip() for name in file.readline().split(",")]
        return (truth, None) if has_joints else (None, truth)
    if recording is None:
        raise InputError("give the RECORDING whose truth/ is to be compared with, or --truth FILE")
    if not recording.is_dir():
        raise InputError(f"{recording}: no such folder; give the recording's folder")
    joints, centroids = recording / "truth" / "joints.csv", recording / "truth" / "centroids.csv"
    if not joints.exists() and not centroids.exists():
        raise InputError(f"{recording}: no truth/joints.csv and no truth/centroids.csv to compare with; give another table by --truth FILE")
    return (joints if joints.exists() else None), (centroids if centroids.exists() else None)


def made_from(directory: Path, recording: Path | None) -> list[str]:
    """A sentence where the result says that it was made from a recording of another name."""
    from hmc.results import read_run

    run = directory / "run.toml"
    made = read_run(run).get("recording") if run.is_file() else None
    if recording is None or not isinstance(made, str) or Path(made).name == recording.resolve().name:
        return []
    return [f"{run}: the result was made from {made}, not from {recording}; are they the same recording?"]


def print_pose(poses, quiet: bool) -> None:
    """The table of landmarks over all persons, then a line a person."""
    summary = poses.summary
    print(
        f"poses: {summary['true_persons']} true person{'' if len(poses.persons) == 1 else 's'}, {summary['person_frames']} person-frames, "
        f"{summary['person_frames_estimated']} with an estimate ({summary['coverage']:.1%})"
    )
    several = len(poses.persons) > 1
    whole = [row for row in poses.rows if row["person"] == "all" and (not quiet or row["landmark"] == "overall")]
    parts = [row for row in poses.rows if row["person"] != "all" and row["landmark"] == "overall"] if several else []
    columns = [name for name in poses.rows[0] if not name.startswith("sigma") and name not in ("person", "landmark")]
    labels = [row["landmark"] for row in whole] + [f"person {row['person']}" for row in parts]
    width = max(len(label) for label in labels)
    print(" " * width + "  " + "  ".join(columns))
    for label, row in zip(labels, whole + parts, strict=True):
        cells = [f"{row[name]:>{len(name)}{number_format(name)}}" for name in columns]
        print(f"{label:<{width}}  " + "  ".join(cells))
    print(f"first frame of each person: {summary['initialisation_mean_mm']:.1f} mm; all others: {summary['tracking_mean_mm']:.1f} mm")


def number_format(column: str) -> str:
    """How a column's numbers are written."""
    return "d" if column.endswith("frames") else ".3f" if column.startswith("mmta") else ".1f"


def track_summary(tracks) -> dict:
    """CLEAR MOT as plain numbers, with the rates of Eq. 4.23."""
    counts = {"misses": tracks.misses, "false_positives": tracks.false_positives, "mismatches": tracks.mismatches}
    rates = {f"{name}_rate": count / tracks.objects if tracks.objects else float("nan") for name, count in counts.items()}
    return {"motp_mm": tracks.motp * 1000, "mota": tracks.mota, "person_frames": tracks.objects, **counts, **rates}


def write_rows(path: Path, rows) -> None:
    """The table as CSV: numbers with enough digits, NaN as an empty cell."""
    with atomic_write(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        for row in rows:
            writer.writerow("" if value != value else f"{value:.4f}" if isinstance(value, float) else value for value in row.values())
