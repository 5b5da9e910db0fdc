"""A recording's calibration in another world: written beside what was there, which is kept."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.io.calibration.toml import calibration_text
from hmc.io.door import read_text_file, read_toml_file
from hmc.io.keeping import write_keeping
from hmc.io.toml_lines import says, statements

__all__ = ["write_new_world", "write_session_world"]

#: Of recording.toml: what is said in the old world's terms.
OLD_TERMS = ("room", "units", "up")


def write_new_world(path: Path, rig: Rig) -> list[str]:
    """Write ``calibration.toml``, which comes before other forms, and take what no longer holds out of ``recording.toml``.

    What was there is kept as ``calibration_before.toml`` and ``recording_before.toml``, and what is taken out stays as a comment.

    Parameters
    ----------
    path : Path
        Folder of the recording.
    rig : Rig
        Of all of its cameras, metres, z up.

    Returns
    -------
    list of str
        What was written and kept.

    Raises
    ------
    InputError
        When ``recording.toml`` is no TOML, or is written so that more would change than is to be taken out, or a file cannot be
        written; all is as it was then.
    """
    target, settings = path / "calibration.toml", path / "recording.toml"
    texts, taken = {target: calibration_text(rig)}, list[str]()
    if settings.is_file():
        new, taken = without_old_terms(read_text_file(settings))
        _refuse_other_changes(settings, new)
        texts |= {settings: new} if taken else {}
    before = write_keeping(texts)
    lines = [f"written: {target}", *_kept_lines(before[target])]
    if taken:
        terms = ", ".join(f"`{key}`" for key in taken)
        lines.append(f"{settings}: {terms} of the old world taken out; {_kept_lines(before[settings])[0]}")
    return lines


def write_session_world(session: Path, rig: Rig, settings: Mapping[str, Any]) -> list[str]:
    """Write the calibration of a session's trials beside its file, which is its user's to change.

    Parameters
    ----------
    session : Path
        ``session.toml``.
    rig : Rig
        Of all of its cameras, metres, z up.
    settings : mapping
        What the session says of its recordings.

    Returns
    -------
    list of str
        What was written, and what to change in the session's file.

    Raises
    ------
    InputError
        When it cannot be written; all is as it was then.
    """
    folder = session if session.is_dir() else session.parent
    target = folder / "calibration_world.toml"
    lines = _kept_lines(write_keeping({target: calibration_text(rig)})[target])
    old = [key for key in OLD_TERMS if key in settings]
    also = f", and take {', '.join(f'`{key}`' for key in old)} of the old world out of its [recording]" if old else ""
    return [f"written: {target}", *lines, f'now say calibration = "{target.name}" in the session\'s file{also}: it holds for all trials']


def _kept_lines(kept: Path | None) -> list[str]:
    return [] if kept is None else [f"kept what was there: {kept}"]


def without_old_terms(text: str) -> tuple[str, list[str]]:
    """``recording.toml`` with the old world's terms as comments, and which they were."""
    lines: list[str] = []
    taken: list[str] = []
    for one in statements(text if text.endswith("\n") else text + "\n"):
        old = one.table is None and one.key in OLD_TERMS
        if old and one.key:
            taken.append(one.key)
        lines += [f"# of the world before: {line}" if old else line for line in re.findall(".*\n", one.text)]
    return "".join(lines), taken


def _refuse_other_changes(file: Path, new: str) -> None:
    """Refuse a new text that says more or less than the file does, but for the old world's terms."""
    if not says(new, {key: value for key, value in read_toml_file(file).items() if key not in OLD_TERMS}):
        raise InputError(
            f"{file}: {', '.join(f'`{key}`' for key in OLD_TERMS)} of the old world cannot be taken out of it without changing more, so "
            "nothing is written; write each as KEY = VALUE, without quotes around the key, before the first table, and run this again"
        )
