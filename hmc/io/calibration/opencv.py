"""OpenCV's calibration files: YAML, XML or JSON, one file a camera or all in one; OpenPose's XML and CMU Panoptic's JSON are such files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.entry import CalibrationEntry
from hmc.io.calibration.storage import read_storage
from hmc.io.calibration.text import as_numbers, listed

__all__ = ["find_array", "find_size", "read_opencv", "trim_distortions"]

#: The names under which programs keep each value; the first that is there, with a fitting shape, counts.
MATRIX = (
    "camera_matrix",
    "cameraMatrix",
    "Camera_Matrix",
    "CameraMatrix",
    "Intrinsics",
    "intrinsic_matrix",
    "intrinsics",
    "intrinsic",
    "matrix",
    "K",
    "mtx",
    "M",
    "M1",
)
DISTORTIONS = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distortion_coeffs",
    "distCoeffs",
    "distCoef",
    "dist_coeffs",
    "dist_coeff",
    "dist_coefs",
    "Distortion",
    "distortion",
    "distortions",
    "dist",
    "D",
    "D1",
)
ROTATION = ("rotation", "rotation_matrix", "R", "Rot", "rvec", "rotation_vector", "rvecs", "rotation_vectors")
TRANSLATION = ("translation", "translation_vector", "T", "t", "tvec", "tvecs", "translation_vectors")
WIDTH = ("image_width", "image_Width", "width", "W", "img_width")
HEIGHT = ("image_height", "image_Height", "height", "H", "img_height")
SIZE = ("image_size", "imageSize", "img_size", "size", "resolution")
#: Rotation and translation in one 3 x 4 matrix [R | t]; ``CameraMatrix`` is OpenPose's word for it.
EXTRINSICS = ("CameraMatrix", "extrinsics", "extrinsic", "RT", "Rt")
LOOKED_FOR = "looked for are camera_matrix or K (3 x 3), R or rvec, T or tvec, and the other names that OpenCV's programs use"
#: What a camera of a list may be named by.
NAME = ("name", "camera_name", "camera", "serial", "id")
#: CMU Panoptic's kinds of camera; where there are cameras of the first, they are meant.
KIND, CHOSEN_KIND = "type", "hd"


def find_array(values: Mapping[str, Any], names: Sequence[str], shapes: Sequence[tuple[int, ...]] = ()) -> np.ndarray | None:
    """The first of the named matrices or lists of numbers; with ``shapes``, the first of such a shape (vectors flat)."""
    for name in names:
        value = as_numbers(values.get(name))
        if value is None or not value.size:
            continue
        value = value.ravel() if value.size == max(value.shape, default=1) else np.squeeze(value)
        if not shapes or value.shape in shapes:
            return value
    return None


def find_size(values: Mapping[str, Any], width: Sequence[str] = WIDTH, height: Sequence[str] = HEIGHT) -> tuple[int, int] | None:
    """(width, height) in pixels, or None."""
    sides = [find_array(values, names, [(1,)]) for names in (width, height)]
    size = find_array(values, SIZE, [(2,)]) if sides[0] is None or sides[1] is None else np.concatenate(sides)  # type: ignore[arg-type]
    return None if size is None or not np.all(np.isfinite(size)) else (round(float(size[0])), round(float(size[1])))


def trim_distortions(values: np.ndarray | None) -> np.ndarray:
    """Distortions without the trailing zeros of OpenCV's longer models; none at all are zeros."""
    values = np.zeros(0) if values is None else values.ravel()
    return values[:5] if not values[5:].any() else values


