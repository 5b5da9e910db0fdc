"""People in JSON files: the forms of OpenPose, AlphaPose, MMPose, RTMPose and MediaPipe.

One reader for all of them: a person is a flat list of numbers, a list of points, or a table with such a list; a frame is a table with a
list of people, or such a list; a file of one camera is a list of frames.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.io.door import check_file, read_json_file
from hmc.io.keypoints.layouts import keypoint_named, places
from hmc.io.keypoints.people import NOBODY, RawPeople, as_people

__all__ = ["MAX_FRAME_BYTES", "MAX_TABLE_BYTES", "last_number", "read_json_frame", "read_json_table"]

#: No file of a frame is larger (a person is 1 to 3 kB), and no file of a camera is read that would not fit into memory.
MAX_FRAME_BYTES = 8 * 2**20
MAX_TABLE_BYTES = 256 * 2**20

_PEOPLE = ("people", "instances", "pred_instances", "predictions", "persons", "poses")
_FLAT = ("pose_keypoints_2d", "pose_keypoints")
_POINTS = ("keypoints", "landmarks", "pose_landmarks", "poseLandmarks", "points")
_SCORES = ("keypoint_scores", "scores", "confidences", "visibility")
_CONFIDENCE = ("confidence", "score", "likelihood", "visibility", "c")
_FRAME = ("frame", "frame_id", "frame_index", "frame_idx", "frame_number", "image_id", "image_name", "image")
_NAME = ("name", "keypoint", "landmark", "joint")
_SIZES = (("width", "height"), ("image_width", "image_height"), ("frame_width", "frame_height"), ("canvas_width", "canvas_height"))
_PAIRS = ("image_size", "size", "resolution")
_META = ("meta_info", "metadata", "meta", "video", "info")


def read_json_frame(path: Path) -> RawPeople:
    """People of the file of one frame.

    Parameters
    ----------
    path : Path

    Returns
    -------
    RawPeople

    Raises
    ------
    InputError
        When it cannot be read, is no JSON or no list of people, or a number is not what it must be.
    """
    document = _load(path, MAX_FRAME_BYTES)
    try:
        return RawPeople(_people(document), _size(document))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def read_json_table(path: Path) -> tuple[dict[int, RawPeople], int]:
    """People of a whole camera, by the number of the frame, and the number that the file gives the first frame of a video.

    Frames without a number count from 0. MMPose's demo programs, whose files begin with ``meta_info``, count from 1.

    Raises
    ------
    InputError
        As for `read_json_frame`.
    """
    document = _load(path, MAX_TABLE_BYTES)
    try:
        size = _size(document)
        first = int(isinstance(document, dict) and "instance_info" in document)
        frames: dict[int, list[np.ndarray]] = {}
        sizes: dict[int, tuple[float, float] | None] = {}
        for number, entry in _frames(document):
            try:
                frames.setdefault(number, []).append(_people(entry))
                sizes[number] = _size(entry) or size
            except ValueError as error:
                raise ValueError(f"frame {number}: {error}") from None
        return {number: RawPeople(np.concatenate(parts), sizes[number]) for number, parts in frames.items()}, first
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _load(path: Path, limit: int) -> Any:
    size = check_file(path)
    if size > limit:
        raise InputError(f"{path}: {size / 2**20:.0f} MB, more than the {limit // 2**20} MB that are read; write one file a frame")
    return read_json_file(path)


def _frames(document: Any) -> Iterator[tuple[int, Any]]:
    """Number and content of every frame of a camera's file."""
    if isinstance(document, dict):
        listed = _first(document, ("instance_info", "frames", "images", "annotations", "predictions", "results"))
        if listed is None and document and all(key.isdecimal() and len(key) < 12 for key in document):
            listed = [{"frame": int(key), "people": value} for key, value in document.items()]
        document = listed
    if not isinstance(document, list):
        raise ValueError("no list of frames")
    numbered = None
    for place, entry in enumerate(document):
        stated = _first(entry, _FRAME) if isinstance(entry, dict) else None
        if numbered not in (None, stated is not None):
            raise ValueError(f"entry {place} has {'a' if stated is not None else 'no'} frame number, unlike those before it")
        numbered = stated is not None
        yield (place if stated is None else _frame_number(stated)), entry


