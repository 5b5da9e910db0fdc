"""Tables of a TOML file that change values of nested dataclasses: each is checked for its name and its kind.

>>> from dataclasses import dataclass, field
>>> @dataclass(frozen=True)
... class Search:
...     draws: int = 300
>>> @dataclass(frozen=True)
... class Preset:
...     search: Search = field(default_factory=Search)
...     drift_scale: float = 0.7
>>> changed(Preset(), [SettingsTable("my.toml", {"search": {"draws": 100}})])
Preset(search=Search(draws=100), drift_scale=0.7)
>>> changed(Preset(), [SettingsTable("my.toml", {"search": {"drows": 100}})])
Traceback (most recent call last):
hmc.errors.InputError: my.toml: no setting `search.drows`; did you mean `search.draws`?
"""

from __future__ import annotations

import difflib
import math
import reprlib
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

from hmc.errors import InputError
from hmc.io.door import read_toml_file
from hmc.io.files import to_toml

__all__ = ["SettingsTable", "changed", "read_settings_table"]

T = TypeVar("T")
#: What counts more, particles or samples, is a slip: no memory holds it.
MAX_COUNT = 1_000_000


@dataclass(frozen=True)
class SettingsTable:
    """Values that are to take the place of others.

    Parameters
    ----------
    where : str
        The file, for messages.
    values : mapping
        Nested as the dataclasses whose fields they are. What may be left out as a whole (`None`) is left out by ``false``.
    complete : bool
        All values are there, as `run.toml` has them: what may be None and is not there is None.
    """

    where: str
    values: Mapping[str, Any]
    complete: bool = False


def read_settings_table(path: str | Path) -> SettingsTable:
    """Read a TOML file of settings.

    Raises
    ------
    InputError
        When it cannot be read, or there is nothing in it.
    """
    values = read_toml_file(path)
    if not values:
        raise InputError(f"{path}: has no settings in it; leave it out, or name values of the preset (run.toml of a result has them all)")
    return SettingsTable(str(path), values)


def changed(value: T, tables: Sequence[SettingsTable]) -> T:
    """A dataclass, or a mapping of some by name, with the values of tables in place of its own, one table after the other.

    Raises
    ------
    InputError
        When a name or a value is wrong: one line that has all faults of a table.
    """
    for table in tables:
        faults: list[str] = []
        value = _Change(table.complete, faults, tuple(_paths(value))).into(value, table.values, "")
        if faults:
            count = f"{len(faults)} faults: " if len(faults) > 1 else ""
            raise InputError(f"{table.where}: {count}{'; '.join(faults)}")
    return value


@dataclass(frozen=True)
class _Change:
    complete: bool
    faults: list[str]
    paths: tuple[str, ...]

    def into(self, current: Any, table: Any, path: str) -> Any:
        """A dataclass or mapping with the values of a table."""
        if not isinstance(table, Mapping):
            self.faults.append(f"`{path}` must be a table, [{path}]; got {table!r}")
            return current
        parts = current if isinstance(current, Mapping) else {one.name: getattr(current, one.name) for one in fields(current)}
        hints = {} if isinstance(current, Mapping) else _hints(type(current))
        new: dict[str, Any] = {}
        for key, value in table.items():
            if key in parts:
                new[key] = self.converted(value, parts[key], hints.get(key), f"{path}.{key}" if path else key)
            else:
                self.faults.append(self.unknown(key, path, list(parts)))
        if self.complete:
            new |= {key: None for key in parts if key not in table and type(None) in typing.get_args(hints.get(key))}
        if isinstance(current, Mapping):
            return {**current, **new}
        new = {key: value for key, value in new.items() if value is not parts[key]}
        try:
            return replace(current, **new) if new else current
        except InputError as error:
            self.faults.append(f"{f'[{path}] ' if path else ''}{error}")
            return current

    def unknown(self, key: str, path: str, siblings: list[str]) -> str:
        full = f"{path}.{key}" if path else key
        near = difflib.get_close_matches(key, siblings, 1, 0.6)
        elsewhere = [one for one in self.paths if one.rpartition(".")[2] == key]
        if near:
            best = f"{path}.{near[0]}" if path else near[0]
        else:
            best = (elsewhere or difflib.get_close_matches(full, self.paths, 1, 0.0))[0]
        return f"no setting `{full}`; did you mean `{best}`?"

    def converted(self, value: Any, current: Any, hint: Any, path: str) -> Any:
        if current is not None and to_toml({"value": current}) == to_toml({"value": value}):
            return current
        kinds = [kind for kind in _kinds(hint) if kind is not type(None)]
        if value is False and type(None) in _kinds(hint) and bool not in kinds:
            return None
        for kind in kinds or [type(current)]:
            if is_dataclass(kind) and isinstance(kind, type):
                begun = current if is_dataclass(current) else _made(kind)
                if begun is not None:
                    return self.into(begun, value, path)
            found = _plain(value, kind)
            if found is not _WRONG:
                return found
        wanted = " or ".join(_said(kind) for kind in kinds or [type(current)])
        wanted += f" of at most {MAX_COUNT}" if type(value) is int and value > MAX_COUNT else ""
        self.faults.append(f"`{path}` must be {wanted}; got {reprlib.repr(value)}")
        return current


_WRONG = object()
_NAMES = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


def _plain(value: Any, kind: Any) -> Any:
    """The value as of this kind; `_WRONG` where it is none."""
    if typing.get_origin(kind) is Literal:
        return value if value in typing.get_args(kind) else _WRONG
    if typing.get_origin(kind) is tuple and isinstance(value, list):
        inner = typing.get_args(kind)
        inner = (inner[0],) * len(value) if inner[1:] == (...,) else inner
        found = tuple(_plain(one, each) for one, each in zip(value, inner, strict=False))
        return _WRONG if len(inner) != len(value) or any(one is _WRONG for one in found) else found
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value):
        return float(value)
    if kind is int and type(value) is int and value > MAX_COUNT:
        return _WRONG
    return value if kind in (bool, int, str) and type(value) is kind else _WRONG


def _said(kind: Any) -> str:
    if typing.get_origin(kind) is Literal:
        return f"one of {', '.join(map(repr, typing.get_args(kind)))}"
    if typing.get_origin(kind) is tuple:
        inner = [one for one in typing.get_args(kind) if one is not ...]
        if all(one in _NAMES or typing.get_origin(one) is tuple for one in inner):
            return f"a list, of {' and '.join(dict.fromkeys(_said(one) for one in inner))}"
    if is_dataclass(kind):
        return "a table"
    return _NAMES.get(kind, "as the preset has it: it cannot be given in a file")


def _kinds(hint: Any) -> tuple[Any, ...]:
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return typing.get_args(hint)
    return () if hint is None else (hint,)


def _hints(kind: type) -> dict[str, Any]:
    try:
        return typing.get_type_hints(kind)
    except NameError:  # a name that is imported for the type checker alone: the value at hand tells the kind
        return {}


def _made(kind: Any) -> Any:
    try:
        return kind()
    except TypeError:
        return None


def _paths(value: Any, before: str = "") -> Iterator[str]:
    """All settings by their dotted names."""
    parts = value if isinstance(value, Mapping) else {one.name: getattr(value, one.name) for one in fields(value)}
    for name, part in parts.items():
        path = f"{before}.{name}" if before else name
        yield path
        if is_dataclass(part) or isinstance(part, Mapping):
            yield from _paths(part, path)
