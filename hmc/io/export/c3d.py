"""Points as C3D, through ezc3d: millimetres, z up, a residual of -1 where a point is missing.

Source: the C3D file format specification (c3d.org), sections on POINT and its optional X_SCREEN and Y_SCREEN.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.files import sibling

__all__ = ["write_c3d"]


def write_c3d(path: str | Path, labels: Sequence[str], first_frame: int, positions: np.ndarray, fps: float) -> None:
    """Write points over time.

    Parameters
    ----------
    path : path
    labels : sequence of str
        Of the k points.
    first_frame : int
        Of the recording, counted from 0; the file counts from 1.
    positions : ndarray, shape (n, k, 3)
        Metres, z up; NaN where missing.
    fps : float

    Raises
    ------
    InputError
        When ezc3d is not installed, or the file cannot be written.
    """
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
    file["header"]["points"]["first_frame"] = first_frame
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = np.where(missing.T[None], -1.0, 0.0)
    file["data"]["meta_points"]["camera_masks"] = np.zeros((7, *missing.T.shape), bool)
    with sibling(path) as temporary:
        file.write(str(temporary))
