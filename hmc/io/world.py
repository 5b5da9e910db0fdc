"""Units and axes of a calibration, as recording.toml states them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hmc.camera.world import World

__all__ = ["UNITS", "UPS", "world_of"]

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


def world_of(settings: Mapping[str, Any]) -> World:
    """The package's world, metres and z up, from the one that a checked recording.toml states: ``units`` ("m", "cm", "mm" or metres a unit)
    and ``up``."""
    units = settings.get("units", "m")
    return World(UPS[settings.get("up", "z")], scale=UNITS[units] if isinstance(units, str) else float(units))
