"""EasyMocap's pair of files, ``intri.yml`` and ``extri.yml``."""

from __future__ import annotations

from pathlib import Path

from hmc.errors import InputError
from hmc.io.calibration.entry import CalibrationEntry
from hmc.io.calibration.opencv import Storage, trim_distortions

__all__ = ["read_easymocap"]


def read_easymocap(intri: Path, extri: Path) -> list[CalibrationEntry]:
    """Read EasyMocap's pair: ``names``; ``K_<name>``, ``dist_<name>`` (``H_``, ``W_`` where it has them); ``R_`` (a rotation vector),
    ``Rot_`` (the matrix) and ``T_`` in metres, world to camera.

    Parameters
    ----------
    intri, extri : Path

    Raises
    ------
    InputError
        When a file is not of this form or a camera is in one only.
    """
    entries = []
    with Storage(intri) as inner, Storage(extri) as outer:
        for name in inner.texts("names"):
            matrix = inner.matrix([f"K_{name}"], [(3, 3)])
            if matrix is None:
                raise InputError(f"{intri}: camera '{name}' has no K_{name} (3 x 3)")
            rotation = outer.matrix([f"Rot_{name}", f"R_{name}"], [(3, 3), (3,)])
            translation = outer.matrix([f"T_{name}"], [(3,)])
            if rotation is None or translation is None:
                raise InputError(f"{extri}: camera '{name}' of {intri.name} has no {'R' if rotation is None else 'T'}_{name} here")
            distortions = trim_distortions(inner.matrix([f"dist_{name}", f"D_{name}"]))
            size = inner.size([f"W_{name}"], [f"H_{name}"])
            entries.append(CalibrationEntry(name, size, matrix, distortions, rotation, translation))
    return entries