def _frame_number(stated: Any) -> int:
    """A whole number, or the last one in the name of an image."""
    number = last_number(Path(stated).stem) if isinstance(stated, str) else stated
    if isinstance(number, float) and number.is_integer():
        number = int(number)
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < 10**12:
        raise ValueError(f"{_short(stated)} is no number of a frame")
    return number


def last_number(stem: str) -> int | None:
    """The number of a frame in a file's name, its last one: 12 of `cam_00_000000000012_keypoints`; None where there is none."""
    numbers = re.findall(r"[0-9]+", re.sub(r"_keypoints(_2d)?$", "", stem))
    return int(numbers[-1]) if numbers and len(numbers[-1]) <= 15 else None


def _size(entry: Any) -> tuple[float, float] | None:
    """(width, height) of the image that the detector saw, where an entry says it."""
    if not isinstance(entry, dict):
        return None
    for across, down in _SIZES:
        if across in entry and down in entry:
            return _checked_size((entry[across], entry[down]))
    for key in _PAIRS:
        if isinstance(entry.get(key), list) and len(entry[key]) == 2:
            return _checked_size(entry[key])
    return next((found for key in _META if (found := _size(entry.get(key))) is not None), None)


def _checked_size(values: Any) -> tuple[float, float]:
    width, height = (_number(value) for value in values)
    if not (1 <= width < 1e6 and 1 <= height < 1e6):
        raise ValueError(f"the image's size, {width:g} x {height:g}, is no size in pixels")
    return width, height


def _people(entry: Any) -> np.ndarray:
    """People of one frame, shape (n, 26, 3)."""
    if entry is None:
        return NOBODY
    if isinstance(entry, dict):
        if (listed := _first(entry, _PEOPLE)) is not None:
            if isinstance(listed, dict):
                return _people(listed)
            entry = listed
        elif any(key in entry for key in (*_FLAT, *_POINTS)):
            points = _first(entry, (*_FLAT, *_POINTS))
            # One person, or the points of all and the scores of all.
            if not _are_several(points):
                return _stack([entry])
            scores = _first(entry, _SCORES)
            scores = [None] * len(points) if scores is None else scores
            if not isinstance(scores, list) or len(scores) != len(points):
                raise ValueError("not as many lists of scores as people")
            entry = [{"keypoints": own, "keypoint_scores": score} for own, score in zip(points, scores, strict=True)]
        elif any(key in entry for key in _FRAME) or not entry:
            return NOBODY
        else:
            raise ValueError(f"no people in it; a frame has a list under {', '.join(_PEOPLE[:3])} or {', '.join(_POINTS[:2])}")
    if not isinstance(entry, list):
        raise ValueError(f"a list of people was expected, not {_short(entry)}")
    if entry and (isinstance(entry[0], int | float) or (_is_table(entry[0]) and "x" in entry[0])):
        entry = [entry]  # one person alone
    return _stack(entry)


def _are_several(points: Any) -> bool:
    """Whether these are the lists of several people, and not of one person's points."""
    if _depth(points) < 2 or not points[0]:
        return _depth(points) > 2
    inner = points[0]
    return _depth(points) > 2 or _is_table(inner[0]) or len(inner) > 4


def _stack(entries: list[Any]) -> np.ndarray:
    people = [person for entry in entries for person in _persons(entry)]
    return np.stack(people) if people else NOBODY


