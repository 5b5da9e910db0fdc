"""Cameras that a run turned back, as a file beside its poses: pictures show the poses by the cameras that they were found with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from hmc.camera.turned_cameras import turn_back
from hmc.errors import InputError
from hmc.io.door import read_toml_file
from hmc.io.files import write_toml
from hmc.io.recording import Recording

__all__ = ["TURNED_CAMERAS", "as_posed", "read_turns", "write_turns"]

TURNED_CAMERAS = "turned_cameras.toml"


def write_turns(folder: str | Path, turns: Mapping[str, np.ndarray]) -> None:
    """Write the rotation vectors of cameras, world, radians, by which they were turned back about their centres."""
    write_toml(Path(folder) / TURNED_CAMERAS, {name: [float(angle) for angle in turn] for name, turn in turns.items()})


def read_turns(folder: str | Path) -> dict[str, np.ndarray]:
    """What `write_turns` wrote; empty where no camera was turned back.

    Raises
    ------
    InputError
        When the file is there and is no such table.
    """
    path = Path(folder) / TURNED_CAMERAS
    if not path.exists():
        return {}
    turns = {}
    for name, turn in read_toml_file(path).items():
        numbers = isinstance(turn, list) and all(isinstance(angle, int | float) and not isinstance(angle, bool) for angle in turn)
        if not numbers or len(turn) != 3 or not np.isfinite(turn).all():
            raise InputError(f"{path}: `{name}` must be a rotation vector, three numbers; got {str(turn)[:60]}")
        turns[name] = np.array(turn, float)
    return turns


def as_posed(recording: Recording, turns: Mapping[str, np.ndarray]) -> Recording:
    """The recording with the cameras with which its poses were found."""
    return replace(recording, rig=turn_back(recording.rig, turns)) if turns else recording
