"""No claim of the studies of Hsiao (2008) holds on garbage: on noise, and on ways that do not differ."""

import numpy as np
import pytest
from results_at_random import claims_on, held_always
from test_experiments_chapters_7_8 import walking

from hmc.experiments.hsiao_3_15 import SCORES
from hmc.experiments.hsiao_pso import METHODS

#: The quick tests draw the results of all experiments at random (`test_garbage_everywhere`).
pytestmark = pytest.mark.slow

STUDIES = ("hsiao-3.8", "hsiao-3.15", "hsiao-3.16", "hsiao-4", "hsiao-pso")


def poses(rng, parameters, size):
    truth = walking()
    away = size * np.where(rng.random(truth.shape[:2]) < 0.2, 10, 1)[..., None]
    counts = {"frames": len(truth), "restarts": 0, "without_fit": 0, "evaluations_per_frame": 1.0, "seconds_per_frame": 0.1}
    return counts | {"estimate_m": truth + away * rng.normal(size=truth.shape), "truth_m": truth}


def hulls(rng, parameters, size):
    rows = np.column_stack([np.arange(5), rng.integers(1, 4, 5), np.zeros(5), rng.uniform(40, 60, (5, 4))])
    return {"rows": rows, "shown": None, "texts": []}


def parts(rng, parameters, size):
    scores = rng.uniform(0, 1, (6, 3, len(SCORES)))
    scores[..., 4:] *= size
    return {"frames": list(range(6)), "apart": [1] * 6, "scores": scores, "shown": None}


def fits(rng, parameters, size):
    rows = [[frame, k, 1000 * size * rng.uniform(), 100.0, 7000] for frame in range(3) for k in range(len(METHODS))]
    return {"rows": np.array(rows)}


MAKE = {"hsiao-3.8": hulls, "hsiao-3.15": parts, "hsiao-3.16": parts, "hsiao-4": poses, "hsiao-pso": fits}


def off_by(name, size):
    return lambda rng, parameters: MAKE[name](rng, parameters, size)


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("name", STUDIES)
def test_nothing_holds_on_noise(name, quick):
    assert not held_always(name, off_by(name, 2.0), quick)


@pytest.mark.parametrize("name", ["hsiao-4", "hsiao-pso"])
def test_no_way_is_ahead_of_an_equal_one(name):
    assert not {text for text in held_always(name, off_by(name, 0.03)) if "than" in text and "half" not in text}


def better(name, parameters, results):
    """The same with what the thesis claims put in."""
    if name == "hsiao-3.8":
        results["rows"][:, 1] = 4 if parameters["cameras"] == "1 to 4" else 2
        results["rows"][:, 4] = 8 if parameters["cameras"] == "1 to 4" else 1
    elif name in ("hsiao-3.15", "hsiao-3.16"):
        results["scores"][:, 0, :4], results["scores"][:, 2, :4] = 0.9, 0.5
        results["scores"][:, 0, 4:], results["scores"][:, 2, 4:] = 0.03, 0.2
    elif name == "hsiao-pso":
        results["rows"][:, 2] += np.where(results["rows"][:, 1] == 0, 10, 60)
    else:
        away = 0.09 if "alone" in parameters["way"] else 0.03
        results["estimate_m"] = results["truth_m"] + away / np.sqrt(3)
    return results


@pytest.mark.parametrize("name", STUDIES)
def test_what_the_thesis_claims_holds_where_it_is_so(name):
    claims = claims_on(name, lambda rng, parameters: better(name, parameters, MAKE[name](rng, parameters, 0.01)), quick=False)
    assert [claim.text for claim in claims if not claim.holds] == []


def test_a_sequence_whose_seeds_disagree_is_undecided():
    """Of one sequence one seed is lost and two are not; all others are followed."""

    def draw(rng, parameters):
        lost = parameters["recording"].startswith("s5_sit") and parameters["repeat"] == 0
        return poses(rng, parameters, 2.0 if lost else 0.005)

    first = claims_on("hsiao-4", draw, quick=False)[0]
    assert first.undecided and first.detail == "not shown of s5_sit"
