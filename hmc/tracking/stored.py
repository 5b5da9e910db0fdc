"""A state as plain values for the journal, and back, whatever its dataclasses hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

__all__ = ["from_plain", "to_plain"]

#: An array of which more is zero than this is stored by its other values.
SPARSE_SHARE = 0.75


def to_plain(value: Any) -> Any:
    """Dataclasses and mappings as dictionaries, tuples as lists, arrays with their type and shape; numbers keep their full precision."""
    if is_dataclass(value):
        return {field.name: to_plain(getattr(value, field.name)) for field in fields(value) if field.init}
    if isinstance(value, Mapping):
        return {name: to_plain(one) for name, one in value.items()}
    if isinstance(value, tuple | list):
        return [to_plain(one) for one in value]
    if isinstance(value, np.ndarray):
        return _plain_array(value)
    return value.item() if isinstance(value, np.generic) else value


def from_plain(kind: Any, plain: Any) -> Any:
    """A value of a type, from what `to_plain` made of it.

    Parameters
    ----------
    kind : type
        A dataclass, or what its fields are annotated with: numbers, strings, arrays, tuples and mappings of these, or None.
    plain : Any
    """
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{name: from_plain(hints[name], one) for name, one in plain.items()})  # type: ignore[operator]
    if kind is np.ndarray:
        return _array(plain)
    origin, inner = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return None if plain is None else from_plain(next(one for one in inner if one is not NoneType), plain)
    if origin is tuple:
        kinds = [inner[0]] * len(plain) if inner[1:] == (...,) else inner
        return tuple(from_plain(one, value) for one, value in zip(kinds, plain, strict=True))
    if origin is not None:
        return {name: from_plain(inner[1], one) for name, one in plain.items()}
    return plain


def _plain_array(array: np.ndarray) -> dict[str, Any]:
    flat = array.ravel()
    plain: dict[str, Any] = {"type": array.dtype.str, "shape": list(array.shape)}
    filled = np.flatnonzero(flat)
    if len(filled) < (1 - SPARSE_SHARE) * flat.size:
        plain["at"], flat = filled.tolist(), flat[filled]
    return plain | {"values": flat.tolist()}


def _array(plain: dict[str, Any]) -> np.ndarray:
    values = np.array(plain["values"], plain["type"])
    if "at" in plain:
        whole = np.zeros(int(np.prod(plain["shape"])), plain["type"])
        whole[np.array(plain["at"], int)] = values
        values = whole
    return values.reshape(plain["shape"])
