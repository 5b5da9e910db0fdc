"""Intervals of pose scores: their middle is the score itself, and a difference is found where there is one."""

from dataclasses import replace

import numpy as np
import pytest

from hmc.errors import InputError
from hmc.experiments.by_action import COLUMNS, pose_scores
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.pose_intervals import SCORES, is_followed, none_better, reaches, score_difference, score_interval


def cells(scatter_m, rng, clips=6, seeds=3, lost=0.0, frames=12):
    """Runs whose landmarks are off by normal errors, of which a share is lost altogether; clips are differently hard."""
    made = []
    for clip in range(clips):
        truth = rng.normal(size=(frames, 15, 3))
        for seed in range(seeds):
            estimate = truth + rng.normal(0, scatter_m * (1 + 0.5 * clip), truth.shape)
            estimate[rng.random((frames, 15)) < lost] = np.nan
            made.append(Cell({"recording": f"clip{clip}@1", "repeat": seed}, {"estimate_m": estimate, "truth_m": truth}))
    return made


@pytest.mark.parametrize("lost", [0.0, 0.2])
def test_the_middle_is_the_score_itself(lost):
    some = cells(0.02, np.random.default_rng(0), lost=lost)
    scores = pose_scores(some)
    for name in SCORES:
        found = score_interval(some, name)
        assert found.value == pytest.approx(scores[name], rel=1e-9)
        assert found.low < found.value < found.high


def test_a_better_method_is_told_and_equal_ones_are_not():
    rng = np.random.default_rng(1)
    good, same, bad = cells(0.02, rng), cells(0.02, rng), cells(0.024, rng)
    assert score_difference(bad, good, "mean_mm").above_zero and score_difference(good, bad, "MMTA_50_percent").above_zero
    equal = score_difference(same, good, "mean_mm")
    assert equal.low < 0 < equal.high
    assert score_difference(good[::-1], good, "mean_mm").value == 0  # by clip and seed, not by order


def test_that_none_is_better_is_shown_and_not_merely_not_refuted():
    rng = np.random.default_rng(4)
    good, same, bad = cells(0.003, rng), cells(0.003, rng), cells(0.01, rng)
    assert none_better("", good, {"same": same, "bad": bad}).holds
    told = none_better("", bad, {"same": bad, "good": good})
    assert not told.holds and "good" in told.detail and "same" not in told.detail
    few = [cells(0.5, rng, clips=1, seeds=3) for _ in range(2)]
    assert not none_better("", few[0], {"same": few[1]}).holds  # too few and too far off to tell
    assert not none_better("", good, {}).holds


def test_only_what_both_have_is_compared():
    some = cells(0.02, np.random.default_rng(2))
    alone = score_difference(some[:4], some, "MMTP_mm")
    assert alone.value == 0
    with pytest.raises(InputError, match="no two of these agree"):
        score_difference(some[:3], some[3:], "MMTP_mm")
    with pytest.raises(InputError, match="no interval of 'angle_deg'"):
        score_interval(some, "angle_deg")


def test_what_differs_is_left_out_of_what_must_agree():
    rng = np.random.default_rng(3)
    few, many = (
        [replace(one, parameters=one.parameters | {"cameras": n}) for one in cells(scatter, rng)] for n, scatter in ((3, 0.03), (7, 0.02))
    )
    with pytest.raises(InputError, match="no two"):
        score_difference(few, many, "mean_mm")
    assert score_difference(few, many, "mean_mm", ("cameras",)).above_zero


def test_noise_is_not_followed():
    rng = np.random.default_rng(4)
    assert is_followed(cells(0.02, rng)) and not is_followed(cells(2.0, rng))


def some_lost(shares, rng, seeds=3):
    """Runs of as many clips, each with its share of frames in which everything is half a metre off."""
    made = []
    for clip, share in enumerate(shares):
        for seed in range(seeds):
            truth = rng.normal(size=(200, 15, 3))
            off = np.where(rng.random(200) < share, 0.5, 0.01)[:, None, None]
            made.append(Cell({"recording": f"clip{clip}@1", "repeat": seed}, {"estimate_m": truth + off / np.sqrt(3), "truth_m": truth}))
    return made


def test_a_figure_is_reached_by_an_interval_that_tells_something():
    rng = np.random.default_rng(5)
    paper = [{"MMTA_percent": 76.0, "MMTP_mm": 60.0}.get(column, 0.0) for column in COLUMNS]
    assert reaches("", some_lost([0.2, 0.25, 0.25, 0.3], rng), paper).holds
    far = reaches("", some_lost([0.4, 0.45, 0.45, 0.5], rng), paper)
    assert not far.holds and not far.undecided
    wide = reaches("", some_lost([0.0, 0.05, 0.45, 0.5], rng), paper)  # the same mean as the first, of clips that say different things
    assert not wide.holds and wide.undecided
