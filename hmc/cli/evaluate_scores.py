"""The scores of ``hmc evaluate``, each with what is printed and written of it."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from hmc.cli.evaluate_input import Compared
from hmc.errors import InputError
from hmc.io.files import atomic_write
from hmc.io.results import TrackTable
from hmc.metrics.mot import MotScores, clear_mot
from hmc.metrics.scores import (
    OffsetEvaluation,
    PoseEvaluation,
    angle_rows,
    comparable_tracks,
    evaluate_images,
    evaluate_offsets,
    evaluate_pose,
    image_landmarks,
    pelvis_tracks,
)
from hmc.metrics.scores.feet import feet_errors
from hmc.metrics.scores.images import THRESHOLDS_PX, ImageEvaluation
from hmc.metrics.scores.poses import THRESHOLDS_M

__all__ = ["Score", "all_scores", "write_rows"]

Row = Mapping[str, Any]
#: Of a landmark's error, in the unit of the landmarks.
Threshold = float | Literal["auto"]


@dataclass(frozen=True)
class Score:
    """One kind of score.

    Parameters
    ----------
    name : str
        In ``metrics.toml``, with the summary.
    summary : mapping of str to object
    lines, brief : sequence of str
        What is printed, and with ``--quiet``.
    file : str
        Of the table.
    rows : sequence of mapping
        The table; empty for none.
    notes : sequence of str
        What a reader should know before trusting the figures, one line each.
    """

    name: str
    summary: Mapping[str, Any]
    lines: Sequence[str]
    brief: Sequence[str]
    file: str = ""
    rows: Sequence[Row] = ()
    notes: Sequence[str] = ()


def all_scores(compared: Compared, thresholds: Sequence[Threshold] | None, angles: bool, offsets: bool) -> list[Score]:
    """Every score that result and truth allow, and those that are asked for.

    Parameters
    ----------
    compared : Compared
    thresholds : sequence of float or "auto", or None
        Largest errors of a matched landmark, millimetres, or pixels of landmarks that are marked in images.
    angles, offsets : bool
        Whether they are asked for.

    Raises
    ------
    InputError
        When there is nothing to compare, or not what is asked for.
    """
    poses = _poses(compared, thresholds)
    images = _images(compared, thresholds)
    tracks = _of_tracks(compared)
    if poses is None and images is None:
        if tracks is None:
            raise InputError(f"{compared.directory}: neither joints.csv nor tracks.csv that the truth could be compared with")
        if not tracks.summary:
            raise InputError(f"{compared.truth}: nothing can be scored: {tracks.notes[-1]}")
    if angles and poses is None and images is None:
        raise InputError(f"{compared.directory}: --angles needs joints.csv there, and true joints")
    if offsets and poses is None:
        raise InputError(f"{compared.directory}: --offsets needs joints.csv there, and true joints in metres")
    scores: list[Score] = []
    if poses is not None:
        scores.append(_of_poses(poses))
        scores += _of_feet(compared, poses)
        if offsets:
            scores.append(_of_offsets(evaluate_offsets(poses.persons)))
    if images is not None:
        scores.append(_of_images(images))
    if angles and poses is not None:
        groups = {str(person.person): (person.estimate, person.truth) for person in poses.persons}
        scores.append(_of_angles(angle_rows("person", groups, poses.thresholds_m[0])))
    elif angles and images is not None:
        scores.append(_of_angles(angle_rows("camera", images.groups, images.thresholds_px[0])))
    return scores if tracks is None else [*scores, tracks]


def _poses(compared: Compared, thresholds: Sequence[Threshold] | None) -> PoseEvaluation | None:
    if compared.poses is None or compared.true_poses is None:
        return None
    chosen: Sequence[Threshold] = THRESHOLDS_M
    if thresholds:
        chosen = ["auto" if one == "auto" else one / 1000 for one in thresholds]
    return evaluate_pose(compared.poses, compared.true_poses, chosen)


def _images(compared: Compared, thresholds: Sequence[Threshold] | None) -> ImageEvaluation | None:
    """Scores in images, against marked landmarks or the projected true joints."""
    rig, truth = compared.rig, compared.marked
    if rig is not None and truth is None and compared.true_poses is not None:
        truth = image_landmarks(compared.true_poses, rig, inside=True)
    if rig is None or truth is None or compared.poses is None:
        return None
    # With true joints a threshold that is given is theirs, in millimetres.
    given = thresholds if thresholds and compared.true_poses is None else THRESHOLDS_PX
    return evaluate_images(image_landmarks(compared.poses, rig), truth, rig, given)


def _of_poses(found: PoseEvaluation) -> Score:
    """The table of landmarks over all persons, then a line a person."""
    summary = found.summary
    first = (
        f"poses: {summary['true_persons']} true person{'' if len(found.persons) == 1 else 's'}, {summary['person_frames']} person-frames, "
        f"{summary['person_frames_estimated']} with an estimate ({summary['coverage']:.1%})"
    )
    last = []
    for name, what in (("trusted", "that are trusted"), ("doubtful", "that are doubtful")):
        if name in summary:
            within = ", ".join(f"{value:.3f} within {key[8:-2]} mm" for key, value in summary[name].items() if key.startswith("mmta"))
            last.append(f"{summary[name]['landmarks']} landmarks {what}: mean {summary[name]['mean_mm']:.1f} mm, {within}")
    last += _threshold_lines(summary, "mm")
    last.append(f"first frame of each person: {summary['initialisation_mean_mm']:.1f} mm; all others: {summary['tracking_mean_mm']:.1f} mm")
    lines, brief = ([first, *_landmark_table(found.rows, "person", quiet), *last] for quiet in (False, True))
    return Score("pose", summary, lines, brief, "metrics.csv", found.rows, found.notes)


def _of_feet(compared: Compared, found: PoseEvaluation) -> list[Score]:
    """Errors of the ends of the soles, where both the result and the recording have them."""
    if compared.feet is None or compared.true_feet is None:
        return []
    feet = feet_errors(compared.feet, compared.true_feet, found.persons)
    if not feet:
        return []
    line = f"ends of the soles: heels {feet['heels_mm']:.1f} mm, toes {feet['toes_mm']:.1f} mm from the true ones, mean"
    return [Score("feet", feet, [line], [line])]


def _of_offsets(found: OffsetEvaluation) -> Score:
    """The landmarks' constant offsets, the errors with and without them, and how much of the mean they are."""
    summary = found.summary
    first = "constant offsets along the true trunk, medians over the same frames:"
    last = []
    if summary["frames"] and summary["mean_mm"] > 0:
        last.append(
            f"without them: mean {summary['mean_without_mm']:.1f} mm for {summary['mean_mm']:.1f}, "
            f"{summary['constant_share']:.0%} of the error is constant (in-sample)"
        )
    lines, brief = (
        [first, *_landmark_table(found.rows, "person", quiet), *last] if summary["frames"] else []  # a note says why
        for quiet in (False, True)
    )
    return Score("offsets", summary, lines, brief, "offsets.csv", found.rows, found.notes)


