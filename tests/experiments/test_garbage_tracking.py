"""No claim of a study of trackers holds on garbage: on runs that are lost, on trackers that do not differ, and on a tree of chance."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from hmc.experiments import Plan, find_experiment
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.style import house_style

#: The quick tests draw the results of all experiments at random (`test_garbage_everywhere`).
pytestmark = pytest.mark.slow

STUDIES = ("table-4.3", "table-4.4", "fig-4.12", "fig-4.13", "fig-4.14")


def claims_on(name, lost, seed, quick=False):
    """The claims of a study whose runs are all as good as each other, whatever was run, clips and seeds apart."""
    experiment, plan, rng = find_experiment(name), Plan(quick=quick), np.random.default_rng(seed)
    grid = experiment.grid(plan)
    clips = {clip: rng.normal(0, 150) for clip in dict.fromkeys(parameters["recording"] for parameters in grid)}
    cells = []
    for parameters in grid:
        wrong = 1400 if lost else int(300 + clips[parameters["recording"]] * 0.5 + rng.normal(0, 80))
        errors = {
            "objects": 1000, "misses": max(wrong, 0), "false_positives": 50, "mismatches": int(rng.integers(0, 9)),
            "matches": 700, "distance_m": 0.7 * (150 + 0.1 * clips[parameters["recording"]] + rng.normal(0, 8)),
        }  # fmt: skip
        points = {"frames": [0, 1], "persons": [0, 0], "positions": [[0.0, 0, 1], [0.1, 0, 1]]}
        results = {
            "head": errors, "centroid": errors, "frames": 250, "fps": 25.0, "rows": 1000, "filter_s": float(rng.uniform(0.9, 1.1)),
            "color_s": 0.0, "persons": 3, "tracks": points, "truth": points,
        }  # fmt: skip
        cells.append(Cell(parameters, results))
    with house_style():
        report = experiment.report(cells, plan)
        plt.close("all")
    return report.claims


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("name", STUDIES)
def test_nothing_holds_where_everybody_is_lost(name, quick):
    held = [{claim.text for claim in claims_on(name, True, seed, quick) if claim.holds} for seed in (1, 2, 3)]
    assert not set.intersection(*held)


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("name", STUDIES)
def test_no_tracker_is_ahead_of_an_equal_one(name, quick):
    """Of intervals of 95 % one in forty is above zero by chance: three draws must not agree."""
    held = [{claim.text for claim in claims_on(name, False, seed, quick) if claim.holds} for seed in (1, 2, 3)]
    assert not set.intersection(*held)


def test_a_tree_of_chance_is_not_the_thesis_s():
    experiment, plan, rng = find_experiment("fig-4.4"), Plan(), np.random.default_rng(0)
    held = 0
    for _ in range(40):
        chosen = [int(k) for k in rng.integers(0, 6, 3)]
        tree = {
            "feature": [*chosen, -1, -1, -1, -1], "threshold": [1.0] * 7, "at_most": [1, 3, 5, -1, -1, -1, -1],
            "above": [2, 4, 6, -1, -1, -1, -1], "share": [0.5] * 7,
        }  # fmt: skip
        with house_style():
            claims = experiment.report([Cell({"tree": "drawn"}, tree)], plan).claims
            plt.close("all")
        held += all(claim.holds for claim in claims)
    assert held < 6


def test_spreads_that_do_not_differ_are_none_faster():
    experiment, plan, rng = find_experiment("fig-4.9"), Plan(quick=True), np.random.default_rng(4)
    rest = {"error_mm": [1.0] * 601, "n_samples": [400] * 601}
    rest["shown_m"] = {str(step): [[0.0, 0.0, 0.0]] for step in (0, 50, 150, 400)}
    held = []
    for _ in range(3):
        cells = [Cell(p, {"spread": list(rng.uniform(0.4, 0.9) + np.zeros(601)), **rest}) for p in experiment.grid(plan)]
        with house_style():
            held.append(experiment.report(cells, plan).claims[0].holds)
            plt.close("all")
    assert not all(held)


def test_nobody_is_behind_where_errors_are_noise():
    experiment, held = find_experiment("why-behind"), []
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        cells = [
            Cell(p, {"standing": 90, "standing_m": 9.0, "walking": 90, "walking_m": 9.0, "behind_m": float(rng.normal(0, 4))})
            for p in experiment.grid(Plan())
        ]
        held.append({claim.text for claim in experiment.report(cells, Plan()).claims if claim.holds})
    assert not set.intersection(*held)
