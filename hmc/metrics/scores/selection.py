"""Frames of a result and of a truth that count."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, Self, TypeVar

import numpy as np

from hmc.errors import InputError

__all__ = ["chosen_frames", "chosen_truth"]


class _Table(Protocol):
    """Rows with frames, of which some can be chosen."""

    @property
    def frames(self) -> np.ndarray: ...

    def where(self, chosen: np.ndarray) -> Self: ...


AnyTable = TypeVar("AnyTable", bound=_Table)


def chosen_frames(table: AnyTable, start: int, n_frames: int | None) -> AnyTable:
    """A table's rows of so many frames from the first on, of all that follow where that is None."""
    end = np.inf if n_frames is None else start + n_frames
    return table.where((table.frames >= start) & (table.frames < end))


def chosen_truth(table: AnyTable, path: Path, start: int, n_frames: int | None) -> AnyTable:
    """The same of a truth.

    Parameters
    ----------
    table : PoseTable, TrackTable or ImageTable
    path : Path
        Of its file.
    start : int
    n_frames : int or None

    Raises
    ------
    InputError
        When the truth has frames, but none of these.
    """
    chosen = chosen_frames(table, start, n_frames)
    if len(table.frames) and not len(chosen.frames):
        wanted = f"{start} on" if n_frames is None else f"{start} to {start + n_frames - 1}"
        raise InputError(
            f"{path}: has frames {table.frames.min()} to {table.frames.max()}, and compared are frames {wanted}: none in common; "
            "let it count frames as the recording does, from 0, or choose others by --start and --frames"
        )
    return chosen
