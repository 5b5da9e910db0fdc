"""Text, XML and nested values of calibration files: decoded whatever the program wrote, one clear line where that fails."""

from __future__ import annotations

import codecs
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from hmc.errors import InputError

__all__ = ["as_numbers", "listed", "read_json", "read_text", "read_xml"]


def read_text(path: Path) -> str:
    """The text of a file in UTF-8 or UTF-16, with or without a byte order mark; what is neither is taken for Latin-1.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    if data[1:2] == b"\0":
        return data.decode("utf-16-le", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


class _NoDoctype(ElementTree.TreeBuilder):
    """Builds a tree, but of no document that declares entities: they can make a small file fill the memory."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise ValueError("a document type or entities are declared, which no calibration needs")


def read_xml(path: Path, what: str) -> ElementTree.Element:
    """The root of an XML file, read without entities.

    Raises
    ------
    InputError
        When it is no XML; the line says that it is not `what`.
    """
    parser = ElementTree.XMLParser(target=_NoDoctype())
    try:
        parser.feed(read_text(path).strip())
        return parser.close()
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not {what} ({error})") from None


def read_json(path: Path) -> Any:
    """The values of a JSON file.

    Raises
    ------
    InputError
        When it is no JSON.
    """
    try:
        return json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a JSON file ({error}); mend or remove it") from None


def as_numbers(value: Any) -> np.ndarray | None:
    """A value, such as nested lists, as an array of float; None where it is not one."""
    try:
        return None if value is None else np.array(value, float)
    except (ValueError, TypeError, OverflowError):
        return None


def listed(words: list[str], most: int = 4, gap: str = ", ") -> str:
    """Words in a row, the first few of many."""
    return gap.join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")
