"""Motion capture in the C3D format: labelled points, frame by frame.

Source: the C3D file format specification (c3d.org). Integer and floating-point files of all three processor types are read; analogue
channels are passed over.

Files are written through `ezc3d` (`hmc.io.export.c3d`), and would be read through it, but that a file cut off within its
parameters makes it run on without an end (1.7.2; tests/io/test_c3d.py has such files), that a few changed bytes in its parameters
can end the whole process by a segmentation fault or make it ask for any amount of memory, and that it is no dependency. Counts in
the header held against the file's size tell the first of these only; the others would need a process of their own for every file.
The package `c3d` (0.6.0) refuses the file in tests/io/test_c3d.py that another program wrote, with a single analogue channel: its
group ANALOG has a scalar where it asserts an array. So this reader stays, and tests hold it against ezc3d's files.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.io.door import read_bytes

__all__ = ["PointData", "read_c3d"]

BLOCK = 512
MAGIC = 0x50
INTEL, DEC, MIPS = 84, 85, 86
#: Metres in the units that files name.
UNITS_M = {"": 1e-3, "mm": 1e-3, "cm": 1e-2, "m": 1.0}


@dataclass(frozen=True, eq=False)
class PointData:
    """Points over time.

    Attributes
    ----------
    labels : tuple of str
        Without the subject's name, where a file puts it before each.
    positions : ndarray, shape (n_frames, n_points, 3)
        Metres; NaN where a point was not seen.
    rate : float
        Frames a second.
    first_frame : int
        Number of the first frame, counted from 0; the file counts from 1.
    """

    labels: tuple[str, ...]
    positions: np.ndarray
    rate: float
    first_frame: int = 0

    def of(self, label: str) -> np.ndarray | None:
        """Positions of one point, (n_frames, 3); None where there is none of that name."""
        return self.positions[:, self.labels.index(label)] if label in self.labels else None


def read_c3d(path: str | Path) -> PointData:
    """Read the points of a C3D file.

    A point is missing where the file says so (a negative residual) and where it lies exactly in the origin, as many programs write it.
    Frames are numbered as the group TRIAL says, where a file has one: the header has 16 bits for them.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    PointData

    Raises
    ------
    InputError
        When the file cannot be read, is no C3D file, or has no points.
    """
    path = Path(path)
    content = read_bytes(path)
    try:
        return _parse(content)
    except (struct.error, IndexError, KeyError, ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{path}: not a C3D file, or a damaged one ({error}); copy it again") from error


def _parse(content: bytes) -> PointData:
    if len(content) < BLOCK or content[1] != MAGIC:
        raise ValueError("it does not begin like one")
    section = (content[0] - 1) * BLOCK
    processor = content[section + 3]
    if processor not in (INTEL, DEC, MIPS):
        raise ValueError(f"processor type {processor}")
    order = ">" if processor == MIPS else "<"
    parameters = _parameters(content, section, order, processor)
    n_points, n_analog, *in_header = struct.unpack_from(f"{order}4H", content, 2)
    first, last = _frame_range(parameters) or in_header
    scale = parameters["POINT", "SCALE"][0]
    start = struct.unpack_from(f"{order}H", content, 16)[0]
    labels = [label for name in ("LABELS", "LABELS2", "LABELS3") for label in parameters.get(("POINT", name), [])]
    if not n_points or len(labels) < n_points:
        raise ValueError(f"{n_points} points and {len(labels)} labels")
    words = 4 * n_points + n_analog
    raw = _numbers(content[(start - 1) * BLOCK :], "float" if scale < 0 else "int", order, processor)
    n_frames = min(last - first + 1, len(raw) // words)
    if n_frames < 1:
        raise ValueError("it has no frames")
    points = raw[: n_frames * words].reshape(n_frames, words)[:, : 4 * n_points].reshape(n_frames, n_points, 4).astype(float)
    units = str(parameters.get(("POINT", "UNITS"), [""])[0]).lower()
    if units not in UNITS_M:
        raise ValueError(f"units {units!r}")
    positions = points[..., :3] * (UNITS_M[units] * (scale if scale > 0 else 1.0))
    positions[(points[..., 3] < 0) | ~points[..., :3].any(axis=-1)] = np.nan
    names = tuple(label.rpartition(":")[2] for label in labels[:n_points])
    return PointData(names, positions, float(parameters["POINT", "RATE"][0]), max(first - 1, 0))


def _frame_range(parameters: dict[tuple[str, str], list[Any]]) -> tuple[int, int] | None:
    """First and last frame by the group TRIAL, counted from 1; None where it does not say."""
    found = [parameters.get(("TRIAL", name), []) for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD")]
    if any(len(words) != 2 for words in found):
        return None
    # Words without a sign, the lower first. The manual multiplies the upper by 65535, by which two pairs of words would be one number;
    # programs take 65536.
    first, last = (int(low) % 2**16 + int(high) % 2**16 * 2**16 for low, high in found)
    return (first, last) if last >= first else None


def _parameters(content: bytes, section: int, order: str, processor: int) -> dict[tuple[str, str], list[Any]]:
    """All parameters, by the names of their groups and their own."""
    groups: dict[int, str] = {}
    found: dict[tuple[int, str], list[Any]] = {}
    place = section + 4
    end = section + content[section + 2] * BLOCK
    while place < end:
        length, number = struct.unpack_from("2b", content, place)
        length = abs(length)
        if length == 0 or number == 0:
            break
        name = content[place + 2 : place + 2 + length].decode("ascii").strip().upper()
        place += 2 + length
        step = struct.unpack_from(f"{order}h", content, place)[0]
        if number < 0:
            groups[-number] = name
        else:
            found[number, name] = _values(content, place + 2, order, processor)
        if step <= 0:
            break
        place += step
    return {(groups.get(number, ""), name): values for (number, name), values in found.items()}


def _values(content: bytes, place: int, order: str, processor: int) -> list[Any]:
    """The values of one parameter; texts stripped."""
    kind, n_dimensions = struct.unpack_from("bB", content, place)
    shape = content[place + 2 : place + 2 + n_dimensions]
    place += 2 + n_dimensions
    count = int(np.prod(np.frombuffer(shape, np.uint8), dtype=int))
    data = content[place : place + abs(kind) * count]
    if kind == -1:
        width = shape[0] if shape else 1
        text = data.decode("latin-1")
        return [text[k : k + width].strip() for k in range(0, len(text), width)] if width else []
    if kind == 1:
        return list(data)
    return _numbers(data, "int" if kind == 2 else "float", order, processor).tolist()


def _numbers(data: bytes, kind: str, order: str, processor: int) -> np.ndarray:
    """Numbers of 16 or 32 bits, as the processor writes them."""
    if kind == "int":
        return np.frombuffer(data[: len(data) // 2 * 2], f"{order}i2")
    data = data[: len(data) // 4 * 4]
    if processor != DEC:
        return np.frombuffer(data, f"{order}f4")
    # A VAX stores the two halves of a number the other way round, and its exponent is larger by two.
    halves = np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1]
    return np.ascontiguousarray(halves).view("<f4").ravel() / 4
