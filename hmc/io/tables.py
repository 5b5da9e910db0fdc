"""Reading tables of comma-separated text, with one clear line where a file is not as it should be."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.door import MAX_FRAME_NUMBER, open_text

__all__ = ["frame_column", "integer_column", "read_columns"]


def read_columns(path: Path, needed: Sequence[str]) -> tuple[dict[str, tuple[str, ...]], np.ndarray]:
    """Columns of a CSV file by name, as text, and the line in the file of every row.

    Parameters
    ----------
    path : Path
    needed : sequence of str
        Columns that must be there; others may be.

    Returns
    -------
    columns : dict of str to tuple of str
    lines : ndarray of int, shape (n,)

    Raises
    ------
    InputError
        When the file cannot be read, is no such table or lacks a column; with the line.
    """
    try:
        with open_text(path) as file:
            reader = csv.reader(file)
            header = [name.strip() for name in next(reader, [])]
            missing = [name for name in needed if name not in header]
            if missing:
                raise InputError(f"{path}: the header line has no column {missing[0]!r}; it must be {','.join(needed)}")
            rows, lines = [], []
            for row in reader:
                if not row:
                    continue
                if len(row) != len(header):
                    raise InputError(f"{path}, line {reader.line_num}: {len(row)} values where the header names {len(header)} columns")
                rows.append(row)
                lines.append(reader.line_num)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a table of comma-separated text ({error})") from error
    cells = list(zip(*rows, strict=True)) if rows else [()] * len(header)
    return dict(zip(header, cells, strict=True)), np.array(lines, int)


def integer_column(path: Path, name: str, cells: Sequence[str], lines: np.ndarray) -> np.ndarray:
    """A column of whole numbers, shape (n,).

    Parameters
    ----------
    path : Path
        For the message.
    name : str
    cells : sequence of str
    lines : ndarray of int, shape (n,)

    Raises
    ------
    InputError
        When a cell is no whole number; with its line.
    """
    try:
        return np.array([int(cell) for cell in cells], np.int64)
    except (ValueError, OverflowError):
        row = next(row for row, cell in enumerate(cells) if not cell.strip().lstrip("+-").isdigit() or len(cell) > 18)
        raise InputError(f"{path}, line {lines[row]}: `{name}` must be a whole number; got {cells[row]!r}") from None


def frame_column(path: Path, cells: Sequence[str], lines: np.ndarray) -> np.ndarray:
    """The column of frame numbers, shape (n,). Arguments as `integer_column`.

    Raises
    ------
    InputError
        When a cell is no whole number from 0 to `MAX_FRAME_NUMBER`; with its line.
    """
    frames = integer_column(path, "frame", cells, lines)
    wrong = (frames < 0) | (frames > MAX_FRAME_NUMBER)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(f"{path}, line {lines[row]}: `frame` must be from 0 to {MAX_FRAME_NUMBER}; got {cells[row]!r}")
    return frames
