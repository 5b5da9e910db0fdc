"""Find out which calibration format a file or folder holds, and read it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.io.calibration.cal import read_cal
from hmc.io.calibration.easymocap import read_easymocap
from hmc.io.calibration.entry import CalibrationEntry, build_camera, natural_key
from hmc.io.calibration.opencv import read_opencv
from hmc.io.calibration.qualisys import read_qualisys
from hmc.io.calibration.toml import read_toml

__all__ = ["find_calibration", "read_calibration", "read_entries"]

#: What a folder is searched for, in this order; all files of the first pattern that matches belong together.
PATTERNS = ("calibration.toml", "intri.y*ml", "*.qca.txt", "*.cal", "[Cc]alib*.toml", "*.xml", "*.y*ml")


def read_calibration(path: str | Path, sizes: Mapping[str, tuple[int, int]] | None = None) -> Rig:
    """Read a rig from any calibration format the package knows.

    Parameters
    ----------
    path : str or Path
        A file, or a folder that holds one or more (see `find_calibration`).
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
    entries = read_entries(path)
    try:
        return Rig(tuple(build_camera(entry, sizes) for entry in entries))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_entries(path: str | Path) -> list[CalibrationEntry]:
    """Read what a calibration states, without judging it: what `check` looks at. Arguments and errors as `read_calibration`."""
    entries = [entry for file in find_calibration(path) for entry in _read_file(file)]
    if not entries:
        raise InputError(f"{path}: no camera in this calibration")
    return entries


def find_calibration(path: str | Path) -> list[Path]:
    """The calibration files of a folder (or of its subfolder ``calibration``), or the file itself.

    ``calibration.toml`` comes first, then EasyMocap's pair, Qualisys' export, ``.cal`` files (one a camera), another ``Calib*.toml``, and
    OpenCV's XML or YAML (one a camera).

    Raises
    ------
    InputError
        When there is nothing, or more than one file of a kind that holds a whole rig.
    """
    path = Path(path)
    if path.is_file():
        return [path]
    for folder in (path, path / "calibration"):
        for pattern in PATTERNS:
            files = sorted(folder.glob(pattern), key=lambda file: natural_key(file.name))
            if len(files) > 1 and pattern.endswith((".toml", ".qca.txt")):
                raise InputError(
                    f"{folder}: more than one calibration ({', '.join(file.name for file in files)}); rename one to calibration.toml"
                )
            if files:
                return files
    raise InputError(f"{path}: no calibration found; a recording needs calibration.toml, or a file of another known format in its place")


def _read_file(path: Path) -> list[CalibrationEntry]:
    text = path.read_text(encoding="utf-8", errors="replace").lstrip("\ufeff \t\r\n")
    if path.stem.lower() in ("intri", "extri"):
        intri, extri = (path.with_stem(stem) for stem in ("intri", "extri"))
        missing = [file for file in (intri, extri) if not file.is_file()]
        if missing:
            raise InputError(f"{missing[0]}: EasyMocap's calibration is a pair, and this file is missing")
        return read_easymocap(intri, extri)
    if path.suffix.lower() == ".toml":
        return read_toml(path)
    if path.suffix.lower() == ".cal":
        return [read_cal(path)]
    if text.startswith("%YAML") or "<opencv_storage" in text:
        return [read_opencv(path)]
    if "<calibration" in text:
        return read_qualisys(path)
    raise InputError(
        f"{path}: not a calibration of a known form (Anipose / Pose2Sim .toml, OpenCV YAML or XML, EasyMocap, Qualisys .qca.txt, .cal)"
    )
