"""The notebooks run from top to bottom, and are stored with what they show, which is of the cells that they have."""

import base64
import importlib.util
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
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


@pytest.fixture(scope="module")
def storing():
    """The script that stores them, `make notebooks`."""
    pytest.importorskip("nbformat")
    spec = importlib.util.spec_from_file_location("run_notebooks", FOLDER.parent / "docs" / "run_notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_with_what_its_cells_show(path, storing):
    notebook = read(path)
    assert not storing.is_stale(notebook), "its cells or the version are others than those that were run: `make notebooks`"
    assert path.stat().st_size <= storing.MOST_BYTES
    for cell in notebook.cells:
        assert cell.get("execution_count") is None and not cell.metadata
        assert all(output.output_type != "error" for output in cell.get("outputs", ()))
        if cell.cell_type == "code" and any(word in cell.source for word in DRAWS):
            assert sum(PNG in output.get("data", {}) for output in cell.outputs) == 1
    text = path.read_text(encoding="utf-8")
    assert not re.search(r" at 0x[0-9a-f]{6,}|/tmp/|/home/|/root/", text), "what it shows tells of the machine"


def test_changed_cells_are_stale_and_changed_words_are_not(storing):
    import nbformat.v4 as v4

    cells = [v4.new_markdown_cell("words"), v4.new_code_cell("1 + 1", execution_count=7, metadata={"scrolled": True})]
    cells[1].outputs = [v4.new_output("stream", name="stderr", text="12 %"), v4.new_output("execute_result", {"text/plain": "2"})]
    notebook = v4.new_notebook(cells=cells)
    assert storing.is_stale(notebook)
    stored = storing.tidied(notebook)
    assert not storing.is_stale(stored) and [output.output_type for output in stored.cells[1].outputs] == ["execute_result"]
    assert stored.cells[1].execution_count is None and not stored.cells[1].metadata
    stored.cells[0].source = "other words"
    assert not storing.is_stale(stored)
    stored.cells[1].source = "1 + 2"
    assert storing.is_stale(stored)


def test_pictures_are_made_smaller_and_look_the_same(storing):
    rng = np.random.default_rng(0)
    smooth = cv2.resize(rng.integers(80, 180, (6, 8, 3), np.uint8), (320, 240), interpolation=cv2.INTER_CUBIC)
    before = base64.b64encode(cv2.imencode(".png", smooth)[1].tobytes()).decode()
    after = storing.smaller(before)
    seen = cv2.imdecode(np.frombuffer(base64.b64decode(after), np.uint8), cv2.IMREAD_COLOR)
    assert len(after) < len(before) / 2 and seen.shape == smooth.shape
    assert np.abs(seen.astype(int) - smooth).mean() < 5


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
