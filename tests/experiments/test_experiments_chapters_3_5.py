"""Experiments of chapters 3 and 5 and appendix B: toy sizes show the papers' claims; reports on poses that are known."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from hmc.body.joints import N_CANTON
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import canton_body, default_body
from hmc.experiments import Plan, find_experiment, pose_runs
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.style import house_style
from hmc.experiments.fig_4_2 import peaks_of
from hmc.experiments.fig_5_3 import misplaced
from hmc.experiments.fig_b_1 import rotated_pixels
from hmc.experiments.toy_likelihood import DISTRACTOR_FRAMES, log_mixture, moving_log_likelihood, target_path


def test_a_peak_of_tops_is_more_than_the_flank_of_another():
    rng = np.random.default_rng(0)
    standing, sitting = rng.normal(1.7, 0.07, 4000), rng.normal(1.2, 0.06, 600)
    np.testing.assert_allclose(sorted(peaks_of(np.concatenate([standing, sitting]))), [1.2, 1.7], atol=0.06)
    (only,) = peaks_of(standing)
    assert abs(only - 1.7) < 0.06


def test_without_rotation_every_pixel_stays_and_oversampling_fills_the_holes():
    for alpha in (1.0, 0.7):
        assert len(rotated_pixels(31, alpha, 0.0)) == 31**2
    whole, sampled = (len(rotated_pixels(101, alpha, np.pi / 4)) / 101**2 for alpha in (1.0, 0.7))
    # Small squares with their middle on a pixel's have the thesis's 84 %.
    assert [round(100 * len(rotated_pixels(side, 1.0, np.pi / 4)) / side**2, 1) for side in (31, 41)] == [84.2, 84.3]
    # A unit square holds a point of a lattice turned by 45 degrees with probability 2 (sqrt 2 - 1).
    assert whole == pytest.approx(2 * (np.sqrt(2) - 1), abs=0.02)
    assert sampled > 0.98


def test_toy_likelihoods_peak_where_they_should():
    x = np.linspace(-10, 10, 2001)[:, None]
    assert x[log_mixture(x).argmax(), 0] == pytest.approx(5.5, abs=0.05)
    path = target_path(20)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 1.2
    for frame in (0, DISTRACTOR_FRAMES[-1]):
        target = path[frame]
        there, beside = moving_log_likelihood(np.array([target, target + 2.5]), target, frame)
        assert (there > beside) == (frame == 0)


@pytest.mark.parametrize("name", ["fig-3.3", "fig-3.5", "fig-B.1"])
def test_toy_sizes_run_and_report(name):
    experiment, plan = find_experiment(name), Plan(quick=True)
    cells = []
    for k, parameters in enumerate(experiment.grid(plan)):
        if parameters.get("repeat", 0) > 1 or parameters.get("side_px", 51) != 51:
            continue
        small = (
            {**parameters, "frames": 8} if name == "fig-3.5" else {**parameters, "side_px": 31} if "side_px" in parameters else parameters
        )
        cells.append(Cell(parameters, experiment.cell(small, None, np.random.default_rng(k))))
    with house_style():
        report = experiment.report(cells, plan)
        plt.close("all")
    assert report.tables[0].rows and name in report.figures


@pytest.fixture(scope="module")
def pose_cells():
    """Estimates as cells hold them: a body of other lengths, noise by method, and an arm lost for a while."""
    rng, n = np.random.default_rng(0), 30
    states = np.tile(neutral_state("down"), (n, 1))
    states[:, 2] = 0.95
    states[:, 3:N_CANTON] += 0.3 * np.sin(np.arange(n)[:, None] / 6 + np.arange(N_CANTON - 3))  # both bodies take it
    truth = landmarks(default_body(1.75), states)
    cells = []
    for clip in ("one@0", "other@0"):
        for method, noise in (("canton2009", 0.02), ("default", 0.012), ("markers", 0.01), ("clean markers", 0.008)):
            estimate = landmarks(canton_body(1.75) if method == "canton2009" else default_body(1.75), states)
            estimate = estimate + noise * rng.standard_normal(truth.shape)
            if method == "canton2009":
                estimate[8:16, 3:6] += 0.3
            results = {"frames": np.arange(n), "fps": 30.0, "estimate_m": estimate, "truth_m": truth}
            cells.append(Cell({"recording": clip, "method": method, "repeat": 0}, results))
    return cells


def test_a_landmark_is_misplaced_where_another_one_is_nearer():
    truth = np.arange(45.0).reshape(1, 15, 3)
    estimate = truth.copy()
    assert not misplaced(estimate, truth).any()
    estimate[0, [11, 14]] = truth[0, [14, 11]]
    estimate[0, 5] = np.nan
    assert np.flatnonzero(misplaced(estimate, truth)[0]).tolist() == [5, 11, 14]


@pytest.mark.parametrize("name", ["fig-5.3", "fig-5.4", "fig-5.5", "fig-5.6", "fig-5.7"])
def test_reports_on_known_poses(pose_cells, name):
    experiment = find_experiment(name)
    assert {parameters["method"] for parameters in experiment.grid(Plan(quick=True))} == set(pose_runs.METHODS)
    assert experiment.store_name == pose_runs.FAMILY and experiment.cell is pose_runs.cell
    with house_style():
        report = experiment.report(pose_cells, Plan(quick=True))
        plt.close("all")
    rows = report.tables[0].rows
    if name == "fig-5.3":
        good, poor, all_good, all_poor = rows
        assert poor["method"] == "canton2009" and 8 <= poor["frame"] < 16
        assert good["frame"] is not None and good["mean_mm_paper"] == 48.91
        assert all_good["MMTA"] > all_poor["MMTA"] and all_good["frames"] + all_poor["frames"] == 240
    if name in ("fig-5.4", "fig-5.6", "fig-5.7"):
        assert [row["method"] for row in rows] == list(pose_runs.METHODS.values())
    if name == "fig-5.5":
        assert rows[0]["mean_with_MMTA"] < -0.5 and rows[1]["runs_with_losses"] == 0
    if name == "fig-5.7":
        assert rows[0]["mean_deg"] > 0 and rows[0]["angles_counted"] < 1
