"""The lines of a TOML file, for changes that leave all else of it as its user wrote it: comments, order and blank lines too."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["Statement", "says", "statements"]

# What may hide a bracket, a # or a line's end from one who only looks for these: text in quotes, and comments.
_PIECE = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}'
    r"|'''.*?'{3,5}"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*"
    r"|[\[\]{}\n]",
    re.DOTALL,
)
_BEGIN = re.compile(r"""\s*(\[{0,2})\s*([\w-]+|"(?:\\.|[^"\\\n])*"|'[^'\n]*')""")


@dataclass(frozen=True)
class Statement:
    """A table's header, a key with all lines of its value, or a line that says nothing.

    Parameters
    ----------
    text : str
        As it stands in the file, with the line's end.
    table : str or None
        First name of the table that it opens or is in; None before the first table.
    key : str or None
        First name of the key that it gives; None of headers, comments and blank lines.
    header : bool
        It opens a table.
    """

    text: str
    table: str | None = None
    key: str | None = None
    header: bool = False


def statements(text: str) -> list[Statement]:
    """The statements of a TOML file, in order; their texts make up the file.

    Parameters
    ----------
    text : str
        That `tomllib` reads; of any other text a statement may be too long.
    """
    found: list[Statement] = []
    table = None
    for piece in _pieces(text):
        begin = _BEGIN.match(piece)
        name = begin[2].strip("\"'") if begin else None
        header = bool(begin and begin[1])
        table = name if header else table
        found.append(Statement(piece, table, None if header else name, header))
    return found


def says(text: str, values: Mapping[str, Any]) -> bool:
    """Whether a text is TOML and has these values and no others."""
    try:
        return tomllib.loads(text) == values
    except (ValueError, RecursionError, OverflowError):
        return False


def _pieces(text: str) -> Iterator[str]:
    """The text, cut at each line's end that is in no brackets and no quotes."""
    begin, depth = 0, 0
    for found in _PIECE.finditer(text):
        piece = found[0]
        if piece in "[{":
            depth += 1
        elif piece in "]}":
            depth -= 1
        elif piece == "\n" and depth <= 0:
            yield text[begin : found.end()]
            begin, depth = found.end(), 0
    if begin < len(text):
        yield text[begin:]
