"""Units and axes of a calibration, made the package's: metres, z up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hmc.camera.model import Camera

__all__ = ["UNITS", "UPS", "WORLD", "World", "in_metres", "world_of"]

#: Metres a unit.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
#: Proper rotations that bring the axis that points up onto z.
UPS = {
    "z": np.eye(3),
    "-z": np.diag([1.0, -1.0, -1.0]),
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "-y": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "x": np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "-x": np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
}


class World(NamedTuple):
    """The world that a calibration is in: ``metres_per_unit``, and the axis that points ``up`` (a key of `UPS`)."""

    metres_per_unit: float = 1.0
    up: str = "z"


WORLD = World()


def world_of(settings: Mapping[str, Any]) -> World:
    """The world that a checked recording.toml states: ``units`` ("m", "cm", "mm" or metres a unit) and ``up``."""
    units = settings.get("units", "m")
    return World(UNITS[units] if isinstance(units, str) else float(units), settings.get("up", "z"))


def in_metres(camera: Camera, world: World) -> Camera:
    """A camera that was calibrated in a world of its own, in the package's: points there are turned by ``UPS[up]`` and scaled to metres.

    The same point, in either world, has the same pixel.
    """
    if world == WORLD:
        return camera
    return replace(camera, rotation=camera.rotation @ UPS[world.up].T, translation=camera.translation * world.metres_per_unit)
