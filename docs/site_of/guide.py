"""Pages of the guide, from the Markdown of the repository."""

import html
import posixpath
import re
from collections.abc import Callable
from pathlib import Path

import markdown2

from site_of.shell import Entry, Page

__all__ = ["PlaceOf", "anchor_of", "guide_page", "plain", "prose", "relocated", "sections", "with_anchors"]

HEADING = re.compile(r"<h([1-6])[^>]*>(.*?)</h\1>", re.DOTALL)
TARGET = re.compile(r'(<(?:a|img)\b[^>]*?\b(?:href|src)=")([^"]+)(")')
#: ``place_of(target, page)`` tells where in the site a file of the repository is; it notes what is not there.
PlaceOf = Callable[[str, str], str]
OUTSIDE = ("http://", "https://", "mailto:", "data:")


def prose(text: str) -> str:
    """Markdown as HTML, with tables that can be moved sideways on a narrow screen."""
    made = markdown2.markdown(text, extras=["fenced-code-blocks", "tables", "cuddled-lists"])
    return made.replace("<table>", '<div class="table"><table>').replace("</table>", "</table></div>")


def plain(made: str) -> str:
    """HTML as plain text, on one line."""
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", made)).split())


def anchor_of(heading: str) -> str:
    """The anchor of a heading, as the sites that show Markdown make it."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def with_anchors(made: str) -> tuple[str, list[tuple[int, str, str]]]:
    """HTML whose headings can be linked to, and the headings: level, anchor, title."""
    headings: list[tuple[int, str, str]] = []

    def named(match: re.Match) -> str:
        level, inner = match.groups()
        title = html.unescape(re.sub(r"<[^>]+>", "", inner)).strip()
        anchor, again = anchor_of(title), sum(one[1].rstrip("0123456789").rstrip("-") == anchor_of(title) for one in headings)
        anchor += f"-{again}" if again else ""
        headings.append((int(level), anchor, title))
        return f'<h{level} id="{anchor}">{inner}<a class="here" href="#{anchor}" aria-label="link to this">#</a></h{level}>'

    return HEADING.sub(named, made), headings


def sections(made: str, headings: list[tuple[int, str, str]], kind: str) -> list[Entry]:
    """What is searched of a page: every heading with the text below it."""
    pieces = re.split(r"<h[1-6] id=", made)[1:]
    return [
        Entry(title, anchor, kind, plain(piece.partition("</h")[2].partition(">")[2])[:600])
        for piece, (_, anchor, title) in zip(pieces, headings, strict=True)
    ]


def relocated(made: str, folder: str, path: str, place_of: PlaceOf) -> str:
    """HTML made of a file in a folder of the repository, with its links as they are from a page of the site."""

    def moved(match: re.Match) -> str:
        before, target, after = match.groups()
        if target.startswith((*OUTSIDE, "#")):
            return match[0]
        file, hash_, anchor = target.partition("#")
        place = place_of(posixpath.normpath(posixpath.join(folder, html.unescape(file))), path)
        return f"{before}{posixpath.relpath(place, posixpath.dirname(path) or '.')}{hash_}{anchor}{after}"

    return TARGET.sub(moved, made)


def guide_page(source: Path, root: Path, path: str, place_of: PlaceOf) -> Page:
    """A page of a Markdown file.

    Parameters
    ----------
    source : Path
    root : Path
        Of the repository.
    path : str
        Where the page goes in the site.
    place_of : callable
    """
    made, headings = with_anchors(prose(source.read_text(encoding="utf-8")))
    body = relocated(made, source.parent.relative_to(root).as_posix(), path, place_of)
    return Page(path, headings[0][2] if headings else source.stem, body, headings, sections(made, headings, "guide"))
