"""Writing files so that a reader never sees half of one, and plain values as TOML."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any

from hmc.errors import InputError

__all__ = ["atomic_write", "matching", "part_path", "real_path", "sibling", "sweep", "to_toml", "write_figure", "write_toml"]

#: Names of files that are being written: of which machine and process.
_PART = re.compile(r"\..*\.([0-9a-f]{8})-(\d+)\.part(\..*)?")


def matching(folder: Path, pattern: str) -> list[Path]:
    """What fits a pattern that a user wrote, in the order of names.

    Raises
    ------
    InputError
        When it is no pattern for what is in a folder; the message is the fault alone, for a line that says where it stands.
    """
    try:
        return sorted(folder.glob(pattern))
    except (ValueError, NotImplementedError, IndexError, re.error) as error:
        raise InputError(str(error)) from None


def real_path(path: str | Path) -> Path:
    """The absolute path without links: `Path.resolve`, which raises no `InputError` where a link leads to itself; such a link stays."""
    return Path(os.path.realpath(path))


@contextmanager
def atomic_write(path: str | Path, mode: str = "w") -> Iterator[IO[Any]]:
    """Open a file that appears under its name only when it is complete.

    Parameters
    ----------
    path : path
        Where the file is to be; folders are made.
    mode : {"w", "wb"}

    Yields
    ------
    file
        A sibling of `path`; renamed to `path` on success, removed when the block raises.

    Raises
    ------
    InputError
        When the file system does not let it be written: no permission, no space, a file where a folder should be.
    """
    path = Path(path)
    text: dict[str, Any] = {} if "b" in mode else {"encoding": "utf-8", "newline": ""}
    with sibling(path) as temporary, open(temporary, mode, **text) as file:
        yield file


@contextmanager
def sibling(path: str | Path) -> Iterator[Path]:
    """The name of a file beside `path` (same suffix) to be written in the block; renamed to `path` on success, removed when it raises.

    For writers that want a name and no open file; otherwise `atomic_write`.

    Raises
    ------
    InputError
        As for `atomic_write`.
    """
    path = Path(path)
    temporary = part_path(path)
    try:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            sweep(path.parent)
            yield temporary
            os.replace(temporary, path)
        finally:
            with suppress(OSError):
                temporary.unlink()
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_figure(path: str | Path, figure: Any, dpi: float) -> None:
    """Write a matplotlib figure, by the path's suffix, into a folder that is there; it appears under its name when it is complete.

    Raises
    ------
    InputError
        When it cannot be written, or not as a picture of that kind.
    """
    path = Path(path)
    if path.suffix[1:].lower() not in figure.canvas.get_supported_filetypes():
        raise InputError(f"{path}: the picture cannot be written (the name of one ends in .png, .jpg, .pdf or .svg)")
    temporary = part_path(path)
    try:
        sweep(path.parent)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)  # a name in a script that the font lacks is boxes
            figure.savefig(temporary, dpi=dpi)
        os.replace(temporary, path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: the picture cannot be written ({getattr(error, 'strerror', None) or error})") from None
    finally:
        with suppress(OSError):
            temporary.unlink()


@cache
def _machine() -> str:
    """Eight letters for this machine: others that write into the same folder have processes of the same numbers."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def part_path(path: Path) -> Path:
    """Beside a file or folder, the name under which this process makes it."""
    return path.with_name(f".{path.stem}.{_machine()}-{os.getpid()}.part{path.suffix}")


@cache
def sweep(folder: Path) -> None:
    """Remove what killed processes of this machine left half-made (`part_path`) in a folder; once a process.

    Raises
    ------
    OSError
        When the folder cannot be read.
    """
    for one in folder.iterdir():
        made = _PART.fullmatch(one.name)
        if made and made[1] == _machine() and not _alive(int(made[2])):
            with suppress(OSError):
                shutil.rmtree(one) if one.is_dir() else one.unlink()


def _alive(pid: int) -> bool:
    if os.name == "nt":
        return True  # a signal of 0 would end the process there
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True  # another user's
    return True


def write_toml(path: str | Path, values: Mapping[str, Any]) -> None:
    """Write nested plain values as TOML, atomically."""
    text = to_toml(values)
    with atomic_write(path) as file:
        file.write(text)


def to_toml(values: Mapping[str, Any]) -> str:
    """Nested plain values as TOML text: plain keys of a table first, then its sub-tables. What is None is left out.

    Raises
    ------
    TypeError
        When a value has no form in TOML.
    """
    lines: list[str] = []
    _toml_table(_plain(values), "", lines)
    return "\n".join(lines).strip("\n") + "\n"


def _toml_table(table: Mapping[str, Any], prefix: str, lines: list[str]) -> None:
    lines.extend(f"{_toml_key(key)} = {_toml_value(value)}" for key, value in table.items() if not isinstance(value, dict))
    for key, value in table.items():
        if isinstance(value, dict):
            name = f"{prefix}.{_toml_key(key)}" if prefix else _toml_key(key)
            lines.extend(["", f"[{name}]"])
            _toml_table(value, name, lines)


def _toml_key(key: str) -> str:
    bare = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if bare else _toml_value(key)


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)  # Python writes nan, inf and exponents as TOML does
    if isinstance(value, str):
        text = value.encode(errors="backslashreplace").decode()  # a file's name may be no text, and a note holds it
        return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(_toml_value(item) for item in value) + "]"
    return "{ " + ", ".join(f"{_toml_key(key)} = {_toml_value(item)}" for key, item in value.items()) + " }"


def _plain(value: Any) -> Any:
    """Dataclasses, mappings, sequences, arrays and paths as nested dicts, lists, strings and numbers, without None."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if hasattr(value, "tolist"):  # NumPy's arrays and numbers; a command that only explains itself does without NumPy
        value = value.tolist()
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value if item is not None]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, str | bool | int | float):
        return value
    raise TypeError(f"{type(value).__name__} has no form in TOML")