def _of_images(found: ImageEvaluation) -> Score:
    last = _threshold_lines(found.summary, "px")
    lines, brief = (["in images:", *_landmark_table(found.rows, "camera", quiet), *last] for quiet in (False, True))
    return Score("images", found.summary, lines, brief, "images.csv", found.rows)


def _of_angles(rows: Sequence[Row]) -> Score:
    """The angles' errors over all groups."""
    whole = [row for row in rows if next(iter(row.values())) == "all"]
    overall = next(row for row in whole if row["angle"] == "overall")
    columns = ("mean_deg", "deviation_deg", "compared")
    tables = (_table([row["angle"] for row in shown], shown, columns) for shown in (whole, [overall]))
    lines, brief = (["angles where both landmarks are matched:", *table] for table in tables)
    return Score("angles", {name: value for name, value in overall.items() if name != "angle"}, lines, brief, "angles.csv", rows)


def _of_tracks(compared: Compared) -> Score | None:
    """CLEAR MOT of the tracks, against the true pelvis where there are no true centroids; without a summary where nothing can be scored."""
    found, true, against = compared.tracks, compared.true_tracks, ""
    if true is None and compared.true_poses is not None:
        true, against = pelvis_tracks(compared.true_poses), " (against the true pelvis, as there are no true centroids)"
    if found is None or true is None:
        return None
    found, comparable, notes = comparable_tracks(found, true)
    if len(true.frames) and not len(comparable.frames):
        return Score("tracks", {}, (), (), notes=notes)
    scores = clear_mot(comparable, found)
    line = (
        f"tracks: MOTP {scores.motp * 1000:.1f} mm, MOTA {scores.mota:.4f}, {scores.misses} misses, {scores.false_positives} false "
        f"positives, {scores.mismatches} mismatches in {scores.objects} person-frames{against}"
    )
    return Score("tracks", _track_summary(scores), [line], [line], notes=(*notes, *_beyond_truth(found, comparable)))


