"""OpenCV's FileStorage files (YAML, XML, JSON) as plain dictionaries, lists, numbers, texts and arrays.

They are read here and not by OpenCV, which ends the process on some broken ones.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.text import as_numbers, read_json, read_text
from hmc.io.calibration.yaml import read_word, read_yaml
from hmc.io.door import read_xml_file

__all__ = ["read_storage"]

_WORDS = re.compile(r'"[^"]*+"|[^\s"]++')


def read_storage(path: Path) -> dict[str, Any]:
    """All values of an OpenCV YAML, XML or JSON file. Plain YAML and JSON, with nested lists for matrices, are read as well.

    Raises
    ------
    InputError
        When the file is none of these.
    """
    if path.suffix.lower() == ".json":
        values = _plain(read_json(path))
    else:
        text = read_text(path).lstrip()
        try:
            values = _element(read_xml_file(path, "an OpenCV XML file")) if text.startswith("<") else _matrices(read_yaml(text))
        except ValueError as error:
            raise error if isinstance(error, InputError) else InputError(f"{path}: not an OpenCV YAML or XML file ({error})") from None
    if not isinstance(values, dict):
        raise InputError(f"{path}: holds no named values; an OpenCV file has camera_matrix and so on")
    return values


def _matrices(value: Any) -> Any:
    """Values of YAML with tables of rows, cols and data made arrays."""
    if isinstance(value, list):
        return [_matrices(one) for one in value]
    if not isinstance(value, dict):
        return value
    return _matrix({name: _matrices(one) for name, one in value.items()})


def _matrix(values: dict[str, Any]) -> Any:
    sizes = values.get("sizes", [values.get("rows"), values.get("cols")])
    return _shaped(values["data"], sizes) if "data" in values and not {"rows", "sizes"}.isdisjoint(values) else values


def _element(node: ElementTree.Element) -> Any:
    """The value of an XML element: a table or list of those in it, else its words."""
    if len(node):
        if all(child.tag == "_" for child in node):
            return [_element(child) for child in node]
        return _matrix({child.tag: _element(child) for child in node})
    words = _WORDS.findall(node.text or "")
    if not words:
        return None
    if node.get("type_id") in ("str", "string"):
        return (node.text or "").strip().strip('"')
    found = [read_word(word) for word in words]
    return found if len(found) > 1 else found[0]


def _plain(value: Any) -> Any:
    """JSON with OpenCV's matrices, objects of the type "opencv-matrix", made arrays."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if not isinstance(value, dict):
        return value
    if value.get("type_id") == "opencv-matrix":
        return _shaped(value.get("data"), [value.get("rows"), value.get("cols")])
    if value.get("type_id") == "opencv-nd-matrix":
        return _shaped(value.get("data"), value.get("sizes"))
    return {name: _plain(item) for name, item in value.items()}


def _shaped(items: Any, sizes: Any) -> np.ndarray | None:
    """Numbers in a row as an array of so many rows, columns ... (and channels, where there are more); None where they do not fit."""
    numbers, shape = as_numbers(items), as_numbers(sizes)
    if (
        numbers is None
        or not numbers.size
        or shape is None
        or not 1 <= shape.size <= 4
        or not np.all((shape >= 1) & (shape <= numbers.size))
    ):
        return None
    shape = shape.ravel().astype(int)
    return numbers.reshape(*shape, -1) if numbers.size % shape.prod() == 0 else None
