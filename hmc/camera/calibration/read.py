"""Find out which calibration format a file or folder holds, and read it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hmc.camera.calibration.entry import CalibrationEntry, build_camera
from hmc.camera.calibration.toml import read_toml
from hmc.camera.model import Rig
from hmc.errors import InputError

__all__ = ["find_calibration", "read_calibration", "read_entries"]


def read_calibration(path: str | Path, sizes: Mapping[str, tuple[int, int]] | None = None) -> Rig:
    """Read a rig from any calibration format the package knows.

    Parameters
    ----------
    path : str or Path
        A file, or a folder that holds one (see `find_calibration`).
    sizes : mapping from camera name to (width, height), optional
        Image sizes, for formats that state none.

    Returns
    -------
    Rig

    Raises
    ------
    InputError
        When there is no calibration, its form is not known, or its numbers describe no camera.
    """
    path = Path(path)
    entries = read_entries(path)
    try:
        return Rig(tuple(build_camera(entry, sizes) for entry in entries))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_entries(path: str | Path) -> list[CalibrationEntry]:
    """Read what a calibration states, without judging it: what `check` looks at. Arguments and errors as `read_calibration`."""
    found = find_calibration(path)
    entries = read_toml(found)
    if not entries:
        raise InputError(f"{found}: no camera in this calibration")
    return entries


def find_calibration(path: str | Path) -> Path:
    """The calibration in a folder (``calibration.toml`` first), or the file itself."""
    path = Path(path)
    if path.is_file():
        return path
    if (path / "calibration.toml").is_file():
        return path / "calibration.toml"
    raise InputError(f"{path}: no calibration found; a recording needs calibration.toml (python -m hmc check tells more)")
