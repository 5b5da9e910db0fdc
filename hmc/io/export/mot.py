"""Coordinates over time as OpenSim's motion file (.mot): degrees, metres, seconds. The format has no gaps.

Source: OpenSim documentation, "Motion (.mot) Files".
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.io.files import atomic_write

__all__ = ["write_mot"]


def write_mot(path: str | Path, dof_names: Sequence[str], times_s: np.ndarray, states: np.ndarray) -> None:
    """Write the coordinates of one person, for the model that `hmc.io.export.osim.write_osim` writes.

    Parameters
    ----------
    path : path
    dof_names : sequence of str
        Three translations of the root, then angles.
    times_s : ndarray, shape (n,)
    states : ndarray, shape (n, n_dof)
        Metres and radians, without gaps.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    path = Path(path)
    values = np.column_stack([times_s, states[:, :3], np.degrees(states[:, 3:])])
    with atomic_write(path) as file:
        file.write(f"{path.stem}\nversion=1\nnRows={len(values)}\nnColumns={values.shape[1]}\ninDegrees=yes\n")
        file.write("# angles in degrees, translations in metres, time in seconds; the model is the .osim beside this file\nendheader\n")
        file.write("\t".join(["time", *dof_names]) + "\n")
        file.writelines("\t".join(f"{value:.8f}" for value in row) + "\n" for row in values)
