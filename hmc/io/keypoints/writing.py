"""Keypoints as OpenPose writes them: BODY_25, one JSON file a frame."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.files import atomic_write
from hmc.io.keypoints.layouts import BODY_25, KEYPOINTS

__all__ = ["write_openpose"]

_ORDER = [KEYPOINTS.index(name) for name in BODY_25]


def write_openpose(folder: str | Path, camera: str, frame: int, people: np.ndarray) -> Path:
    """Write people of one frame and camera, to a thousandth of a pixel.

    Parameters
    ----------
    folder : path
        Gets ``CAMERA/CAMERA_000000000012_keypoints.json``; for a recording, its ``keypoints``.
    camera : str
    frame : int
        Number of the frame in the camera's video.
    people : ndarray, shape (n, 26, 3)
        x, y, confidence in the order of `KEYPOINTS`; NaN where a point is not given. The head's top has no place in BODY_25.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        When the shape is another, or the file cannot be written.
    """
    people = np.asarray(people, float)
    if people.ndim != 3 or people.shape[1:] != (len(KEYPOINTS), 3):
        raise InputError(f"`people` must be (n, {len(KEYPOINTS)}, 3); got {people.shape}")
    points = people[:, _ORDER]
    points = np.where(np.isnan(points).any(axis=-1, keepdims=True), 0.0, points).round(3)
    entries = [{"person_id": [-1], "pose_keypoints_2d": person.ravel().tolist()} for person in points]
    path = Path(folder) / camera / f"{camera}_{frame:012d}_keypoints.json"
    with atomic_write(path) as file:
        json.dump({"version": 1.3, "people": entries}, file, separators=(",", ":"))
    return path
