"""Images that have not the size of their calibration: what may have happened, and the calibration made to fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmc.camera.model import Camera
from hmc.errors import InputError

__all__ = ["FITS", "fit_size", "size_cure"]

#: Values of `image_size` in recording.toml: the images are the calibrated ones made smaller or larger, or have some rows or columns more or
#: fewer at the bottom and right edges.
FITS = ("scaled", "padded")
#: Codecs fill images up to multiples of 8, 16 or 32.
MAX_PADDING_PX = 31
#: Share of a side by which an optical centre may be off the middle.
MIDDLE = 0.12
#: Nobody scales images by less than this.
NEARLY_ONE = 0.05


def fit_size(camera: Camera, size: tuple[int, int], fit: str) -> Camera:
    """The camera for images of another size.

    Parameters
    ----------
    camera : Camera
    size : (width, height)
        Of the images.
    fit : {"scaled", "padded"}
        "scaled": made smaller or larger as a whole. "padded": cut or filled at the bottom and right edges.

    Raises
    ------
    InputError
        When images of this size cannot have come about so.
    """
    if size == camera.size:
        return camera
    factor = common_factor(camera.size, size)
    if fit == "scaled" and factor is not None:
        return replace(camera.scaled(factor), size=size)
    if fit == "padded" and is_padded(camera.size, size):
        return replace(camera, size=size)
    how = "no factor makes the one the other" if fit == "scaled" else f"they differ by more than {MAX_PADDING_PX} pixels"
    raise InputError(
        f"camera '{camera.name}': recording.toml says image_size = \"{fit}\", but images are {_by(size)} and the calibration says "
        f"{_by(camera.size)}: {how}; calibrate at the images' size"
    )


def size_cure(calibrated: tuple[int, int], size: tuple[int, int], optical_centre: Sequence[float] | np.ndarray) -> str:
    """What to do about images of another size than the calibration's: a clause. The optical centre (u, v) is the calibration's, pixels."""
    if size == calibrated[::-1] and size[0] != size[1]:
        # Whose optical centre is in the middle of the images was calibrated with such, and height and width changed places in the file.
        off = [float(np.abs(np.divide(optical_centre, sides) - 0.5).max()) for sides in (calibrated, size)]
        if off[1] < MIDDLE < off[0]:
            return f"their middle is the optical centre: write size = [{size[0]}, {size[1]}] (width, height) in the calibration"
        return "they are turned by 90 degrees (a phone's rotation flag?): turn them back, or calibrate with images that are turned alike"
    factor = common_factor(calibrated, size)
    padded = is_padded(calibrated, size)
    if factor is not None and not (padded and abs(factor - 1) < NEARLY_ONE):
        return f'they are {factor:.4g} times as large: if nothing was cut off, write image_size = "scaled" in recording.toml'
    if padded:
        return 'if a codec filled up or cut the bottom and right edges, write image_size = "padded" in recording.toml'
    return "calibrate at the images' size, or correct `size` and `matrix`"


def common_factor(calibrated: tuple[int, int], size: tuple[int, int]) -> float | None:
    """The factor by which both sides grew, up to whole pixels; None where there is none."""
    ratios = [new / old for old, new in zip(calibrated, size, strict=True)]
    for factor in (*ratios, sum(ratios) / 2, sum(size) / sum(calibrated)):
        # A side may be rounded up or down, and to an even number, as videos have them.
        if all(abs(old * factor - new) <= 1 for old, new in zip(calibrated, size, strict=True)):
            return factor
    return None


def is_padded(calibrated: tuple[int, int], size: tuple[int, int]) -> bool:
    """Whether both sides differ by what a codec adds, at most."""
    return all(abs(new - old) <= MAX_PADDING_PX for old, new in zip(calibrated, size, strict=True))


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
