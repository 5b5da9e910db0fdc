"""OptiTrack Motive's calibration, ``.mcal`` (Motive 3.2 and later): XML, metres, Y up."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.entry import CalibrationEntry, natural_key
from hmc.io.calibration.text import as_numbers, listed, read_xml

__all__ = ["read_optitrack"]

#: Motive's camera looks along -z with y up; OpenCV's looks along z with y down.
OPENCV_FROM_MOTIVE = np.diag([1.0, -1.0, -1.0])
#: Serial numbers of colour cameras begin with this.
COLOR = "C"
LENS = "IntrinsicStandardCameraModel"
NEEDED = {
    "Attributes": ("ImagerPixelWidth", "ImagerPixelHeight"),
    LENS: ("HorizontalFocalLength", "VerticalFocalLength", "LensCenterX", "LensCenterY", "k1", "k2", "TangentialX", "TangentialY", "k3"),
    "Extrinsic": ("X", "Y", "Z", *(f"OrientMatrix{place}" for place in range(9))),
}


def read_optitrack(path: Path) -> list[CalibrationEntry]:
    """Read the cameras of an ``.mcal`` file: the colour cameras (serial number "C...") where there are any, else all; their serial
    numbers are their names.

    ``Extrinsic`` has the camera's place in metres and its axes, as the columns of a matrix, in a room whose y points up: recording.toml
    must say ``up = "y"`` unless Motive was set otherwise. The lens is that of ``IntrinsicStandardCameraModel``, which is OpenCV's;
    ``Intrinsic`` is Motive's own model and is not read.

    Raises
    ------
    InputError
        When the file is not of this form or something is not in it.
    """
    root = read_xml(path, "an OptiTrack calibration")
    cameras = [node for node in root.iter("Camera") if node.find("Extrinsic") is not None]
    colored = [node for node in cameras if node.get("Serial", "").upper().startswith(COLOR)]
    missing: list[str] = []
    entries = [_entry(node, missing) for node in colored or cameras]
    if missing:
        raise InputError(f"{path}: {listed(missing, gap='; ')}; export the calibration again, from Motive 3.2 or later")
    return sorted((entry for entry in entries if entry is not None), key=lambda entry: natural_key(entry.name))


def _entry(node: ElementTree.Element, missing: list[str]) -> CalibrationEntry | None:
    name = node.get("Serial", "?")
    found = {}
    for tag, keys in NEEDED.items():
        part = node.find(tag)
        attributes = {} if part is None else part.attrib
        lacking = [key for key in keys if not _is_number(attributes.get(key))]
        if lacking:
            missing.append(f"camera '{name}' has no <{tag}>" if part is None else f"<{tag}> of camera '{name}' has no {listed(lacking)}")
        else:
            found[tag] = np.array([float(attributes[key]) for key in keys])
    if len(found) < len(NEEDED):
        return None
    size, lens, place = found.values()
    matrix = np.array([[lens[0], 0, lens[2]], [0, lens[1], lens[3]], [0, 0, 1]])
    rotation = OPENCV_FROM_MOTIVE @ place[3:].reshape(3, 3).T
    sides = (round(float(size[0])), round(float(size[1])))
    return CalibrationEntry(name, sides, matrix, lens[4:], rotation, -rotation @ place[:3], True)


def _is_number(text: str | None) -> bool:
    value = as_numbers(text)
    return value is not None and bool(np.isfinite(value))
