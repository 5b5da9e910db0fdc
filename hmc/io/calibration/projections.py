"""Bare projection matrices in a text: 3 x 4 numbers a camera, or K, R and t as Middlebury's ``*_par.txt`` has them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scipy.linalg import rq

from hmc.errors import InputError
from hmc.io.calibration.entry import CalibrationEntry
from hmc.io.calibration.text import as_numbers, read_text

__all__ = ["decompose", "read_projections"]

N_PROJECTION = 12
N_MIDDLEBURY = 21
#: What Middlebury's first column ends in.
IMAGE = re.compile(r"\.(png|jpe?g|ppm|pgm|bmp|tiff?)$", re.IGNORECASE)


def read_projections(path: Path) -> list[CalibrationEntry]:
    """Read projection matrices P of a world to pixels. There are no lens distortion and no image size in them.

    A line a camera: its name, then P row by row (12 numbers), or K (9), R (9) and t (3) as at Middlebury, where the name is
    the image's; commas or spaces between. A first line with words (``view,p00,...``), or with the number of cameras, is passed
    over. Three lines of four numbers are one camera, with the file's name.

    A left-handed world is told by what all cameras look at: it would be behind them. Its x axis is then turned round.

    Raises
    ------
    InputError
        When a line is not of this form, or a matrix is no camera's.
    """
    lines = [line.replace(",", " ").replace(";", " ").split() for line in read_text(path).splitlines()]
    lines = [words for words in lines if words and not words[0].startswith("#")]
    if lines and (len(lines[0]) == 1 or as_numbers(lines[0][1:]) is None):
        lines = lines[1:]
    whole = as_numbers(lines)
    if whole is not None and whole.shape == (3, 4):
        return [_entry(path, path.stem, whole.ravel())]
    entries = [_entry(path, IMAGE.sub("", words[0]), as_numbers(words[1:])) for words in lines]
    return [_mirrored(entry) for entry in entries] if _look_away(entries) else entries


def _look_away(entries: list[CalibrationEntry]) -> bool:
    """Whether the point that all cameras point at lies behind them: proper cameras of a left-handed world."""
    with np.errstate(all="ignore"):
        axes = np.array([entry.rotation[2] for entry in entries]).reshape(-1, 3)
        centres = np.array([-entry.rotation.T @ entry.translation for entry in entries]).reshape(-1, 3)
        across = np.eye(3) - axes[:, :, None] * axes[:, None]  # what leads away from each axis
        system, target = across.sum(axis=0), np.einsum("nij,nj->i", across, centres)
    if len(entries) < 2 or not np.all(np.isfinite(system)) or not np.all(np.isfinite(target)):
        return False
    point = np.linalg.lstsq(system, target, rcond=None)[0]
    return bool((np.einsum("ni,ni->n", point - centres, axes) < 0).all())


def _mirrored(entry: CalibrationEntry) -> CalibrationEntry:
    """The camera in a world whose x runs the other way: in front of it is what was behind it, with the same pixels."""
    rotation = -entry.rotation * [-1.0, 1.0, 1.0]
    return entry._replace(rotation=rotation, translation=-entry.translation)


def _entry(path: Path, name: str, numbers: np.ndarray | None) -> CalibrationEntry:
    if numbers is None or numbers.size not in (N_PROJECTION, N_MIDDLEBURY) or not np.all(np.isfinite(numbers)):
        raise InputError(
            f"{path}: '{name[:40]}' needs {N_PROJECTION} numbers (a 3 x 4 projection matrix, row by row) or {N_MIDDLEBURY} (K, R, t) "
            f"behind its name; got {0 if numbers is None else numbers.size}"
        )
    if numbers.size == N_MIDDLEBURY:
        return CalibrationEntry(name, None, numbers[:9].reshape(3, 3), np.zeros(5), numbers[9:18].reshape(3, 3), numbers[18:])
    parts = decompose(numbers.reshape(3, 4))
    if parts is None:
        raise InputError(f"{path}: the projection matrix of '{name[:40]}' is no camera's (its first three columns have no inverse)")
    return CalibrationEntry(name, None, parts[0], np.zeros(5), parts[1], parts[2])


def decompose(projection: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """K, R and t of P = K [R | t], up to P's scale and sign.

    Parameters
    ----------
    projection : ndarray, shape (3, 4)

    Returns
    -------
    (matrix, rotation, translation), shapes (3, 3), (3, 3), (3,), or None
        None where there are none.
    """
    with np.errstate(all="ignore"):
        projection = projection / np.linalg.norm(projection[2, :3])  # the length of R's last row is one
        if not np.all(np.isfinite(projection)) or np.linalg.cond(projection[:, :3]) > 1e12:
            return None
        projection = projection * np.sign(np.linalg.det(projection[:, :3]))
    upper, rotation = rq(projection[:, :3])
    signs = np.sign(np.diag(upper))
    upper, rotation = upper * signs, signs[:, None] * rotation
    translation = np.linalg.solve(upper, projection[:, 3])
    return upper / upper[2, 2], rotation, translation
