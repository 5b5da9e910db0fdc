"""Images as they are given to a session, checked: one line says whose is wrong, and how."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice

import numpy as np

from hmc.camera.images import camera_image
from hmc.camera.model import Camera, Rig
from hmc.camera.reduction import reduce_image
from hmc.errors import InputError

__all__ = ["Images", "background_images", "frame_images"]

#: One a camera; None where it has none.
Images = Sequence[np.ndarray | None]


def frame_images(rig: Rig, images: Images, factors: Sequence[int]) -> tuple[np.ndarray | None, ...]:
    """The images of a frame, so many times smaller and copied: cameras write the next frame where the last one was, and views are kept for
    a while."""
    if not isinstance(images, Sequence | np.ndarray) or len(images) != len(rig):
        given = len(images) if isinstance(images, Sequence | np.ndarray) else type(images).__name__
        raise InputError(f"a frame has one image a camera, {len(rig)} of them, None where there is none; got {given}")
    return tuple(
        None if image is None else _smaller(camera_image(camera, image, "its image"), factor)
        for camera, image, factor in zip(rig, images, factors, strict=True)
    )


def _smaller(image: np.ndarray, factor: int) -> np.ndarray:
    return image.copy() if factor == 1 else reduce_image(image, factor)


def background_images(camera: Camera, images: Iterable[np.ndarray], most: int, factor: int) -> Iterator[np.ndarray]:
    """Images of a camera's empty scene, one at least, so many times smaller."""
    empty = True
    for image in islice(images, most):
        empty = False
        yield reduce_image(camera_image(camera, image, "an image of its background"), factor)
    if empty:
        raise InputError(f"no background for camera '{camera.name}'; give images of the empty scene")
