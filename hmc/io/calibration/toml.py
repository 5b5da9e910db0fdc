"""The Anipose / Pose2Sim calibration file, which FreeMoCap and Caliscope have too: TOML, one table a camera, world to camera."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.camera.model import Camera
from hmc.errors import InputError
from hmc.io.calibration.caliscope import caliscope_tables
from hmc.io.calibration.entry import CalibrationEntry, natural_key
from hmc.io.calibration.text import as_numbers, listed
from hmc.io.door import read_toml_file
from hmc.io.files import atomic_write

__all__ = ["calibration_text", "read_toml", "write_calibration"]

KEYS = ("size", "matrix", "distortions", "rotation", "translation")


def read_toml(path: Path) -> list[CalibrationEntry]:
    """Read a calibration TOML: Anipose's, Pose2Sim's, FreeMoCap's or Caliscope's (`caliscope_tables`).

    Tables without a `matrix` (such as ``[metadata]``) are passed over; so are keys that are not needed, and cameras that say ``ignore``.
    Cameras come in the natural order of their tables' names.

    Parameters
    ----------
    path : Path

    Returns
    -------
    list of CalibrationEntry

    Raises
    ------
    InputError
        When the file is no TOML, keys are missing or not numbers, or a camera is a fisheye camera.
    """
    tables = caliscope_tables(read_toml_file(path, guess=True))
    cameras = {
        label: table
        for label, table in sorted(tables.items(), key=lambda item: natural_key(item[0]))
        if isinstance(table, dict)
        and not table.keys().isdisjoint(("matrix", "rotation", "translation"))
        and table.get("ignore") is not True
    }
    lacking = {label: [key for key in KEYS if key not in table] for label, table in cameras.items()}
    gaps = [f"[{label}] has no {', '.join(f'`{key}`' for key in keys)}" for label, keys in lacking.items() if keys]
    if gaps:
        raise InputError(f"{path}: {listed(gaps, gap='; ')}; each camera needs {', '.join(KEYS)}")
    return [_entry(path, label, table) for label, table in cameras.items()]


def _entry(path: Path, label: str, table: dict) -> CalibrationEntry:
    if table.get("fisheye"):
        raise InputError(
            f"{path}: [{label}] is a fisheye camera, which is not supported; undistort its videos, or calibrate it with k1, k2, p1, p2"
        )
    arrays = {}
    for key in KEYS:
        value = as_numbers(table[key])
        if value is None:
            raise InputError(f"{path}: [{label}] `{key}` must be numbers; got {str(table[key])[:60]!r}")
        arrays[key] = value
    size = arrays["size"]
    if size.shape != (2,) or not np.all(np.isfinite(size)):
        raise InputError(f"{path}: [{label}] `size` must be [width, height] in pixels; got {str(table['size'])[:60]}")
    width, height = (round(float(n)) for n in size)
    name = str(table.get("name", label))
    return CalibrationEntry(name, (width, height), arrays["matrix"], arrays["distortions"], arrays["rotation"], arrays["translation"])


def write_calibration(path: str | Path, rig: Iterable[Camera]) -> None:
    """Write a rig as a calibration TOML that `read_calibration` reads back to within rounding.

    Parameters
    ----------
    path : str or Path
        It appears when it is complete; folders are made.
    rig : Rig or iterable of Camera

    Raises
    ------
    InputError
        When it cannot be written; a file that was there is as it was.
    """
    text = calibration_text(rig)
    with atomic_write(path) as file:
        file.write(text)


def calibration_text(rig: Iterable[Camera]) -> str:
    """What `write_calibration` writes of a rig."""
    blocks = []
    for camera in rig:
        distortions = camera.distortions if camera.distortions[4] else camera.distortions[:4]
        rows = ", ".join(_numbers(row) for row in camera.matrix)
        blocks.append(
            f"[{_key(camera.name)}]\n"
            f"name = {_text(camera.name)}\n"
            f"size = [{camera.size[0]}, {camera.size[1]}]\n"
            f"matrix = [{rows}]\n"
            f"distortions = {_numbers(distortions)}\n"
            f"rotation = {_numbers(Rotation.from_matrix(camera.rotation).as_rotvec())}\n"
            f"translation = {_numbers(camera.translation)}\n"
            f"fisheye = false\n"
        )
    return "\n".join(blocks)


def _key(name: str) -> str:
    """A name as a key: bare where TOML allows that, as a dot in it would make a table in a table, and a space none at all."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _text(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)


def _numbers(values: np.ndarray) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"
