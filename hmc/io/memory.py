"""A recording whose images are in memory: arrays in, and everything that is done with a recording on disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hmc.camera.coverage import estimate_room
from hmc.camera.model import Camera, Rig
from hmc.errors import InputError
from hmc.io.footage import Footage
from hmc.io.recording import DEFAULT_FPS, Recording, wrong_units
from hmc.io.views import common_length

__all__ = ["recording_of"]

#: Of one camera, frame by frame: an array (n, h, w, 3), a list of images, a memory map, or whatever tells its length and gives an item;
#: None stands for an image that is not there.
Images = Sequence[np.ndarray | None] | np.ndarray


def recording_of(
    rig: Rig | Sequence[Camera],
    images: Sequence[Images] | None = None,
    background: Sequence[Images | None] | None = None,
    silhouettes: Sequence[Images] | None = None,
    *,
    fps: float = DEFAULT_FPS,
    room: np.ndarray | None = None,
    persons: int | None = None,
    height_m: float | Sequence[float] = (),
    name: str = "arrays",
) -> Recording:
    """A recording of images in memory, for `hmc.track`, `hmc.pose`, `hmc.view` and all else that takes one.

    Parameters
    ----------
    rig : Rig or sequence of Camera
        In metres, z up, the floor at 0.
    images : sequence of images, one a camera, optional
        Each a sequence of (h, w, 3) uint8 BGR, one a frame, None where there is none; the recording lasts as long as two cameras at
        least do. Nothing is copied, and items are asked for when they are needed: a memory map, or a sequence that loads, streams.
    background : sequence of images, one a camera, optional
        Of the empty scene, 30 or so; None of a camera that has none.
    silhouettes : sequence of images, one a camera, optional
        Ready-made, (h, w) bool or uint8, where more than 127 counts; with or in place of images.
    fps : float
        Frames a second.
    room : array_like, shape (2, 3), optional
        Lower and upper corner, metres; estimated from the rig where left out.
    persons : int, optional
        How many people are there at once at most, where that is known.
    height_m : float or sequence of float
        Statures that are known, metres.
    name : str

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        When there is nothing, numbers of cameras differ, or an array is no image of its camera.

    Examples
    --------
    >>> import hmc, numpy as np
    >>> rig = hmc.open_recording("data/synthetic/tiny").rig
    >>> still = np.zeros((4, 240, 320, 3), np.uint8)
    >>> recording = hmc.recording_of(rig, [still] * len(rig), fps=15)
    >>> recording.n_frames, recording.fps
    (4, 15.0)
    """
    rig = rig if isinstance(rig, Rig) else Rig(tuple(rig))
    footage = _views(rig, images, "images")
    masks = _views(rig, silhouettes, "silhouettes")
    both = [one or other for one, other in zip(footage, masks, strict=True)]
    lacking = [camera.name for camera, view in zip(rig, both, strict=True) if view is None]
    if lacking:
        raise InputError(f"camera '{lacking[0]}' has neither images nor silhouettes; give some, or leave it out of the rig")
    for problem in wrong_units(rig):
        raise InputError(problem)
    if not (np.isfinite(fps) and fps > 0):
        raise InputError(f"`fps` must be above 0; got {fps}")
    corners = estimate_room(rig) if room is None else np.array(room, float)
    if corners.shape != (2, 3) or not np.all(corners[1] > corners[0]):
        raise InputError("`room` must be [[x0, y0, z0], [x1, y1, z1]] in metres, lower corner first")
    return Recording(
        path=Path(name),
        name=name,
        fps=float(fps),
        rig=rig,
        room=corners,
        n_frames=common_length([view.n_frames for view in both if view is not None]),
        start=0,
        persons=persons,
        subject_height_m=tuple(float(one) for one in np.atleast_1d(np.array(height_m, float))),
        room_is_estimated=room is None,
        factors=(1,) * len(rig),
        _footage=footage,
        _silhouettes=masks,
        _background=_views(rig, background, "background"),
    )


def _views(rig: Rig, images: Sequence[Images | None] | None, what: str) -> tuple[Footage | None, ...]:
    """One camera's images after the other's, looked at as far as the first image of each."""
    if images is None:
        return (None,) * len(rig)
    if len(images) != len(rig):
        raise InputError(f"`{what}` must have one entry a camera, {len(rig)} of them; got {len(images)}")
    return tuple(None if own is None or not len(own) else _view(camera, own, what) for camera, own in zip(rig, images, strict=True))


def _view(camera: Camera, images: Images, what: str) -> Footage:
    flat = what == "silhouettes"
    first = next((image for image in images if image is not None), None)
    if first is None:
        raise InputError(f"camera '{camera.name}': all of its {what} are None; leave it out of the rig")
    kinds = (np.bool_, np.uint8) if flat else (np.uint8,)
    shape = camera.size[::-1] if flat else (*camera.size[::-1], 3)
    if not isinstance(first, np.ndarray) or first.dtype not in kinds or first.shape != shape:
        got = f"{first.dtype} of shape {first.shape}" if isinstance(first, np.ndarray) else type(first).__name__
        wanted = f"bool or uint8, shape {shape}" if flat else f"uint8, shape {shape}, BGR"
        raise InputError(f"camera '{camera.name}': its {what} must be arrays of {wanted}; got {got}")
    footage = Footage(Path(camera.name), len(images), camera.size)
    return replace(footage, arrays=images)
