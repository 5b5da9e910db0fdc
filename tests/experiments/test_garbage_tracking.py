"""No claim of a study of trackers holds on garbage: on runs that are lost, on trackers that do not differ, and on a tree of chance."""

import numpy as np
import pytest
from results_at_random import claims_on, held_always

#: The quick tests draw the results of all experiments at random (`test_garbage_everywhere`).
pytestmark = pytest.mark.slow

STUDIES = ("table-4.3", "table-4.4", "fig-4.12", "fig-4.13", "fig-4.14")


def as_good(lost):
    """Runs that are all as good as each other, whatever was run, clips and seeds apart."""

    def draw(rng, parameters):
        clip = np.random.default_rng(list(parameters["recording"].encode())).normal(0, 150)
        wrong = 1400 if lost else int(300 + clip * 0.5 + rng.normal(0, 80))
        errors = {
            "objects": 1000, "misses": max(wrong, 0), "false_positives": 50, "mismatches": int(rng.integers(0, 9)),
            "matches": 700, "distance_m": 0.7 * (150 + 0.1 * clip + rng.normal(0, 8)),
        }  # fmt: skip
        points = {"frames": [0, 1], "persons": [0, 0], "positions": [[0.0, 0, 1], [0.1, 0, 1]]}
        return {
            "head": errors, "centroid": errors, "frames": 250, "fps": 25.0, "rows": 1000, "filter_s": float(rng.uniform(0.9, 1.1)),
            "color_s": 0.0, "persons": 3, "tracks": points, "truth": points,
        }  # fmt: skip

    return draw


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("lost", [True, False])
@pytest.mark.parametrize("name", STUDIES)
def test_nothing_holds_where_all_are_lost_or_equal(name, lost, quick):
    assert not held_always(name, as_good(lost), quick)


def test_a_tree_of_chance_is_not_the_thesis_s():
    def tree(rng, parameters):
        chosen = [int(k) for k in rng.integers(0, 6, 3)]
        return {
            "feature": [*chosen, -1, -1, -1, -1], "threshold": [1.0] * 7, "at_most": [1, 3, 5, -1, -1, -1, -1],
            "above": [2, 4, 6, -1, -1, -1, -1], "share": [0.5] * 7,
        }  # fmt: skip

    assert sum(all(claim.holds for claim in claims_on("fig-4.4", tree, seed)) for seed in range(40)) < 6


def test_spreads_that_do_not_differ_are_none_faster():
    rest = {"error_mm": [1.0] * 601, "n_samples": [400] * 601}
    rest["shown_m"] = {str(step): [[0.0, 0.0, 0.0]] for step in (0, 50, 150, 400)}
    assert not held_always("fig-4.9", lambda rng, parameters: {"spread": list(rng.uniform(0.4, 0.9) + np.zeros(601)), **rest})


def test_nobody_is_behind_where_errors_are_noise():
    def noise(rng, parameters):
        return {"standing": 90, "standing_m": 9.0, "walking": 90, "walking_m": 9.0, "behind_m": float(rng.normal(0, 4))}

    assert not held_always("why-behind", noise, quick=False)
