"""Pages of functions and notebooks: made by docs/make_pages.py, where its tools are installed."""

import base64
import importlib.util
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "make_pages.py"
PIXEL = base64.b64encode(b"a picture").decode()


@pytest.fixture(scope="module")
def pages():
    for name in ("pdoc", "markdown2", "pygments", "nbclient"):
        pytest.importorskip(name)
    spec = importlib.util.spec_from_file_location("make_pages", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_functions_from_their_docstrings(pages, tmp_path):
    pages.make_api(tmp_path, "hmc.metrics")
    text = (tmp_path / "hmc" / "metrics" / "landmarks.html").read_text(encoding="utf-8")
    assert "landmark_errors" in text and "<h6" in text and "Parameters" in text
    assert (tmp_path / "hmc" / "metrics" / "mot.html").is_file()


def test_notebooks_and_their_gallery(pages):
    import nbformat.v4 as v4

    picture = v4.new_output("display_data", {"image/png": PIXEL + "\n"})
    small = v4.new_output("display_data", {"image/png": base64.b64encode(b"x").decode()})
    printed = v4.new_output("stream", name="stdout", text="1 < 2\n")
    notebook = v4.new_notebook(
        cells=[
            v4.new_markdown_cell("# What it is\nIt **shows** something. And more."),
            v4.new_code_cell("print(1 < 2)", outputs=[printed, small, picture]),
        ]
    )
    text = pages.notebook_page(notebook)
    assert "<strong>shows</strong>" in text and "1 &lt; 2" in text and f"data:image/png;base64,{PIXEL}" in text
    gallery = pages.gallery_page({"01_it": notebook})
    assert 'href="01_it.html"' in gallery and "What it is" in gallery and "It shows something.</p>" in gallery and PIXEL in gallery
