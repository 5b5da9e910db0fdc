"""Methods and trackers of files outside of the package, by name on the command line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hmc.io.results import read_joints, read_run

ROOT = Path(__file__).resolve().parents[2]
TINY = ROOT / "data" / "synthetic" / "tiny"


def run(*words):
    """In a process of its own: what a plugin registers stays."""
    environment = {name: value for name, value in os.environ.items() if name != "HMC_PLUGINS"}
    return subprocess.run([sys.executable, "-m", "hmc", *map(str, words)], capture_output=True, text=True, cwd=ROOT, env=environment)


@pytest.mark.parametrize(("file", "method"), [("random_search.py", "random-search"), ("top_of_head.py", "apf-top")])
@pytest.mark.slow
def test_examples_of_the_documentation_run(file, method, tmp_path):
    words = ("pose", TINY, "--plugin", f"docs/{file}", "--method", method, "--frames", 3, "--voxel", 0.05, "--out", tmp_path, "--quiet")
    done = run(*words)
    assert done.returncode == 0, done.stderr
    assert read_joints(tmp_path / "joints.csv").frames.tolist() == [0, 1, 2]
    told = read_run(tmp_path / "run.toml")
    assert told["method"] == method and len(told["parameters"]["plugins"]) == 16


@pytest.mark.parametrize("command", ["pose", "track"])
def test_what_is_no_plugin_is_one_line(command, tmp_path):
    (tmp_path / "broken.py").write_text("1 / 0")
    for file, said in (("none.py", "there is no such Python file"), ("broken.py", "ZeroDivisionError")):
        done = run(command, TINY, "--plugin", tmp_path / file, "--out", tmp_path / "out")
        assert done.returncode == 2 and said in done.stderr and len(done.stderr.splitlines()) == 1
