"""How sure a figure is: confidence intervals over clips and seeds, and paired comparisons of methods.

Figures of a study are ratios of sums over many clips and seeds (a mean error is a sum of errors over a number of landmarks), and clips
differ far more than seeds do. So clips are drawn with replacement, and of each clip drawn its seeds; two methods are compared on the same
draws. The bootstrap of few runs is too narrow (of three it misses the truth in a quarter of all cases): intervals are widened as
Student's are.

References
----------
Davison and Hinkley (1997), Bootstrap Methods and their Application, section 3.8: hierarchical data.
Hesterberg (2015), What Teachers Should Know About the Bootstrap, section 3.2: narrowness of percentile intervals of few values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Claim

__all__ = ["DRAWS", "LEVEL", "Interval", "all_of", "decide", "difference", "interval"]

#: Draws of an interval, and the share of them that it holds.
DRAWS, LEVEL = 2000, 0.95


@dataclass(frozen=True)
class Interval:
    """A figure and between which values it lies, by `LEVEL`.

    Attributes
    ----------
    value, low, high : float
        NaN where there is nothing to say; low and high are infinite with one clip and one seed.
    """

    value: float
    low: float
    high: float

    @property
    def above_zero(self) -> bool:
        """Whether all of it is above 0."""
        return bool(self.low > 0)

    @property
    def open(self) -> bool:
        """Whether it does not tell: neither all of it is above 0, nor none."""
        return not self.above_zero and not self.high <= 0

    def over(self, value: float) -> Interval:
        """By how much it is above a value."""
        return Interval(self.value - value, self.low - value, self.high - value)

    def under(self, value: float) -> Interval:
        """By how much it is below a value."""
        return Interval(value - self.value, value - self.high, value - self.low)

    def __str__(self) -> str:
        value = f"{self.value:.1f}"
        return f"{value} [{self.low:.1f}, {self.high:.1f}]" if np.isfinite([self.low, self.high]).all() else value


def decide(text: str, gains: Interval | Sequence[Interval], detail: str = "", given: bool = True) -> Claim:
    """The claim that something is above 0, or several are.

    Parameters
    ----------
    text : str
    gains : Interval or sequence of Interval
        What is to be above 0; of none nothing is decided.
    detail : str
        The figures that decide.
    given : bool
        What has to be so besides; where it is not, the claim does not hold, whatever the intervals are.

    Returns
    -------
    Claim
        It holds where all of every interval is above 0. It is undecided where it does not, and no interval is without a value above 0.
    """
    several = [gains] if isinstance(gains, Interval) else list(gains)
    holds = bool(several) and all(one.above_zero for one in several)
    undecided = not holds and all(one.above_zero or one.open for one in several)
    return Claim(text, bool(given and holds), detail, bool(given and undecided))


def all_of(text: str, parts: Sequence[Claim], detail: str = "") -> Claim:
    """The claim that several claims hold; undecided where some of them are, and none differs."""
    holds = all(part.holds for part in parts)
    return Claim(text, holds, detail, not holds and all(part.holds or part.undecided for part in parts))


def interval(clips: Sequence[str], sums: np.ndarray, counts: np.ndarray, draws: int = DRAWS) -> Interval:
    """A ratio of sums and its interval.

    Parameters
    ----------
    clips : sequence of str, length n
        Of which clip each run is; runs of one clip are its seeds.
    sums, counts : array, shape (n,)
        Of each run.
    draws : int

    Returns
    -------
    Interval
        Of ``sum(sums) / sum(counts)``.

    Raises
    ------
    InputError
        When the lengths differ.
    """
    groups = _by_clip(clips, len(sums))
    picked = _draws(groups, draws)
    sums, counts = np.asarray(sums, float), np.asarray(counts, float)
    return _interval(float(_ratio(sums.sum(), counts.sum())), _ratio(picked @ sums, picked @ counts), groups)


def difference(
    clips: Sequence[str],
    first: tuple[np.ndarray, np.ndarray],
    second: tuple[np.ndarray, np.ndarray],
    draws: int = DRAWS,
) -> Interval:
    """By how much a ratio of sums is larger in the first of two methods, on the same clips and seeds.

    Parameters
    ----------
    clips : sequence of str, length n
        As for `interval`; run k of both methods is of clip k.
    first, second : (sums, counts), each array, shape (n,)
    draws : int
    """
    groups = _by_clip(clips, len(first[0]))
    picked = _draws(groups, draws)
    value, drawn = 0.0, np.zeros(draws)
    for sign, (sums, counts) in ((1, first), (-1, second)):
        sums, counts = np.asarray(sums, float), np.asarray(counts, float)
        value += sign * float(_ratio(sums.sum(), counts.sum()))
        drawn = drawn + sign * _ratio(picked @ sums, picked @ counts)
    return _interval(value, drawn, groups)


def _by_clip(clips: Sequence[str], n: int) -> list[np.ndarray]:
    if len(clips) != n:
        raise InputError(f"there are {len(clips)} names of clips and {n} runs")
    names = np.array(list(clips), str)
    return [np.flatnonzero(names == name) for name in dict.fromkeys(clips)]


def _draws(groups: list[np.ndarray], draws: int) -> np.ndarray:
    """How often each run is in each draw, shape (draws, n); the same for the same groups."""
    rng = np.random.default_rng([len(groups), sum(map(len, groups))])
    picked = np.zeros((draws, sum(map(len, groups))))
    for group, times in zip(groups, rng.multinomial(len(groups), np.full(len(groups), 1 / len(groups)), draws).T, strict=True):
        picked[:, group] = rng.multinomial(times * len(group), np.full(len(group), 1 / len(group)))
    return picked


def _ratio(sums: np.ndarray, counts: np.ndarray) -> np.ndarray:
    return np.divide(sums, counts, out=np.full(np.shape(sums), np.nan), where=np.asarray(counts) > 0)


def _interval(value: float, drawn: np.ndarray, groups: list[np.ndarray]) -> Interval:
    known = drawn[np.isfinite(drawn)]
    n = len(groups) if len(groups) > 1 else sum(map(len, groups))
    if not len(known) or n < 2:  # one run tells nothing of others
        return Interval(value, -np.inf, np.inf)
    tail = (1 + LEVEL) / 2
    wider = stats.t.ppf(tail, n - 1) / stats.norm.ppf(tail) * np.sqrt(n / (n - 1))
    low, high = value + wider * (np.quantile(known, [1 - tail, tail]) - value)
    return Interval(value, float(low), float(high))
