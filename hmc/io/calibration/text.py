"""Text, XML and nested values of calibration files: decoded whatever the program wrote, one clear line where that fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from hmc.io.door import read_json_file, read_text_file, read_xml_file

__all__ = ["as_numbers", "listed", "read_json", "read_text", "read_xml"]

SETTINGS_MB = "HMC_MAX_SETTINGS_MB"


def read_text(path: Path) -> str:
    """The text of a file in UTF-8 or UTF-16, with or without a byte order mark; what is neither is taken for Latin-1.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    return read_text_file(path, SETTINGS_MB, guess=True)


def read_xml(path: Path, what: str) -> ElementTree.Element:
    """The root of an XML file, read without entities.

    Raises
    ------
    InputError
        When it is no XML; the line says that it is not `what`.
    """
    return read_xml_file(path, what)


def read_json(path: Path) -> Any:
    """The values of a JSON file.

    Raises
    ------
    InputError
        When it is no JSON.
    """
    return read_json_file(path, SETTINGS_MB, guess=True)


def as_numbers(value: Any) -> np.ndarray | None:
    """A value, such as nested lists, as an array of float; None where it is not one."""
    try:
        return None if value is None else np.array(value, float)
    except (ValueError, TypeError, OverflowError):
        return None


def listed(words: list[str], most: int = 4, gap: str = ", ") -> str:
    """Words in a row, the first few of many."""
    return gap.join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")
