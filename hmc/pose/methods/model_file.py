"""A user's own scalable model from a TOML file."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hmc.body.joints import DOF_NAMES
from hmc.body.scalable_models import Inclusive, Model, Union, Unitive
from hmc.errors import InputError
from hmc.io.door import read_toml_file

__all__ = ["read_hierarchy"]

_KEYS = {"inclusive": ("kind", "name", "held", "thinning", "model"), "unitive": ("kind", "name", "leaf", "union", "needs")}
_MODEL_KEYS = ("name", "angles", "parts")
_UNION_KEYS = (*_MODEL_KEYS, "of")


def read_hierarchy(path: str | Path) -> Inclusive | Unitive:
    """Read a hierarchy; docs/scalable.md describes the form.

    A joint's name, such as ``r_shoulder``, stands for all of its angles. A union without angles and parts takes those of its members.

    Parameters
    ----------
    path : path
        A TOML file.

    Raises
    ------
    InputError
        When there is no such file, it is no TOML, a key is unknown, or the relation between the models does not hold.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; a model is 1, 2, auto or a TOML file")
    content = read_toml_file(path)
    kind = content.get("kind")
    if not isinstance(kind, str) or kind not in _KEYS:
        raise InputError(f"{path}: `kind` must be 'inclusive' or 'unitive'; got {kind!r}")
    _check_keys(content, _KEYS[kind], str(path))
    name, needed = content.get("name", path.stem), content.get("needs", [])
    if not isinstance(name, str) or not isinstance(needed, list):
        raise InputError(f'{path}: `name` must be text, and `needs` a list of pairs of leaves, [["r_shank", "r_thigh"]]')
    try:
        if kind == "inclusive":
            models = tuple(_model(item, f"[[model]] {k + 1}") for k, item in enumerate(_tables(content, "model")))
            return Inclusive(name, models, content.get("held", "last"), content.get("thinning", 1))
        leaves = [_model(item, f"[[leaf]] {k + 1}") for k, item in enumerate(_tables(content, "leaf"))]
        known, unions = {leaf.name: leaf for leaf in leaves}, []
        for k, item in enumerate(_tables(content, "union")):
            unions.append(_union(item, known, f"[[union]] {k + 1}"))
            known[unions[-1].model.name] = unions[-1].model
        needs = tuple(tuple(_texts({"needs": pair}, "needs", "the top")) for pair in needed)
        if any(len(pair) != 2 for pair in needs):
            raise InputError('`needs` must be pairs of leaves, [["r_shank", "r_thigh"]]')
        return Unitive(name, tuple(leaves), tuple(unions), needs)  # type: ignore[arg-type]
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _check_keys(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, 1, 0.0)[0]
            raise InputError(f"{where}: unknown key `{key}`; did you mean `{near}`? (known: {', '.join(known)})")


def _tables(content: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    tables = content.get(key, [])
    if not isinstance(tables, list) or not all(isinstance(item, dict) for item in tables):
        raise InputError(f"`{key}` must be tables, each under its own line [[{key}]]")
    return tables


def _texts(table: Mapping[str, Any], key: str, where: str) -> tuple[str, ...]:
    values = table.get(key)
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise InputError(f'{where}: `{key}` must be a list of names, ["...", "..."]; got {values!r}')
    return tuple(values)


def _model(table: Mapping[str, Any], where: str, keys: tuple[str, ...] = _MODEL_KEYS) -> Model:
    _check_keys(table, keys, where)
    if not isinstance(table.get("name"), str):
        raise InputError(f"{where}: needs a `name`")
    angles = [dof for name in _texts(table, "angles", where) for dof in _angles(name)]
    return Model(table["name"], tuple(angles), _texts(table, "parts", where))


def _angles(name: str) -> list[str]:
    """A joint's angles, or the one that is named."""
    return [dof for dof in DOF_NAMES if dof.rpartition("_")[0] == name] or [name]


def _union(table: Mapping[str, Any], known: Mapping[str, Model], where: str) -> Union:
    of = _texts(table, "of", where)
    members = [known[name] for name in of if name in known]
    filled = dict(table)
    filled.setdefault("angles", [angle for one in members for angle in one.angles])
    filled.setdefault("parts", [part for one in members for part in one.parts])
    return Union(_model(filled, where, _UNION_KEYS), of)
