"""Links of a made site: every one to a file of the site leads to one, and to an anchor that is there."""

import posixpath
from collections.abc import Mapping
from html.parser import HTMLParser

__all__ = ["broken_links"]


class _Read(HTMLParser):
    """The links and the anchors of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: dict[str, None] = {}
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.links[value] = None
            elif name in ("id", "name") and value:
                self.anchors.add(value)


def broken_links(pages: Mapping[str, str], files: set[str]) -> list[str]:
    """What is wrong with the links of pages, a line each.

    Parameters
    ----------
    pages : mapping of str to str
        The HTML of every page, by its place in the site.
    files : set of str
        Places of all other files.
    """
    read = {}
    for path, text in pages.items():
        read[path] = _Read()
        read[path].feed(text)
    wrong = []
    for path, page in read.items():
        for link in page.links:
            if link.startswith(("http://", "https://", "mailto:", "data:")):
                continue
            file, _, anchor = link.partition("#")
            place = posixpath.normpath(posixpath.join(posixpath.dirname(path), file)) if file else path
            if place not in pages and place not in files:
                wrong.append(f"{path}: {link} is not there")
            elif anchor and place in pages and anchor not in read[place].anchors:
                wrong.append(f"{path}: {link}: no such heading or name on that page")
    return wrong
