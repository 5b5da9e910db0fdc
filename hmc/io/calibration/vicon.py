"""Vicon's calibration, ``.xcp``: XML, millimetres; a lens model that runs from the image to the ideal camera, unlike OpenCV's."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.errors import InputError
from hmc.io.calibration.entry import MM, CalibrationEntry, natural_key
from hmc.io.calibration.text import as_numbers, listed, read_xml

__all__ = ["read_vicon"]

#: The words before the numbers of the lens model: centre (2) and three factors, in pixels.
LENS = "Vicon3Parameter"
#: OpenCV's five numbers must say the same as Vicon's to within this, everywhere in the image.
MAX_MISFIT_PX = 0.25
GRID = 25


def read_vicon(path: Path) -> list[CalibrationEntry]:
    """Read the cameras of an ``.xcp`` file: the video cameras (``TYPE`` or ``DISPLAY_TYPE`` with "video" or "Vue") where there are any,
    else all that are calibrated, in natural order of their ``DEVICEID``, which is their name.

    ``ORIENTATION`` is a quaternion x, y, z, w, world to camera, which looks along z with y down; ``POSITION`` is the camera's centre in mm.
    ``VICON_RADIAL2`` (``VICON_RADIAL`` with two factors) tells where a pixel of the image lies in an ideal one, about a centre and in
    pixels; k1, k2, p1, p2, k3 that say the same the other way round are found by least squares.

    Raises
    ------
    InputError
        When the file is not of this form, something is not in it, or the lens model has no such five numbers.
    """
    root = read_xml(path, "a Vicon calibration")
    cameras = [node for node in root.iter("Camera") if node.find(".//KeyFrame") is not None]
    films = [node for node in cameras if any(word in _kind(node) for word in ("video", "vue"))]
    missing: list[str] = []
    entries = [_entry(path, node, missing) for node in films or cameras]
    if missing:
        raise InputError(f"{path}: {listed(missing, gap='; ')}")
    return sorted((entry for entry in entries if entry is not None), key=lambda entry: natural_key(entry.name))


def _kind(node: ElementTree.Element) -> str:
    return f"{node.get('TYPE', '')} {node.get('DISPLAY_TYPE', '')}".lower()


def _entry(path: Path, node: ElementTree.Element, missing: list[str]) -> CalibrationEntry | None:
    name = node.get("DEVICEID", "?")
    frame = node.find(".//KeyFrame")
    values = {**node.attrib, **(frame.attrib if frame is not None else {})}
    counts = {"SENSOR_SIZE": 2, "FOCAL_LENGTH": 1, "PRINCIPAL_POINT": 2, "ORIENTATION": 4, "POSITION": 3}
    found = {key: as_numbers(values.get(key, "").split()) for key in counts}
    lacking = [key for key, value in found.items() if value is None or value.shape != (counts[key],) or not np.all(np.isfinite(value))]
    size, focal, centre, orientation, position = (np.zeros(0) if value is None else value for value in found.values())
    aspect = as_numbers(values.get("PIXEL_ASPECT_RATIO", "1"))
    lacking += ["PIXEL_ASPECT_RATIO"] * (aspect is None or not aspect > 0)
    if not lacking and (size.min() < 1 or focal[0] <= 0 or not orientation.any()):
        lacking = [key for key, bad in zip(counts, (size.min() < 1, focal[0] <= 0, False, not orientation.any()), strict=False) if bad]
    if lacking or aspect is None:
        missing.append(f"camera '{name}' has no sound {', '.join(lacking)}")
        return None
    matrix = np.array([[focal[0], 0, centre[0]], [0, focal[0] / aspect, centre[1]], [0, 0, 1]])
    rotation = Rotation.from_quat(orientation).as_matrix()
    distortions, misfit = _opencv_lens(matrix, size, _lens(path, name, values, centre))
    if not misfit < MAX_MISFIT_PX:
        raise InputError(
            f"{path}: the lens of camera '{name}' has no likeness in k1, k2, p1, p2, k3 (off by {misfit:.2g} px); undistort its video"
        )
    return CalibrationEntry(
        name, (round(float(size[0])), round(float(size[1]))), matrix, distortions, rotation, -rotation @ position * MM, True
    )


def _lens(path: Path, name: str, values: dict[str, str], principal: np.ndarray) -> np.ndarray:
    """Centre (2) and three factors, pixels."""
    words = values.get("VICON_RADIAL2", "").split()
    numbers = as_numbers([word for word in words if word != LENS])
    if not words:
        factors = as_numbers(values.get("VICON_RADIAL", "").split())
        numbers = None if factors is None or factors.size > 3 else np.concatenate([principal, np.pad(factors, (0, 3 - factors.size))])
    if numbers is None or numbers.shape != (5,) or not np.all(np.isfinite(numbers)):
        raise InputError(f"{path}: the lens model of camera '{name}' is not {LENS} with five numbers; got {' '.join(words)!r}")
    return numbers


def _opencv_lens(matrix: np.ndarray, size: np.ndarray, lens: np.ndarray) -> tuple[np.ndarray, float]:
    """k1, k2, p1, p2, k3 that distort as Vicon's model corrects, and by how many pixels they differ at most."""
    if not lens[2:].any():
        return np.zeros(5), 0.0
    u, v = np.meshgrid(np.linspace(0, size[0] - 1, GRID), np.linspace(0, size[1] - 1, GRID))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    offset = pixels - lens[:2]
    with np.errstate(over="ignore", invalid="ignore"):
        r2 = (offset**2).sum(axis=1, keepdims=True)
        ideal = lens[:2] + offset * (1 + r2 * (lens[2] + r2 * (lens[3] + r2 * lens[4])))
        focal, centre = np.diag(matrix)[:2], matrix[:2, 2]
        x, y = ((ideal - centre) / focal).T
        wanted = (pixels - centre) / focal - np.stack([x, y], axis=1)
        s = x * x + y * y
        columns = np.array([[x * s, x * s**2, 2 * x * y, s + 2 * x * x, x * s**3], [y * s, y * s**2, s + 2 * y * y, 2 * x * y, y * s**3]])
    system, target = columns.transpose(0, 2, 1).reshape(-1, 5), wanted.T.ravel()
    if not (np.all(np.isfinite(system)) and np.all(np.isfinite(target))):
        return np.zeros(5), np.inf
    distortions = np.linalg.lstsq(system, target, rcond=None)[0]
    return distortions, float(np.abs((system @ distortions - target) * np.repeat(focal, len(pixels))).max())
