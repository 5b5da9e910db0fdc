"""What a calibration file says about one camera, before anything has been checked."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hmc.camera.model import Camera
from hmc.camera.world import World, moved_camera
from hmc.errors import InputError

__all__ = ["CalibrationEntry", "build_camera", "natural_key"]

MM = 1e-3


class CalibrationEntry(NamedTuple):
    """One camera as a file states it; the fields are those of `hmc.camera.model.Camera`, unchecked.

    ``size`` is None where the format has no place for it: it then comes from the images. ``metric`` says that the format fixes its unit, so
    that ``translation`` is in metres, whatever recording.toml says.
    """

    name: str
    size: tuple[int, int] | None
    matrix: np.ndarray
    distortions: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    metric: bool = False


def build_camera(entry: CalibrationEntry, sizes: Mapping[str, tuple[int, int]] | None = None, world: World | None = None) -> Camera:
    """Check an entry and make it a camera, in metres and with z up.

    Parameters
    ----------
    entry : CalibrationEntry
    sizes : mapping from camera name to (width, height), optional
        Used where the file states no size.
    world : World, optional
        The package's from the calibration's own; by default they are the same.

    Raises
    ------
    InputError
        When the size is nowhere to be found, or `Camera` refuses the numbers.
    """
    size = entry.size or (sizes or {}).get(entry.name)
    if size is None:
        raise InputError(
            f"camera '{entry.name}': the calibration states no image size and there are no images to take it from; give `size`"
        )
    camera = Camera(entry.name, size, entry.matrix, entry.distortions, entry.rotation, entry.translation)
    if world is None:
        return camera
    return moved_camera(camera, replace(world, scale=1.0) if entry.metric else world)


def natural_key(text: str) -> list:
    """Sort key under which ``cam_10`` comes after ``cam_2``."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", text) if part]
