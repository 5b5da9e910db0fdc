"""Cells over Dask, against a real scheduler with two worker processes, one of which is killed; stores of several machines merged."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hmc.errors import InputError
from hmc.experiments import Plan, run_experiment
from hmc.experiments.__main__ import main
from hmc.experiments.engine.merging import merge_stores
from hmc.experiments.engine.store import cell_text, write_text

ROOT = Path(__file__).resolve().parents[2]

#: Each cell notes who began it, and does what files in the folder of the run tell it to.
TOY = """
import os
import time

from hmc.experiments import Claim, Experiment, Report, Table
from hmc.errors import InputError


def grid(plan):
    return [{"size": size, "repeat": k} for size in (1, 2, 3) for k in range(4 if plan.quick else 6)]


def cell(parameters, inputs, rng):
    out = inputs.folder.parent
    out.mkdir(parents=True, exist_ok=True)
    with open(out / "begun.log", "a") as log:
        log.write(f"{os.getpid()} {parameters['size']} {parameters['repeat']}\\n")
    time.sleep(0.4 if (out / "slowly").exists() else 0)
    if (out / "wrong").exists():
        raise InputError("no such thing")
    return {"value": rng.normal(0, parameters["size"]), "many": rng.random(3)}


def report(cells, plan):
    rows = [{"size": one.parameters["size"], "ours_mm": one.results["value"]} for one in cells]
    return Report((Table("toy", "A toy", rows),), {}, (Claim("it runs", True),))


