"""When each camera's frames were taken, written into a recording: only that changes, and what was there is kept."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.door import read_text_file, read_toml_file
from hmc.io.keeping import write_keeping
from hmc.io.timing import times_file, times_text
from hmc.io.toml_lines import says, statements

__all__ = ["with_first_frames", "write_new_timing"]


def write_new_timing(path: Path, first_frames: Mapping[str, int], times: Mapping[str, np.ndarray], zeros: bool = False) -> list[str]:
    """Write ``first_frame`` of ``recording.toml`` and, of cameras for which that is not enough, ``times/CAMERA.csv``.

    Parameters
    ----------
    path : Path
        Folder of the recording.
    first_frames : mapping of str to int
        Of the cameras that count frames; those with 0 need not be named.
    times : mapping of str to ndarray, shape (n,)
        Seconds, of the others' frames.
    zeros : bool
        Write a ``first_frame`` where all are 0 too: without one of its own a trial has its session's.

    Returns
    -------
    list of str
        What was written and kept.

    Raises
    ------
    InputError
        When ``recording.toml`` is no TOML, or is written so that more than ``first_frame`` would change, or a file cannot be written;
        all is as it was then.
    """
    file = path / "recording.toml"
    text = read_text_file(file) if file.is_file() else ""
    new = with_first_frames(text, first_frames, zeros)
    texts, said = {}, {}
    if new != text:
        _refuse_other_changes(file, new, first_frames)
        texts[file], said[file] = new, f"`first_frame` of {file}"
    for name, seconds in times.items():
        own = times_file(path, name)
        texts[own], said[own] = times_text(seconds), str(own)
    before = write_keeping(texts)
    return [f"written: {said[one]}" + (f"; kept what was there: {kept}" if kept else "") for one, kept in before.items()]


def with_first_frames(text: str, first_frames: Mapping[str, int], zeros: bool = False) -> str:
    """``recording.toml`` with another ``first_frame``, or, unless `zeros` are asked for, without where all are 0; all else as it was."""
    kept: list[str] = []
    place = None
    for one in statements(text):
        comment = one.key is None and not one.header
        old = not comment and "first_frame" in (one.table, one.key if one.table is None else None)
        if place is None and (one.header or (old and one.table is None)):
            place = len(kept)  # where it stood; a key must stand before the first table
        if not old:
            kept.append(one.text)
    if zeros or any(first_frames.values()):
        place = len(kept) if place is None else place
        if place and not kept[place - 1].endswith("\n"):
            kept[place - 1] += "\n"
        kept.insert(place, _first_frame_line(first_frames))
    return "".join(kept)


def _first_frame_line(first_frames: Mapping[str, int]) -> str:
    named = ", ".join(f"{_key(name)} = {first}" for name, first in first_frames.items())
    return f"first_frame = {{ {named} }}\n"


def _refuse_other_changes(file: Path, new: str, first_frames: Mapping[str, int]) -> None:
    """Refuse a new text that says more or less than the file does, but for ``first_frame``."""
    wanted = read_toml_file(file) if file.is_file() else {}
    wanted.pop("first_frame", None)
    if not says(new, wanted | {"first_frame": dict(first_frames)}) and (any(first_frames.values()) or not says(new, wanted)):
        raise InputError(
            f"{file}: `first_frame` cannot be changed in it without changing more, so nothing is written; put this line before its "
            f"first table, in the place of any `first_frame` that it has: {_first_frame_line(first_frames).strip()}"
        )


def _key(name: str) -> str:
    """A key as TOML has it: bare where that is allowed."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
