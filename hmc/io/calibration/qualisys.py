"""Qualisys' calibration export, ``.qca.txt``: XML; 1/64 pixel, millimetres, camera axes in the room's frame."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.entry import MM, CalibrationEntry, natural_key

__all__ = ["read_qualisys"]

SUBPIXELS = 64
#: Qualisys' camera looks along -z with y up; OpenCV's looks along z with y down.
OPENCV_FROM_QUALISYS = np.diag([1.0, -1.0, -1.0])


def read_qualisys(path: Path) -> list[CalibrationEntry]:
    """Read a Qualisys calibration the way Pose2Sim's converter does, so that both give the same cameras.

    Video cameras only (model "... Video ..." or "none"), active ones, in the natural order of their serial numbers, which are their names.
    The transform holds the camera's place in the room (mm) and a rotation whose rows are the camera's axes. Focal lengths and centres are
    in 1/64 pixel; the converter divides the distortion coefficients by 64 too, which makes them all but vanish, and so do we: the
    recordings in circulation were converted so. ``viewrotation`` is not applied: images must be as the sensor has them.

    Raises
    ------
    InputError
        When the file is not of this form or a number is not in it.
    """
    try:
        root = ElementTree.fromstring(path.read_text(encoding="utf-8").strip())
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: not a Qualisys calibration ({error})") from None
    cameras = [node for node in root.iter("camera") if _is_active_video(node)]
    return sorted((_entry(path, node) for node in cameras), key=lambda entry: natural_key(entry.name))


def _is_active_video(node: ElementTree.Element) -> bool:
    model = node.get("model", "none")
    return node.get("active", "1") != "0" and (model == "none" or "Video" in model)


def _entry(path: Path, node: ElementTree.Element) -> CalibrationEntry:
    name = node.get("serial", "")

    def numbers(tag: str, *keys: str) -> np.ndarray:
        found = node.find(tag)
        try:
            return np.array([float(found.attrib[key]) for key in keys])  # type: ignore[union-attr]
        except (AttributeError, KeyError, ValueError):
            raise InputError(f"{path}: camera '{name}' needs <{tag}> with the numbers {', '.join(keys)}") from None

    left, top, right, bottom = numbers("fov_video", "left", "top", "right", "bottom")
    fx, fy, cx, cy = numbers("intrinsic", "focalLengthU", "focalLengthV", "centerPointU", "centerPointV") / SUBPIXELS
    distortions = numbers("intrinsic", "radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2")
    axes = numbers("transform", *(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))).reshape(3, 3)
    centre = numbers("transform", "x", "y", "z") * MM
    rotation = OPENCV_FROM_QUALISYS @ axes
    matrix = np.array([[fx, 0, cx - left], [0, fy, cy - top], [0, 0, 1]])
    size = (round(right - left) + 1, round(bottom - top) + 1)
    return CalibrationEntry(name, size, matrix, distortions / SUBPIXELS, rotation, -rotation @ centre)
