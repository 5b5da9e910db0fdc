"""What is on disk of every experiment, and how it compares with its paper: what the page and the booklet show."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmc.errors import InputError
from hmc.experiments.engine.catalogue import CATALOGUE, OWN_REASONS, UNKNOWN, Entry
from hmc.experiments.engine.experiment import Claim, Plan, Source
from hmc.experiments.engine.library import EXPERIMENTS, find_experiment
from hmc.experiments.engine.writing import report_folder
from hmc.io.results import read_run

__all__ = ["DIFFERS", "MISSING", "NOT_RUN", "OURS", "REPRODUCED", "SHOWN", "Row", "StoredRun", "StoredTable", "summarise"]

REPRODUCED, DIFFERS, SHOWN = "reproduced", "differs", "shown"
NOT_RUN, MISSING = "not computed yet", "no experiment yet"
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
    what : str
        How it was run: in full or quick, on which recordings.
    claims : tuple of Claim
    tables : tuple of StoredTable
    pictures : tuple of Path
        PNG files.
    versions : mapping of str to str
        Of the libraries.
    """

    folder: Path
    what: str
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
        One of the constants of this module, of the run that counts: in full before quick.
    results : tuple of StoredRun
        The run that counts, then one on the user's recordings; either may be missing.
    """

    entry: Entry
    verdict: str
    results: tuple[StoredRun, ...] = ()

    @property
    def differing(self) -> tuple[Claim, ...]:
        """Claims of the paper's that do not hold in the run that counts."""
        return tuple(claim for claim in self.results[0].claims if not claim.holds) if self.results else ()

    @property
    def why(self) -> str:
        """Why it differs, as far as known; empty where it does not."""
        return (self.entry.why or UNKNOWN) if self.differing else ""


def summarise(out: Path) -> list[Row]:
    """All rows, in the order of the papers.

    Parameters
    ----------
    out : Path
        Folder of the reports, as `run` wrote them.

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
        folders = [report_folder(out, experiment, Plan(quick, own)) for quick in (False, True)]
        found = next((folder for folder in folders if (folder / "run.toml").is_file()), None)
        if found is not None:
            results.append(_result(found))
    if not results:
        return Row(entry, NOT_RUN)
    claims = results[0].claims
    verdict = SHOWN if not claims else REPRODUCED if all(claim.holds for claim in claims) else DIFFERS
    return Row(entry, verdict, tuple(results))


def _result(folder: Path) -> StoredRun:
    run = read_run(folder / "run.toml")
    parameters: dict[str, Any] = run.get("parameters", {})
    try:
        claims = tuple(Claim(one["claim"], one["holds"], one.get("detail", "")) for one in run.get("claims", []))
    except (KeyError, TypeError) as error:
        raise InputError(f"{folder / 'run.toml'}: its claims cannot be read; run the experiment again") from error
    names = [source.rpartition("@")[0] for source in parameters.get("recordings", [])]
    what = f"{'quick' if parameters.get('quick') else 'in full'}, {len(parameters.get('cells', {}))} cells"
    if names:
        what += f", on {', '.join(names)}"
    captions = run.get("captions", {})
    tables = (_table(path, captions.get(path.stem, "")) for path in _in_order(folder, "csv", list(captions)))
    pictures = _in_order(folder, "png", run.get("figures", []))
    return StoredRun(folder, what, claims, tuple(tables), tuple(pictures), run.get("versions", {}))


def _in_order(folder: Path, kind: str, names: list[str]) -> Iterator[Path]:
    """Files of a kind, in the order of the report that wrote them; nothing that an earlier form of the experiment left."""
    for path in [folder / f"{name}.{kind}" for name in names] or sorted(folder.glob(f"*.{kind}")):
        if path.is_file():
            yield path


def _table(path: Path, caption: str) -> StoredTable:
    with open(path, encoding="utf-8", newline="") as file:
        rows = [tuple(row) for row in csv.reader(file)]
    return StoredTable(path.stem, caption, rows[0] if rows else (), tuple(rows[1:]))
