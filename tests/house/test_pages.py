"""The documentation site: made by docs/make_pages.py, where its tools are installed; its links lead somewhere, its search finds."""

import base64
import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PIXEL = base64.b64encode(b"a picture").decode()


@pytest.fixture(scope="module")
def part():
    """A part of the site's builder by its name."""
    for name in ("markdown2", "pygments", "nbformat"):
        pytest.importorskip(name)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "docs")
        yield lambda name: importlib.import_module(f"site_of.{name}")


@pytest.fixture(scope="module")
def site(part, tmp_path_factory):
    """The site without the pages of the functions."""
    out = tmp_path_factory.mktemp("site") / "pages"
    done = subprocess.run([sys.executable, "docs/make_pages.py", "--no-api", "--out", out], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


def test_every_page_of_the_guide_and_every_notebook_is_there(site):
    guide = {path.stem.lower() for path in (ROOT / "docs").glob("*.md")}
    assert guide <= {path.stem for path in (site / "guide").glob("*.html")}
    notebooks = {path.stem for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert notebooks | {"index"} == {path.stem for path in (site / "gallery").glob("*.html")}
    first = (site / "index.html").read_text(encoding="utf-8")
    assert all(f'href="gallery/{name}.html"' in first for name in notebooks)
    assert 'href="guide/conventions.html#calibration-formats"' in (site / "guide" / "which_when.html").read_text().replace(
        'href="', 'href="guide/'
    )


def test_what_is_searched_leads_to_headings(site):
    text = (site / "search-index.js").read_text(encoding="utf-8")
    index = json.loads(text.removeprefix("window.HMC_INDEX = ").removesuffix(";\n"))
    by_title = {title: url for title, url, _, _ in index}
    assert by_title["Calibration formats"] == "guide/conventions.html#calibration-formats"
    for _, url, _, _ in index:
        file, _, anchor = url.partition("#")
        assert (site / file).is_file() and anchor
    assert {kind for _, _, kind, _ in index} == {"guide", "notebook"}


def test_a_link_that_leads_nowhere_is_told(part):
    pages = {
        "index.html": '<a href="guide/a.html#there">x</a> <a href="https://example.org/none">x</a> <img src="b.png">',
        "guide/a.html": '<h2 id="there">x</h2> <a href="../index.html">x</a> <a href="#gone">x</a> <a href="c.html">x</a>',
    }
    wrong = part("links").broken_links(pages, {"b.png"})
    assert wrong == ["guide/a.html: #gone: no such heading or name on that page", "guide/a.html: c.html is not there"]


def test_headings_are_named_as_elsewhere(part):
    made, headings = part("guide").with_anchors("<h1>What `it` is, then?</h1><p>a</p><h2>Twice</h2><h2>Twice</h2>")
    assert [anchor for _, anchor, _ in headings] == ["what-it-is-then", "twice", "twice-1"] and 'id="twice-1"' in made


def test_notebooks_and_their_gallery(part):
    import nbformat.v4 as v4

    picture = v4.new_output("display_data", {"image/png": PIXEL + "\n"})
    small = v4.new_output("display_data", {"image/png": base64.b64encode(b"x").decode()})
    printed = v4.new_output("stream", name="stdout", text="1 < 2\n")
    notebook = v4.new_notebook(
        cells=[
            v4.new_markdown_cell("# What it is\nIt **shows** something. And [more](../docs/more.md#there)."),
            v4.new_code_cell("print(1 < 2)", outputs=[printed, small, picture]),
        ]
    )
    gallery = part("gallery")
    page, pictures = gallery.notebook_page("01_it", notebook, lambda target, page: {"docs/more.md": "guide/more.html"}[target])
    assert "<strong>shows</strong>" in page.body and "1 &lt; 2" in page.body and 'src="01_it-2.png"' in page.body
    assert 'href="../guide/more.html#there"' in page.body
    assert pictures == {"gallery/01_it-1.png": b"x", "gallery/01_it-2.png": b"a picture"}
    assert gallery.picture_of(pictures) == "gallery/01_it-2.png"
    text = gallery.gallery_page([("01_it", *gallery.title_of(notebook), "gallery/01_it-2.png")]).body
    assert 'href="01_it.html"' in text and "What it is" in text and 'src="01_it-2.png"' in text
    assert "It shows something. And more.</p>" in text
    long = "A sentence that is as long as what is said of a notebook should be at the least."
    notebook.cells[0].source = f"# What it is\nShort. {long} Another one."
    assert gallery.title_of(notebook) == ("What it is", f"Short. {long}")


def test_functions_from_their_docstrings(part):
    pytest.importorskip("pdoc")
    pages = {page.path: page for page in part("api").api_pages("hmc.metrics")}
    page = pages["api/hmc/metrics/landmarks.html"]
    assert "landmark_errors" in page.body and "Parameters" in page.body and "<main" not in page.body
    assert any(entry.title == "landmark_errors" and entry.anchor == "landmark_errors" for entry in page.entries)
    assert "api/hmc/metrics/mot.html" in pages and 'href="metrics/mot.html"' in pages["api/hmc/metrics.html"].body


@pytest.mark.slow
def test_the_whole_site_has_no_broken_link(part, tmp_path):
    pytest.importorskip("pdoc")
    done = subprocess.run([sys.executable, "docs/make_pages.py", "--out", tmp_path / "pages"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "pages" / "api" / "hmc" / "pose" / "registry.html").is_file()
