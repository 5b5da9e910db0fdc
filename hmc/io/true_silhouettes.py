"""True silhouettes beside a recording, as rendered ones have them: ``truth/silhouettes/CAMERA/FRAME.png``."""

from __future__ import annotations

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.recording import Recording

__all__ = ["true_frames", "true_silhouettes"]


def true_frames(recording: Recording) -> list[int]:
    """The frames that have true silhouettes, rising.

    Raises
    ------
    InputError
        When there are none.
    """
    folder = recording.path / "truth" / "silhouettes"
    frames = sorted(int(file.stem) for file in (folder / recording.rig.cameras[0].name).glob("*.png"))
    if not frames:
        raise InputError(f"{folder}: there are no true silhouettes to learn from")
    return frames


def true_silhouettes(recording: Recording, frame: int) -> tuple[np.ndarray, ...] | None:
    """The true silhouettes of a frame, one a camera; None where there are none."""
    folder = recording.path / "truth" / "silhouettes"
    paths = [folder / camera.name / f"{frame:06d}.png" for camera in recording.rig]
    if not all(path.is_file() for path in paths):
        return None
    pictures = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths]
    return tuple(np.asarray(picture) > 0 for picture in pictures)
