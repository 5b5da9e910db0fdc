"""Figures of single runs, of one clip and one seed each, and the intervals of their means (`hmc.experiments.engine.intervals`)."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence

import numpy as np

from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.intervals import Interval, interval
from hmc.experiments.engine.selection import REPEAT

__all__ = ["RunValues", "gains", "mean_interval", "run_values"]

#: Clip and seed to a figure.
RunValues = Mapping[tuple[str, Hashable], float]


def run_values(cells: Sequence[Cell], value: Callable[[Cell], float], clip: str = "recording") -> dict[tuple[str, Hashable], float]:
    """A figure of every run; one that cannot be told (NaN) is left out.

    Parameters
    ----------
    cells : sequence of Cell
        One a run.
    value : callable
        ``value(cell) -> float``.
    clip : str
        The parameter that says which clip a run is of.
    """
    found = {(str(one.parameters.get(clip, "")), one.parameters.get(REPEAT, 0)): float(value(one)) for one in cells}
    return {run: figure for run, figure in found.items() if np.isfinite(figure)}


def gains(first: RunValues, second: RunValues) -> dict[tuple[str, Hashable], float]:
    """By how much the first figure is larger, run by run, in those that both have."""
    return {run: first[run] - second[run] for run in first if run in second}


def mean_interval(values: RunValues) -> Interval:
    """The mean over runs and its interval over clips and seeds; nothing is known of no run."""
    if not values:
        return Interval(np.nan, -np.inf, np.inf)
    return interval([clip for clip, _ in values], np.array(list(values.values())), np.ones(len(values)))