def _persons(entry: Any) -> Iterator[np.ndarray]:
    """The person of one entry, shape (26, 3); none of an empty one."""
    scores = None
    if isinstance(entry, dict):
        points = _first(entry, (*_FLAT, *_POINTS))
        scores = _first(entry, _SCORES)
        if points is None and not any(key in entry for key in (*_FLAT, *_POINTS)):
            raise ValueError(f"a person without {_FLAT[0]} or keypoints")
        if isinstance(points, list) and len(points) == 1 and _depth(points) == 3:
            points = points[0]  # rows of one
            scores = scores[0] if isinstance(scores, list) and len(scores) == 1 else scores
    else:
        points = entry
    if points is None:
        return
    if isinstance(points, dict):
        points = [{"name": name, **value} if _is_table(value) else {"name": name, "point": value} for name, value in points.items()]
    if not isinstance(points, list):
        raise ValueError(f"a list of points was expected, not {_short(points)}")
    if not points:
        return
    if not isinstance(points[0], list | dict):
        if len(points) % 3:
            raise ValueError(f"{len(points)} numbers are no list of x, y, confidence")
        if scores is None and (rows := _flat_rows(points)) is not None:
            yield as_people(rows[None], places(len(rows)))[0]
            return
        points = [points[k : k + 3] for k in range(0, len(points), 3)]
    if scores is not None and (not isinstance(scores, list) or len(scores) != len(points)):
        raise ValueError("not as many scores as points")
    names = [_first(point, _NAME) if isinstance(point, dict) else None for point in points]
    named = [name for name in names if isinstance(name, str)]
    if len(named) == len(points):
        order = np.array([keypoint_named(name) for name in named])
        if not (order >= 0).any():
            raise ValueError(f"no known name among its points ({_short(names[0])}, ...)")
        used = order[order >= 0]
        if len(np.unique(used)) < len(used):
            raise ValueError("has a point twice")
    else:
        order = places(len(points))
    rows = np.array([_point(point) for point in points])
    if scores is not None:
        rows[:, 2] = [_number(score[0] if isinstance(score, list) and len(score) == 1 else score, 0.0) for score in scores]
    yield as_people(rows[None], order)[0]


def _flat_rows(numbers: list[Any]) -> np.ndarray | None:
    """Rows of x, y and confidence, of finite numbers and nothing else: what most files hold, all at once; else None."""
    if not set(map(type, numbers)) <= {int, float}:
        return None
    try:
        rows = np.array(numbers, float).reshape(-1, 3)
    except OverflowError:
        return None
    return rows if np.isfinite(rows).all() else None


def _point(point: Any) -> tuple[float, float, float]:
    """x, y and confidence; 1 where none is stated, and NaN coordinates where there is no point."""
    if isinstance(point, dict):
        if "point" in point:
            return _point(point["point"])
        x, y, confidence = point.get("x"), point.get("y"), _first(point, _CONFIDENCE)
        confidence = 1.0 if confidence is None else confidence
    elif isinstance(point, list) and 2 <= len(point) <= 4:
        x, y, confidence = point[0], point[1], point[-1] if len(point) > 2 else 1.0
    elif point is None:
        x = y = confidence = None
    else:
        raise ValueError(f"{_short(point)} is no point (x, y, confidence)")
    if x is None or y is None:
        return np.nan, np.nan, 0.0
    return _number(x), _number(y), _number(confidence, 0.0)


def _number(value: Any, instead: float | None = None) -> float:
    """A finite number; `instead` of null."""
    if value is None and instead is not None:
        return instead
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{_short(value)} where a number must be")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("holds a number that is not finite; leave out what was not detected")
    return number


def _first(table: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    return next((table[key] for key in keys if table.get(key) is not None), None)


def _depth(value: Any) -> int:
    """How deep lists are nested, along the first entries."""
    depth = 0
    while isinstance(value, list):
        depth, value = depth + 1, value[0] if value else None
    return depth


def _is_table(value: Any) -> bool:
    return isinstance(value, dict)


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
