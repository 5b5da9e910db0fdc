"""Arrays as a page holds them: base64 of little-endian numbers, with a scale and a value for what is not known."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

__all__ = ["MISSING", "pack", "pack_fixed"]

#: Stands for NaN among numbers of 16 bits.
MISSING = -32768


def pack(array: np.ndarray) -> dict[str, Any]:
    """An array as it is: its type, shape and bytes.

    Parameters
    ----------
    array : ndarray of uint8, uint16, int16 or float32
    """
    kind = {"u1": "u1", "u2": "u2", "i2": "i2", "f4": "f4"}[array.dtype.str[1:]]
    data = np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()
    return {"type": kind, "shape": list(array.shape), "data": base64.b64encode(data).decode("ascii")}


def pack_fixed(array: np.ndarray, step: float) -> dict[str, Any]:
    """Numbers in whole steps, of 16 bits: what is not known is `MISSING`, what is beyond them is as far as they go.

    Parameters
    ----------
    array : ndarray
    step : float
        In the array's unit.
    """
    known = np.isfinite(array)
    whole = np.where(known, np.clip(np.round(np.where(known, array, 0) / step), -32767, 32767), MISSING)
    return {**pack(whole.astype(np.int16)), "step": step}
