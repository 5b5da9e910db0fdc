"""``hmc evaluate DIR RECORDING``: the scores of a result against the truth."""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from hmc.cli.common import made_from, unlike_its_run, whole_number
from hmc.errors import InputError
from hmc.io.files import atomic_write, write_toml

if TYPE_CHECKING:
    from hmc.io.results import TrackTable

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
    """Score, print, write."""
    from hmc.io.results import PoseTable, read_joints, read_tracks, run_selection
    from hmc.metrics.mot import MotScores, clear_mot
    from hmc.metrics.scores import PoseEvaluation, angle_rows, comparable_tracks, evaluate_offsets, evaluate_pose, pelvis_tracks
    from hmc.metrics.scores.poses import THRESHOLDS_M

    if not args.directory.is_dir():
        raise InputError(f"{args.directory}: no such folder; a result is the folder that `hmc pose` or `hmc track` wrote")
    truth_joints, truth_centroids, truth_images = find_truth(args.recording, args.truth)
    joints_file, tracks_file = args.directory / "joints.csv", args.directory / "tracks.csv"
    start, frames = run_selection(args.directory, args.start, args.frames)

    def selected(table):
        return table.where((table.frames >= start) & (table.frames < (float("inf") if frames is None else start + frames)))

    def selected_truth(table, path):
        """Of a truth that has frames, but none of these, it is said which it has."""
        chosen = selected(table)
        if len(table.frames) and not len(chosen.frames):
            wanted = f"{start} on" if frames is None else f"{start} to {start + frames - 1}"
            raise InputError(
                f"{path}: has frames {table.frames.min()} to {table.frames.max()}, and compared are frames {wanted}: none in common; "
                "let it count frames as the recording does, from 0, or choose others by --start and --frames"
            )
        return chosen

    estimated: PoseTable | None = selected(read_joints(joints_file)) if joints_file.exists() else None
    poses: PoseEvaluation | None = None
    true_poses = None if truth_joints is None else selected_truth(read_joints(truth_joints), truth_joints)
    if true_poses is not None and estimated is not None:
        given: Sequence[float | Literal["auto"]] = THRESHOLDS_M
        if args.threshold:
            given = ["auto" if one == "auto" else one / 1000 for one in args.threshold]
        poses = evaluate_pose(estimated, true_poses, given)

    images = None
    if args.images or truth_images is not None:
        if estimated is None or (true_poses is None and truth_images is None):
            raise InputError(f"{args.directory}: scores in images need joints.csv there, and true joints or marked landmarks")
        images = _in_images(args, estimated, true_poses, truth_images, selected_truth)

    tracks: MotScores | None = None
    tracks_note, tracks_notes = "", list[str]()
    true_tracks = None if truth_centroids is None else selected_truth(read_tracks(truth_centroids), truth_centroids)
    if true_tracks is None and true_poses is not None:
        true_tracks, tracks_note = pelvis_tracks(true_poses), " (against the true pelvis, as there are no true centroids)"
    if true_tracks is not None and tracks_file.exists():
        found = selected(read_tracks(tracks_file))
        found, comparable, left_out = comparable_tracks(found, true_tracks)
        tracks_notes += left_out
        if len(comparable.frames) or not len(true_tracks.frames):
            tracks = clear_mot(comparable, found)
            tracks_notes += _beyond_truth(found, comparable)
    if poses is None and tracks is None and images is None and tracks_notes:
        raise InputError(f"{truth_centroids}: nothing can be scored: {tracks_notes[-1]}")
    if poses is None and tracks is None and images is None:
        raise InputError(f"{args.directory}: neither joints.csv nor tracks.csv that the truth could be compared with")
    if args.angles and poses is None and images is None:
        raise InputError(f"{args.directory}: --angles needs joints.csv there, and true joints")
    if args.offsets and poses is None:
        raise InputError(f"{args.directory}: --offsets needs joints.csv there, and true joints in metres")
    offsets = evaluate_offsets(poses.persons) if args.offsets and poses is not None else None

    report: dict = {}
    notes: list[str] = []
    angles: list[dict] = []
    if poses is not None:
        print_pose(poses, args.quiet)
        write_rows(args.directory / "metrics.csv", poses.rows)
        report["pose"] = poses.summary
        notes += poses.notes
        feet = _feet(args, poses.persons, selected)
        if feet:
            print(f"ends of the soles: heels {feet['heels_mm']:.1f} mm, toes {feet['toes_mm']:.1f} mm from the true ones, mean")
            report["feet"] = feet
        if args.angles:
            groups = {str(person.person): (person.estimate, person.truth) for person in poses.persons}
            angles = angle_rows("person", groups, poses.thresholds_m[0])
        if offsets is not None:
            print_offsets(offsets, args.quiet)
            write_rows(args.directory / "offsets.csv", offsets.rows)
            report["offsets"] = offsets.summary
            notes += offsets.notes
    if images is not None:
        print("in images:")
        print_rows(images.rows, "camera", args.quiet)
        print_thresholds(images.summary, "px")
        write_rows(args.directory / "images.csv", images.rows)
        report["images"] = images.summary
        if args.angles and poses is None:
            angles = angle_rows("camera", images.groups, images.thresholds_px[0])
    if angles:
        print_angles(angles, args.quiet)
        write_rows(args.directory / "angles.csv", angles)
        report["angles"] = {
            name: value for name, value in next(row for row in angles if row["angle"] == "overall").items() if name != "angle"
        }
    if tracks is not None:
        print(
            f"tracks: MOTP {tracks.motp * 1000:.1f} mm, MOTA {tracks.mota:.4f}, {tracks.misses} misses, {tracks.false_positives} false "
            f"positives, {tracks.mismatches} mismatches in {tracks.objects} person-frames{tracks_note}"
        )
        report["tracks"] = track_summary(tracks)
    notes += tracks_notes
    notes += unlike_its_run(args.directory) + made_from(args.directory, args.recording)
    for note in notes:
        print(f"note: {note}")
    report["notes"] = notes
    write_toml(args.directory / "metrics.toml", {"truth": str(args.truth or args.recording), "start": start, "frames": frames, **report})
    return 0


