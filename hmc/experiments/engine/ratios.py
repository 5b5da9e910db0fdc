"""Figures of groups of runs: ratios of sums over clips and seeds, and by how much one group's is larger than another's."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence

import numpy as np

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.intervals import Interval, difference, interval
from hmc.experiments.engine.selection import REPEAT

__all__ = ["Parts", "clip_and_seed", "ratio_gain", "ratio_interval"]

#: A run's numerator and denominator, as the sum of its errors and how many.
Parts = Callable[[Cell], tuple[float, float]]


def clip_and_seed(one: Cell) -> tuple[str, int]:
    """Of which clip a run is, and with which seed: what else differs was chosen, not drawn, and is taken together."""
    return str(one.parameters.get("recording", "")), int(one.parameters.get(REPEAT, 0))


def ratio_interval(cells: Sequence[Cell], parts: Parts) -> Interval:
    """A figure of some runs together, and its interval over clips and seeds.

    Parameters
    ----------
    cells : sequence of Cell
    parts : callable
        ``parts(cell)`` is a run's share of the numerator and of the denominator.
    """
    runs = list(dict.fromkeys(map(clip_and_seed, cells)))
    return interval([clip for clip, _ in runs], *_sums(zip(map(clip_and_seed, cells), cells, strict=True), runs, parts))


def ratio_gain(
    larger: Sequence[Cell],
    smaller: Sequence[Cell],
    parts: Parts,
    agree: Callable[[Cell], Hashable] = clip_and_seed,
    smaller_parts: Parts | None = None,
) -> Interval:
    """By how much a figure of some runs is larger than that of others, and its interval, over all pairs of runs that agree.

    Parameters
    ----------
    larger, smaller : sequence of Cell
        A run that agrees with several of the others is compared with each.
    parts : callable
        As for `ratio_interval`.
    agree : callable
        In what both runs of a pair must be equal.
    smaller_parts : callable, optional
        Of the second group; where left out, as of the first.

    Raises
    ------
    InputError
        When no two runs agree.
    """
    others: dict[Hashable, list[Cell]] = {}
    for one in smaller:
        others.setdefault(agree(one), []).append(one)
    pairs = [(one, other) for one in larger for other in others.get(agree(one), [])]
    if not pairs:
        raise InputError("groups are compared run by run, and no two of these agree")
    own = [clip_and_seed(one) for one, _ in pairs]
    runs = list(dict.fromkeys(own))
    first, second = (zip(own, cells, strict=True) for cells in zip(*pairs, strict=True))
    return difference([clip for clip, _ in runs], _sums(first, runs, parts), _sums(second, runs, smaller_parts or parts))


def _sums(cells: Iterable[tuple[tuple[str, int], Cell]], runs: Sequence[tuple[str, int]], parts: Parts) -> tuple[np.ndarray, np.ndarray]:
    """Numerators and denominators, one a clip and seed."""
    place, sums = {run: k for k, run in enumerate(runs)}, np.zeros((2, len(runs)))
    for run, one in cells:
        sums[:, place[run]] += parts(one)
    return sums[0], sums[1]
