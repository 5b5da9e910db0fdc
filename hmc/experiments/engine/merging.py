"""Cells that several machines computed, brought together in one store."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from hmc.errors import InputError
from hmc.experiments.engine.library import EXPERIMENTS, find_experiment
from hmc.experiments.engine.store import cell_key, digest, read_cell, write_text

__all__ = ["MergeReport", "merge_stores"]


@dataclass(frozen=True)
class MergeReport:
    """What became of the cells of other stores.

    Attributes
    ----------
    copied : int
        Cells that were not here.
    same : int
        Cells that were here with the same results.
    different : tuple of Path
        Cells that were here with other results; ours stay. Measured times differ, anything else means that the code did.
    old : tuple of Path
        Cells that are not named as the experiment names them now: of an earlier version, or altered. They are left.
    damaged : tuple of Path
        Files that are no cells; they are left.
    """

    copied: int
    same: int
    different: tuple[Path, ...] = ()
    old: tuple[Path, ...] = ()
    damaged: tuple[Path, ...] = ()


def merge_stores(out: Path, others: Sequence[Path]) -> MergeReport:
    """Copy the cells of other stores that this one has not, each checked against its name.

    Cells of experiments that are not the package's are copied unchecked.

    Parameters
    ----------
    out : Path
        The store that takes them.
    others : sequence of Path
        As `out`, folders with ``cells``.

    Returns
    -------
    MergeReport

    Raises
    ------
    InputError
        When a folder has no ``cells``, or nothing can be written.
    """
    for other in others:
        if not (other / "cells").is_dir():
            raise InputError(f"{other}: has no folder cells; give the --out of a run")
    experiments: dict[str, list] = {}
    for experiment in map(find_experiment, EXPERIMENTS):
        experiments.setdefault(experiment.store_name, []).append(experiment)
    copied = same = 0
    different, old, damaged = [], [], []
    for path, target in _pairs(out, others):
        try:
            cell = read_cell(path)
        except InputError:
            cell = None
        known = experiments.get(path.parent.name, [])
        text = path.read_text(encoding="utf-8", errors="replace")
        if cell is None:
            damaged.append(path)
        elif known and path.stem not in {cell_key(experiment, cell.parameters) for experiment in known}:
            old.append(path)
        elif not target.exists():
            write_text(target, text)
            copied += 1
        elif _results_of(target) == digest(cell.results):
            same += 1
        else:
            different.append(path)
    return MergeReport(copied, same, tuple(different), tuple(old), tuple(damaged))


def _results_of(path: Path) -> str | None:
    """The digest of the results of a cell that is here; None where it is damaged."""
    try:
        cell = read_cell(path)
    except InputError:
        return None
    return None if cell is None else digest(cell.results)


def _pairs(out: Path, others: Iterable[Path]) -> Iterable[tuple[Path, Path]]:
    """Every cell of other stores, and where it would be here."""
    for other in others:
        if other.exists() and out.exists() and os.path.samefile(other, out):
            continue
        for path in sorted((other / "cells").glob("*/*.json")):
            yield path, out / "cells" / path.parent.name / path.name
