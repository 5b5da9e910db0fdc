"""Pages from what is in the repository: the functions from their docstrings (by pdoc), and a gallery from the notebooks, which are run.

python docs/make_pages.py --out out/pages
"""

import argparse
import base64
import html
import re
import warnings
from pathlib import Path

import markdown2
import nbclient
import nbformat
import pdoc
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

ROOT = Path(__file__).resolve().parents[1]
STYLE = """
body { font: 16px/1.55 system-ui, "DejaVu Sans", sans-serif; color: #1c2430; max-width: 1060px; margin: 0 auto; padding: 1.5rem; }
a { color: #1f4f9c; text-decoration: none; } a:hover { text-decoration: underline; } img { max-width: 100%; height: auto; }
pre { background: #f5f7fa; border-radius: 4px; padding: .7rem .9rem; overflow-x: auto; font-size: .84rem; line-height: 1.45; }
pre.output { background: none; border-left: 3px solid #d4dae4; border-radius: 0; } code { font-size: .9em; }
.gallery { display: grid; grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); gap: 1.5rem; }
.gallery a { color: inherit; } .gallery .picture { height: 190px; overflow: hidden; border: 1px solid #e3e7ee; border-radius: 4px; }
.gallery img { width: 100%; } .gallery h2 { font-size: 1.05rem; margin: .5rem 0 .2rem; }
.gallery p { margin: 0; font-size: .88rem; color: #566072; }
"""


def page(title: str, body: str) -> str:
    """A page around a body of HTML."""
    colors = HtmlFormatter(style="friendly").get_style_defs(".highlight")
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>{html.escape(title)}</title>'
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}\n<style>{STYLE}{colors}</style></head>\n<body>\n{body}\n</body></html>\n'


def prose(text: str) -> str:
    """Markdown as HTML."""
    return markdown2.markdown(text, extras=["fenced-code-blocks", "tables"])


def title_of(notebook: nbformat.NotebookNode) -> tuple[str, str]:
    """A notebook's heading, and the first sentence below it."""
    heading, _, rest = notebook.cells[0].source.partition("\n")
    return heading.lstrip("# "), re.split(r"(?<=[.?])\s", re.sub(r"[*`]", "", rest.strip().replace("\n", " ")))[0]


def notebook_page(notebook: nbformat.NotebookNode) -> str:
    """A notebook that has been run, as a page."""
    parts = ['<p><a href="index.html">All notebooks</a></p>']
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(prose(cell.source))
            continue
        parts.append(highlight(cell.source, PythonLexer(), HtmlFormatter()))
        for output in cell.get("outputs", ()):
            if output.output_type == "stream":
                parts.append(f'<pre class="output">{html.escape(output.text)}</pre>')
            elif "image/png" in output.get("data", {}):
                parts.append(f'<img alt="" src="data:image/png;base64,{output.data["image/png"].strip()}">')
            elif "text/plain" in output.get("data", {}):
                parts.append(f'<pre class="output">{html.escape(output.data["text/plain"])}</pre>')
    return page(title_of(notebook)[0], "\n".join(parts))


def largest_picture(notebook: nbformat.NotebookNode) -> str:
    """The picture that stands for a notebook: the one with the most bytes, which has the most in it; empty where there is none."""
    outputs = (output for cell in notebook.cells for output in cell.get("outputs", ()))
    pictures = [output.data["image/png"].strip() for output in outputs if "image/png" in output.get("data", {})]
    return max(pictures, key=lambda text: len(base64.b64decode(text)), default="")


def gallery_page(notebooks: dict[str, nbformat.NotebookNode]) -> str:
    """One picture, heading and sentence of each notebook."""
    parts = ["<h1>Notebooks</h1>", '<div class="gallery">']
    for name, notebook in notebooks.items():
        title, sentence = title_of(notebook)
        picture = f'<div class="picture"><img alt="" src="data:image/png;base64,{largest_picture(notebook)}"></div>'
        parts.append(f'<a href="{name}.html">{picture}<h2>{html.escape(title)}</h2><p>{html.escape(sentence)}</p></a>')
    return page("Notebooks", "\n".join([*parts, "</div>"]))


def make_gallery(folder: Path, out: Path) -> None:
    """Run every notebook of a folder and write its page and the gallery."""
    out.mkdir(parents=True, exist_ok=True)
    notebooks = {}
    for path in sorted(folder.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        resources = {"metadata": {"path": str(path.parent)}}
        nbclient.NotebookClient(notebook, timeout=900, kernel_name="python3", resources=resources).execute()
        notebooks[path.stem] = notebook
        (out / f"{path.stem}.html").write_text(notebook_page(notebook), encoding="utf-8")
    (out / "index.html").write_text(gallery_page(notebooks), encoding="utf-8")


def make_api(out: Path, *modules: str) -> None:
    """The pages of modules and of all that is in them."""
    pdoc.render.configure(docformat="numpy", show_source=False, footer_text="hmc")
    with warnings.catch_warnings():
        # the fields of a NamedTuple bear annotations that pdoc cannot look up
        warnings.filterwarnings("ignore", "Error parsing type annotation")
        pdoc.pdoc(*modules, output_directory=out)


def main() -> None:
    """Make all pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "pages", help="where the pages go")
    parser.add_argument("--no-gallery", action="store_true", help="the functions alone; the notebooks take some minutes")
    args = parser.parse_args()
    make_api(args.out / "api", "hmc")
    links = ['<li><a href="api/hmc.html">Functions and classes</a>, from their docstrings</li>']
    if not args.no_gallery:
        make_gallery(ROOT / "notebooks", args.out / "gallery")
        links.insert(0, '<li><a href="gallery/index.html">Notebooks</a>, with what they show</li>')
    (args.out / "index.html").write_text(page("hmc", f"<h1>hmc</h1>\n<ul>{''.join(links)}</ul>"), encoding="utf-8")
    print(args.out / "index.html")


if __name__ == "__main__":
    main()
