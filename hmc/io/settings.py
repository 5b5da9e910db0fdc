"""The optional ``recording.toml`` of a recording: name, rate, room, persons; the calibration's units and axes; whose files are whose."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.io.door import MAX_FRAME_NUMBER, read_toml_file
from hmc.io.naming import FILES, PLACE
from hmc.io.sizes import FITS
from hmc.io.world import UNITS, UPS

__all__ = ["check_settings", "read_settings"]

SETTINGS = ("name", "fps", "frames", "units", "up", "room", "persons", "subject_height_m", "first_frame", "image_size", *FILES)
#: No room is wider (metres): beyond, it is in millimetres.
MAX_ROOM_M = 300.0


def read_settings(path: Path) -> dict[str, Any]:
    """Read ``recording.toml`` of a folder, checked; empty when there is none.

    Raises
    ------
    InputError
        When a key is unknown or its value is not what it must be.
    """
    file = path / "recording.toml"
    if not os.path.lexists(file):
        return {}
    return check_settings(read_toml_file(file), file)


def check_settings(settings: Mapping[str, Any], file: Path) -> dict[str, Any]:
    """Keys and values of a ``recording.toml``, or of a table of another file that has the same, checked.

    Raises
    ------
    InputError
        When a key is unknown or its value is not what it must be.
    """
    for key in settings:
        if key not in SETTINGS:
            near = difflib.get_close_matches(key, SETTINGS, 1, 0.0)
            raise InputError(f"{file}: unknown key `{key}`; did you mean `{near[0]}`? (known: {', '.join(SETTINGS)})")
    return _checked(settings, file)


def _checked(settings: Mapping[str, Any], file: Path) -> dict[str, Any]:
    def is_number(value: Any) -> bool:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

    def demand(key: str, fine: bool, what: str) -> None:
        if key in settings and not fine:
            raise InputError(f"{file}: `{key}` must be {what}; got {settings[key]!r}")

    checked = dict(settings)
    fps: Any = settings.get("fps")
    demand("name", isinstance(settings.get("name"), str), "a text")
    units: Any = settings.get("units")
    up = settings.get("up")
    known = isinstance(units, str) and units in UNITS
    demand("units", known or (is_number(units) and 0 < units < 1e6), 'those of the calibration: "m", "cm", "mm" or metres a unit')
    demand("up", isinstance(up, str) and up in UPS, f"the calibration's axis that points up, one of {', '.join(UPS)}")
    demand("image_size", settings.get("image_size") in FITS, f"one of {', '.join(FITS)}")
    for key in FILES:
        files = settings.get(key)
        pattern = isinstance(files, str) and files.count(PLACE) == 1
        table = isinstance(files, dict) and all(isinstance(file, str) and file for file in files.values())
        demand(key, pattern or table, f'a table {{ cam_00 = "{key}/FILE" }} or a pattern such as "{key}/{PLACE}_*.mp4"')
    demand("fps", is_number(fps) and fps > 0, "a number above 0")
    demand("fps", is_number(fps) and 1e-3 <= fps <= 1e5, "frames a second, .001 to 100,000")
    for key, least in (("frames", 1), ("persons", 0)):
        value = settings.get(key)
        demand(key, isinstance(value, int) and not isinstance(value, bool) and value >= least, f"a whole number, {least} or more")
    starts = settings.get("first_frame", {})
    whole = isinstance(starts, dict) and all(
        isinstance(n, int) and not isinstance(n, bool) and 0 <= n <= MAX_FRAME_NUMBER for n in starts.values()
    )
    demand("first_frame", whole, "a table of cameras, each with the frame of its video that is frame 0 of the recording: { cam_00 = 12 }")
    if "subject_height_m" in settings:
        heights = settings["subject_height_m"] if isinstance(settings["subject_height_m"], list) else [settings["subject_height_m"]]
        demand("subject_height_m", all(is_number(height) and 0.3 < height < 3 for height in heights), "statures in metres, such as [1.77]")
        checked["subject_height_m"] = tuple(float(height) for height in heights)
    if "room" in settings:
        try:
            room = np.array(settings["room"], float)
        except (ValueError, TypeError, OverflowError):
            room = np.zeros(0)
        fine = room.shape == (2, 3) and bool(np.all(np.isfinite(room))) and bool(np.all(room[1] > room[0]))
        demand("room", fine, "[[x0, y0, z0], [x1, y1, z1]] in metres, lower corner first")
        demand("room", float(np.ptp(room, axis=0).max()) < MAX_ROOM_M, "in metres; this looks like millimetres: divide by 1000")
        room.setflags(write=False)
        checked["room"] = room
    return checked
