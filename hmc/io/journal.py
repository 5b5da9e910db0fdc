"""An append-only journal, by which a long run that was stopped goes on where it was.

One JSON object a line, and behind it a checksum of this line and all before it. The first line that does not agree with its checksum
ends the journal, be it cut off, altered or out of its place: what was before is whole, the rest is cut off the file.
"""

from __future__ import annotations

import json
import logging
import os
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.io.door import check_file

__all__ = ["append_journal", "open_journal", "read_journal"]

#: What ends a line: a tab, eight hexadecimal digits, and the line's end.
TAIL_BYTES = 10

_logger = logging.getLogger("hmc")


def append_journal(path: str | Path, record: Mapping[str, Any]) -> None:
    """Add one record; numbers keep their full precision.

    Parameters
    ----------
    path : path
        Made, with its folder, where it does not exist.
    record : mapping
        Plain values and arrays; an array comes back as nested lists.

    Raises
    ------
    InputError
        When the file system does not let it be written.
    """
    path = Path(path)
    line = json.dumps(record, default=_plain, separators=(",", ":")).encode()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "ab") as file:
            file.write(line + _tail(line, _last_sum(path)))
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another folder, or make room") from error


def open_journal(path: str | Path | None, key: str, on_problem: Callable[[str], None] = _logger.warning) -> list[dict[str, Any]]:
    """What was done of a run: the records after the first, which holds the key that says what the run depends on.

    Parameters
    ----------
    path : path or None
        A journal that is not there, or of another key, is begun anew. None: nothing is done, and nothing kept.
    key : str
    on_problem : callable
        Called with one line when a part of the journal is damaged; what was before is taken.

    Raises
    ------
    InputError
        When the file system does not let it be read or written.
    """
    if path is None:
        return []
    records = read_journal(path, on_problem)
    if records and records[0].get("key") == key:
        return records[1:]
    if os.path.lexists(path):
        Path(path).unlink()
    append_journal(path, {"key": key})
    return []


def read_journal(path: str | Path, on_problem: Callable[[str], None] = _logger.warning) -> list[dict[str, Any]]:
    """All whole records, in order; none where there is no file. What follows them is cut off the file, so that appending can go on.

    An unfinished last line, as a killed run leaves it, is no problem; anything else is told to `on_problem`.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    path = Path(path)
    if not os.path.lexists(path):
        return []
    check_file(path)
    records, end, total = [], 0, 0
    try:
        with open(path, "r+b") as file:
            for number, line in enumerate(file, start=1):
                if not line.endswith(b"\n"):
                    break
                try:
                    record = json.loads(line[:-TAIL_BYTES]) if line[-TAIL_BYTES:] == _tail(line[:-TAIL_BYTES], total) else None
                except (ValueError, RecursionError):
                    record = None
                if not isinstance(record, dict):
                    on_problem(f"{path}: damaged in line {number}; the run goes on from what was before")
                    break
                records.append(record)
                total = int(line[-TAIL_BYTES + 1 :], 16)
                end += len(line)
            file.truncate(end)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    return records


def _tail(line: bytes, before: int) -> bytes:
    """What goes behind a line: the checksum of the journal up to it."""
    return b"\t%08x\n" % zlib.crc32(line, before)


def _last_sum(path: Path) -> int:
    """The checksum in a journal's last line; 0 where there is none."""
    try:
        with open(path, "rb") as file:
            file.seek(-TAIL_BYTES, os.SEEK_END)
            return int(file.read(TAIL_BYTES)[1:], 16)
    except (OSError, ValueError):
        return 0


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot go into a journal")
