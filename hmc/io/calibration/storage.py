"""OpenCV's FileStorage files (YAML, XML, JSON) as plain dictionaries, lists, numbers, texts and arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.calibration.text import as_numbers, read_json, read_text

__all__ = ["read_storage"]


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
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise InputError(f"{path}: not an OpenCV YAML or XML file (a document type or entities are declared)")
        if not text.startswith(("%YAML", "<")):
            text = f"%YAML:1.0\n---\n{text}"
        try:
            storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
            values = _value(storage.root())
            storage.release()
        except (cv2.error, SystemError, UnicodeError, RecursionError, MemoryError) as error:
            reason = (str(error).strip().splitlines() or ["?"])[-1]
            raise InputError(f"{path}: not an OpenCV YAML or XML file ({reason})") from None
    if not isinstance(values, dict):
        raise InputError(f"{path}: holds no named values; an OpenCV file has camera_matrix and so on")
    return values


def _value(node: cv2.FileNode) -> Any:
    if node.isMap():
        # Matrices too are put together here: OpenCV's own way from a damaged one leads out of the memory.
        values = {name: _value(node.getNode(name)) for name in node.keys()}
        sizes = values.get("sizes", [values.get("rows"), values.get("cols")])
        return _shaped(values["data"], sizes) if "data" in values and not {"rows", "sizes"}.isdisjoint(values) else values
    if node.isSeq():
        return [_value(node.at(i)) for i in range(node.size())]
    if node.isString():
        return node.string()
    return node.real() if node.isInt() or node.isReal() else None


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
