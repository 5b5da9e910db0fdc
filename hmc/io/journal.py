"""An append-only journal, by which a long run that was stopped goes on where it was.

One JSON object a line. A line that was being written when the run died is dropped on reading, so what is read back is always whole.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError

__all__ = ["append_journal", "open_journal", "read_journal"]


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
    line = json.dumps(record, default=_plain, separators=(",", ":")) + "\n"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "a", encoding="utf-8") as file:
            file.write(line)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another folder, or make room") from error


def open_journal(path: str | Path | None, key: str) -> list[dict[str, Any]]:
    """What was done of a run: the records after the first, which holds the key that says what the run depends on.

    Parameters
    ----------
    path : path or None
        A journal that is not there, or of another key, is begun anew. None: nothing is done, and nothing kept.
    key : str

    Raises
    ------
    InputError
        When the journal is damaged.
    """
    if path is None:
        return []
    records = read_journal(path)
    if records and records[0].get("key") == key:
        return records[1:]
    if Path(path).exists():
        Path(path).unlink()
    append_journal(path, {"key": key})
    return []


def read_journal(path: str | Path) -> list[dict[str, Any]]:
    """All whole records, in order; none where there is no file. An unfinished last line is cut off the file, so that appending can go on.

    Raises
    ------
    InputError
        When an earlier line is damaged.
    """
    path = Path(path)
    if not path.exists():
        return []
    data = path.read_bytes()
    whole = data[: data.rfind(b"\n") + 1]
    if len(whole) < len(data):
        with open(path, "r+b") as file:
            file.truncate(len(whole))
    records = []
    for number, line in enumerate(whole.splitlines(), start=1):
        try:
            records.append(json.loads(line))
        except ValueError as error:
            raise InputError(f"{path}, line {number}: damaged; delete the file to start the run anew ({error})") from error
    return records


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot go into a journal")
