"""Where computed cells are kept: one file a cell, named by a hash of its parameters.

A file appears under its name only when it is whole, so a run that is killed loses the cells in flight and no other. The name depends on
the parameters alone, so what several machines computed is merged by copying their files into one folder.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Experiment
from hmc.io.door import read_json_file
from hmc.io.files import atomic_write

__all__ = ["cell_key", "cell_path", "cell_rng", "cell_text", "digest", "read_cell", "write_text"]


def digest(value: Any, length: int = 24) -> str:
    """A name for plain values: hexadecimal digits that depend on the values alone, not on the order of keys nor on the machine."""
    return hashlib.sha256(_canonical(value).encode()).hexdigest()[:length]


def cell_key(experiment: Experiment, parameters: Mapping[str, Any]) -> str:
    """The name of a cell, shape of 24 hexadecimal digits.

    Raises
    ------
    InputError
        When a parameter is no plain value.
    """
    return digest([experiment.store_name, experiment.version, dict(parameters)])


def cell_rng(key: str) -> np.random.Generator:
    """The random numbers of a cell: the same on every machine, whoever computes it and when."""
    return np.random.default_rng(np.random.SeedSequence(int(key, 16)))


def cell_path(out: Path, experiment: Experiment, key: str) -> Path:
    """Where a cell is or will be."""
    return out / "cells" / experiment.store_name / f"{key}.json"


def cell_text(parameters: Mapping[str, Any], results: Mapping[str, Any], made: Mapping[str, Any] | None = None) -> str:
    """What the file of a cell holds; numbers keep their full precision, and `made` says by which code and in how many seconds.

    A digest of parameters and results tells a file that was changed since.

    Raises
    ------
    InputError
        When a result is no plain value.
    """
    content: dict[str, Any] = {"parameters": dict(parameters), "results": dict(results)}
    content |= {"digest": _sum(json.loads(_canonical(content)))} | ({"made": dict(made)} if made else {})
    return _canonical(content, indent=1) + "\n"


def _sum(content: Mapping[str, Any]) -> str:
    return digest([content["parameters"], content["results"]])


def write_text(path: Path, text: str) -> None:
    """Store a cell's text, which appears when it is whole.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    with atomic_write(path) as file:
        file.write(text)


def read_cell(path: Path) -> Cell | None:
    """A stored cell; None where there is none.

    Raises
    ------
    InputError
        When the file is damaged.
    """
    if not os.path.lexists(path):
        return None
    try:
        content = read_json_file(path)
        made = content.get("made", {})
        seconds = made.get("seconds", 0.0)
        if isinstance(seconds, bool) or not (isinstance(seconds, int | float) and 0 <= seconds < math.inf):
            raise TypeError(f"`seconds` must be a number, 0 or more; got {seconds!r:.40}")
        if not isinstance(content["parameters"], dict) or not isinstance(content["results"], dict):
            raise TypeError("parameters and results must be tables")
        if content["digest"] != _sum(content):
            raise TypeError("changed since it was computed")
        return Cell(content["parameters"], content["results"], made)
    except InputError as error:
        raise InputError(f"{error}; delete the file to compute it again") from None
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a cell of an experiment ({error}); delete the file to compute it again") from error


def _canonical(value: Any, indent: int | None = None) -> str:
    try:
        separators = (",", ":") if indent is None else None
        return json.dumps(value, sort_keys=True, default=_plain, indent=indent, separators=separators)
    except TypeError as error:
        raise InputError(f"cells hold plain values only: {error}") from error


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is none")
