"""Writing into what a user wrote: what was there stays under another name, and where writing fails all is as it was."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

from hmc.errors import InputError
from hmc.io.files import sibling

__all__ = ["write_keeping"]

#: So many names of what was there before are tried.
MOST_KEPT = 1000


def write_keeping(texts: Mapping[Path, str]) -> dict[Path, Path | None]:
    """Write files, and keep what was there before beside each: all of them, or none.

    Every text is written in full under another name first, then what was there gets its second name (``NAME_before``, ``NAME_before_2`` and
    so on), and only then do the new files take its place: there is no moment at which a file is missing.

    Parameters
    ----------
    texts : mapping of Path to str
        What is to be in each file; folders are made.

    Returns
    -------
    dict of Path to Path or None
        Where what was in each is kept; None where nothing was there.

    Raises
    ------
    InputError
        When the file system does not let one be written or kept: no space, no permission. Then all is as it was.
    """
    kept: dict[Path, Path | None] = {}
    with ExitStack() as undo:
        with ExitStack() as parts:
            for path, text in texts.items():
                for folder in reversed([one for one in path.parents if not os.path.exists(one)]):
                    undo.callback(_remove_empty, folder)
                with open(parts.enter_context(sibling(path)), "w", encoding="utf-8", newline="") as file:
                    file.write(text)
            for path in texts:
                kept[path] = _keep(path)
                undo.callback(_put_back, path, kept[path])
        undo.pop_all()
    return kept


def _keep(file: Path) -> Path | None:
    """Give what is there a second name that is free, and tell it; None where nothing is there."""
    if not os.path.lexists(file):
        return None
    names = (file.with_stem(f"{file.stem}_before{'' if n == 1 else f'_{n}'}") for n in range(1, MOST_KEPT))
    kept = next((name for name in names if not os.path.lexists(name)), None)
    if kept is None:
        raise InputError(f"{file}: cannot be kept, as {MOST_KEPT - 1} of its kind are beside it; move some of them away")
    try:
        _second_name(file, kept)
    except OSError as error:
        with suppress(OSError):
            kept.unlink(missing_ok=True)
        raise InputError(f"{file}: cannot be kept as {kept.name} ({error.strerror or error}), so nothing is written") from error
    return kept


def _second_name(file: Path, kept: Path) -> None:
    """A link, which takes no space; a copy where the file system has none, and of what is a link itself."""
    if not file.is_symlink():
        with suppress(OSError):
            os.link(file, kept)
            return
    shutil.copy2(file, kept, follow_symlinks=False)


def _put_back(path: Path, kept: Path | None) -> None:
    with suppress(OSError):
        if kept is None:
            path.unlink(missing_ok=True)
        else:
            os.replace(kept, path)
            kept.unlink(missing_ok=True)  # two names of one file are left as they are by a renaming


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
