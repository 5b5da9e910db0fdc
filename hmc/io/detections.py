"""2-D detections of markers, frame by frame and camera by camera, and their table on disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.files import atomic_write
from hmc.io.tables import integer_column, read_columns

__all__ = ["DetectionTable", "read_detections", "write_detections"]

COLUMNS = ("frame", "camera", "u", "v")


@dataclass(frozen=True)
class DetectionTable:
    """Positions in images where a marker was seen, true or not; which marker it is, is not known.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Absolute frame numbers of the recording.
    cameras : ndarray of str, shape (n,)
        Names of the cameras.
    uv : ndarray, shape (n, 2)
        Pixels as the images have them (with the lens's distortion), the centre of the top-left pixel at (0, 0).
    """

    frames: np.ndarray
    cameras: np.ndarray
    uv: np.ndarray

    def in_frame(self, frame: int, cameras: Sequence[str]) -> tuple[np.ndarray, ...]:
        """Detections of one frame, an array (n, 2) a camera."""
        rows = np.flatnonzero(self.frames == frame)
        return tuple(self.uv[rows[self.cameras[rows] == name]] for name in cameras)


def read_detections(path: str | Path, cameras: Sequence[str]) -> DetectionTable:
    """Read a table `frame, camera, u, v`; further columns are ignored.

    Parameters
    ----------
    path : path
    cameras : sequence of str
        Names of all cameras of the calibration; a row of another is refused.

    Returns
    -------
    DetectionTable
        Sorted by frame.

    Raises
    ------
    InputError
        When the file is missing, a column is missing, a value is no number, or a camera is unknown.
    """
    path = Path(path)
    columns, lines = read_columns(path, COLUMNS)
    frames = integer_column(path, "frame", columns["frame"], lines)
    names = np.array([name.strip() for name in columns["camera"]], dtype=str)
    unknown = np.flatnonzero(~np.isin(names, list(cameras)))
    if len(unknown):
        row = unknown[0]
        raise InputError(f"{path}, line {lines[row]}: no camera named {str(names[row])!r} in the calibration; it has {', '.join(cameras)}")
    uv = np.array([[_pixels(u), _pixels(v)] for u, v in zip(columns["u"], columns["v"], strict=True)]).reshape(-1, 2)
    bad = ~np.isfinite(uv).all(axis=1)
    if bad.any():
        raise InputError(f"{path}, line {lines[np.argmax(bad)]}: `u` and `v` must be numbers of pixels; leave out what was not detected")
    order = np.argsort(frames, kind="stable")
    return DetectionTable(frames[order], names[order], uv[order])


def _pixels(cell: str) -> float:
    """A cell's number; NaN where it is none."""
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def write_detections(path: str | Path, table: DetectionTable) -> None:
    """Write a table `frame, camera, u, v`, to a thousandth of a pixel."""
    with atomic_write(path) as file:
        file.write(",".join(COLUMNS) + "\n")
        file.writelines(
            f"{frame},{camera},{u:.3f},{v:.3f}\n" for frame, camera, (u, v) in zip(table.frames, table.cameras, table.uv, strict=True)
        )
