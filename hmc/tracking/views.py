"""The silhouettes and images of one frame, with the cameras that took them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Rig

__all__ = ["FrameViews"]


@dataclass(frozen=True)
class FrameViews:
    """The silhouettes and images of one frame, with the cameras that took them.

    Attributes
    ----------
    rig : Rig
    masks : sequence of ndarray of bool, shape (height, width), or None; one a camera
    images : sequence of ndarray of uint8, shape (height, width, 3), or None; one a camera
        Empty where the tracker does not use colors.
    """

    rig: Rig
    masks: Sequence[np.ndarray | None]
    images: Sequence[np.ndarray | None] = ()
