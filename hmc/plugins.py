"""A stranger's methods and trackers: Python files outside of the package, which register what they hold when they are run.

Which files there are is kept in the environment, so that every process that this one starts has them too; a process that something else
started is told them (`add_plugins`). The lookups of methods and trackers by name ask for them (`load_plugins`), each file is run once.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from hmc.errors import InputError

__all__ = ["VARIABLE", "add_plugins", "load_plugins", "plugin_files", "plugins_version"]

#: Of the environment: files, as in PATH.
VARIABLE = "HMC_PLUGINS"
_loaded: set[str] = set()


def plugin_files() -> tuple[str, ...]:
    """The files of this process, absolute paths, in order."""
    return tuple(path for path in os.environ.get(VARIABLE, "").split(os.pathsep) if path)


def add_plugins(files: Iterable[str | Path]) -> None:
    """Run files that register methods or trackers, now and in every process that is started from here.

    Parameters
    ----------
    files : iterable of path
        A file that was given before is not run again.

    Raises
    ------
    InputError
        When there is no such file, or it cannot be run.
    """
    known = list(plugin_files())
    new = [path for path in dict.fromkeys(os.path.realpath(file) for file in files) if path not in known]
    for path in new:
        _load(path)
    if new:
        os.environ[VARIABLE] = os.pathsep.join(known + new)


def plugins_version() -> str:
    """A digest of the files' text, by which results know whether these have changed; empty where there are none."""
    files = plugin_files()
    return hashlib.sha256("\0".join(Path(path).read_text(encoding="utf-8") for path in files).encode()).hexdigest()[:16] if files else ""


def load_plugins() -> None:
    """Run the files of the environment that were not run in this process yet.

    Raises
    ------
    InputError
        When there is no such file, or it cannot be run.
    """
    for path in plugin_files():
        _load(path)


def _load(path: str) -> None:
    if path in _loaded:
        return
    spec = importlib.util.spec_from_file_location(f"_hmc_plugin_{Path(path).stem}", path)
    if not path.endswith(".py") or not Path(path).is_file() or spec is None or spec.loader is None:
        raise InputError(f"plugin {path}: there is no such Python file (its name ends with .py)")
    module = importlib.util.module_from_spec(spec)
    _loaded.add(path)  # before it is run: it may ask for methods itself
    # Classes of the file may be looked up by the name of their module, as dataclasses do.
    sys.modules[module.__name__] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        _loaded.discard(path)
        del sys.modules[module.__name__]
        raise InputError(f"plugin {path}: {type(error).__name__}: {error}") from error
