"""When each camera's frames were taken, written into a recording: only that changes, and what was there is kept."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hmc.io.door import read_text_file
from hmc.io.files import atomic_write
from hmc.io.new_world import keep_before
from hmc.io.timing import times_file, write_times

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
    """
    lines = []
    path.mkdir(parents=True, exist_ok=True)  # a trial whose videos lie elsewhere has no folder of its own yet
    file = path / "recording.toml"
    text = read_text_file(file) if file.is_file() else ""
    new = with_first_frames(text, first_frames, zeros)
    if new != text:
        kept = f"; kept what was there: {keep_before(file)}" if file.is_file() else ""
        with atomic_write(file) as target:
            target.write(new)
        lines.append(f"written: `first_frame` of {file}{kept}")
    for name, seconds in times.items():
        own = times_file(path, name)
        kept = f"; kept what was there: {keep_before(own)}" if own.is_file() else ""
        write_times(own, seconds)
        lines.append(f"written: {own}{kept}")
    return lines


def with_first_frames(text: str, first_frames: Mapping[str, int], zeros: bool = False) -> str:
    """``recording.toml`` with another ``first_frame``, or, unless `zeros` are asked for, without where all are 0; all else as it was."""
    kept: list[str] = []
    place = None
    depth, inside, table = 0, False, False
    for line in text.splitlines(keepends=True):
        bare = line.split("#")[0]
        header = re.match(r"\s*\[\s*([^\]]*?)\s*\]", bare) if not depth else None
        if header:
            inside = header[1].strip("\"'") == "first_frame"
            if not table and not inside and place is None:
                place = len(kept)  # a key must stand before the first table
            table = True
        own = depth > 0 or inside or (not table and re.match(r"\s*[\"']?first_frame[\"']?\s*[=.]", bare))
        if own:
            depth = max(0, depth + bare.count("{") - bare.count("}")) if not inside else 0
            if not table and place is None:
                place = len(kept)
        else:
            kept.append(line)
    named = ", ".join(f"{_key(name)} = {first}" for name, first in first_frames.items())
    if zeros or any(first_frames.values()):
        place = len(kept) if place is None or (table and place > len(kept)) else place
        if place and not kept[place - 1].endswith("\n"):
            kept[place - 1] += "\n"
        kept.insert(place, f"first_frame = {{ {named} }}\n")
    return "".join(kept)


def _key(name: str) -> str:
    """A key as TOML has it: bare where that is allowed."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
