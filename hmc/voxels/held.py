"""Frames held back for half a second, so that what is found of a camera late counts from its first bad frame on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from hmc.camera.model import Rig
from hmc.io.camera_faults import CameraFault
from hmc.io.masks import MaskStep

__all__ = ["frames_to_hold", "held_steps", "with_faults", "without_faulty"]

#: How long frames are held, seconds, and how many bytes at most; an image with its silhouette and doubts takes so many a pixel.
HELD_S, HELD_BYTES, PIXEL_BYTES = 0.5, 120e6, 5

Masks = tuple[np.ndarray | None, ...]


def frames_to_hold(rig: Rig, fps: float) -> int:
    """How many frames are held back: half a second, or what the memory for it takes."""
    frame_bytes = PIXEL_BYTES * sum(camera.size[0] * camera.size[1] for camera in rig)
    return max(1, min(round(HELD_S * fps), int(HELD_BYTES // frame_bytes)))


def held_steps(steps: Iterable[MaskStep], n: int) -> Iterator[MaskStep]:
    """Pass frames on, each when so many others have come, with the faults that were found of it until then.

    Parameters
    ----------
    steps : iterable of MaskStep
        Each with the faults that are known when it comes.
    n : int

    Yields
    ------
    MaskStep
    """
    held: deque[MaskStep] = deque()
    for step in steps:
        held.append(step)
        if any(fault is not None for fault in step.faults):
            held = deque(with_faults(one, step.faults) for one in held)
        if len(held) > n:
            yield held.popleft()
    yield from held


def with_faults(step: MaskStep, faults: Sequence[CameraFault | None]) -> MaskStep:
    """A frame with those of some faults that had begun by then, without the silhouettes of cameras that are left out."""
    known = step.faults or (None,) * len(step.masks)
    now = tuple(new if new is not None and new.since <= step.index else old for new, old in zip(faults, known, strict=True))
    return replace(
        step,
        masks=without_faulty(step.masks, now),
        doubtful=without_faulty(step.doubtful, now),
        faults=now if any(fault is not None for fault in now) else known,
    )


def without_faulty(masks: Masks, faults: Sequence[CameraFault | None]) -> Masks:
    """Silhouettes, or doubts, of the cameras that count; None of the others."""
    return tuple(None if fault is not None and fault.left_out else mask for mask, fault in zip(masks, faults, strict=True))
