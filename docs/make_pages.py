"""The documentation site: guide, functions, notebooks with what they show, and a search, as plain files that need no server.

python docs/make_pages.py --out out/pages

Nothing is run: the notebooks are as they are stored (`make notebooks`). A link that leads nowhere is an error.
"""

import argparse
import json
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).resolve().parent))

from site_of.gallery import gallery_page, notebook_page, picture_of, title_of
from site_of.guide import guide_page
from site_of.links import broken_links
from site_of.shell import Group, Page, asset_files, page_html

ROOT = Path(__file__).resolve().parents[1]
#: The parts of the guide, in the order in which they are read; a page of docs/ that is not named here stands in the last.
GUIDE = {
    "Guide": ("README.md", "docs/which_when.md", "docs/conventions.md", "docs/sessions.md"),
    "Methods": ("docs/tracking.md", "docs/scalable.md", "docs/spectral.md", "docs/multi-cue.md"),
    "Measured": ("docs/accuracy.md", "docs/results.md", "docs/experiments.md", "benchmarks/README.md"),
    "The house": ("docs/architecture.md", "CONTRIBUTING.md", "CHANGELOG.md"),
}
#: What stands in the navigation of functions: the public face and its packages; the rest is linked from these, and found by the search.
FACE = 2


def sources() -> dict[str, list[Path]]:
    """The Markdown files by the part of the guide in which they are."""
    parts = {part: [ROOT / name for name in names] for part, names in GUIDE.items()}
    known = {path for paths in parts.values() for path in paths}
    parts["Guide"] += [path for path in sorted((ROOT / "docs").glob("*.md")) if path not in known]
    return parts


def page_path(source: Path) -> str:
    """Where the page of a Markdown file goes: the README is the first page."""
    name = source.relative_to(ROOT).as_posix()
    return (
        "index.html"
        if name == "README.md"
        else "guide/" + name.removeprefix("docs/").removesuffix(".md").lower().replace("/", "-") + ".html"
    )


class Site:
    """The pages and files of a site as they come together: by their places in it."""

    def __init__(self, modules: Iterable[Page] = ()) -> None:
        """Make all pages; `modules` are those of the functions."""
        self.files: dict[str, bytes] = {name: text.encode() for name, text in asset_files().items()}
        self.missing: list[str] = []
        self.guide = {path: page_path(path) for paths in sources().values() for path in paths}
        self.pages = [guide_page(path, ROOT, place, self.place_of) for path, place in self.guide.items()]
        self.cards: list[tuple[str, str, str, str]] = []
        self.pages += self.notebooks()
        self.modules = list(modules)
        self.pages += self.modules

    def place_of(self, target: str, page: str) -> str:
        """Where a file of the repository is in the site; files that are no pages are taken along."""
        path = ROOT / target
        if path in self.guide:
            return self.guide[path]
        if path.suffix == ".ipynb" and path.is_file():
            return f"gallery/{path.stem}.html"
        if path.is_file():
            place = f"files/{target}"
            self.files.setdefault(place, path.read_bytes())
            return place
        self.missing.append(f"{page}: {target} is not a file of the repository")
        return target

    def notebooks(self) -> list[Page]:
        """The gallery and its pages."""
        made = []
        for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
            notebook = nbformat.read(path, as_version=4)
            page, pictures = notebook_page(path.stem, notebook, self.place_of)
            self.files |= pictures
            self.files[f"files/notebooks/{path.name}"] = path.read_bytes()
            self.cards.append((path.stem, *title_of(notebook), picture_of(pictures)))
            made.append(page)
        return [gallery_page(self.cards), *made]

    def groups(self) -> list[Group]:
        """The navigation."""
        titles = {page.path: page.title for page in self.pages}
        found = [Group(part, tuple((self.guide[path], titles[self.guide[path]]) for path in paths)) for part, paths in sources().items()]
        gallery = [("gallery/index.html", "All notebooks"), *((f"gallery/{name}.html", title) for name, title, _, _ in self.cards)]
        face = [(page.path, page.title) for page in self.modules if page.title.count(".") < FACE]
        return [*found, Group("Notebooks", tuple(gallery)), *([Group("Functions", tuple(face))] if face else [])]

    def write(self, out: Path) -> list[str]:
        """Write all of it in place of what was there; returns what is wrong with its links."""
        groups = self.groups()
        texts = {page.path: page_html(page, groups) for page in self.pages}
        places = [(page.path, one) for page in self.pages for one in page.entries]
        index = [[one.title, path + (f"#{one.anchor}" if one.anchor else ""), one.kind, one.text] for path, one in places]
        self.files["search-index.js"] = f"window.HMC_INDEX = {json.dumps(index, ensure_ascii=False)};\n".encode()
        shutil.rmtree(out, ignore_errors=True)
        for place, content in {**self.files, **{path: text.encode() for path, text in texts.items()}}.items():
            (out / place).parent.mkdir(parents=True, exist_ok=True)
            (out / place).write_bytes(content)
        return self.missing + broken_links(texts, set(self.files))


def main() -> int:
    """Make the site."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "pages", help="where the pages go; what is there is replaced")
    parser.add_argument("--no-api", action="store_true", help="without the pages of the functions, which take longest")
    args = parser.parse_args()
    if args.no_api:
        site = Site()
    else:
        from site_of.api import api_pages

        site = Site(api_pages("hmc"))
    wrong = site.write(args.out)
    print(*wrong, sep="\n", file=sys.stderr, end="\n" if wrong else "")
    print(args.out / "index.html")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
