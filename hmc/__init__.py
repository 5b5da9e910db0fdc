"""hmc: where people are and what pose their bodies take, from calibrated videos and without markers.

>>> import hmc
>>> recording = hmc.sample(frames=8)
>>> people = hmc.pose(recording, method="apf", seed=0)
>>> people.positions.shape  # rows, landmarks, x y z in metres
(8, 15, 3)

These names will stay: `open_recording`, `sample`, `check`, `silhouettes`, `hulls`, `track`, `views`, `pose`, `evaluate`, `view`, `export`;
`recording_of` for images in memory, `Session` and `live` for images as they come; the records `Recording`, `Rig`, `Camera`, `TrackTable`,
`PoseTable`, `PosedPeople`; `METHODS` and `TRACKERS`, `pose_method`, `PoseMethod`, `register_method` and `register_tracker` to add to them;
and `InputError`.
What is in the modules below may move.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

#: Names of the public face, and where each is. Nothing is imported before it is asked for.
_WHERE = {
    "Camera": "hmc.camera.model",
    "InputError": "hmc.errors",
    "METHODS": "hmc.pose.registry",
    "PoseMethod": "hmc.pose.method",
    "PoseTable": "hmc.io.results",
    "PosedPeople": "hmc.pose.follow",
    "Recording": "hmc.io.recording",
    "Rig": "hmc.camera.model",
    "Session": "hmc.session.front",
    "TRACKERS": "hmc.tracking.trackers",
    "TrackTable": "hmc.io.results",
    "evaluate": "hmc.api",
    "export": "hmc.api",
    "hulls": "hmc.api",
    "live": "hmc.session.newest",
    "open_recording": "hmc.io.recording",
    "pose_method": "hmc.pose.registry",
    "recording_of": "hmc.io.memory",
    "register_method": "hmc.pose.registry",
    "register_tracker": "hmc.tracking.trackers",
    "sample": "hmc.io.shipped",
    "silhouettes": "hmc.api",
    "track": "hmc.api",
    "views": "hmc.api",
}
#: Packages that are called too: ``hmc.pose(recording)`` (`hmc.callable_package`).
_CALLED = ("check", "pose", "view")

__all__ = [*_WHERE, *_CALLED]


def __getattr__(name: str) -> Any:
    if name in _CALLED:
        return importlib.import_module(f"hmc.{name}")
    if name in _WHERE:
        value = getattr(importlib.import_module(_WHERE[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'hmc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
