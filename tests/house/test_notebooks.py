"""The notebooks run from top to bottom, and are kept without output."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
PNG = "image/png"
#: A cell that has one of these makes one picture.
DRAWS = ("draw_", "plt.figure(", "plt.subplots(")


def read(path):
    nbformat = pytest.importorskip("nbformat")
    return nbformat.read(path, as_version=4)


def test_there_are_notebooks():
    assert [path.stem for path in NOTEBOOKS][:1] == ["01_first_recording"] and len(NOTEBOOKS) >= 9


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_kept_without_output(path):
    for cell in read(path).cells:
        assert not cell.get("outputs") and cell.get("execution_count") is None, "clear the outputs before you commit"


#: Runs a notebook in a process of its own. The kernel is spoken to by files, not by ports: a port that is found free may be
#: taken by the notebook beside it before the kernel binds it.
RUN = """
import sys, jupyter_client, nbclient, nbformat
notebook = nbformat.read(sys.argv[1], as_version=4)
kernel = jupyter_client.AsyncKernelManager(kernel_name="python3", transport="ipc", ip=sys.argv[3] + "-ipc")
nbclient.NotebookClient(notebook, km=kernel, timeout=300, resources={"metadata": {"path": sys.argv[2]}}).execute()
nbformat.write(notebook, sys.argv[3])
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Every notebook's run, two at a time: most of what they do is one thread's work."""
    pytest.importorskip("nbclient")
    folder = tmp_path_factory.mktemp("notebooks")
    own = {"JUPYTER_PLATFORM_DIRS": "1", "MPLBACKEND": "module://matplotlib_inline.backend_inline", "OPENBLAS_NUM_THREADS": "1"}

    def run(path):
        command = [sys.executable, "-c", RUN, str(path), str(path.parent), str(folder / path.name)]
        return subprocess.run(command, env=os.environ | own, capture_output=True, text=True), folder / path.name

    with ThreadPoolExecutor(2) as pool:
        yield {path: pool.submit(run, path) for path in NOTEBOOKS}


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs_and_shows_pictures(path, runs):
    done, result = runs[path].result()
    assert done.returncode == 0, done.stderr
    notebook = read(result)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    pictures = [output for output in outputs if PNG in output.get("data", {})]
    complaints = [output.text for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    drawing = [cell for cell in notebook.cells if cell.cell_type == "code" and any(word in cell.source for word in DRAWS)]
    assert len(pictures) == len(drawing)
    assert not complaints
