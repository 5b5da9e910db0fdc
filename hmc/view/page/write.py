"""One HTML file of a result."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hmc.body.joints import SEGMENTS
from hmc.camera.model import Rig, backproject
from hmc.errors import InputError
from hmc.io.files import atomic_write
from hmc.io.recording import Recording
from hmc.landmarks import BONES, ENOUGH_VIEWS, LANDMARKS, TRUSTED
from hmc.view.mosaic import Result
from hmc.view.page.moments import moments_of, shown_moments
from hmc.view.page.people import chosen_frames, page_people
from hmc.voxels.grid import VoxelGrid

__all__ = ["write_page"]

#: How far a camera's pyramid reaches, metres.
CAMERA_M = 0.25
#: Which landmark is at the end of a segment of the body, by the last word of its name.
ENDS = {
    "pelvis": "pelvis", "torso": "neck", "chest": "neck", "head": "head_top", "clavicle": "shoulder", "upper_arm": "elbow",
    "forearm": "wrist", "thigh": "knee", "shank": "ankle", "foot": "ankle", "toes": "ankle",
}  # fmt: skip
#: The page's parts, in the order in which its scripts stand.
SCRIPTS = ("unpack.js", "scene.js", "curves.js", "page.js")


def write_page(
    path: str | Path,
    recording: Recording,
    result: Result,
    voxel_size_m: float | None = 0.04,
    outlines: bool = True,
    on_problem: Callable[[str], None] | None = None,
    progress: Callable[[Iterable, int], Iterable] | None = None,
) -> None:
    """Write a result as a page that needs nothing beside it: neither other files nor a network.

    Parameters
    ----------
    path : path
    recording : Recording
    result : Result
    voxel_size_m : float or None
        Of the hull; None: it is not shown, and nothing is segmented.
    outlines : bool
        Draw the outline of the flesh into the cameras' images.
    on_problem : callable, optional
        Called with one line for everything that was survived.
    progress : callable, optional
        ``progress(steps, total)`` passes frames on and may show how far they are.

    Raises
    ------
    InputError
        When there is nothing of the result in the recording's selection, or the file cannot be written.
    """
    frames = chosen_frames(result, recording.start, recording.n_frames)
    people = page_people(result, frames)
    if not people:
        last = recording.start + recording.n_frames - 1
        raise InputError(f"{path}: the result has nobody in frames {recording.start} to {last}; choose others with --start and --frames")
    wanted = shown_moments(frames, len(recording.rig))
    stream: Iterable = moments_of(recording, result, wanted, voxel_size_m, outlines, on_problem)
    stream = progress(stream, wanted[-1] + 1 - recording.start) if progress else stream
    moments = [moment for moment in stream if moment is not None]
    data = {
        "name": recording.name,
        "fps": recording.fps,
        "first": int(frames[0]),
        "stride": int(frames[1] - frames[0]) if len(frames) > 1 else 1,
        "count": len(frames),
        "room": np.asarray(recording.room).round(4).tolist(),
        "voxel": voxel_size_m,
        "origin": _origin(recording, voxel_size_m),
        "cameras": _cameras(recording.rig),
        "landmarks": LANDMARKS,
        "bones": [[LANDMARKS.index(a), LANDMARKS.index(b)] for a, b in BONES],
        "ends": [LANDMARKS.index(_end(segment.name)) for segment in SEGMENTS],
        "angles": [] if result.states is None else list(result.states.dof_names[3:]),
        "enough": ENOUGH_VIEWS,
        "trusted": round(200 * TRUSTED),  # in 200ths, as the page has it
        "people": people,
        "moments": moments,
    }
    with atomic_write(path) as file:
        file.write(_page(data, recording.name))


def _end(segment: str) -> str:
    """The landmark at the end of a segment."""
    side = segment[:2] if segment[:2] in ("l_", "r_") else ""
    return side + ENDS[segment[len(side) :]]


def _origin(recording: Recording, voxel_size_m: float | None) -> list[float] | None:
    """The centre of the first voxel."""
    if voxel_size_m is None:
        return None
    grid = VoxelGrid.from_room(recording.room, voxel_size_m, len(recording.rig))
    return grid.centres(np.zeros((1, 3), int))[0].round(5).tolist()


def _cameras(rig: Rig) -> list[dict[str, Any]]:
    """Where each camera is, and the corners of its view."""
    out = []
    for camera in rig:
        width, height = camera.size
        corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1.0]])
        ends = camera.centre + CAMERA_M * backproject(camera, corners)
        out.append({"name": camera.name, "centre": camera.centre.round(4).tolist(), "corners": ends.round(4).tolist(), "size": camera.size})
    return out


def _page(data: dict[str, Any], name: str) -> str:
    """The template with its style, scripts and data in it."""
    parts = files("hmc.view.page")
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")  # no name in it can end the script
    scripts = "\n".join((parts / script).read_text(encoding="utf-8") for script in SCRIPTS)
    values = {"STYLE": (parts / "page.css").read_text(encoding="utf-8"), "SCRIPT": scripts, "TITLE": escape(name), "DATA": text}
    page = (parts / "page.html").read_text(encoding="utf-8")
    head, *rest = page.split("@@")
    return head + "".join(values[part] if k % 2 == 0 else part for k, part in enumerate(rest))
