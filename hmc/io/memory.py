"""A recording whose images are in memory: arrays in, and everything that is done with a recording on disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hmc.camera.coverage import estimate_room
from hmc.camera.images import camera_image, is_image, wrong_image
from hmc.camera.model import Camera, Rig
from hmc.errors import InputError
from hmc.io.footage import Footage
from hmc.io.recording import DEFAULT_FPS, Recording, wrong_units
from hmc.io.settings import check_settings
from hmc.io.views import common_length, unlike_lengths

__all__ = ["recording_of"]

#: Of one camera, frame by frame: an array (n, h, w, 3), a list of images, a memory map, or whatever tells its length and gives an item;
#: None stands for an image that is not there.
Images = Sequence[np.ndarray | None] | np.ndarray
#: What images are called, where they are no pictures.
SILHOUETTES = "silhouettes"


def recording_of(
    rig: Rig | Sequence[Camera],
    images: Sequence[Images] | None = None,
    background: Sequence[Images | None] | None = None,
    silhouettes: Sequence[Images] | None = None,
    *,
    fps: float = DEFAULT_FPS,
    room: np.ndarray | None = None,
    persons: int | None = None,
    height_m: float | Sequence[float] | None = (),
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
        The first is looked at here, the others when they are read: what is no such array is an `InputError` then, and one of another
        size is left out.
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
    height_m : float or sequence of float, optional
        Statures that are known, metres.
    name : str

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        When there is nothing, numbers of cameras differ, an array is no image of its camera, or a setting is none that recording.toml
        may have.

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
    masks = _views(rig, silhouettes, SILHOUETTES)
    both = [one or other for one, other in zip(footage, masks, strict=True)]
    lacking = [camera.name for camera, view in zip(rig, both, strict=True) if view is None]
    if lacking:
        raise InputError(f"camera '{lacking[0]}' has neither images nor silhouettes; give some, or leave it out of the rig")
    for problem in wrong_units(rig):
        raise InputError(problem)
    lengths = {camera.name: view.n_frames for camera, view in zip(rig, both, strict=True) if view is not None}
    settings = _checked({"name": name, "fps": fps, "room": room, "persons": persons, "subject_height_m": height_m})
    return Recording(
        path=Path(name),
        name=name,
        fps=float(settings["fps"]),
        rig=rig,
        room=estimate_room(rig) if room is None else settings["room"],
        n_frames=common_length(list(lengths.values())),
        start=0,
        problems=tuple(unlike_lengths(name, lengths)),
        persons=settings.get("persons"),
        subject_height_m=settings.get("subject_height_m", ()),
        room_is_estimated=room is None,
        factors=(1,) * len(rig),
        _footage=footage,
        _silhouettes=masks,
        _background=_views(rig, background, "background"),
    )


def _checked(given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by the rules of recording.toml, of NumPy's numbers too; those that are None are left out, but for `name` and `fps`."""
    plain = {key: _plain(value) for key, value in given.items()}
    stated = {key: value for key, value in plain.items() if key in ("name", "fps") or value is not None}
    try:
        return check_settings(stated, Path("recording_of"))
    except InputError as error:
        raise InputError(str(error).replace("subject_height_m", "height_m")) from None


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


def _views(rig: Rig, images: Sequence[Images | None] | None, what: str) -> tuple[Footage | None, ...]:
    """One camera's images after the other's, looked at as far as the first image of each."""
    if images is None:
        return (None,) * len(rig)
    if not _is_sequence(images) or len(images) != len(rig):
        got = len(images) if _is_sequence(images) else type(images).__name__
        raise InputError(f"`{what}` must have one entry a camera, {len(rig)} of them; got {got}")
    for camera, own in zip(rig, images, strict=True):
        if own is not None and not _is_sequence(own):
            raise InputError(
                f"camera '{camera.name}': its {what} must be an array or a list, which tells its length and gives any item; got "
                f"{type(own).__name__}"
            )
    return tuple(None if own is None or not len(own) else _view(camera, own, what) for camera, own in zip(rig, images, strict=True))


def _is_sequence(value: Any) -> bool:
    """Whether it tells its length and gives any item; an array of no dimension has both methods and does neither."""
    return hasattr(value, "__len__") and hasattr(value, "__getitem__") and (not isinstance(value, np.ndarray) or value.ndim > 0)


@dataclass(frozen=True)
class _Checked(Sequence[np.ndarray | None]):
    """Images of a camera, each looked at when it is asked for: what OpenCV and NumPy say of a wrong one names neither camera nor frame."""

    images: Images
    camera: Camera
    what: str

    def __len__(self) -> int:
        return len(self.images)

    def __getitem__(self, frame: Any) -> Any:
        image = self.images[frame]
        if image is not None and not is_image(image, self.what == SILHOUETTES):
            raise wrong_image(self.camera, image, f"frame {frame} of its {self.what}", self.what == SILHOUETTES)
        return image


def _view(camera: Camera, images: Images, what: str) -> Footage:
    found = (images[frame] for frame in range(len(images)))
    first = next((image for image in found if image is not None), None)
    if first is None:
        raise InputError(f"camera '{camera.name}': all of its {what} are None; leave it out of the rig")
    camera_image(camera, first, f"its {what}", what == SILHOUETTES)
    footage = Footage(Path(camera.name), len(images), camera.size)
    return replace(footage, arrays=_Checked(images, camera, what))
