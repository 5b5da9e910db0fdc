"""Reports on disk: tables as CSV and LaTeX, figures as PNG and PDF, and what they were made with."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hmc.experiments.engine.experiment import Experiment, Plan, Report, Table
from hmc.experiments.engine.selection import grid_of
from hmc.experiments.engine.store import cell_key, digest
from hmc.io.files import atomic_write
from hmc.io.results import write_run

__all__ = ["report_folder", "to_latex", "write_report"]

_LATEX = {"&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}",
          "^": r"\textasciicircum{}", "\\": r"\textbackslash{}"}  # fmt: skip
#: No dates in the files: the same cells give the same bytes.
_METADATA = {"png": {"Software": None}, "pdf": {"CreationDate": None, "Producer": None, "Creator": None}}


def report_folder(out: Path, experiment: Experiment, plan: Plan) -> Path:
    """Where an experiment's report goes: a quick one, one on the user's recordings and one of other cells never replace the full one."""
    suffix = ("-quick" if plan.quick else "") + ("-own" if plan.recordings else "") + ("-other" if plan.changed else "")
    return out / f"{experiment.id}{suffix}"


def write_report(out: Path, experiment: Experiment, plan: Plan, report: Report) -> Path:
    """Write a report.

    Parameters
    ----------
    out : Path
    experiment : Experiment
    plan : Plan
    report : Report
        Its figures are closed.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    from matplotlib import pyplot as plt

    folder = report_folder(out, experiment, plan)
    for table in report.tables:
        _write_csv(folder / f"{table.name}.csv", table)
        with atomic_write(folder / f"{table.name}.tex") as file:
            file.write(to_latex(table))
    for name, figure in report.figures.items():
        for kind, metadata in _METADATA.items():
            with atomic_write(folder / f"{name}.{kind}", "wb") as file:
                figure.savefig(file, format=kind, metadata=metadata)
        plt.close(figure)
    grid = grid_of(experiment, plan)
    parameters: dict[str, Any] = {
        "title": experiment.title,
        "source": experiment.source,
        "quick": plan.quick,
        "recordings": sorted({str(cell["recording"]) for cell in grid if "recording" in cell}),
        "cells_version": experiment.version,
        "grid": _axes(grid),
        "cells": [cell_key(experiment, cell) for cell in grid],
    }
    if plan.changed:
        parameters["changed"] = _changes(experiment, plan, parameters["cells"])
    claims = [
        {"claim": claim.text, "holds": claim.holds, "detail": claim.detail} | ({"undecided": True} if claim.undecided else {})
        for claim in report.claims
    ]
    captions = {table.name: table.caption for table in report.tables}
    write_run(
        folder / "run.toml", experiment.id, parameters, None, seeds="of each cell, by its parameters", claims=claims,
        figures=list(report.figures), captions=captions,
    )  # fmt: skip
    return folder


def _axes(grid: Sequence[Mapping[str, Any]]) -> dict[str, list]:
    """The values of every parameter in a grid, each once; None, which stands for "has none", is left out."""
    names = dict.fromkeys(name for cell in grid for name in cell)
    return {name: list({digest(cell[name]): cell[name] for cell in grid if cell.get(name) is not None}.values()) for name in names}


def _changes(experiment: Experiment, plan: Plan, keys: Iterable[str]) -> dict[str, Any]:
    """What was asked for otherwise than the experiment has it, and how much of its own grid that is."""
    own = {cell_key(experiment, cell) for cell in experiment.grid(replace(plan, seeds=None, actions=(), settings=(), kept=()))}
    asked = ({"seeds": plan.seeds} if plan.seeds else {}) | ({"actions": list(plan.actions)} if plan.actions else {})
    return {"asked": asked | dict(plan.kept) | dict(plan.settings), "own_cells": len(own), "of_own": len(own.intersection(keys))}


def to_latex(table: Table) -> str:
    """A table as a LaTeX `table` with the rules of the package booktabs."""
    columns = list(table.rows[0]) if table.rows else []
    numeric = [all(isinstance(row.get(name), int | float | None) for row in table.rows) for name in columns]
    lines = [
        r"\begin{table}",
        r"  \centering",
        f"  \\caption{{{_escape(table.caption)}}}",
        f"  \\begin{{tabular}}{{{''.join('r' if number else 'l' for number in numeric)}}}",
        r"    \toprule",
        "    " + " & ".join(_escape(name) for name in columns) + r" \\",
        r"    \midrule",
        *("    " + " & ".join(_escape(_text(row.get(name))) for name in columns) + r" \\" for row in table.rows),
        r"    \bottomrule",
        r"  \end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _write_csv(path: Path, table: Table) -> None:
    with atomic_write(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        columns = list(table.rows[0]) if table.rows else []
        writer.writerow(columns)
        writer.writerows([_text(row.get(name)) for name in columns] for row in table.rows)


def _text(value: Any) -> str:
    """A number with four digits that count, anything else as it is; nothing for None and NaN."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"
    return str(value)


def _escape(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)
