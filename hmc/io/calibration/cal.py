"""Bare numbers in a ``.cal`` file: HumanEva's (22) and PARSEC bodytrack's (25), one file a camera, millimetres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.entry import MM, CalibrationEntry
from hmc.io.calibration.text import as_numbers, read_text

__all__ = ["read_cal"]

N_HUMANEVA = 22
N_BODYTRACK = 25


def read_cal(path: Path) -> CalibrationEntry:
    """Read focal lengths (2), centre (2), skew (the angle's, as the MATLAB calibration toolbox has it: times fx), distortions k1, k2, p1,
    p2, k3, rotation (9, row by row), translation (3, mm), world to camera. Bodytrack repeats the rotation as a vector (3).

    The camera bears the file's name. The format has no image size.

    Raises
    ------
    InputError
        When there are not 22 or 25 numbers.
    """
    words = read_text(path).replace(",", " ").split()
    values = as_numbers(words)
    if values is None or len(values) not in (N_HUMANEVA, N_BODYTRACK) or not np.all(np.isfinite(values)):
        raise InputError(
            f"{path}: a .cal file holds {N_HUMANEVA} numbers (HumanEva) or {N_BODYTRACK} (bodytrack), all finite; found {len(words)} "
            "words; one of OptiTrack's Motive: export it as .mcal (Motive 3.2 or later)"
        )
    fx, fy, cx, cy, skew = values[:5]
    matrix = np.array([[fx, skew * fx, cx], [0, fy, cy], [0, 0, 1]])
    return CalibrationEntry(path.stem, None, matrix, values[5:10], values[10:19].reshape(3, 3), values[19:22] * MM, True)