def _beyond_truth(found: TrackTable, true: TrackTable) -> list[str]:
    """What is said of rows of tracks before or after all of the truth: nobody may be there then, or the truth may be of less."""
    if not len(true.frames):
        return []
    first, last = int(true.frames.min()), int(true.frames.max())
    n = int(((found.frames < first) | (found.frames > last)).sum())
    if not n:
        return []
    return [f"{n} rows of the tracks are outside the truth's frames {first} to {last} and count as false positives (--start, --frames)"]


def _landmark_table(rows: Sequence[Row], group: str, quiet: bool) -> list[str]:
    """The landmarks over all groups, or all together alone, then a line a group where there are several."""
    whole = [row for row in rows if row[group] == "all" and (not quiet or row["landmark"] == "overall")]
    parts = [row for row in rows if row[group] != "all" and row["landmark"] == "overall"]
    columns = [name for name in rows[0] if not name.startswith("sigma") and name not in (group, "landmark")]
    if len(parts) == 1:
        parts = []
    return _table([row["landmark"] for row in whole] + [f"{group} {row[group]}" for row in parts], whole + parts, columns)


def _table(labels: Sequence[str], rows: Sequence[Row], columns: Sequence[str]) -> list[str]:
    """Rows under the names of their columns."""
    width = max(len(label) for label in labels)
    lines = [" " * width + "  " + "  ".join(columns)]
    for label, row in zip(labels, rows, strict=True):
        lines.append(f"{label:<{width}}  " + "  ".join(f"{row[name]:>{len(name)}{_number_format(name)}}" for name in columns))
    return lines


def _threshold_lines(summary: Mapping[str, Any], unit: str) -> list[str]:
    """The thresholds that the errors suggest, where they were asked for."""
    chosen = [summary.get(f"threshold_{test}_{unit}") for test in ("lilliefors", "r2")]
    return [] if None in chosen else [f"threshold from the errors: {chosen[0]:.1f} {unit} by Lilliefors, {chosen[1]:.1f} {unit} by R^2"]


def _number_format(column: str) -> str:
    """How a column's numbers are written."""
    return "d" if column.endswith("frames") or column == "compared" else ".3f" if column.startswith("mmta") else ".1f"


def _track_summary(tracks: MotScores) -> dict[str, float]:
    """CLEAR MOT as plain numbers, with the rates of Eq. 4.23."""
    counts = {"misses": tracks.misses, "false_positives": tracks.false_positives, "mismatches": tracks.mismatches}
    rates = {f"{name}_rate": count / tracks.objects if tracks.objects else float("nan") for name, count in counts.items()}
    return {"motp_mm": tracks.motp * 1000, "mota": tracks.mota, "person_frames": tracks.objects, **counts, **rates}


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """The table as CSV: numbers with enough digits, NaN as an empty cell."""
    with atomic_write(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        for row in rows:
            writer.writerow("" if value != value else f"{value:.4f}" if isinstance(value, float) else value for value in row.values())
