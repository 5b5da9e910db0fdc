"""A claim that holds whatever the results are says nothing: of every experiment, none may hold on shuffled results and noise alike."""

import pytest
from results_at_random import REPEATED, RESULTS, claims_at_random

from hmc.experiments import EXPERIMENTS, find_experiment

#: Draws each way. A claim that compares two things holds on all of them but one by chance once in a hundred times.
DRAWS = 5


def test_every_experiment_has_results_at_random():
    assert set(RESULTS) == {find_experiment(name).store_name for name in EXPERIMENTS}


def held_by_all_but_one(name, quick):
    """The claims that fail in at most one of many draws, of shuffled results and of noise."""
    missed: dict[str, int] = {}
    for noise, seed in ((noise, seed) for seed in range(DRAWS) for noise in (True, False)):
        for claim in claims_at_random(name, seed, noise, quick):
            missed[claim.text] = missed.get(claim.text, 0) + (not claim.holds)
        if min(missed.values(), default=2) > 1:
            break
    return {text for text, n in missed.items() if n <= 1}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_no_claim_holds_on_everything(name):
    held = held_by_all_but_one(name, quick=True)
    assert not held, "these hold on shuffled results and on noise: let them say something that can fail"


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_nor_does_one_of_a_run_in_full(name):
    """Some claims are made in full alone, and more runs make narrower intervals: what is garbage must not hold there either."""
    held = held_by_all_but_one(name, quick=False)
    assert not held, "these hold on shuffled results and on noise: let them say something that can fail"


@pytest.mark.parametrize("name", REPEATED)
def test_a_single_seed_of_every_cell_can_be_reported(name):
    assert claims_at_random(name, seed=0, noise=False, repeats=1)
