"""What a method tells of each frame beside the pose, as ``fits.csv``."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from hmc.io.files import atomic_write

__all__ = ["write_fits"]


def write_fits(
    path: str | Path, frames: Sequence[int], persons: Sequence[int], status: Sequence[str], details: Sequence[Mapping[str, object]]
) -> None:
    """Write a row for each frame and person: frame, person, status, and what the method tells, in the order in which it first tells it.

    Parameters
    ----------
    path : path
    frames, persons : sequence of int
    status : sequence of str
        Such as "fitted" (`hmc.pose.method.StepInfo`).
    details : sequence of mapping
        Numbers, truths (written 0 or 1) or text; what a frame does not tell, or is no number, stays empty.
    """
    names = list(dict.fromkeys(name for told in details for name in told))
    with atomic_write(path) as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["frame", "person", "status", *names])
        for frame, person, state, told in zip(frames, persons, status, details, strict=True):
            out.writerow([frame, person, state, *(_text(told.get(name)) for name in names)])


def _text(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return str(int(value))
    return f"{value:.4f}" if isinstance(value, float) else str(value)
