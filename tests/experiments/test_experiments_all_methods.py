"""The side-by-side of all pose methods: what runs, and what is made of poses that are known."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from hmc.experiments import Plan
from hmc.experiments.all_methods import EXPERIMENT, PAPER_SEEDS, SEEDS, cell, effort, title, ways
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.style import house_style
from hmc.pose.registry import METHODS, pose_method

N = 12


def made(parameters, off_mm):
    """A run whose landmarks are all off by so much, ten frames a second."""
    truth = np.random.default_rng(0).normal(size=(N, 15, 3))
    estimate = truth + [off_mm / 1000, 0, 0]
    return Cell(parameters, {"frames": np.arange(N), "fps": 20.0, "estimate_m": estimate, "truth_m": truth, "frame_s": 0.1})


def grid_of(quick):
    grid = EXPERIMENT.grid(Plan(quick=quick))
    return grid, list(dict.fromkeys(title(one) for one in grid))


def test_every_method_that_needs_no_markers_takes_part_and_every_paper_once():
    assert {name for name, _ in ways()} == {name for name in METHODS if pose_method(name).needs_hulls}
    assert [way for way in ways() if way[1] != "default"] == [("apf", "canton2009"), ("smd", "kehl2006"), ("pso", "hsiao2008")]
    grid, titles = grid_of(False)
    papers = sum(preset != "default" for _, preset in ways())
    assert len(grid) == 10 * (SEEDS[False] * (len(ways()) - papers) + PAPER_SEEDS * papers) and titles[0] == "apf"


@pytest.mark.parametrize("worst", [title({"method": name, "preset": preset}) for name, preset in ways()])
def test_every_method_has_its_row(worst):
    grid, titles = grid_of(True)
    assert len(grid) == 5 * len(titles)
    cells = [made(one, 120.0 if title(one) == worst else 30.0) for one in grid]
    with house_style():
        report = EXPERIMENT.report(cells, Plan(quick=True))
        plt.close("all")
    whole, each = report.tables
    assert [row["method"] for row in whole.rows] == titles and len(each.rows) == 5 * len(titles)
    for row in whole.rows:
        wrong = row["method"] == worst
        assert row["mean_mm"] == pytest.approx(120 if wrong else 30) and row["MMTA_percent"] == (0 if wrong else 100)
        assert row["frames_per_s"] == pytest.approx(10) and row["mean_spread_mm"] is None
    assert report.claims[0].holds == (worst != titles[0])


def test_the_spread_is_that_over_the_seeds():
    grid, _ = grid_of(False)
    with house_style():
        whole = EXPERIMENT.report([made(one, 30.0 + 10 * one["repeat"]) for one in grid], Plan()).tables[0]
        plt.close("all")
    for row in whole.rows:
        several = row["seeds"] == SEEDS[False]
        assert row["mean_mm"] == pytest.approx(40 if several else 30)
        assert row["mean_spread_mm"] == (pytest.approx(10) if several else None)


def test_efforts_are_those_of_the_presets():
    assert effort(pose_method("apf", "canton2009")) == "6 layers of 600 particles"
    assert len({effort(pose_method(name)) for name in ("apf", "shbm-apf", "pso", "smd")}) == 4


def test_a_cell_hands_over_poses_and_the_median_frames_time(monkeypatch):
    from hmc.experiments import all_methods

    truth, asked = made({}, 0.0).results["truth_m"], []
    clock = iter([0.0, 1.0, 1.2, 1.4, 9.0])

    class Seen:
        class recording:
            fps, subject_height_m = 20.0, (1.7,)

    def run(seen, method, options, progress):
        asked.append((method.name, options.height_m))
        list(progress(range(5), 5))

    monkeypatch.setattr(all_methods, "tracked", lambda *rest: Seen)
    monkeypatch.setattr(all_methods, "pose_results", lambda recording, people: {"estimate_m": truth + 0.01, "truth_m": truth})
    monkeypatch.setattr(all_methods, "run_method", run)
    monkeypatch.setattr(all_methods.time, "process_time", lambda: next(clock))
    results = cell({"recording": "box@0", "method": "smd", "preset": "kehl2006", "repeat": 0}, None, np.random.default_rng(0))
    assert results["frame_s"] == pytest.approx(0.6) and asked == [("smd", 1.7)]
    np.testing.assert_allclose(results["estimate_m"] - results["truth_m"], 0.01)
