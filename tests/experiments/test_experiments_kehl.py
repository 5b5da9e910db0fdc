"""Experiments of Kehl's figures: what is made of cells, and a cell that needs no recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hmc.experiments import kehl_1, kehl_9, kehl_11, kehl_13, kehl_14, kehl_17, kehl_runs
from hmc.experiments.engine.experiment import Cell, Plan
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.library import find_experiment
from hmc.synthetic.library import make_motion
from hmc.synthetic.recipe import load_recipe
from hmc.synthetic.skeleton import landmark_positions, make_skeleton

IDS = ("kehl-1", "kehl-4", "kehl-9", "kehl-11", "kehl-13", "kehl-14", "kehl-17")


def cells_of(experiment, off_m, seconds):
    """Cells of a standing body that is off by so much, for each variant."""
    rng = np.random.default_rng(0)
    truth = np.cumsum(rng.normal(0, 0.01, (20, 15, 3)), axis=0) + rng.normal(0, 0.4, (15, 3))
    cells = []
    for parameters in experiment.grid(Plan()):
        shift = [off_m[parameters["variant"]], 0, 0]
        picture = {"frame": 3, "image": np.zeros((40, 30, 3), np.uint8), "uv": 20 * rng.random((15, 2))}
        results = {
            "frames": list(range(20)), "fps": 15.0, "estimate_m": truth + shift, "truth_m": truth,
            "seconds": [seconds[parameters["variant"]]] * 20, "iterations": np.full((20, 6), 7), "pictures": [picture],
        }  # fmt: skip
        cells.append(Cell(parameters, results))
    return cells


@pytest.mark.parametrize("name", IDS)
def test_every_experiment_is_listed_with_distinct_cells(name):
    experiment = find_experiment(name)
    assert experiment.id == name
    for quick in (True, False):
        grid = experiment.grid(Plan(quick))
        assert len({repr(parameters) for parameters in grid}) == len(grid) > 0


def test_hull_cell_is_identical_and_reported_beside_the_paper():
    parameters = kehl_1.grid(Plan(quick=True))[0] | {"side": 24, "frames": 2}
    results = kehl_1.cell(parameters, Inputs(Path("unused")), np.random.default_rng(0))
    assert results["identical"]
    assert results["surface_voxels"] > 50
    report = kehl_1.report([Cell(parameters | {"side": 64}, results)], Plan())
    assert report.tables[0].rows[0]["paper_reconstruction_ms"] == 7.56
    assert report.claims[0].holds


@pytest.mark.parametrize("smd_mm", [30.0, 60.0])
def test_claims_against_levenberg_marquardt_follow_the_figures(smd_mm):
    beside = dict.fromkeys(kehl_13.BESIDE, 0.01)  # they decide nothing
    off = {"SMD": smd_mm / 1000, "LM": 0.05, "LM, 5 times the points": 0.04} | beside
    report = kehl_13.report(cells_of(kehl_13, off, {"SMD": 0.1, "LM": 0.2, "LM, 5 times the points": 0.5} | beside), Plan())
    rows = {row["method"]: row for row in report.tables[0].rows}
    assert rows["SMD"]["mean_error_mm"] == pytest.approx(smd_mm)
    assert rows["LM"]["frames_per_s"] == pytest.approx(5)
    assert [claim.holds for claim in report.claims] == [smd_mm <= 40, smd_mm < 50, True]


@pytest.mark.parametrize(("experiment", "better"), [(kehl_11, "surface, edges"), (kehl_17, "SMD")])
def test_cues_are_compared_by_the_arms(experiment, better):
    off = dict.fromkeys(kehl_runs.VARIANTS, 0.06)
    for value, holds in ((0.03, True), (0.09, False)):
        report = experiment.report(cells_of(experiment, off | {better: value}, dict.fromkeys(off, 0.1)), Plan())
        assert report.claims[0].holds == holds


def test_fast_motion_tells_turns_and_loss():
    report = kehl_14.report(cells_of(kehl_14, {"SMD": 0.15}, {"SMD": 0.1}), Plan())
    assert not report.claims[1].holds
    assert report.tables[0].rows[0]["last_tenth_mm"] == pytest.approx(150)


def test_displacements_are_counted():
    results = {"distance_m": {"SMD": [0.01, 0.02, 0.3], "deterministic": [0.01, 0.2, 0.3]}, "degrees": [20, 30, 40]}
    report = kehl_9.report([Cell(kehl_9.grid(Plan())[0], results)], Plan())
    assert [row["led_back"] for row in report.tables[0].rows] == [2, 1]
    assert report.claims[0].holds


@pytest.mark.parametrize("name", ["kick_turn", "pedal_arms", "dance", "play_cube"])
def test_drills_keep_feet_above_the_floor_and_bones_their_length(name):
    recipe = load_recipe(name)
    skeleton = make_skeleton(1.8, "man", np.random.default_rng(0))
    times = np.arange(recipe.n_frames) / recipe.fps
    motion = make_motion(recipe.actors[0], skeleton, times, np.random.default_rng(1))
    points = landmark_positions(skeleton, motion.root, motion.orientations)
    ankles = points[:, [11, 14], 2]
    assert ankles.min() > 0.9 * skeleton.ankle_height
    assert ankles.min(axis=1).max() < skeleton.ankle_height + 0.15  # one foot stands, or nearly
    spread = np.linalg.norm(points[0, 5, :2] - points[0, 8, :2])
    assert spread > 0.7 * 1.8  # da Vinci's man


def test_kick_and_turn_has_the_papers_length():
    assert load_recipe("kick_turn").n_frames == 115
