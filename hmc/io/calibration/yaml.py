"""The part of YAML that OpenCV and EasyMocap write: maps and lists by indentation or in brackets, numbers and texts; no anchors.

OpenCV's own reader ends the process on some broken files, and reserves whatever memory a file asks for.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from hmc.io.door import MAX_DEPTH

__all__ = ["read_word", "read_yaml"]

_KEY = re.compile(r"""("(?:[^"\\]|\\.)*+"|'[^']*+'|[^\s\[\]{}"'#,&*!%@`-][^:#\[\]{}]*?|-[^\s:][^:#]*?)\s*:(?:\s+(.*))?$""", re.DOTALL)
_TOKEN = re.compile(r"""\s*([\[\]{},:]|"(?:[^"\\]|\\.)*+"|'[^']*+'|[^\[\]{},:"'\s]++(?:[ \t]+[^\[\]{},:"'\s]++)*+)""")
_QUOTED = re.compile(r""""(?:[^"\\]|\\.)*+"|'[^']*+'""")
_TAG = re.compile(r"(?:!\S*\s*)+")
_SPECIAL = {".nan": float("nan"), ".inf": float("inf"), "+.inf": float("inf"), "-.inf": float("-inf"), "": None, "~": None, "null": None}


class _Line(NamedTuple):
    number: int
    indent: int
    text: str


def read_yaml(text: str) -> Any:
    """The values of a text: dictionaries, lists, floats, texts and None.

    Raises
    ------
    ValueError
        With the line, when it is nothing that is read here.
    """
    lines = _lines(text)
    if not lines:
        return None
    value, end = _block(lines, 0, 0)
    if end < len(lines):
        raise ValueError(f"line {lines[end].number}: {lines[end].text[:40]!r} is not in line with what is above it")
    return value


def read_word(word: str) -> Any:
    """A word as a number, a text or None. In quotes it is a text."""
    if word[:1] in ('"', "'"):
        return re.sub(r"\\(.)", r"\1", word[1:-1]) if word[0] == '"' else word[1:-1]
    if word.lower() in _SPECIAL:
        return _SPECIAL[word.lower()]
    if word[0] in "&*":
        raise ValueError(f"{word[:20]!r}: anchors are not read")
    try:
        return float(word) if word[-1].isdigit() or word[-1] == "." else word
    except ValueError:
        return word


def _lines(text: str) -> list[_Line]:
    """Lines with something in them, those of one bracket joined."""
    found: list[_Line] = []
    open_brackets = 0
    for number, raw in enumerate(text.replace("\t", " ").splitlines(), 1):
        line = _without_comment(raw)
        words = line.strip()
        if not words or (not open_brackets and (words.startswith("%") or words in ("---", "..."))):
            continue
        if open_brackets:
            last = found[-1]
            found[-1] = last._replace(text=f"{last.text}\n{words}")
        else:
            found.append(_Line(number, len(line) - len(line.lstrip()), words.removeprefix("--- ")))
        bare = _QUOTED.sub("", words)
        open_brackets += bare.count("[") + bare.count("{") - bare.count("]") - bare.count("}")
        if open_brackets < 0:
            raise ValueError(f"line {number}: a bracket is closed that was not opened")
    if open_brackets:
        raise ValueError(f"line {found[-1].number}: a bracket is not closed")
    return found


def _without_comment(line: str) -> str:
    if "#" not in line:
        return line
    quoted = [match.span() for match in _QUOTED.finditer(line)]
    for match in re.finditer(r"(?:^|\s)#", line):
        if not any(a < match.end() <= b for a, b in quoted):
            return line[: match.start()]
    return line


def _block(lines: list[_Line], at: int, depth: int) -> tuple[Any, int]:
    """The value that begins with a line, and the place of the first line that is not of it."""
    if depth > MAX_DEPTH:
        raise ValueError(f"line {lines[at].number}: more than {MAX_DEPTH} values in one another")
    if lines[at].text.startswith("- ") or lines[at].text == "-":
        return _sequence(lines, at, depth)
    if _KEY.match(lines[at].text):
        return _mapping(lines, at, depth)
    return _inline(lines[at], lines[at].text), at + 1


