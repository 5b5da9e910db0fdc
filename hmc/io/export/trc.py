"""Marker trajectories as TRC (Motion Analysis), which OpenSim reads: millimetres, y up, an empty cell where a marker is missing.

Source: OpenSim documentation, "Marker (.trc) Files".
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.io.export.axes import FACING_X
from hmc.io.files import atomic_write

__all__ = ["write_trc"]


def write_trc(path: str | Path, names: Sequence[str], frames: np.ndarray, positions: np.ndarray, fps: float) -> None:
    """Write the points of one person.

    Parameters
    ----------
    path : path
    names : sequence of str
        Of the k points.
    frames : ndarray of int, shape (n,)
        Consecutive, counted from 0; the file counts from 1, and its times are ``frame / fps``.
    positions : ndarray, shape (n, k, 3)
        Metres, z up; NaN where missing.
    fps : float

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    # Rows end with a tab: without one, OpenSim counts an empty last cell as none and refuses the file.
    path = Path(path)
    n, k = positions.shape[:2]
    points = 1000 * (positions @ FACING_X.T)
    first = int(frames[0]) + 1 if n else 1
    with atomic_write(path) as file:
        file.write(f"PathFileType\t4\t(X/Y/Z)\t{path.name}\n")
        file.write("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n")
        file.write(f"{fps:g}\t{fps:g}\t{n}\t{k}\tmm\t{fps:g}\t{first}\t{n}\n")
        file.write("Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t\n")
        file.write("\t\t" + "\t".join(f"{axis}{number}" for number in range(1, k + 1) for axis in "XYZ") + "\n\n")
        for frame, row in zip(frames, points.reshape(n, -1), strict=True):
            cells = "\t".join("" if value != value else f"{value:.4f}" for value in row)
            file.write(f"{frame + 1}\t{frame / fps:.6f}\t{cells}\t\n")
