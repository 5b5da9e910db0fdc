"""OpenCV FileStorage calibration: YAML or XML, one file a camera, and OpenPose's XML, which is one too."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.entry import CalibrationEntry

__all__ = ["Storage", "read_opencv"]

#: The names under which programs keep each value; the first that is there, with a fitting shape, counts.
MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "CameraMatrix", "Intrinsics", "intrinsic", "matrix", "K", "M", "M1")
DISTORTIONS = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distCoeffs",
    "dist_coeffs",
    "Distortion",
    "distortions",
    "dist",
    "D",
    "D1",
)
ROTATION = ("rotation", "rotation_matrix", "R", "Rot", "rvec", "rotation_vector")
TRANSLATION = ("translation", "translation_vector", "T", "t", "tvec")
WIDTH = ("image_width", "image_Width", "width", "W")
HEIGHT = ("image_height", "image_Height", "height", "H")
#: Rotation and translation in one 3 x 4 matrix [R | t]; ``CameraMatrix`` is OpenPose's word for it.
EXTRINSICS = ("CameraMatrix", "extrinsics", "extrinsic", "RT", "Rt")


class Storage:
    """The named matrices and numbers of a FileStorage file; use as a context manager.

    Raises
    ------
    InputError
        When the file is not OpenCV's YAML or XML.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        except (cv2.error, SystemError) as error:
            raise InputError(f"{path}: not an OpenCV YAML or XML file ({str(error).strip().splitlines()[-1]})") from None

    def __enter__(self) -> Storage:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.release()

    def matrix(self, names: Sequence[str], shapes: Sequence[tuple[int, ...]] = ()) -> np.ndarray | None:
        """The first of the named matrices or number lists; with ``shapes``, the first of such a shape (vectors flat)."""
        for name in names:
            node = self._file.getNode(name)
            if node.empty():
                continue
            value = node.mat() if node.isMap() else np.array([node.at(i).real() for i in range(node.size())])
            if value is None:
                continue
            value = np.asarray(value, float)
            value = value.ravel() if 1 in value.shape else value
            if not shapes or value.shape in shapes:
                return value
        return None

    def number(self, names: Sequence[str]) -> int | None:
        """The first of the named whole numbers."""
        for name in names:
            node = self._file.getNode(name)
            if node.isInt() or node.isReal():
                return round(node.real())
        return None

    def texts(self, name: str) -> list[str]:
        """A list of words; words that look like numbers come back as they are written without quotes."""
        node = self._file.getNode(name)
        items = [node.at(i) for i in range(node.size())] if node.isSeq() else []
        return [item.string() if item.isString() else str(round(item.real())) for item in items]

    def size(self, width: Sequence[str], height: Sequence[str]) -> tuple[int, int] | None:
        """(width, height) from two numbers, or None."""
        found = self.number(width), self.number(height)
        return None if found[0] is None or found[1] is None else (found[0], found[1])


def trim_distortions(values: np.ndarray | None) -> np.ndarray:
    """Distortions without the trailing zeros of OpenCV's longer models; none at all are zeros."""
    values = np.zeros(0) if values is None else values.ravel()
    return values[:5] if not values[5:].any() else values


def read_opencv(path: Path) -> CalibrationEntry:
    """Read one camera from OpenCV's YAML or XML. The camera bears the file's name; metres, world to camera.

    Known names are those of OpenCV's own samples (``camera_matrix``, ``distortion_coefficients``, ``image_width``), short ones (``K``,
    ``D``, ``R``, ``T``) and OpenPose's (``CameraMatrix`` for [R | t], ``Intrinsics``, ``Distortion``). A rotation may be a matrix or a
    vector.

    Raises
    ------
    InputError
        When the file is not of this form or something is not in it.
    """
    with Storage(path) as storage:
        size = storage.size(WIDTH, HEIGHT)
        listed = storage.matrix(("image_size", "size", "imageSize"), [(2,)])
        if size is None and listed is not None:
            size = (round(float(listed[0])), round(float(listed[1])))
        matrix = storage.matrix(MATRIX, [(3, 3)])
        distortions = trim_distortions(storage.matrix(DISTORTIONS))
        both = storage.matrix(EXTRINSICS, [(3, 4), (4, 4)])
        rotation = storage.matrix(ROTATION, [(3, 3), (3,)]) if both is None else both[:3, :3]
        translation = storage.matrix(TRANSLATION, [(3,)]) if both is None else both[:3, 3]
    if matrix is None:
        raise _missing(path, "intrinsic matrix", MATRIX)
    if rotation is None:
        raise _missing(path, "rotation", ROTATION)
    if translation is None:
        raise _missing(path, "translation", TRANSLATION)
    return CalibrationEntry(path.stem, size, matrix, distortions, rotation, translation)


def _missing(path: Path, what: str, names: Sequence[str]) -> InputError:
    return InputError(f"{path}: no {what} in this file; it is looked for as {', '.join(names)}")
