"""Intervals over clips and seeds: against SciPy's bootstrap, against known scatter, and on what has no difference."""

import numpy as np
import pytest
from scipy import stats

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Claim
from hmc.experiments.engine.intervals import Interval, all_of, decide, difference, interval

RNG = np.random.default_rng(5)


def test_with_one_seed_a_clip_it_is_scipys_bootstrap():
    sums, counts = RNG.gamma(4.0, 10.0, 30), RNG.integers(50, 100, 30).astype(float)
    found = interval([str(k) for k in range(30)], sums, counts, 6000)
    other = stats.bootstrap(
        (sums, counts),
        lambda a, b, axis: a.sum(axis) / b.sum(axis),
        paired=True,
        vectorized=True,
        method="percentile",
        n_resamples=6000,
        rng=1,
    )
    wider = stats.t.ppf(0.975, 29) / 1.96 * np.sqrt(30 / 29)  # 6 %
    low, high = (found.value + wider * (end - found.value) for end in other.confidence_interval)
    assert found.value == pytest.approx(sums.sum() / counts.sum())
    assert found.low == pytest.approx(low, abs=0.05 * (high - low))
    assert found.high == pytest.approx(high, abs=0.05 * (high - low))


def test_it_holds_the_truth_about_as_often_as_it_says():
    """Clips differ by 3, seeds by 1; 12 clips with 3 seeds each. Intervals that took all runs for independent would hold it in 75 %."""
    held = []
    clips = np.repeat([f"clip {k}" for k in range(12)], 3).tolist()
    for _ in range(150):
        values = 50 + np.repeat(RNG.normal(0, 3, 12), 3) + RNG.normal(0, 1, 36)
        found = interval(clips, values, np.ones(36), 300)
        held.append(found.low <= 50 <= found.high)
    assert 0.84 <= np.mean(held) <= 1.0


@pytest.mark.parametrize(("clips", "seeds"), [(1, 3), (3, 1), (3, 3), (5, 3)])
def test_of_few_runs_too(clips, seeds):
    names, held = np.repeat([f"{k}" for k in range(clips)], seeds).tolist(), []
    for _ in range(300):
        values = 50 + (np.repeat(RNG.normal(0, 3, clips), seeds) if clips > 1 else 0) + RNG.normal(0, 1, clips * seeds)
        found = interval(names, values, np.ones(len(values)), 300)
        held.append(found.low <= 50 <= found.high)
    assert np.mean(held) >= 0.9


def test_a_small_difference_shows_where_clips_are_the_same():
    """Two methods that differ by 1 on clips that differ by 10: apart, the intervals overlap; on the same clips the difference is sure."""
    hard = np.repeat(RNG.normal(50, 10, 8), 3)
    clips, ones = np.repeat([f"{k}" for k in range(8)], 3).tolist(), np.ones(24)
    first, second = hard + 1 + RNG.normal(0, 0.3, 24), hard + RNG.normal(0, 0.3, 24)
    assert interval(clips, second, ones).high > interval(clips, first, ones).low
    found = difference(clips, (first, ones), (second, ones))
    assert found.above_zero and found.value == pytest.approx((first - second).mean())


def test_shuffled_methods_do_not_differ():
    """With no difference between the methods, one is found in about a twentieth of the studies (two-sided), not in all."""
    clips, ones, found = np.repeat([f"{k}" for k in range(10)], 3).tolist(), np.ones(30), []
    for _ in range(100):
        hard = np.repeat(RNG.normal(50, 10, 10), 3)
        a, b = (hard + np.repeat(RNG.normal(0, 2, 10), 3) + RNG.normal(0, 1, 30) for _ in range(2))
        found.append(difference(clips, (a, ones), (b, ones), 300).above_zero)
    assert np.mean(found) <= 0.1


def test_one_run_says_nothing_of_its_interval_and_lengths_are_checked():
    alone = interval(["a"], np.array([3.0]), np.array([2.0]))
    assert (alone.value, alone.low, alone.high) == (1.5, -np.inf, np.inf) and not alone.above_zero
    with pytest.raises(InputError, match="2 names of clips and 1 runs"):
        interval(["a", "b"], np.array([3.0]), np.array([2.0]))


SURE, OPEN, AGAINST, EQUAL = Interval(2.0, 1.0, 3.0), Interval(2.0, -1.0, 5.0), Interval(-2.0, -3.0, -1.0), Interval(0.0, 0.0, 0.0)
UNKNOWN = Interval(np.nan, -np.inf, np.inf)


@pytest.mark.parametrize(
    ("gains", "given", "verdict"),
    [
        (SURE, True, "holds"), ([SURE, SURE], True, "holds"), (SURE, False, "differs"),
        (OPEN, True, "undecided"), ([SURE, OPEN], True, "undecided"), (UNKNOWN, True, "undecided"), ([], True, "undecided"),
        (OPEN, False, "differs"), (AGAINST, True, "differs"), (EQUAL, True, "differs"), ([OPEN, AGAINST], True, "differs"),
    ],
)  # fmt: skip
def test_what_an_interval_has_both_of_is_undecided(gains, given, verdict):
    assert decide("it is so", gains, "by 2", given).verdict == verdict


def test_figures_above_and_below_a_value():
    assert decide("", OPEN.over(-2)).holds and decide("", OPEN.under(6)).holds
    assert OPEN.over(2).open and OPEN.under(2).open and OPEN.under(2) == Interval(0.0, -3.0, 3.0)
    assert decide("", OPEN.over(5)).verdict == decide("", OPEN.under(-1)).verdict == "differs"


def test_several_claims_are_one_that_is_no_surer_than_they_are():
    holds, undecided, differs = Claim("", True), Claim("", False, undecided=True), Claim("", False)
    told = [all_of("", parts).verdict for parts in ([holds, holds], [holds, undecided], [undecided, differs], [holds, differs])]
    assert told == ["holds", "undecided", "differs", "differs"]


def test_few_runs_without_a_difference_are_undecided_and_many_alike_ones_differ():
    """What 400 runs show to be no gain, three do not."""
    gains = RNG.normal(-0.5, 1.0, 400)
    few, many = (interval([f"{k}" for k in range(n)], gains[:n], np.ones(n)) for n in (3, 400))
    assert decide("", few).verdict == "undecided" and decide("", many).verdict == "differs"
