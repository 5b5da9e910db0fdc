"""Scores of trackers with their intervals, and trackers compared on the same clips and seeds (`hmc.experiments.engine.intervals`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Claim
from hmc.experiments.engine.intervals import Interval, difference, interval
from hmc.experiments.engine.selection import REPEAT

__all__ = ["SCORES", "ahead", "gain", "is_followed", "score_interval"]

#: By name, the unit and whether less is better.
SCORES = {
    "MOTA": ("%", False),
    "MOTP": ("mm", True),
    "centroid MOTP": ("mm", True),
    "mismatches": ("% of positions", True),
    "filter": ("ms a person and frame", True),
}


def score_interval(cells: Sequence[Cell], score: str) -> Interval:
    """A score of some runs together, and its interval over clips and seeds.

    Parameters
    ----------
    cells : sequence of Cell
        Of `hmc.experiments.tracking_runs`.
    score : str
        One of `SCORES`.
    """
    keys = list(dict.fromkeys(map(_run, cells)))
    sums, counts = _sums([(_run(one), one) for one in cells], keys, score)
    return interval([clip for clip, _ in keys], sums, counts)


def gain(better: Sequence[Cell], worse: Sequence[Cell], score: str, by: Sequence[str]) -> Interval:
    """By how much a score of some runs is better than that of others, and its interval, over the pairs of runs that agree.

    Parameters
    ----------
    better, worse : sequence of Cell
    score : str
        One of `SCORES`; where less is better, the gain is how much less it is.
    by : sequence of str
        Parameters in which a pair must agree. Where a run agrees with several of the others it is compared with each.

    Raises
    ------
    InputError
        When no two runs agree.
    """
    pairs = [(one, other) for one in better for other in worse if all(one.parameters[name] == other.parameters[name] for name in by)]
    if not pairs:
        raise InputError(f"runs are compared pair by pair, and no two of these agree in {', '.join(by)}")
    keys = list(dict.fromkeys(_run(one) for one, _ in pairs))
    first = _sums([(_run(one), one) for one, _ in pairs], keys, score)
    second = _sums([(_run(one), other) for one, other in pairs], keys, score)
    less_is_better = SCORES[score][1]
    return difference([clip for clip, _ in keys], *((second, first) if less_is_better else (first, second)))


def ahead(text: str, better: Sequence[Cell], worse: Sequence[Cell], score: str, by: Sequence[str]) -> Claim:
    """The claim that some runs have a better score than others: it holds where the interval of the gain is above 0 and people are followed.

    Parameters
    ----------
    text : str
    better, worse, score, by
        As for `gain`. Without runs on either side nothing is claimed.
    """
    if not better or not worse:
        return Claim(text, False, "no runs to compare")
    found, unit = gain(better, worse, score, by), SCORES[score][0]
    followed = is_followed(better)
    detail = f"{score} {score_interval(better, score)} for {score_interval(worse, score)}: better by {found} {unit}"
    return Claim(text, found.above_zero and followed, detail if followed else f"{detail}; people are not followed")


def is_followed(cells: Sequence[Cell]) -> bool:
    """Whether people are followed at all: the interval of MOTA is above 0. Nothing is claimed of runs that are lost."""
    values = [one.results["head"] for one in cells]
    known = sum(one["objects"] - one["misses"] - one["false_positives"] - one["mismatches"] for one in values)
    return known > 0 and bool(score_interval(cells, "MOTA").low > 0 or len({_run(one) for one in cells}) < 2)


def _run(one: Cell) -> tuple[str, int]:
    """Clip and seed: what else differs was chosen, not drawn, and is taken together."""
    return str(one.parameters["recording"]), int(one.parameters.get(REPEAT, 0))


def _sums(cells: Sequence[tuple[tuple[str, int], Cell]], keys: Sequence[tuple[str, int]], score: str) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of a score, one a clip and seed."""
    if score not in SCORES:
        raise InputError(f"no interval of {score!r}; there are {', '.join(SCORES)}")
    sums, counts = np.zeros(len(keys)), np.zeros(len(keys))
    for key, one in cells:
        own = _parts(one, score)
        sums[keys.index(key)] += own[0]
        counts[keys.index(key)] += own[1]
    return sums, counts


def _parts(one: Cell, score: str) -> tuple[float, float]:
    if score == "filter":
        return 1000 * one.results["filter_s"], one.results["rows"]
    errors = one.results["centroid" if score.startswith("centroid") else "head"]
    if score.endswith("MOTP"):
        return 1000 * errors["distance_m"], errors["matches"]
    if score == "mismatches":
        return 100 * errors["mismatches"], errors["objects"]
    return 100 * (errors["objects"] - errors["misses"] - errors["false_positives"] - errors["mismatches"]), errors["objects"]
