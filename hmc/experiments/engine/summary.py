"""What is on disk of every experiment, and how it compares with its paper: what the page shows."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmc.errors import InputError
from hmc.experiments.engine.catalogue import CATALOGUE, OWN_REASONS, UNKNOWN, Entry
from hmc.experiments.engine.experiment import DIFFERS, HOLDS, UNDECIDED, Claim, Experiment, Plan, Source
from hmc.experiments.engine.library import EXPERIMENTS, find_experiment
from hmc.experiments.engine.writing import report_folder
from hmc.io.results import read_run

__all__ = [
    "CHANGED", "IN_FULL", "IN_PART", "MISSING", "NOT_RUN", "OURS", "QUICK", "REPRODUCED", "SCOPES", "SHOWN", "Row",
    "StoredRun", "StoredTable", "summarise",
]  # fmt: skip

#: Of a row, besides what a claim can be.
REPRODUCED, SHOWN = "reproduced", "shown"
NOT_RUN, MISSING = "not computed yet", "no experiment yet"
#: How much of an experiment a run is: its own grid, cells of that and no others, its quick grid, or other seeds and parameters.
IN_FULL, IN_PART, QUICK, CHANGED = "in full", "in part", "quick", "changed"
#: Which run counts, where there are several.
SCOPES = (IN_FULL, IN_PART, QUICK, CHANGED)
#: Experiments without a paper come last.
OURS = "Beyond the papers"


@dataclass(frozen=True)
class StoredTable:
    """A table as it was written: its caption, its columns and its rows, all of them text."""

    name: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class StoredRun:
    """What one run left.

    Attributes
    ----------
    folder : Path
    scope : str
        One of `SCOPES`.
    what : str
        How it was run: in full or quick, with what changed, on which recordings.
    recordings : tuple of str
        Their names; none where it was computed on no recording.
    claims : tuple of Claim
    tables : tuple of StoredTable
    pictures : tuple of Path
        PNG files.
    versions : mapping of str to str
        Of the libraries.
    """

    folder: Path
    scope: str
    what: str
    recordings: tuple[str, ...]
    claims: tuple[Claim, ...]
    tables: tuple[StoredTable, ...]
    pictures: tuple[Path, ...]
    versions: dict[str, str]


@dataclass(frozen=True)
class Row:
    """An experiment in the report.

    Attributes
    ----------
    entry : Entry
    verdict : str
        One of the constants of this module, of the run that counts, the first of `SCOPES`. `REPRODUCED` where everything that a paper
        shows holds in a run in full; `HOLDS` where it does in less than that, and in full where it is no paper's. `UNDECIDED` where some
        of it is, and nothing differs.
    results : tuple of StoredRun
        The run that counts, then one on the user's recordings; either may be missing.
    """

    entry: Entry
    verdict: str
    results: tuple[StoredRun, ...] = ()

    @property
    def label(self) -> str:
        """The verdict, and in how much it was found where that has to be said: "quick, holds", "in full, differs"."""
        return f"{self.results[0].scope}, {self.verdict}" if self.verdict in (HOLDS, UNDECIDED, DIFFERS) else self.verdict

    @property
    def differing(self) -> tuple[Claim, ...]:
        """Claims of the paper's that do not hold in the run that counts, undecided ones among them."""
        return tuple(claim for claim in self.results[0].claims if not claim.holds) if self.results else ()

    @property
    def why(self) -> str:
        """Why it differs or what has to be known of what holds, and over how much what is undecided is."""
        told = []
        if self.verdict == DIFFERS:
            told.append(f"Why it differs, as far as known: {self.entry.why or UNKNOWN}")
        elif self.results and self.entry.why:
            told.append(self.entry.why)
        if any(claim.undecided for claim in self.differing):
            n = len(self.results[0].recordings)
            over = f"{n} recording{'s' * (n > 1)}" if n else "its runs"
            told.append(f"Undecided: the interval over {over} has both in it, that it is so and that it is not.")
        return " ".join(told)


def summarise(out: Path) -> list[Row]:
    """All rows, in the order of the papers.

    Parameters
    ----------
    out : Path
        Folder of the reports, as `run` wrote them; those of cells of an earlier version are left out.

    Returns
    -------
    list of Row

    Raises
    ------
    InputError
        When a `run.toml` there is damaged.
    """
    known = {entry.id for entry in CATALOGUE}
    own = [_own_entry(name) for name in EXPERIMENTS if name not in known]
    return [_row(out, entry) for entry in (*CATALOGUE, *own)]