EXPERIMENT = Experiment("toy", "a toy", "nobody", grid, cell, report)
"""


@pytest.fixture
def toy(tmp_path):
    path = tmp_path / "toy.py"
    path.write_text(TOY)
    return path


class Cluster:
    """A scheduler and worker processes, each its own program."""

    def __init__(self, folder):
        self.file = folder / "scheduler.json"
        self.environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "ignore"}
        self.programs = [
            self.start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(self.file), "--no-dashboard")
        ]
        deadline = time.monotonic() + 60
        while not self.file.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        self.address = json.loads(self.file.read_text())["address"]

    def start(self, what, *options):
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *options]
        return subprocess.Popen(command, env=self.environment, cwd=self.file.parent, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def add_worker(self):
        options = ("--scheduler-file", str(self.file), "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory")
        self.programs.append(self.start("worker", *options, str(self.file.parent / f"worker-{len(self.programs)}")))
        return self.programs[-1]

    def wait_for_workers(self):
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(len(self.programs) - 1, timeout=60)

    def close(self):
        for program in reversed(self.programs):
            program.kill()
            program.wait(30)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """With two workers; the first test kills one of them, which the others do not mind."""
    pytest.importorskip("distributed")
    many = Cluster(tmp_path_factory.mktemp("cluster"))
    try:
        many.add_worker()
        many.add_worker()
        many.wait_for_workers()
        yield many
    finally:
        many.close()


def cells_of(out):
    """Parameters and results by name: seconds differ."""
    return {path.name: {**json.loads(path.read_text()), "made": None} for path in (out / "cells" / "toy").glob("*.json")}


def begun_in(log):
    return [line.split() for line in log.read_text().splitlines()] if log.exists() else []


def wait_for(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert condition()


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing(toy, tmp_path, cluster):
    whole, out = tmp_path / "whole", tmp_path / "out"
    run_experiment(str(toy), whole, Plan(quick=True))

    out.mkdir()
    (out / "slowly").touch()
    killed, other = cluster.programs[1:]
    log = out / "begun.log"
    command = ["run", str(toy), "--quick", "--quiet", "--out", str(out), "--backend", "dask", "--scheduler", cluster.address]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    run = subprocess.Popen([sys.executable, "-m", "hmc.experiments", *command], env=cluster.environment, **pipes)
    wait_for(lambda: run.poll() is not None or [pid for pid, *_ in begun_in(log)].count(str(killed.pid)) == 2)
    os.kill(killed.pid, signal.SIGKILL)
    output, errors = run.communicate(timeout=120)

    assert run.returncode == 0, errors
    assert "12 cells computed, 0 found" in output
    assert cells_of(out) == cells_of(whole)
    begun = begun_in(log)
    assert {pid for pid, *_ in begun} == {str(killed.pid), str(other.pid)}
    assert len({tuple(cell) for _, *cell in begun}) == 12
    assert 12 <= len(begun) <= 14  # all once, but those the dead worker had in hand


def test_a_dask_run_goes_on_where_another_stopped(toy, tmp_path, cluster, capsys):
    out = tmp_path / "out"
    run_experiment(str(toy), out, Plan(quick=True))
    assert main(["run", str(toy), "--quiet", "--out", str(out), "--backend", "dask", "--scheduler", cluster.address]) == 0
    assert "6 cells computed, 12 found" in capsys.readouterr().out
    run_experiment(str(toy), tmp_path / "here")
    assert cells_of(out) == cells_of(tmp_path / "here")


def test_wrong_input_on_a_worker_is_told_in_a_line(toy, tmp_path, cluster, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "wrong").touch()
    assert main(["run", str(toy), "--quiet", "--out", str(tmp_path / "out"), "--backend", "dask", "--scheduler", cluster.address]) == 2
    assert capsys.readouterr().err.strip().endswith("no such thing")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--backend", "dask"], "go together"),
        (["--scheduler", "tcp://127.0.0.1:1"], "go together"),
        (["--backend", "dask", "--scheduler", "tcp://127.0.0.1:1"], "no Dask scheduler answers"),
        (["--backend", "dask", "--scheduler", "nonsense://x"], "no Dask scheduler answers"),
    ],
)
def test_a_scheduler_that_is_not_there(options, words, toy, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("hmc.experiments.engine.cluster.CONNECT_S", 0.5)
    assert main(["run", str(toy), "--quiet", "--out", str(tmp_path / "out"), *options]) == 2
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1


def test_stores_of_several_machines_are_merged(toy, tmp_path, capsys):
    here, there = tmp_path / "here", tmp_path / "there"
    run_experiment(str(toy), here, Plan(quick=True))
    run_experiment(str(toy), there)
    assert main(["merge", str(there), "--out", str(here)]) == 0
    assert "6 cells copied, 12 were here" in capsys.readouterr().out
    assert cells_of(here) == cells_of(there)
    merged = run_experiment(str(toy), here)
    assert (merged.computed, merged.found) == (0, 18)


def test_merging_takes_no_cell_that_is_not_what_its_name_says(tmp_path, capsys):
    here, there = tmp_path / "here", tmp_path / "there"
    run_experiment("fig-B.1", here, Plan(quick=True))
    shutil.copytree(here, there)
    first, second, third, fourth = sorted((there / "cells" / "fig-B.1").glob("*.json"))[:4]
    for path in (second, fourth):
        (here / "cells" / "fig-B.1" / path.name).unlink()
    first.write_text(first.read_text().replace('"results"', '"found"'))  # damaged
    content = json.loads(second.read_text())
    second.write_text(cell_text(content["parameters"] | {"step_deg": 11}, content["results"]))  # other parameters under this name
    content = json.loads(third.read_text())
    third.write_text(cell_text(content["parameters"], dict.fromkeys(content["results"], 0)))  # other results
    before = cells_of_b1(here)
    merged = merge_stores(here, [there])
    assert (merged.copied, merged.damaged, merged.old, merged.different) == (1, (first,), (second,), (third,))
    assert merged.same == len(before) - 2
    assert cells_of_b1(here) == before | {fourth.name: fourth.read_bytes()}
    assert main(["merge", str(there), "--out", str(here)]) == 1
    told = capsys.readouterr()
    assert (
        "1 cell is damaged" in told.err
        and "1 cell is of an earlier version" in told.err
        and "1 cell is here with other results" in told.err
    )


def test_results_without_a_number_are_the_same_when_merged(tmp_path):
    """What equals nothing, itself included, is still the same result."""
    here, there = tmp_path / "here", tmp_path / "there"
    for folder in (here, there):
        write_text(folder / "cells" / "toy" / "one.json", cell_text({"x": 1}, {"none": np.nan, "many": [np.nan, 1.0]}))
        write_text(folder / "cells" / "toy" / "other.json", cell_text({"x": 2}, {"none": np.nan if folder == here else 0.0}))
    merged = merge_stores(here, [there])
    assert (merged.copied, merged.same) == (0, 1) and [path.name for path in merged.different] == ["other.json"]


def cells_of_b1(out):
    return {path.name: path.read_bytes() for path in (out / "cells" / "fig-B.1").glob("*.json")}


def test_merging_what_is_no_store(tmp_path):
    with pytest.raises(InputError, match="has no folder cells"):
        merge_stores(tmp_path, [tmp_path / "nowhere"])
