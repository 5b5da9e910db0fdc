"""Ratios of sums over runs, against sums written out."""

import numpy as np
import pytest

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.intervals import difference, interval
from hmc.experiments.engine.ratios import ratio_gain, ratio_interval


def run(clip, seed, particles, total, count):
    return Cell({"recording": clip, "repeat": seed, "particles": particles}, {"total": total, "count": count})


def parts(one):
    return one.results["total"], one.results["count"]


SOME = [run("a", 0, 50, 3.0, 2), run("a", 0, 90, 5.0, 4), run("a", 1, 50, 2.0, 2), run("b", 0, 50, 9.0, 3), run("b", 0, 90, 1.0, 1)]


def test_runs_of_a_clip_and_seed_count_together():
    assert ratio_interval(SOME, parts) == interval(["a", "a", "b"], np.array([8.0, 2.0, 10.0]), np.array([6.0, 2.0, 4.0]))


def test_groups_are_compared_on_all_pairs_that_agree():
    others = [run("b", 0, 50, 4.0, 4), run("a", 0, 90, 2.0, 4), run("a", 0, 50, 1.0, 2), run("c", 0, 50, 7.0, 1)]
    by_particles = ratio_gain(SOME, others, parts, lambda one: (one.parameters["recording"], one.parameters["particles"]))
    # Of a: the runs of seed 0 one by one, that of seed 1 with the other's seed 0. Of b: that of 50 particles.
    first, second = (np.array([8.0, 2.0, 9.0]), np.array([6.0, 2.0, 3.0])), (np.array([3.0, 1.0, 4.0]), np.array([6.0, 2.0, 4.0]))
    assert by_particles == difference(["a", "a", "b"], first, second)


def test_one_group_is_compared_with_itself_by_two_figures():
    gain = ratio_gain(SOME[2:4], SOME[2:4], parts, smaller_parts=lambda one: (1.0, 1.0))
    assert gain.value == pytest.approx(11 / 5 - 1)


def test_without_a_pair_nothing_is_said():
    with pytest.raises(InputError, match="no two of these agree"):
        ratio_gain(SOME[:1], SOME[3:4], parts)
