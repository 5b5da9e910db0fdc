"""Scores of trackers with their intervals, and trackers compared on the same clips and seeds (`hmc.experiments.engine.intervals`)."""

from __future__ import annotations

from collections.abc import Sequence

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Claim
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.ratios import Parts, clip_and_seed, ratio_gain, ratio_interval

__all__ = ["SCORES", "ahead", "following", "gain", "is_followed", "score_interval"]

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
    return ratio_interval(cells, _parts(score))


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
    larger, smaller = (worse, better) if SCORES[score][1] else (better, worse)
    return ratio_gain(larger, smaller, _parts(score), lambda one: repr([one.parameters[name] for name in by]))


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
    followed = following(better)
    detail = f"{score} {score_interval(better, score)} for {score_interval(worse, score)}: better by {found} {unit}"
    return decide(text, (found, followed), detail if followed.above_zero else f"{detail}; people may be lost")


def following(cells: Sequence[Cell]) -> Interval:
    """By how much MOTA is above 0: people are followed where all of it is. Nothing is claimed of runs that are lost."""
    return score_interval(cells, "MOTA")


def is_followed(cells: Sequence[Cell]) -> bool:
    """Whether people are followed at all: the interval of MOTA is above 0. Nothing is claimed of runs that are lost."""
    values = [one.results["head"] for one in cells]
    known = sum(one["objects"] - one["misses"] - one["false_positives"] - one["mismatches"] for one in values)
    return known > 0 and bool(score_interval(cells, "MOTA").low > 0 or len(set(map(clip_and_seed, cells))) < 2)


def _parts(score: str) -> Parts:
    """Numerator and denominator of a score of a run."""
    if score not in SCORES:
        raise InputError(f"no interval of {score!r}; there are {', '.join(SCORES)}")

    def parts(one: Cell) -> tuple[float, float]:
        if score == "filter":
            return 1000 * one.results["filter_s"], one.results["rows"]
        errors = one.results["centroid" if score.startswith("centroid") else "head"]
        if score.endswith("MOTP"):
            return 1000 * errors["distance_m"], errors["matches"]
        if score == "mismatches":
            return 100 * errors["mismatches"], errors["objects"]
        return 100 * (errors["objects"] - errors["misses"] - errors["false_positives"] - errors["mismatches"]), errors["objects"]

    return parts
