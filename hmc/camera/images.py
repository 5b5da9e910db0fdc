"""What may be an image of a camera: one line says whose is wrong, and how."""

from __future__ import annotations

from typing import Any

import numpy as np

from hmc.camera.model import Camera
from hmc.errors import InputError

__all__ = ["camera_image", "is_image", "wrong_image"]


def is_image(image: Any, silhouette: bool = False) -> bool:
    """Whether it may be an image, or a silhouette, of whatever size."""
    if not isinstance(image, np.ndarray):
        return False
    if silhouette:
        return image.ndim == 2 and image.dtype in (np.bool_, np.uint8)
    return image.ndim == 3 and image.shape[2] == 3 and image.dtype == np.uint8


def wrong_image(camera: Camera, image: Any, what: str, silhouette: bool = False) -> InputError:
    """What is said of one that is none: what it must be, and what it is.

    Parameters
    ----------
    camera : Camera
    image : object
    what : str
        Which of the camera's it is, as "its images".
    silhouette : bool
    """
    shape = camera.size[::-1]
    wanted = f"bool or uint8, shape {shape}" if silhouette else f"uint8, shape {(*shape, 3)}, BGR"
    got = f"{image.dtype} of shape {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
    return InputError(f"camera '{camera.name}': {what} must be {wanted}; got {got}")


def camera_image(camera: Camera, image: Any, what: str, silhouette: bool = False) -> np.ndarray:
    """An image that may be the camera's, as it is; parameters as of `wrong_image`.

    Raises
    ------
    InputError
        When it is no image, or of another size than the calibration says.
    """
    if not is_image(image, silhouette) or image.shape[1::-1] != camera.size:
        raise wrong_image(camera, image, what, silhouette)
    return image
