"""Caliscope's ``camera_array.toml``: one table a camera under ``cameras``, by number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["caliscope_tables"]

#: What Caliscope writes for a value that there is not.
NULL = "null"


def caliscope_tables(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of Caliscope's cameras, as Anipose names and fills them; those of another program as they are.

    Camera 3, ``[cameras.3]``, is ``cam_3``, as Caliscope names its videos (``port_3`` in older versions); cameras that it ignores are left
    out. A rotation may be a vector or, in older versions, a matrix.
    """
    cameras = tables.get("cameras")
    if not isinstance(cameras, dict) or not all(isinstance(camera, dict) for camera in cameras.values()):
        return dict(tables)
    return {
        f"cam_{number}": {key: value for key, value in camera.items() if value is not None and value != NULL}
        for number, camera in cameras.items()
        if camera.get("ignore") is not True
    }
