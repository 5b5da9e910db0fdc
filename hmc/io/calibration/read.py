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
from hmc.io.calibration.optitrack import read_optitrack
from hmc.io.calibration.projections import read_projections
from hmc.io.calibration.qualisys import read_qualisys
from hmc.io.calibration.text import read_text
from hmc.io.calibration.toml import read_toml
from hmc.io.calibration.vicon import read_vicon
from hmc.io.settings import read_settings
from hmc.io.world import world_of

__all__ = ["find_calibration", "read_calibration", "read_entries"]

#: What a folder is searched for, in this order; all files of the first pattern that matches belong together.
PATTERNS = (
    "calibration.toml",
    "camera_array.toml",
    "intri.y*ml",
    "*.qca.txt",
    "*.xcp",
    "*.mcal",
    "*.cal",
    "[Cc]alib*.toml",
    "*_camera_calibration.toml",
    "[Cc]alib*.json",
    "[Cc]am*.json",
    "[Pp]rojection*.csv",
    "[Pp]rojection*.txt",
    "*_par.txt",
    "*.xml",
    "*.y*ml",
    "config.toml",
)
#: Patterns of files that hold a whole rig: there must be one only.
WHOLE_RIG = (".toml", ".qca.txt", ".xcp", ".mcal", ".csv", ".txt")
KNOWN = (
    "Anipose, Pose2Sim and FreeMoCap (calibration.toml, Calib*.toml, *_camera_calibration.toml), Caliscope (camera_array.toml, "
    "config.toml), EasyMocap (intri.yml with extri.yml), Qualisys and Theia (*.qca.txt), Vicon (*.xcp), OptiTrack (*.mcal), "
    "HumanEva and bodytrack (*.cal), CMU Panoptic (calib*.json), OpenCV (*.yml, *.xml, cam*.json), projection matrices "
    "(projections.csv, *_par.txt)"
)
XML_READERS = {"<calibrationProfile": read_optitrack, "<Cameras": read_vicon, "<calibration": read_qualisys}


def read_calibration(path: str | Path, sizes: Mapping[str, tuple[int, int]] | None = None) -> Rig:
    """Read a rig from any calibration format the package knows. For a folder with recording.toml, its ``units`` and ``up`` hold.

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
    world = world_of(read_settings(Path(path)))
    try:
        return Rig(tuple(build_camera(entry, sizes, world) for entry in entries))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_entries(path: str | Path) -> list[CalibrationEntry]:
    """Read what a calibration states, without judging it: what `check` looks at. Arguments and errors as `read_calibration`."""
    files = find_calibration(path)
    entries = [entry for file in files for entry in _read_file(file)]
    if not entries:
        raise InputError(f"{files[0]}: no camera in this calibration; export it again, or remove it")
    return entries


def find_calibration(path: str | Path) -> list[Path]:
    """The calibration files of a folder (or of its subfolder ``calibration``), or the file itself.

    ``calibration.toml`` comes first, then the forms that bear names of their own (Caliscope's, EasyMocap's pair, Qualisys', Vicon's and
    OptiTrack's exports, ``.cal`` files, one a camera), then the others, OpenCV's XML and YAML (one a camera) nearly at the end.

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
            files = sorted((file for file in folder.glob(pattern) if file.is_file()), key=lambda file: natural_key(file.name))
            if pattern == "config.toml":
                files = [file for file in files if "translation" in read_text(file)]  # other programs have a config.toml too
            if len(files) > 1 and pattern.endswith(WHOLE_RIG):
                raise InputError(
                    f"{folder}: more than one calibration ({', '.join(file.name for file in files)}); keep the one that is meant"
                )
            if files:
                return files
    others = [file.name for folder in (path, path / "calibration") for file in sorted(folder.glob("*.*")) if file.is_file()]
    others = [name for name in others if name != "recording.toml" and not name.startswith(".")]
    seen = f" ({', '.join(others[:4])}{', ...' if len(others) > 4 else ''}: not of a known form)" if others else ""
    raise InputError(f"{path}: no calibration found here or in calibration/{seen}; what can be read is {KNOWN}")


def _read_file(path: Path) -> list[CalibrationEntry]:
    if path.stem.lower() in ("intri", "extri"):
        intri, extri = (path.with_stem(stem) for stem in ("intri", "extri"))
        missing = [file for file in (intri, extri) if not file.is_file()]
        if missing:
            raise InputError(f"{missing[0]}: EasyMocap's calibration is a pair, and this file is missing")
        return read_easymocap(intri, extri)
    kind, text = path.suffix.lower(), read_text(path).lstrip()
    if kind == ".toml":
        return read_toml(path)
    if kind == ".cal":
        return [read_cal(path)]
    for tag, reader in XML_READERS.items():
        if text.startswith("<") and tag in text:
            return reader(path)
    if kind in (".json", ".yml", ".yaml") or text.startswith("%YAML") or "<opencv_storage" in text:
        return read_opencv(path)
    if kind in (".csv", ".txt"):
        return read_projections(path)
    raise InputError(f"{path}: not a calibration of a known form, which are {KNOWN}")
