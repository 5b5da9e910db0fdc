"""The gallery: notebooks as they are stored, with what they show."""

import base64
import html
import re

import nbformat
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

from site_of.guide import PlaceOf, prose, relocated, sections, with_anchors
from site_of.shell import Page

__all__ = ["gallery_page", "notebook_page", "picture_of", "title_of"]

#: What is said of a notebook in the gallery is made of whole sentences, until it is at least so long.
LEAST_SAID = 70
PNG = "image/png"


def title_of(notebook: nbformat.NotebookNode) -> tuple[str, str]:
    """A notebook's heading, and the first sentences below it: so many that they say something."""
    heading, _, rest = notebook.cells[0].source.partition("\n")
    said, plain = "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", re.sub(r"[*`]", "", rest.strip().replace("\n", " ")))
    for sentence in re.split(r"(?<=[.?])\s", plain):
        if len(said) >= LEAST_SAID:
            break
        said = f"{said} {sentence}".strip()
    return heading.lstrip("# "), said


def notebook_page(name: str, notebook: nbformat.NotebookNode, place_of: PlaceOf) -> tuple[Page, dict[str, bytes]]:
    """A stored notebook as a page, and its pictures by their places in the site."""
    parts, pictures = [], dict[str, bytes]()
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(relocated(prose(cell.source), "notebooks", f"gallery/{name}.html", place_of))
            continue
        parts.append(highlight(cell.source, PythonLexer(), HtmlFormatter()))
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if output.output_type == "stream":
                parts.append(f'<pre class="output">{html.escape(output.text)}</pre>')
            elif PNG in data:
                file = f"{name}-{len(pictures) + 1}.png"
                pictures[f"gallery/{file}"] = base64.b64decode(data[PNG])
                parts.append(f'<img alt="what the cell above shows" src="{file}" loading="lazy">')
            elif "text/html" in data:
                parts.append(f'<div class="table">{data["text/html"]}</div>')
            elif "text/plain" in data:
                parts.append(f'<pre class="output">{html.escape(data["text/plain"])}</pre>')
    made, headings = with_anchors("\n".join(parts))
    source = f'<p><a href="../files/notebooks/{name}.ipynb">The notebook itself</a></p>'
    return Page(f"gallery/{name}.html", title_of(notebook)[0], made + source, headings, sections(made, headings, "notebook")), pictures


def picture_of(pictures: dict[str, bytes]) -> str:
    """The picture that stands for a notebook: the one with the most bytes, which has the most in it; empty where there is none."""
    return max(pictures, key=lambda name: len(pictures[name]), default="")


def gallery_page(cards: list[tuple[str, str, str, str]]) -> Page:
    """One picture, heading and what is said of each notebook: cards of (name, title, what is said, picture's place)."""
    parts = ["<h1>Notebooks</h1>", '<div class="gallery">']
    for name, title, sentence, picture in cards:
        image = f'<img alt="" src="{picture.removeprefix("gallery/")}" loading="lazy">' if picture else ""
        text = f"<h2>{html.escape(title)}</h2><p>{html.escape(sentence)}</p>"
        parts.append(f'<a href="{name}.html"><div class="picture">{image}</div>{text}</a>')
    return Page("gallery/index.html", "Notebooks", "\n".join([*parts, "</div>"]))
