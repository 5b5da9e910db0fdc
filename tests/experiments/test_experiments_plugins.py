"""A stranger's pose method, in a file outside of the package: random search around the last pose."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmc import plugins
from hmc.errors import InputError
from hmc.experiments import find_experiment, plan_of
from hmc.experiments.__main__ import main
from hmc.experiments.all_methods import grid, ways
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.sweep import stored_cells
from hmc.experiments.markerless_runs import VOXEL_M, tracked
from hmc.experiments.truth import estimate_of, first_truth
from hmc.pose.follow import FollowOptions, follow
from hmc.pose.registry import METHODS, pose_method

#: So far off may random search be: it loses limbs.
FAR_MM = 150
TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
METHOD = """
from dataclasses import replace

import numpy as np

from hmc.pose.method import PoseMethod, StepInfo, Tracked, unseen
from hmc.pose.registry import register_method
from hmc.pose.starts.candidates import StartSettings
from hmc.pose.starts.window import WindowStart
from hmc.pose.steps.polish import fine_objective
from hmc.pose.steps.presets import PRESETS

HOUSE = PRESETS["default"]


def step(rng, tracked, view):
    if view.target is None:
        return unseen(tracked)
    objective, limits = fine_objective(rng, tracked.subject, view, HOUSE.polish), tracked.subject.body.limits
    state = tracked.state
    for width in (0.2, 0.1, 0.1, 0.05):
        moved = rng.standard_normal((120, len(state))) * (rng.random((120, len(state))) < 0.1)
        states = np.concatenate([state[None], np.clip(state + width * moved, limits.low, limits.high)])
        costs = objective.cost(states)
        state = states[costs.argmin()]
    return Tracked(tracked.subject, state, state - tracked.state), StepInfo(cost=float(costs.min()), evaluations=4 * len(costs))


# Few candidates and the usual proportions: a start that takes a second.
START = WindowStart(replace(HOUSE, fit_body=None), StartSettings(anchors=1, candidates=2, follow_s=0.2))
register_method(PoseMethod("random-search", "nobody (2026)", START, step))
"""
#: The table of all methods, with one method's rows alone.
EXPERIMENT = """
from dataclasses import replace

from hmc.experiments import all_methods

EXPERIMENT = replace(
    all_methods.EXPERIMENT,
    grid=lambda plan: [one for one in all_methods.grid(plan) if one["method"] == "random-search" and one["repeat"] < 2],
)
"""


@pytest.fixture
def files(tmp_path, monkeypatch):
    """The method's file and the experiment's; nothing is left of them in this process."""
    method, experiment = tmp_path / "random_search.py", tmp_path / "mine.py"
    method.write_text(METHOD)
    experiment.write_text(EXPERIMENT)
    monkeypatch.setenv(plugins.VARIABLE, "")
    before = dict(METHODS)
    yield method, experiment
    METHODS.clear()
    METHODS.update(before)
    plugins._loaded.clear()


@pytest.mark.slow
def test_a_strangers_method_runs_from_python_and_from_experiments(files, tmp_path):
    method, experiment = files
    out, env = tmp_path / "out", {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    command = ["run", str(experiment), "--out", str(out), "--recordings", str(TINY), "--plugin", str(method), "--quiet"]
    done = subprocess.run(
        [sys.executable, "-m", "hmc.experiments", *command, "--workers", "2"], capture_output=True, text=True, env=env, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "2 cells computed" in done.stdout and "random-search" in next(out.glob("**/all-methods.csv")).read_text()

    plugins.add_plugins([method])
    assert pose_method("random-search").source == "nobody (2026)" and ("random-search", "default") in ways()
    plan = plan_of(False, [TINY])
    mine = find_experiment(str(experiment))
    cells = stored_cells(mine, out, mine.grid(plan))
    errors = [1000 * np.linalg.norm(np.subtract(one.results["estimate_m"], one.results["truth_m"]), axis=-1) for one in cells]
    assert len(errors) == 2 and all(np.mean(one) < FAR_MM for one in errors)

    # The same from Python, without an experiment.
    source = plan.recordings[0]
    seen = tracked(Inputs(out / "inputs", {source.label: TINY}), source.label, 0)
    people = follow(replace(seen.recording, n_frames=6), seen.tracks, pose_method("random-search"), FollowOptions(VOXEL_M))
    truth = first_truth(seen.recording)
    truth = truth.where(truth.frames < 6)
    assert people.status == ("fitted",) * 6
    assert 1000 * np.linalg.norm(estimate_of(truth, people.poses) - truth.positions, axis=-1).mean() < FAR_MM


def test_a_method_that_changed_is_computed_again_and_the_others_are_not(files):
    method, _ = files
    plugins.add_plugins([method])
    plan = plan_of(True, [TINY])
    before = grid(plan)
    method.write_text(METHOD.replace("0.05)", "0.02)"))
    assert {one["method"] for one in grid(plan) if one not in before} == {"random-search"}


def test_a_file_is_run_once_and_processes_that_start_later_know_it(files):
    method, _ = files
    for _ in range(2):
        plugins.add_plugins([method])
        plugins.load_plugins()
    assert plugins.plugin_files() == (str(method),)
    asked = "from hmc.pose.registry import pose_method; print(pose_method('random-search').name)"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True)
    assert done.stdout == "random-search\n", done.stderr


def test_wrong_files_are_told_in_a_line(files, tmp_path, capsys):
    broken = tmp_path / "broken.py"
    broken.write_text("1 / 0")
    for path, words in ((tmp_path / "none.py", "there is no such Python file"), (broken, "ZeroDivisionError: division by zero")):
        with pytest.raises(InputError, match=words):
            plugins.add_plugins([path])
        assert main(["status", "all-methods", "--quick", "--out", str(tmp_path), "--plugin", str(path)]) == 2
        assert words in capsys.readouterr().err
    assert plugins.plugin_files() == ()
