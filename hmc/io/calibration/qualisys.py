"""Qualisys' calibration export, ``.qca.txt``, and Theia's file that looks like it: XML, millimetres."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.entry import MM, CalibrationEntry, natural_key
from hmc.io.calibration.text import as_numbers, listed, read_xml

__all__ = ["read_qualisys"]

SUBPIXELS = 64
#: Qualisys' camera looks along -z with y up; OpenCV's looks along z with y down.
OPENCV_FROM_QUALISYS = np.diag([1.0, -1.0, -1.0])
SIDES = ("left", "top", "right", "bottom")
SENSOR = ("sensorMinU", "sensorMinV", "sensorMaxU", "sensorMaxV")
LENS = ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV")
DISTORTIONS = ("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2")
PLACE = ("x", "y", "z", *(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)))


def read_qualisys(path: Path) -> list[CalibrationEntry]:
    """Read a Qualisys calibration the way Pose2Sim's converter does, so that both give the same cameras.

    Video cameras only (model "... Video ..." or "none"), active ones, in the natural order of their serial numbers, which are their names.
    The transform holds the camera's place in the room (mm) and a rotation whose rows are the camera's axes. Focal lengths, centres and skew
    are in 1/64 pixel; the converter divides the distortion coefficients by 64 too, which makes them all but vanish, and so do we: the
    recordings in circulation were converted so. ``viewrotation`` is not applied: images must be as the sensor has them.

    A camera without ``fov_video`` is Theia's: there the transform is that of points, room to camera, in OpenCV's axes, the lens
    is in pixels, and the distortion coefficients are OpenCV's.

    Raises
    ------
    InputError
        When the file is not of this form or numbers are not in it.
    """
    root = read_xml(path, "a Qualisys calibration")
    missing: list[str] = []
    entries = [_entry(node, missing) for node in root.iter("camera") if _is_active_video(node)]
    if missing:
        raise InputError(f"{path}: {listed(missing, gap='; ')}")
    return sorted((entry for entry in entries if entry is not None), key=lambda entry: natural_key(entry.name))


def _is_active_video(node: ElementTree.Element) -> bool:
    model = node.get("model", "none")
    return node.get("active", "1") != "0" and (model == "none" or "Video" in model)


def _entry(node: ElementTree.Element, missing: list[str]) -> CalibrationEntry | None:
    name = node.get("serial", "")
    whole = True

    def numbers(tag: str, *keys: str, optional: str = "") -> np.ndarray:
        nonlocal whole
        part = node.find(tag)
        attributes = {} if part is None else {**dict.fromkeys(optional.split(), "0"), **part.attrib}
        found = {key: as_numbers(attributes.get(key)) for key in (*keys, *optional.split())}
        lacking = [key for key, value in found.items() if value is None or not np.isfinite(value)]
        if lacking:
            missing.append(f"camera '{name}' needs <{tag}> with the numbers {', '.join(lacking)}")
            whole = False
            return np.zeros(len(found))
        return np.array(list(found.values()), float)

    theia = node.find("fov_video") is None
    left, top, right, bottom = numbers("intrinsic", *SENSOR) if theia else numbers("fov_video", *SIDES)
    lens = numbers("intrinsic", *LENS, *DISTORTIONS, optional="radialDistortion3 skew")
    place = numbers("transform", *PLACE)
    if not whole:
        return None
    lens, axes, centre = lens if theia else lens / SUBPIXELS, place[3:].reshape(3, 3), place[:3] * MM
    fx, fy, cx, cy, *distortions, skew = lens
    rotation = axes if theia else OPENCV_FROM_QUALISYS @ axes
    translation = centre if theia else -rotation @ centre
    matrix = np.array([[fx, skew, cx - left], [0, fy, cy - top], [0, 0, 1]])
    size = (round(right - left) + (not theia), round(bottom - top) + (not theia))
    return CalibrationEntry(name, size, matrix, np.array(distortions), rotation, translation, True)