def _beyond_truth(found: TrackTable, true: TrackTable) -> list[str]:
    """What is said of rows of tracks before or after all of the truth: nobody may be there then, or the truth may be of less."""
    if not len(true.frames):
        return []
    first, last = int(true.frames.min()), int(true.frames.max())
    n = int(((found.frames < first) | (found.frames > last)).sum())
    if not n:
        return []
    return [f"{n} rows of the tracks are outside the truth's frames {first} to {last} and count as false positives (--start, --frames)"]


def _feet(args: argparse.Namespace, persons, selected) -> dict[str, float]:
    """Errors of the ends of the soles, where both the result and the recording have them."""
    from hmc.io.results import read_joints
    from hmc.landmarks import FOOT_POINTS
    from hmc.metrics.scores.feet import feet_errors

    found, true = args.directory / "feet.csv", Path(args.recording or "") / "truth" / "feet.csv"
    if args.recording is None or args.truth is not None or not found.is_file() or not true.is_file():
        return {}
    return feet_errors(selected(read_joints(found, FOOT_POINTS)), read_joints(true, FOOT_POINTS), persons)


def _in_images(args: argparse.Namespace, estimated, true_poses, truth_images: Path | None, selected):
    """Scores in images, against marked landmarks or the projected true joints."""
    from hmc.camera.turned_cameras import turn_back
    from hmc.io.camera_turns import read_turns
    from hmc.io.recording import read_rig
    from hmc.metrics.scores.images import THRESHOLDS_PX, evaluate_images, image_landmarks, read_image_landmarks

    if args.recording is None:
        raise InputError("scores in images need the RECORDING, for its calibration")
    rig = turn_back(read_rig(args.recording), read_turns(args.directory))
    if truth_images is not None:
        truth = selected(read_image_landmarks(truth_images, rig.names), truth_images)
    else:
        truth = image_landmarks(true_poses, rig, inside=True)
    # With true joints a threshold that is given is theirs, in millimetres.
    given = args.threshold if args.threshold and true_poses is None else THRESHOLDS_PX
    return evaluate_images(image_landmarks(estimated, rig), truth, rig, given)


