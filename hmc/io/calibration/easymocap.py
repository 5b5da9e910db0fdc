"""EasyMocap's pair of files, ``intri.yml`` and ``extri.yml``."""

from __future__ import annotations

from pathlib import Path

from hmc.errors import InputError
from hmc.io.calibration.entry import CalibrationEntry
from hmc.io.calibration.opencv import find_array, find_size, trim_distortions
from hmc.io.calibration.storage import read_storage
from hmc.io.calibration.text import listed

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
    inner, outer = read_storage(intri), read_storage(extri)
    words = inner.get("names")
    # Words that look like numbers come back as numbers where they are written without quotes.
    names = (
        [word if isinstance(word, str) else f"{word:g}" for word in words if isinstance(word, str | float)]
        if isinstance(words, list)
        else []
    )
    entries, missing = [], {intri: list[str](), extri: list[str]()}
    for name in names:
        matrix = find_array(inner, [f"K_{name}"], [(3, 3)])
        rotation = find_array(outer, [f"Rot_{name}", f"R_{name}"], [(3, 3), (3,)])
        translation = find_array(outer, [f"T_{name}"], [(3,)])
        missing[intri] += [f"K_{name}"] * (matrix is None)
        missing[extri] += [f"R_{name}"] * (rotation is None) + [f"T_{name}"] * (translation is None)
        if matrix is None or rotation is None or translation is None:
            continue
        distortions = trim_distortions(find_array(inner, [f"dist_{name}", f"D_{name}"]))
        size = find_size({**inner, "size": None}, [f"W_{name}"], [f"H_{name}"])
        entries.append(CalibrationEntry(name, size, matrix, distortions, rotation, translation))
    if missing[intri] or missing[extri]:
        gaps = "; ".join(f"{path}: has no {listed(keys, 9)}" for path, keys in missing.items() if keys)
        raise InputError(f"{gaps}; every camera in `names` of {intri.name} needs K_ (3 x 3) there, R_ and T_ in {extri.name}")
    return entries
