"""People in CSV files, one file a camera: a row a point (long form), or DeepLabCut's table with three or four header lines."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.door import check_file, open_text
from hmc.io.keypoints.json_forms import MAX_TABLE_BYTES, last_number
from hmc.io.keypoints.layouts import KEYPOINTS, keypoint_named, places
from hmc.io.keypoints.people import RawPeople, as_people

__all__ = ["read_csv_table"]

#: Names of the columns of the long form; the first of each is ours.
COLUMNS = {
    "frame": ("frame", "frame_id", "frame_index", "frame_idx", "frame_number"),
    "person": ("person", "person_id", "track_id", "individual", "individuals", "id"),
    "keypoint": ("keypoint", "landmark", "joint", "bodypart", "keypoint_name", "landmark_name", "landmark_id", "name"),
    "x": ("x", "u", "x_px"),
    "y": ("y", "v", "y_px"),
    "confidence": ("confidence", "likelihood", "visibility", "score", "conf", "c"),
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
}
NEEDED = ("frame", "keypoint", "x", "y")
MAX_FRAME = 10**12

Rows = Iterator[tuple[int, list[str]]]


def read_csv_table(path: Path) -> dict[int, RawPeople]:
    """People of a whole camera, by the number of the frame.

    An empty cell is a point that is not given. Points whose names are none of ours (fingers, a background) are left out.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict of int to RawPeople

    Raises
    ------
    InputError
        When it cannot be read, is no such table, or a cell is not what it must be; with the line.
    """
    try:
        if (size := check_file(path)) > MAX_TABLE_BYTES:
            raise InputError(
                f"{path}: {size / 2**20:.0f} MB, more than the {MAX_TABLE_BYTES // 2**20} MB that are read; write JSON, a frame a file"
            )
        with open_text(path) as file:
            reader = csv.reader(file)
            rows = ((reader.line_num, row) for row in reader if row)
            header = [name.strip() for name in next(rows, (0, [""]))[1]]
            return (_read_deeplabcut if header[0].lower() == "scorer" else _read_long)(path, header, rows)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a table of comma-separated text ({error})") from None


def _read_long(path: Path, header: Sequence[str], rows: Rows) -> dict[int, RawPeople]:
    lower = [name.lower() for name in header]
    columns = {ours: lower.index(found[0]) for ours, names in COLUMNS.items() if (found := [name for name in names if name in lower])}
    if missing := [name for name in NEEDED if name not in columns]:
        raise InputError(f"{path}: the header line has no column {missing[0]!r}; it must be frame,[person,]keypoint,x,y,confidence")
    sized = "width" in columns and "height" in columns
    size: tuple[float, float] | None = None
    frames, lines, points, values = array("q"), array("q"), array("q"), array("d")
    persons: dict[str, int] = {}
    names: dict[str, int] = {}
    who = array("q")
    for line, row in rows:
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: {len(row)} values where the header names {len(header)} columns")
        frames.append(_frame(path, line, row[columns["frame"]]))
        who.append(persons.setdefault(row[columns["person"]].strip() if "person" in columns else "", len(persons)))
        points.append(names.setdefault(row[columns["keypoint"]].strip(), len(names)))
        lines.append(line)
        confidence = row[columns["confidence"]] if "confidence" in columns else "1"
        values.extend(_point(path, line, row[columns["x"]], row[columns["y"]], confidence))
        if sized:
            size = _size(path, line, row[columns["width"]], row[columns["height"]], size)
    if not len(frames):
        return {}
    try:
        order = _order(list(names))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    place = order[np.array(points)]
    known = np.flatnonzero(place >= 0)
    keys, rows_of = np.unique(np.stack([np.array(frames), np.array(who)], axis=1)[known], axis=0, return_inverse=True)
    cells = rows_of.ravel() * len(KEYPOINTS) + place[known]
    _, first, count = np.unique(cells, return_index=True, return_counts=True)
    if (count > 1).any():
        again = known[np.flatnonzero(cells == cells[first[np.argmax(count > 1)]])[1]]
        name = list(names)[points[again]]
        raise InputError(
            f"{path}, line {lines[again]}: {name!r} of frame {frames[again]} a second time; several people need a column `person`"
        )
    people = np.full((len(keys) * len(KEYPOINTS), 3), (np.nan, np.nan, 0.0))
    people[cells] = np.array(values).reshape(-1, 3)[known]
    return _by_frame(path, keys[:, 0], people.reshape(len(keys), len(KEYPOINTS), 3), np.arange(len(KEYPOINTS)), size)


def _read_deeplabcut(path: Path, header: Sequence[str], rows: Rows) -> dict[int, RawPeople]:
    heads: dict[str, list[str]] = {}
    while "coords" not in heads:
        line, row = next(rows, (0, [""]))
        label = row[0].strip().lower()
        if label not in ("individuals", "bodyparts", "coords") or len(row) != len(header):
            raise InputError(f"{path}: after `scorer`, DeepLabCut's header has lines `bodyparts` and `coords`; got {row[0][:30]!r}")
        heads[label] = [cell.strip() for cell in row]
    if "bodyparts" not in heads:
        raise InputError(f"{path}: DeepLabCut's header has no line `bodyparts`")
    individuals = heads.get("individuals", [""] * len(header))
    persons = {name: place for place, name in enumerate(dict.fromkeys(individuals[1:]))}
    names = {name: place for place, name in enumerate(dict.fromkeys(heads["bodyparts"][1:]))}
    axes = {"x": 0, "y": 1, "likelihood": 2}
    column: dict[tuple[int, int, int], int] = {}
    for k in range(1, len(header)):
        coordinate = heads["coords"][k].lower()
        if coordinate not in axes:
            raise InputError(f"{path}: `coords` must be x, y and likelihood; got {coordinate!r}")
        column[persons[individuals[k]], names[heads["bodyparts"][k]], axes[coordinate]] = k
    pairs = [(who, point) for who, point, axis in column if axis == 0]
    if any((*pair, 1) not in column for pair in pairs) or 3 * len(pairs) < len(column) or not pairs:
        raise InputError(f"{path}: every body part needs the columns x and y, and may have likelihood")
    try:
        order = _order(list(names))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    frames, values = array("q"), array("d")
    seen: set[int] = set()
    for line, row in rows:
        if len(row) != len(header):
            raise InputError(f"{path}, line {line}: {len(row)} values where the header names {len(header)} columns")
        frame = _frame(path, line, row[0])
        if frame in seen:
            raise InputError(f"{path}, line {line}: frame {frame} a second time")
        seen.add(frame)
        frames.append(frame)
        for pair in pairs:
            confidence = row[column[*pair, 2]] if (*pair, 2) in column else "1"
            values.extend(_point(path, line, row[column[*pair, 0]], row[column[*pair, 1]], confidence))
    table = np.full((len(frames), len(persons), len(names), 3), (np.nan, np.nan, 0.0))
    who, point = np.array(pairs).T
    table[:, who, point] = np.array(values).reshape(len(frames), len(pairs), 3)
    people = table.reshape(-1, len(names), 3)
    return _by_frame(path, np.repeat(np.array(frames, np.int64), len(persons)), people, order, None)


def _by_frame(
    path: Path, frames: np.ndarray, points: np.ndarray, order: np.ndarray, size: tuple[float, float] | None
) -> dict[int, RawPeople]:
    """Rows of people, (n, k, 3), parted by frame."""
    try:
        people = as_people(points, order)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    rows = np.argsort(frames, kind="stable")
    numbers, first = np.unique(frames[rows], return_index=True)
    parts = np.split(people[rows], first[1:])
    return {int(number): RawPeople(part, size) for number, part in zip(numbers, parts, strict=False)}


def _order(names: Sequence[str]) -> np.ndarray:
    """Place in `KEYPOINTS` of every name; numbers are places in a layout.

    Raises
    ------
    ValueError
        When no name is known, two mean one point, or no layout has so many numbers.
    """
    if all(name.isdecimal() and len(name) < 6 for name in names):
        numbers = np.array([int(name) for name in names])
        order = places(int(numbers.max()) + 1)[numbers]
    else:
        order = np.array([keypoint_named(name) for name in names])
    known = order[order >= 0]
    if not len(known):
        raise ValueError(f"no known name among its points ({', '.join(names)[:60]}); known are {', '.join(KEYPOINTS)}")
    if len(np.unique(known)) < len(known):
        twice = [name for name, place in zip(names, order, strict=True) if place >= 0 and (order == place).sum() > 1]
        raise ValueError(f"{' and '.join(map(repr, twice[:2]))} mean one point; leave one out")
    return order


def _frame(path: Path, line: int, cell: str) -> int:
    text = cell.strip()
    if text.isdecimal() and len(text) <= 15:
        return int(text)
    number = last_number(Path(text).stem) if "." in text and not _is_number(text) else None  # the name of an image
    if number is None and _is_number(text) and float(text).is_integer() and 0 <= float(text) < MAX_FRAME:
        number = int(float(text))
    if number is None:
        raise InputError(f"{path}, line {line}: {cell[:30]!r} is no number of a frame")
    return number


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _point(path: Path, line: int, x: str, y: str, confidence: str) -> tuple[float, float, float]:
    if not x.strip() or not y.strip():
        return math.nan, math.nan, 0.0
    return _number(path, line, x), _number(path, line, y), _number(path, line, confidence) if confidence.strip() else 0.0


def _number(path: Path, line: int, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{path}, line {line}: {cell[:30]!r} where a number must be; leave the cell empty for what was not detected")
    return number


def _size(path: Path, line: int, width: str, height: str, before: tuple[float, float] | None) -> tuple[float, float]:
    size = (_number(path, line, width), _number(path, line, height))
    if min(size) < 1 or max(size) > 1e6 or before not in (None, size):
        raise InputError(f"{path}, line {line}: an image of {width} x {height}; all rows must have one size in pixels")
    return size
