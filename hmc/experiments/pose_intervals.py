"""Scores of poses with their intervals, and methods compared on the same clips and seeds (`hmc.experiments.engine.intervals`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hmc.errors import InputError
from hmc.experiments.by_action import COLUMNS, MATCHED_MM, NEAR_MM, STRICT_MM
from hmc.experiments.engine.experiment import Cell, Claim
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.ratios import Parts, ratio_gain, ratio_interval
from hmc.experiments.truth import estimates
from hmc.metrics.landmarks import landmark_errors

__all__ = ["SCORES", "WORTH_MM", "ahead", "following", "is_followed", "none_better", "reaches", "score_difference", "score_interval"]

#: As `hmc.experiments.by_action.pose_scores` calls them.
SCORES = ("mean_mm", "MMTP_mm", "MMTA_percent", "MMTP_70_mm", "MMTA_70_percent", "MMTA_50_percent")
#: Mean errors that differ by less are as good as each other, millimetres.
WORTH_MM = 1.0
#: A wider interval of MMTA says of no figure that it is in it, percent.
TELLS_PERCENT = 30.0
#: By what a score's name says, how far a landmark may be to be matched.
_WITHIN = {"_70_": STRICT_MM, "_50_": NEAR_MM}


def score_interval(cells: Sequence[Cell], score: str) -> Interval:
    """A score of some cells together, and its interval over clips and seeds.

    Parameters
    ----------
    cells : sequence of Cell
        Of one method, with ``estimate_m`` and ``truth_m``.
    score : str
        One of `SCORES`.
    """
    return ratio_interval(cells, _parts(score))


def score_difference(first: Sequence[Cell], second: Sequence[Cell], score: str, but: Sequence[str] = ("method",)) -> Interval:
    """By how much the first group's score is larger than the second's, and its interval, on the cells that both have.

    Parameters
    ----------
    first, second : sequence of Cell
        Of one method each, or of one number of cameras, and so on.
    score : str
        One of `SCORES`.
    but : sequence of str
        Parameters in which the groups differ: cells that agree in all others are compared.

    Raises
    ------
    InputError
        When no two cells agree.
    """
    return ratio_gain(first, second, _parts(score), lambda one: _without(one, but))


def ahead(text: str, better: Sequence[Cell], worse: Sequence[Cell], score: str = "MMTA_percent", but: Sequence[str] = ("method",)) -> Claim:
    """The claim that one group's score is better than another's: it holds where the interval of the difference says so.

    Parameters
    ----------
    text : str
    better, worse : sequence of Cell
    score : str
        One of `SCORES`; errors are better where they are smaller.
    but : sequence of str
        As for `score_difference`.
    """
    error = score.endswith("_mm")
    first, second = (worse, better) if error else (better, worse)
    gain = score_difference(first, second, score, but)
    unit = "mm" if error else "%"
    detail = f"{score.split('_')[0]} {score_interval(better, score)} {unit} for {score_interval(worse, score)}: better by {gain}"
    return decide(text, gain, detail)


def none_better(text: str, chosen: Sequence[Cell], others: Mapping[str, Sequence[Cell]], but: Sequence[str] = ("method",)) -> Claim:
    """The claim that no other group is better than the chosen one by `WORTH_MM` or more: what intervals too wide to tell do not show.

    Parameters
    ----------
    text : str
    chosen : sequence of Cell
    others : mapping of name to sequence of Cell
    but : sequence of str
        As for `score_difference`.
    """
    costs = {name: score_difference(own, chosen, "mean_mm", but) for name, own in others.items()}
    shown = {name: cost for name, cost in costs.items() if cost.low <= -WORTH_MM} or costs
    told = "; ".join(f"{name} costs {cost} mm" for name, cost in shown.items())
    return decide(text, [cost.over(-WORTH_MM) for cost in costs.values()], told)


def reaches(text: str, cells: Sequence[Cell], paper: Sequence[float]) -> Claim:
    """The claim that MMTA at 100 mm, of people who are followed, is that of a paper or better by an interval that tells something.

    Parameters
    ----------
    text : str
    cells : sequence of Cell
        Of one method.
    paper : sequence of float
        The paper's figures in the order of `hmc.experiments.by_action.COLUMNS`.
    """
    found, mmtp = score_interval(cells, "MMTA_percent"), paper[COLUMNS.index("MMTP_mm")]
    mmta = paper[COLUMNS.index("MMTA_percent")]
    holds = bool(found.high >= mmta and found.high - found.low <= TELLS_PERCENT and is_followed(cells))
    detail = f"MMTA {found} %, MMTP {score_interval(cells, 'MMTP_mm')} mm; the paper {mmta} %, {mmtp} mm"
    return Claim(text, holds, detail, undecided=bool(not holds and found.high >= mmta))


def following(cells: Sequence[Cell], least_percent: float = 50.0) -> Interval:
    """By how much MMTA at 100 mm is above a least: people are followed where all of it is. Nothing is claimed of runs that are lost."""
    return score_interval(cells, "MMTA_percent").over(least_percent)


def is_followed(cells: Sequence[Cell]) -> bool:
    """Whether people are shown to be followed at all."""
    return following(cells).above_zero


def _without(one: Cell, but: Sequence[str]) -> str:
    return repr(sorted((name, value) for name, value in one.parameters.items() if name not in but))


def _parts(score: str) -> Parts:
    """Numerator and denominator of a score of a run."""
    if score not in SCORES:
        raise InputError(f"no interval of {score!r}; there are {', '.join(SCORES)}")

    def parts(one: Cell) -> tuple[float, float]:
        errors = 1000 * landmark_errors(*estimates(one))
        if score == "mean_mm":  # of each frame the mean of what is estimated in it (Canton, Eq. 5.1, 5.2)
            there = np.isfinite(errors)
            means = np.where(there, errors, 0.0).sum(axis=1)[there.any(axis=1)] / there.sum(axis=1)[there.any(axis=1)]
            return float(means.sum()), float(len(means))
        matched = errors <= next((within for name, within in _WITHIN.items() if name in score), MATCHED_MM)
        if score.startswith("MMTP"):
            return float(errors[matched].sum()), float(matched.sum())
        return 100 * float(matched.sum()), float((~np.isnan(errors)).sum())

    return parts
