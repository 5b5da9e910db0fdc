"""What an experiment is: a grid of parameters, a function that computes one cell of it, and a report made of all cells."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmc.experiments.engine.inputs import Inputs

__all__ = ["DIFFERS", "HOLDS", "UNDECIDED", "Cell", "Claim", "Experiment", "Plan", "Report", "Source", "Table"]

#: Of a claim.
HOLDS, UNDECIDED, DIFFERS = "holds", "undecided", "differs"

Parameters = Mapping[str, Any]
Results = dict[str, Any]


@dataclass(frozen=True)
class Source:
    """A recording to compute on.

    Attributes
    ----------
    label : str
        Its name, and a digest of what it depends on: what a cell's parameters hold.
    folder : Path or None
        Where the user's recording lies; None for one that is rendered from a shipped recipe.
    """

    label: str
    folder: Path | None = None

    @property
    def name(self) -> str:
        """The label without the digest."""
        return self.label.rpartition("@")[0]


@dataclass(frozen=True)
class Plan:
    """What a grid depends on.

    Attributes
    ----------
    quick : bool
        A small grid that shows the shape, in minutes.
    recordings : tuple of Source
        The user's recordings, in place of the rendered ones; empty: the rendered ones.
    seeds : int or None
        So many seeds of every cell that has any; None: as many as the experiment has by itself.
    actions : tuple of str
        Of the rendered recordings those of these actions alone; empty: all.
    settings : tuple of (str, value)
        Parameters that all cells have otherwise, as ``("frames", 60)``.
    kept : tuple of (str, value)
        Of the grid the cells that have this value, or one of a list of values, as ``("layers", [1, 3])``.
    """

    quick: bool = False
    recordings: tuple[Source, ...] = ()
    seeds: int | None = None
    actions: tuple[str, ...] = ()
    settings: tuple[tuple[str, Any], ...] = ()
    kept: tuple[tuple[str, Any], ...] = ()

    @property
    def changed(self) -> bool:
        """Whether other seeds, actions, parameters or fewer cells are asked for than the experiment has by itself."""
        return self.seeds is not None or bool(self.actions or self.settings or self.kept)


@dataclass(frozen=True)
class Cell:
    """One computed cell: what it was computed with, what came out, and by which code and in how many seconds; plain values all."""

    parameters: Parameters
    results: Results
    made: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Table:
    """A table of a report, written as CSV and as LaTeX.

    Attributes
    ----------
    name : str
        Of the files.
    caption : str
    rows : sequence of mapping
        Column to value; the first row names the columns. Columns carry their units, the paper's own figures stand beside ours
        in columns that say so. None is an empty place.
    """

    name: str
    caption: str
    rows: Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Claim:
    """Something that the paper shows, and whether it shows here.

    Attributes
    ----------
    text : str
    holds : bool
    detail : str
        The figures that decide.
    undecided : bool
        Whether it does not hold for no other reason than that too little was run: an interval has both sides in it.
    """

    text: str
    holds: bool
    detail: str = ""
    undecided: bool = False

    @property
    def verdict(self) -> str:
        """ "holds", "undecided" or "differs"."""
        return HOLDS if self.holds else UNDECIDED if self.undecided else DIFFERS


@dataclass(frozen=True)
class Report:
    """What is made of an experiment's cells.

    Attributes
    ----------
    tables : tuple of Table
    figures : mapping of str to Figure
        By the name of the files; written as PNG and as PDF.
    claims : tuple of Claim
    """

    tables: tuple[Table, ...] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)
    claims: tuple[Claim, ...] = ()


@dataclass(frozen=True)
class Experiment:
    """An experiment.

    Attributes
    ----------
    id : str
        By which it is run, as "table-4.3".
    title, source : str
        What it shows, and where in the paper.
    grid : callable
        ``grid(plan) -> list of parameters``, one mapping of plain values a cell; no two are equal.
    cell : callable
        ``cell(parameters, inputs, rng) -> results``: plain values (None, bool, int, float, str, lists and dicts of them, arrays). What it
        computes depends on the parameters and on nothing else; `rng` is seeded by them.
    report : callable
        ``report(cells, plan) -> Report``, from the cells in the order of the grid.
    family : str
        Experiments of one family have the same `cell` function and share what is stored; by default an experiment is its own family.
    version : int
        Of the `cell` function: raise it when old cells no longer hold.
    """

    id: str
    title: str
    source: str
    grid: Callable[[Plan], list[dict[str, Any]]]
    cell: Callable[[Parameters, Inputs, np.random.Generator], Results]
    report: Callable[[Sequence[Cell], Plan], Report]
    family: str = ""
    version: int = 1

    @property
    def store_name(self) -> str:
        """Name of the folder of its cells."""
        return self.family or self.id
