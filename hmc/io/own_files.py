"""Refusing to write in the place of what is the user's: a recording's own files, and those of a result. It needs no numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hmc.errors import InputError
from hmc.io.files import real_path
from hmc.io.result_files import BESIDE, RESULT

if TYPE_CHECKING:
    from hmc.io.places import RecordingPlaces

__all__ = ["refuse_own_file", "refuse_own_folder", "refuse_result_file"]


def refuse_own_file(out: str | Path, places: RecordingPlaces) -> None:
    """Refuse to write a picture or a video in the place of a recording's own file, or among those of its cameras.

    Parameters
    ----------
    out : path
        Where something is to be written.
    places : RecordingPlaces
        Where the parts of the recording lie.

    Raises
    ------
    InputError
        When it is, or would lie among, the recording's own files.
    """
    if places.has(Path(out)):
        raise InputError(f"{out}: is, or would lie among, the recording's own files; choose another place")


def refuse_own_folder(out: str | Path, places: RecordingPlaces) -> None:
    """Refuse to write a result where parts of its recording are looked for: its files would be taken for the recording's.

    Parameters
    ----------
    out : path
        The result's folder.
    places : RecordingPlaces
        Where the parts of the recording lie.

    Raises
    ------
    InputError
        When it is a folder such as videos/ or pose/ of the recording, or lies in one.
    """
    if places.looked_through(Path(out)):
        raise InputError(f"--out {out}: the recording's own parts are looked for there; choose another folder, as {places.path / 'result'}")


def refuse_result_file(out: str | Path, result: str | Path) -> None:
    """Refuse to write what is made of a result in the place of one of its own files.

    Parameters
    ----------
    out : path
        Where something is to be written.
    result : path
        Folder of the result.

    Raises
    ------
    InputError
        When it is one of the result's own files (`hmc.io.result_files`).
    """
    out = Path(out)
    if out.name in (*RESULT, *BESIDE) and real_path(out.parent) == real_path(result):
        raise InputError(f"{out}: is the result's own file; choose another name")
