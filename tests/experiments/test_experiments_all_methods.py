"""The side-by-side of all pose methods: what runs, and what is made of poses that are known."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from hmc.experiments import Plan
from hmc.experiments.all_methods import EXPERIMENT, METHODS, cell, effort
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.style import house_style

N = 12


def made(parameters, off_mm):
    """A run whose landmarks are all off by so much, ten frames a second."""
    truth = np.random.default_rng(0).normal(size=(N, 15, 3))
    estimate = truth + [off_mm / 1000, 0, 0]
    return Cell(parameters, {"frames": np.arange(N), "fps": 20.0, "estimate_m": estimate, "truth_m": truth, "frame_s": 0.1})


@pytest.mark.parametrize("worst", METHODS)
def test_every_method_has_its_row(worst):
    grid = EXPERIMENT.grid(Plan(quick=True))
    assert len(grid) == 5 * len(METHODS)
    cells = [made(one, 120.0 if one["method"] == worst else 30.0) for one in grid]
    with house_style():
        report = EXPERIMENT.report(cells, Plan(quick=True))
        plt.close("all")
    whole, each = report.tables
    assert [row["method"] for row in whole.rows] == list(METHODS) and len(each.rows) == 5 * len(METHODS)
    for row in whole.rows:
        wrong = row["method"] == worst
        assert row["mean_mm"] == pytest.approx(120 if wrong else 30) and row["MMTA_percent"] == (0 if wrong else 100)
        assert row["frames_per_s"] == pytest.approx(10)
    assert report.claims[0].holds == (worst != next(iter(METHODS)))


def test_efforts_are_those_of_the_presets():
    assert effort("APF, canton2009") == "6 layers of 600 particles"
    assert len({effort(name) for name in ("APF", "SHBM-APF", "PSO", "SMD")}) == 4


def test_a_cell_hands_over_poses_and_the_median_frames_time(monkeypatch):
    from hmc.experiments import all_methods

    truth = made({}, 0.0).results["truth_m"]
    clock = iter([0.0, 1.0, 1.2, 1.4, 9.0])

    class Table:
        frames, positions = np.arange(N), truth

    class Recording:
        fps, subject_height_m = 20.0, (1.7,)

    def run(progress, **passed):
        list(progress(range(5), 5))
        return type("People", (), {"poses": None})

    monkeypatch.setattr(all_methods, "tracked", lambda *rest: (Recording, None, None))
    monkeypatch.setattr(all_methods, "first_truth", lambda recording: Table)
    monkeypatch.setattr(all_methods, "estimate_of", lambda table, poses: truth + 0.01)
    monkeypatch.setattr(all_methods, "_way", lambda *rest: run)
    monkeypatch.setattr(all_methods.time, "process_time", lambda: next(clock))
    results = cell({"recording": "box@0", "method": "APF"}, None, np.random.default_rng(0))
    assert results["frame_s"] == pytest.approx(0.6)
    np.testing.assert_allclose(results["estimate_m"] - results["truth_m"], 0.01)
