"""Points as C3D, through ezc3d: millimetres, z up, a residual of -1 where a point is missing.

Source: the C3D file format specification (c3d.org), sections on POINT and its optional X_SCREEN and Y_SCREEN, and on the group TRIAL.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.files import sibling

__all__ = ["MOST_FRAMES", "write_c3d"]

#: The header's first and last frame and POINT:FRAMES are words of 16 bits.
MOST_FRAMES = 65_535
#: What a parameter of 16-bit integers is in the file.
_INTEGERS = 2


def write_c3d(path: str | Path, labels: Sequence[str], first_frame: int, positions: np.ndarray, fps: float) -> None:
    """Write points over time.

    Parameters
    ----------
    path : path
    labels : sequence of str
        Of the k points.
    first_frame : int
        Of the recording, counted from 0; the file counts from 1. Where the last frame's number is more than `MOST_FRAMES`, the header
        begins at 1, and TRIAL:ACTUAL_START_FIELD alone has the first frame's number.
    positions : ndarray, shape (n, k, 3)
        Metres, z up; NaN where missing.
    fps : float

    Raises
    ------
    InputError
        When there are more than `MOST_FRAMES` frames, ezc3d is not installed, or the file cannot be written.
    """
    if len(positions) > MOST_FRAMES:
        raise InputError(
            f"{path}: {len(positions)} frames, and a C3D file holds {MOST_FRAMES}; write TRC, or split: make results of fewer frames "
            "(--start and --frames of hmc pose) and export each"
        )
    try:
        import ezc3d
    except ImportError:
        raise InputError("C3D needs ezc3d, which is in the extra `biomech`; install it with that, or write TRC") from None
    file = ezc3d.c3d()
    missing = ~np.isfinite(positions).all(axis=-1)
    points = np.ones((4, positions.shape[1], len(positions)))
    points[:3] = np.moveaxis(np.where(missing[..., None], 0.0, 1000 * positions), -1, 0).swapaxes(1, 2)
    parameters = file["parameters"]["POINT"]
    parameters["UNITS"]["value"], parameters["RATE"]["value"], parameters["LABELS"]["value"] = ["mm"], [fps], list(labels)
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    first, last = first_frame + 1, first_frame + len(positions)
    for name, number in (("ACTUAL_START_FIELD", first), ("ACTUAL_END_FIELD", last)):
        # ezc3d makes floating-point numbers of a list; the manual has two words of 16 bits, the lower first.
        file.add_parameter("TRIAL", name, [0, 0])
        file["parameters"]["TRIAL"][name] |= {"type": _INTEGERS, "value": np.array([number % 2**16, number // 2**16])}
    file["header"]["points"]["first_frame"] = first_frame if last <= MOST_FRAMES else 0
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = np.where(missing.T[None], -1.0, 0.0)
    file["data"]["meta_points"]["camera_masks"] = np.zeros((7, *missing.T.shape), bool)
    with sibling(path) as temporary:
        file.write(str(temporary))
