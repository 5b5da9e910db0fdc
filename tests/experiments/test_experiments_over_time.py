"""The experiment on motion priors, recovery and smoothing, on poses that are known."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from hmc.experiments import Plan, over_time
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.style import house_style
from hmc.experiments.over_time import DEFAULT, GONE_S, NO_RECOVERY, WAYS, hidden, jitter_mm
from hmc.pose.steps.presets import PRESETS
from hmc.voxels.hulls import HullStep

FPS, N = 20.0, 90


def made(parameters, errors_mm, jitter=0.0):
    """A cell whose landmarks are off along x by so much in each frame, and by a tremble from frame to frame besides."""
    truth = np.zeros((N, 15, 3))
    truth[..., 0] = np.linspace(0, 1, N)[:, None]
    estimate = truth.copy()
    estimate[..., 1] += np.asarray(errors_mm).reshape(-1, 1) / 1000
    estimate[1::2, :, 2] += jitter
    gone = [round(second * FPS) for second in parameters["gone_s"]]
    return Cell(parameters, {"frames": np.arange(N), "fps": FPS, "estimate_m": estimate, "truth_m": truth, "gone": gone})


def cells(off_mm, found):
    """Cells of the quick grid: ways off by so much; the walker found again after a quarter of a second where `found` says so."""
    out = []
    for parameters in over_time.EXPERIMENT.grid(Plan(quick=True)):
        errors = np.full(N, off_mm[parameters["way"]] + 0.1 * parameters["repeat"])
        if parameters["gone_s"]:
            first = round(GONE_S[0] * FPS)
            back = round((GONE_S[1] + 0.25) * FPS) if found[parameters["way"]] else N
            errors[first:back] = 700.0
        out.append(made(parameters, errors, 0.01))
    return out


def report_of(off_mm, found):
    with house_style():
        report = over_time.EXPERIMENT.report(cells(off_mm, found), Plan(quick=True))
        plt.close("all")
    return report


def test_what_is_as_it_should_be_holds_and_nothing_else_does():
    right = report_of(dict.fromkeys(WAYS, 40.0) | {DEFAULT: 30.0}, {DEFAULT: True, NO_RECOVERY: False})
    assert [claim.holds for claim in right.claims] == [True, True, True]
    wrong = report_of(dict.fromkeys(WAYS, 30.0) | {DEFAULT: 40.0}, {DEFAULT: True, NO_RECOVERY: True})
    assert [claim.holds for claim in wrong.claims] == [False, False, True]
    never = report_of(dict.fromkeys(WAYS, 30.0), {DEFAULT: False, NO_RECOVERY: False})
    assert [claim.holds for claim in never.claims] == [True, False, True] and "default: never" in never.claims[1].detail


def test_figures_of_the_tables():
    ways, smoothing, found = report_of(dict.fromkeys(WAYS, 40.0) | {DEFAULT: 30.0}, {DEFAULT: True, NO_RECOVERY: False}).tables
    costs = {row["way"]: row["costs_mm"] for row in ways.rows if row["action"] == "all"}
    assert costs.pop(DEFAULT) == 0 and set(costs) == set(WAYS) - {DEFAULT, NO_RECOVERY}
    assert all(cost == pytest.approx(9.5, abs=0.5) for cost in costs.values())
    assert [row["jitter_mm"] for row in smoothing.rows if row["window_s"] == 0] == pytest.approx([20.0] * 2)
    assert all(row["jitter_mm"] < 10 for row in smoothing.rows if row["window_s"] >= 0.3)
    assert {row["way"]: row["back_after_s"] for row in found.rows} == {DEFAULT: pytest.approx(0.25), NO_RECOVERY: None}


def test_jitter_is_the_second_difference():
    steps = np.arange(10.0)[:, None, None] * np.ones((10, 15, 3))
    assert jitter_mm(0.01 * steps) == pytest.approx(0, abs=1e-9)  # what drifts evenly does not tremble
    assert jitter_mm(0.001 * steps**2) == pytest.approx(2 * np.sqrt(3))


def test_nobody_is_seen_in_the_gap(monkeypatch):
    full = np.ones((2, 2, 2), bool)
    steps = [HullStep(k, (None,), (np.ones((4, 4), bool),), (None,), full, full, full) for k in range(100)]
    seen = [bool(hidden(step, 40, 70).strict.any() and hidden(step, 40, 70).masks[0].any()) for step in steps]
    assert seen == [not 40 <= k < 70 for k in range(100)] and full.all()

    asked = []
    recording = SimpleNamespace(recording=SimpleNamespace(start=5, fps=20.0))
    monkeypatch.setattr(over_time, "tracked", lambda *rest: recording)
    monkeypatch.setattr(over_time, "run_method", lambda seen, method, options: asked.append((method, options.change)))
    monkeypatch.setattr(over_time, "pose_results", lambda recording, people: {})
    results = [
        over_time.cell(parameters, None, np.random.default_rng(0))
        for parameters in over_time.EXPERIMENT.grid(Plan(quick=True))
        if parameters["gone_s"]
    ]
    assert all(result["gone"] == [45, 75] for result in results)
    assert [method.recover is None for method, _ in asked] == [False, True]
    assert all(method.settings == PRESETS["default"] for method, _ in asked)
    shown = list(map(asked[0][1], steps))
    assert not shown[50].strict.any() and shown[80] is steps[80]
