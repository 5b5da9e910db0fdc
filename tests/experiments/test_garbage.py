"""No claim of a study of poses holds on garbage: on noise in place of poses, and on methods that do not differ."""

import numpy as np
import pytest
from results_at_random import claims_on, held_always
from test_experiments_chapters_7_8 import walking

#: The quick tests draw the results of all experiments at random (`test_garbage_everywhere`).
pytestmark = pytest.mark.slow

STUDIES = ("fig-6.16", "fig-6.17", "fig-6.18", "fig-7.13", "table-7.1", "table-8.1", "fig-8.1", "missing-data")


def off_by(size_m):
    """Runs that are all off by errors of one size, whatever was run; a fifth of the landmarks by ten times that."""

    def draw(rng, parameters):
        truth = walking()
        size = size_m * np.where(rng.random(truth.shape[:2]) < 0.2, 10, 1)[..., None]
        estimate = truth + size * rng.normal(size=truth.shape)
        return {"frames": np.arange(len(truth)), "fps": 30.0, "estimate_m": estimate, "truth_m": truth, "filter_s_per_frame": 0.1}

    return draw


@pytest.mark.parametrize("name", STUDIES)
def test_nothing_holds_on_noise(name):
    assert [claim.text for claim in claims_on(name, off_by(2.0)) if claim.holds] == []


@pytest.mark.parametrize("name", STUDIES)
def test_no_method_is_ahead_of_an_equal_one(name):
    """Nor is one that reaches a figure of the thesis."""
    assert not {text for text in held_always(name, off_by(0.03)) if "reaches" not in text}
