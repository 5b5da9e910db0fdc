"""The cheapest way through choices, against looking at every way there is."""

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from hmc.search.paths import cheapest_path


def cost(way, own, between):
    return sum(own[k][choice] for k, choice in enumerate(way)) + sum(between[k][way[k - 1], way[k]] for k in range(1, len(way)))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.integers(1, 3), min_size=1, max_size=7))
def test_no_other_way_is_cheaper(seed, sizes):
    rng = np.random.default_rng(seed)
    own = [rng.uniform(0, 5, size) for size in sizes]
    between = [None, *(rng.uniform(0, 5, pair) for pair in pairwise(sizes))]
    path = cheapest_path(own, lambda k: between[k])
    assert tuple(path) == min(product(*map(range, sizes)), key=lambda way: cost(way, own, between))


def test_of_ways_that_cost_the_same_the_first_choices():
    assert_array_equal(cheapest_path(np.zeros((4, 2)), lambda k: np.zeros((2, 2))), [0, 0, 0, 0])


def test_no_frames_are_an_empty_way_and_a_frame_without_choice_is_refused():
    assert len(cheapest_path([], lambda k: np.zeros((1, 1)))) == 0
    with pytest.raises(ValueError, match="at least one choice"):
        cheapest_path([np.zeros(2), np.zeros(0)], lambda k: np.zeros((2, 0)))
