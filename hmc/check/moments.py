"""Silhouettes of a few moments of a recording, by what is learnt of each camera alone: for who asks what a calibration is worth."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from hmc.camera.segmentation import BackgroundModel, segment, train_background
from hmc.camera.shade import floor_pixels
from hmc.io.recording import Frame, Recording, background_frames, iterate_frames

__all__ = ["Masks", "knows_the_floor", "learn_background", "moment_frames", "probe_masks"]

#: Silhouettes of one moment, one a camera: bool, shape (height, width), or None.
Masks = Sequence[np.ndarray | None]

#: Frames of the empty scene that are learnt from.
LEARNT_FRAMES = 20
#: Moments are of so many frames from the start, at most.
SPAN = 900


def probe_masks(recording: Recording, frames: Sequence[Frame], medians: bool = False) -> list[Masks]:
    """The silhouettes of a few frames: those on disk, or else what differs from the empty scene.

    Parameters
    ----------
    recording : Recording
    frames : sequence of Frame
    medians : bool
        Of a camera without an empty scene, the median of the frames stands for it; else it has no silhouettes.

    Returns
    -------
    list (frames) of sequence (cameras) of ndarray of bool, shape (h, w), or None
    """
    if recording.has_silhouettes:
        return [frame.silhouettes or (None,) * len(recording.rig) for frame in frames]
    with ThreadPoolExecutor() as pool:
        models = list(pool.map(lambda c: learn_background(recording, c, frames if medians else ()), range(len(recording.rig))))
    masks: list[list[np.ndarray | None]] = [[None] * len(models) for _ in frames]
    for c, model in enumerate(models):
        for frame, found in zip(frames, masks, strict=True):
            if model is not None:
                found[c], model = segment(model, frame.images[c])
    return list(masks)


def moment_frames(recording: Recording, n: int) -> list[Frame]:
    """So many moments, well spread over the recording's first frames."""
    span = min(recording.n_frames, SPAN)
    wanted = {recording.start + round(k) for k in np.linspace(0, span - 1, min(n, span))}
    return [frame for frame in iterate_frames(recording, last=recording.start + span) if frame.index in wanted]


def knows_the_floor(recording: Recording) -> bool:
    """Whether silhouettes are better for knowing where the floor is: shadows on it are told by an empty scene (`learn_background`)."""
    return not recording.has_silhouettes and any(recording.n_background_frames)


def learn_background(recording: Recording, index: int, frames: Sequence[Frame]) -> BackgroundModel | None:
    """The empty scene of one camera: of its own frames, or else the median of some of the recording's, if there are three or more."""
    if recording.n_background_frames[index]:
        floor = floor_pixels(recording.rig.cameras[index], recording.room)
        return train_background(background_frames(recording, index, LEARNT_FRAMES), floor=floor, factor=recording.factors[index])
    images = [image for frame in frames if (image := frame.images[index]) is not None]
    if len(images) < 3:
        return None
    return train_background([np.median(np.stack(images), axis=0).astype(np.uint8)] * LEARNT_FRAMES)