def _own_entry(name: str) -> Entry:
    experiment = find_experiment(name)
    return Entry(name, OURS, experiment.title, experiment.source, why=OWN_REASONS.get(name, ""))


def _row(out: Path, entry: Entry) -> Row:
    if entry.id not in EXPERIMENTS:
        return Row(entry, MISSING)
    experiment = find_experiment(entry.id)
    results = []
    for own in ((), (Source("any@0"),)):
        folders = [report_folder(out, experiment, Plan(quick, own, seeds)) for seeds in (None, 1) for quick in (False, True)]
        runs = [(folder, read_run(folder / "run.toml")) for folder in folders if (folder / "run.toml").is_file()]
        found = [_result(folder, run) for folder, run in runs if not _is_old(experiment, run)]
        results += sorted(found, key=lambda run: SCOPES.index(run.scope))[:1]
    if not results:
        return Row(entry, NOT_RUN)
    return Row(entry, _verdict(entry, results[0]), tuple(results))


def _verdict(entry: Entry, run: StoredRun) -> str:
    if not run.claims:
        return SHOWN
    if any(claim.verdict == DIFFERS for claim in run.claims):
        return DIFFERS
    if any(claim.undecided for claim in run.claims):
        return UNDECIDED
    return REPRODUCED if run.scope == IN_FULL and entry.work != OURS else HOLDS


def _is_old(experiment: Experiment, run: Mapping[str, Any]) -> bool:
    """Whether a run is of cells of an earlier version, which no longer hold."""
    version = run.get("parameters", {}).get("cells_version")
    return version is not None and version != experiment.version


def _result(folder: Path, run: Mapping[str, Any]) -> StoredRun:
    parameters: dict[str, Any] = run.get("parameters", {})
    try:
        claims = tuple(
            Claim(one["claim"], one["holds"], one.get("detail", ""), one.get("undecided", False)) for one in run.get("claims", [])
        )
    except (KeyError, TypeError) as error:
        raise InputError(f"{folder / 'run.toml'}: its claims cannot be read; run the experiment again") from error
    names = tuple(source.rpartition("@")[0] for source in parameters.get("recordings", []))
    scope, what = _scope(folder, parameters)
    if names:
        what += f", on {', '.join(names)}"
    captions = run.get("captions", {})
    tables = (_table(path, captions.get(path.stem, "")) for path in _in_order(folder, "csv", list(captions)))
    pictures = _in_order(folder, "png", run.get("figures", []))
    return StoredRun(folder, scope, what, names, claims, tuple(tables), tuple(pictures), run.get("versions", {}))


def _scope(folder: Path, parameters: dict[str, Any]) -> tuple[str, str]:
    """How much of its experiment a run is, in a word and in figures."""
    quick, changed, n = parameters.get("quick", False), parameters.get("changed"), len(parameters.get("cells", {}))
    if changed is None and not folder.name.endswith("-other"):
        return QUICK if quick else IN_FULL, f"{QUICK if quick else IN_FULL}, {n} cells"
    changed = changed or {}
    own, total = changed.get("of_own", 0), changed.get("own_cells", 0)
    scope = IN_PART if n and own == n and not quick else CHANGED
    what = f"{scope}, {n} cells, {own} of the {total} of the {QUICK if quick else 'full'} grid" if total else f"{scope}, {n} cells"
    asked = [f"{name} = {value}" for name, value in changed.get("asked", {}).items()]
    return scope, f"{what}, with {', '.join(asked)}" if asked else what


def _in_order(folder: Path, kind: str, names: list[str]) -> Iterator[Path]:
    """Files of a kind, in the order of the report that wrote them; nothing that an earlier form of the experiment left."""
    for path in [folder / f"{name}.{kind}" for name in names] or sorted(folder.glob(f"*.{kind}")):
        if path.is_file():
            yield path


def _table(path: Path, caption: str) -> StoredTable:
    with open(path, encoding="utf-8", newline="") as file:
        rows = [tuple(row) for row in csv.reader(file)]
    return StoredTable(path.stem, caption, rows[0] if rows else (), tuple(rows[1:]))