def read_opencv(path: Path) -> list[CalibrationEntry]:
    """Read what OpenCV wrote, or a program that uses OpenCV: YAML, XML or JSON. World to camera; metres, unless recording.toml says else.

    Known names are those of OpenCV's own samples (``camera_matrix``, ``distortion_coefficients``, ``image_width``, ``rvecs``, ``tvecs``),
    short ones (``K``, ``D``, ``R``, ``T``), OpenPose's (``CameraMatrix`` for [R | t], ``Intrinsics``, ``Distortion``) and CMU Panoptic's
    (``K``, ``distCoef``, ``R``, ``t``, ``resolution``). A rotation may be a matrix or a vector.

    A file is one camera, which bears the file's name, or holds a group of values a camera, under its name or in a list ``cameras``. Of CMU
    Panoptic's list, the HD cameras are taken.

    Raises
    ------
    InputError
        When the file is not of this form or something is not in it.
    """
    groups = _groups(read_storage(path), path.stem)
    missing: list[str] = []
    entries = [_entry(path, name, values, missing) for name, values in groups]
    if missing:
        raise InputError(f"{path}: {listed(missing, gap='; ')}; {LOOKED_FOR}")
    return [entry for entry in entries if entry is not None]


def _groups(values: dict[str, Any], stem: str) -> list[tuple[str, dict[str, Any]]]:
    """The values of each camera, by name."""
    listed_cameras = values.get("cameras")
    if isinstance(listed_cameras, list):
        cameras = [camera for camera in listed_cameras if isinstance(camera, dict)]
        if any(camera.get(KIND) == CHOSEN_KIND for camera in cameras):
            cameras = [camera for camera in cameras if camera.get(KIND) == CHOSEN_KIND]
        return [(_name(camera, f"cam_{place:02d}"), _flat(camera)) for place, camera in enumerate(cameras)]
    if isinstance(listed_cameras, dict):
        values = listed_cameras
    groups = {name: _flat(group) for name, group in values.items() if isinstance(group, dict)}
    cameras_in_it = [(name, group) for name, group in groups.items() if find_array(group, MATRIX, [(3, 3)]) is not None]
    placed = [name for name, group in cameras_in_it if find_array(group, (*TRANSLATION, *EXTRINSICS)) is not None]
    return cameras_in_it if placed or len(cameras_in_it) > 1 else [(stem, _flat(values))]


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    """The values with those of groups within, such as ``intrinsics``; what stands outside counts first."""
    inner = {name: value for group in values.values() if isinstance(group, dict) for name, value in group.items()}
    return {**inner, **{name: value for name, value in values.items() if not isinstance(value, dict)}}


def _name(values: Mapping[str, Any], fallback: str) -> str:
    named = next((values[key] for key in NAME if isinstance(values.get(key), str | int | float)), fallback)
    return str(round(named) if isinstance(named, float) and np.isfinite(named) else named)


def _entry(path: Path, name: str, values: Mapping[str, Any], missing: list[str]) -> CalibrationEntry | None:
    both = find_array(values, EXTRINSICS, [(3, 4), (4, 4)])
    matrix = find_array(values, MATRIX, [(3, 3)])
    if both is None:
        _refuse_several(path, name, values)
        rotation, translation = find_array(values, ROTATION, [(3, 3), (3,)]), find_array(values, TRANSLATION, [(3,)])
    else:
        rotation, translation = both[:3, :3], both[:3, 3]
    parts = {"intrinsic matrix": matrix, "rotation": rotation, "translation": translation}
    lacking = [what for what, value in parts.items() if value is None]
    if matrix is None or rotation is None or translation is None:
        owner = "in this file" if name == path.stem else f"of camera '{name}'"
        missing.append(f"no {', no '.join(lacking)} {owner}")
        return None
    return CalibrationEntry(name, find_size(values), matrix, trim_distortions(find_array(values, DISTORTIONS)), rotation, translation)


def _refuse_several(path: Path, name: str, values: Mapping[str, Any]) -> None:
    """Of a calibration of the lens, with a pose of the board in every image, nobody knows which is the room's."""
    for key in ("rvecs", "rotation_vectors"):
        value = as_numbers(values.get(key))
        several = value is not None and value.size > 3 and value.size % 3 == 0 and value.shape != (3, 3)
        if several and find_array(values, ROTATION, [(3, 3), (3,)]) is None:
            raise InputError(
                f"{path}: `{key}` of '{name}' holds {value.size // 3} views of a board; keep the one in which the board lies on the "  # type: ignore[union-attr]
                "room's floor, as `rvec`, with its `tvec`"
            )