def _sequence(lines: list[_Line], at: int, depth: int) -> tuple[list[Any], int]:
    indent, items = lines[at].indent, []
    while at < len(lines) and lines[at].indent == indent and (lines[at].text.startswith("- ") or lines[at].text == "-"):
        line = lines[at]
        rest = line.text[1:].lstrip()
        if rest and rest[0] not in "[{\"'" and (_KEY.match(rest) or rest.startswith("- ")):
            lines[at] = line._replace(indent=indent + len(line.text) - len(rest), text=rest)
            value, at = _block(lines, at, depth + 1)
        else:
            value, at = _value(lines, at, rest, depth)
        items.append(value)
    return items, at


def _mapping(lines: list[_Line], at: int, depth: int) -> tuple[dict[str, Any], int]:
    indent, values = lines[at].indent, dict[str, Any]()
    while at < len(lines) and lines[at].indent == indent:
        line = lines[at]
        match = _KEY.match(line.text)
        if match is None:
            raise ValueError(f"line {line.number}: {line.text[:40]!r} is no `name: value`")
        name = match[1]
        key = str(read_word(name)) if name[0] in "\"'" else name
        if key in values:
            raise ValueError(f"line {line.number}: `{key[:40]}` is given twice")
        values[key], at = _value(lines, at, match[2] or "", depth)
    return values, at


def _value(lines: list[_Line], at: int, text: str, depth: int) -> tuple[Any, int]:
    """What stands after a name or a dash: in the same line, or in lines that are further in."""
    line, text = lines[at], _TAG.sub("", text, count=1) if text.startswith("!") else text
    if text:
        return _inline(line, text), at + 1
    if at + 1 < len(lines):
        after = lines[at + 1]
        listed = after.indent == line.indent and after.text.startswith("-") and not line.text.startswith("-")
        if after.indent > line.indent or listed:
            return _block(lines, at + 1, depth + 1)
    return None, at + 1


def _inline(line: _Line, text: str) -> Any:
    if text[0] not in "[{":
        return read_word(text)
    tokens, at = [], 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            if text[at:].strip():
                raise ValueError(f"line {line.number}: {text[at : at + 20]!r} is not read")
            break
        tokens.append(match[1])
        at = match.end()
    value, end = _flow(tokens, 0, 0, line.number)
    if end < len(tokens):
        raise ValueError(f"line {line.number}: {tokens[end][:20]!r} after a bracket is closed")
    return value


def _flow(tokens: list[str], at: int, depth: int, number: int) -> tuple[Any, int]:
    """A value in brackets, or a word."""
    if depth > MAX_DEPTH:
        raise ValueError(f"line {number}: more than {MAX_DEPTH} brackets in one another")
    opened = tokens[at]
    if opened not in ("[", "{"):
        if opened in ("]", "}", ",", ":"):
            raise ValueError(f"line {number}: {opened!r} where a value should be")
        return read_word(opened), at + 1
    items: list[Any] = []
    names: list[str] = []
    at += 1
    closed = "]" if opened == "[" else "}"
    while at < len(tokens) and tokens[at] != closed:
        if opened == "{":
            if at + 1 >= len(tokens) or tokens[at + 1] != ":":
                raise ValueError(f"line {number}: {tokens[at][:20]!r} is no `name: value`")
            names.append(str(read_word(tokens[at])) if tokens[at][0] in "\"'" else tokens[at])
            at += 2
        if at >= len(tokens):
            break
        value, at = _flow(tokens, at, depth + 1, number)
        items.append(value)
        if at < len(tokens) and tokens[at] == ",":
            at += 1
        elif at < len(tokens) and tokens[at] != closed:
            raise ValueError(f"line {number}: no comma before {tokens[at][:20]!r}")
    if at >= len(tokens):
        raise ValueError(f"line {number}: a bracket is not closed")
    return (items if opened == "[" else dict(zip(names, items, strict=True))), at + 1