def find_truth(recording: Path | None, truth: Path | None) -> tuple[Path | None, Path | None, Path | None]:
    """The files of true joints, of true centroids and of landmarks marked in images; None for what there is not.

    Raises
    ------
    InputError
        When there is none.
    """
    if truth is not None:
        if not truth.is_file():
            raise InputError(f"{truth}: no such file (--truth)")
        with open(truth, encoding="utf-8-sig", errors="replace") as file:
            header = file.readline(200).strip()
        names = [name.strip() for name in header.split(",")]
        if not {"frame", "person"} <= set(names):
            raise InputError(
                f"{truth}: no table of the truth: the first line must be frame,person,joint,x,y,z (joints), frame,person,x,y,z (centroids) "
                f"or frame,camera,person,joint,u,v (marked in images), with commas between; got {header[:80]!r}"
            )
        if "joint" in names:
            return (None, None, truth) if "u" in names else (truth, None, None)
        return None, truth, None
    if recording is None:
        raise InputError("give the RECORDING whose truth/ is to be compared with, or --truth FILE")
    if not recording.is_dir():
        raise InputError(f"{recording}: no such folder; give the recording's folder")
    joints, centroids = recording / "truth" / "joints.csv", recording / "truth" / "centroids.csv"
    if not joints.exists() and not centroids.exists():
        raise InputError(f"{recording}: no truth/joints.csv and no truth/centroids.csv to compare with; give another table by --truth FILE")
    return (joints if joints.exists() else None), (centroids if centroids.exists() else None), None


def print_pose(poses, quiet: bool) -> None:
    """The table of landmarks over all persons, then a line a person."""
    summary = poses.summary
    print(
        f"poses: {summary['true_persons']} true person{'' if len(poses.persons) == 1 else 's'}, {summary['person_frames']} person-frames, "
        f"{summary['person_frames_estimated']} with an estimate ({summary['coverage']:.1%})"
    )
    print_rows(poses.rows, "person", quiet)
    for name, what in (("trusted", "that are trusted"), ("doubtful", "that are doubtful")):
        if name in summary:
            within = ", ".join(f"{value:.3f} within {key[8:-2]} mm" for key, value in summary[name].items() if key.startswith("mmta"))
            print(f"{summary[name]['landmarks']} landmarks {what}: mean {summary[name]['mean_mm']:.1f} mm, {within}")
    print_thresholds(summary, "mm")
    print(f"first frame of each person: {summary['initialisation_mean_mm']:.1f} mm; all others: {summary['tracking_mean_mm']:.1f} mm")


def print_rows(rows, group: str, quiet: bool) -> None:
    """The landmarks over all groups, then a line a group where there are several."""
    whole = [row for row in rows if row[group] == "all" and (not quiet or row["landmark"] == "overall")]
    parts = [row for row in rows if row[group] != "all" and row["landmark"] == "overall"]
    columns = [name for name in rows[0] if not name.startswith("sigma") and name not in (group, "landmark")]
    if len(parts) == 1:
        parts = []
    print_table([row["landmark"] for row in whole] + [f"{group} {row[group]}" for row in parts], whole + parts, columns)


def print_angles(rows, quiet: bool) -> None:
    """The angles' errors over all groups."""
    whole = [row for row in rows if next(iter(row.values())) == "all" and (not quiet or row["angle"] == "overall")]
    print("angles where both landmarks are matched:")
    print_table([row["angle"] for row in whole], whole, ["mean_deg", "deviation_deg", "compared"])


def print_offsets(offsets, quiet: bool) -> None:
    """The landmarks' constant offsets, the errors with and without them, and how much of the mean they are."""
    summary = offsets.summary
    if not summary["frames"]:
        return  # a note says why
    print("constant offsets along the true trunk, medians over the same frames:")
    print_rows(offsets.rows, "person", quiet)
    if summary["mean_mm"] > 0:
        print(
            f"without them: mean {summary['mean_without_mm']:.1f} mm for {summary['mean_mm']:.1f}, "
            f"{summary['constant_share']:.0%} of the error is constant (in-sample)"
        )


def print_table(labels, rows, columns) -> None:
    """Rows under the names of their columns."""
    width = max(len(label) for label in labels)
    print(" " * width + "  " + "  ".join(columns))
    for label, row in zip(labels, rows, strict=True):
        cells = [f"{row[name]:>{len(name)}{number_format(name)}}" for name in columns]
        print(f"{label:<{width}}  " + "  ".join(cells))


def print_thresholds(summary, unit: str) -> None:
    """The thresholds that the errors suggest, where they were asked for."""
    chosen = [summary.get(f"threshold_{test}_{unit}") for test in ("lilliefors", "r2")]
    if None not in chosen:
        print(f"threshold from the errors: {chosen[0]:.1f} {unit} by Lilliefors, {chosen[1]:.1f} {unit} by R^2")


def number_format(column: str) -> str:
    """How a column's numbers are written."""
    return "d" if column.endswith("frames") or column == "compared" else ".3f" if column.startswith("mmta") else ".1f"


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
