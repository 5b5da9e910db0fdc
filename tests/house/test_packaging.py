"""What is installed: a wheel that was built from the checkout does, in an empty environment and elsewhere, what the README says."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import hmc
from hmc.io.shipped import DISTRIBUTION, shipped_folder

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WHAT_IS_BUILT = ("hmc", "pyproject.toml", "README.md", "LICENSE", "MANIFEST.in")


def test_the_sample_is_the_small_recording():
    assert hmc.sample().path == shipped_folder() / "tiny" == ROOT / "data" / "synthetic" / "tiny"
    assert PROJECT["project"]["name"] == DISTRIBUTION


def test_everything_of_the_small_recording_is_in_the_list_of_what_is_installed():
    listed = {path for globs in PROJECT["tool"]["setuptools"]["data-files"].values() for glob in globs for path in ROOT.glob(glob)}
    there = {path for path in (ROOT / "data" / "synthetic").rglob("*") if path.is_file()}
    assert there == listed


def test_nobody_is_told_to_install_what_is_somebody_elses():
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "hmc").rglob("*.py"), *(ROOT / "notebooks").glob("*.ipynb")]:
        assert not re.search(r"pip install +['\"]?hmc(\[|['\"]?\s|$)", path.read_text(encoding="utf-8"), re.MULTILINE), path


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Python of an environment that has the wheel, and of the libraries what this one has."""
    folder = tmp_path_factory.mktemp("packaging")
    (folder / "source").mkdir()
    for name in WHAT_IS_BUILT:
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, folder / "source" / name)
    shutil.copytree(ROOT / "data" / "synthetic", folder / "source" / "data" / "synthetic")
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder), str(folder / "source")]
    done = subprocess.run(build, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "venv", with_pip=False)
    python = folder / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    done = subprocess.run([*pip, "--python", str(python), "install", "--no-deps", str(wheel)], env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    # The libraries are those of this environment: a path appended behind the wheel's own, so that hmc is the wheel's.
    (site,) = (folder / "venv").rglob("site-packages")
    import numpy

    (site / "libraries.pth").write_text(str(Path(numpy.__file__).parents[1]) + "\n")
    return python, wheel, clean


@pytest.mark.slow
def test_the_wheel_has_types_data_and_licence(installed):
    names = zipfile.ZipFile(installed[1]).namelist()
    assert {"hmc/py.typed", "hmc/tracking/person_tree.csv"} <= set(names)
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if name.startswith(("tests", "docs", "notebooks"))]
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "hmc").rglob("*.py")}
    assert modules <= set(names)


@pytest.mark.slow
def test_the_readmes_program_runs_where_there_is_no_checkout(installed, tmp_path):
    python, _, clean = installed
    blocks = re.findall(r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    program = blocks[0] + "\nprint(hmc.__file__)\nfrom hmc.synthetic.recipe import shipped_recipes\nprint(*shipped_recipes())\n"
    done = subprocess.run([python, "-c", program], cwd=tmp_path, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    mean_mm, where, recipes = done.stdout.splitlines()[-3:]
    assert 5 < float(mean_mm) < 30
    assert str(python.parents[1]) in where and {"tiny", "demo", "bvh"} <= set(recipes.split())
    assert (tmp_path / "people.png").is_file() and (tmp_path / "result" / "joints.csv").is_file()
    command = subprocess.run([python.with_name("hmc"), "--version"], cwd=tmp_path, env=clean, capture_output=True, text=True)
    assert command.stdout.split() == ["hmc", hmc.__version__]
