"""Silhouettes of many frames that follow one another, small and kept as bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.camera.segmentation import segment
from hmc.check.moments import learn_background
from hmc.check.sync.evidence import Packed, pack, unpack
from hmc.io.recording import Recording, iterate_frames, reduced

__all__ = ["masks_at", "packed_silhouettes", "small_recording"]

#: Images are read no larger than this, pixels, and so many tell what a scene without people looks like, where no empty scene is there.
SIDE_PX, LEARNT = 640, 25


def small_recording(recording: Recording) -> Recording:
    """The recording with images no longer than 640 pixels, nearly."""
    return reduced(recording, [max(1, round(max(camera.size) / SIDE_PX)) for camera in recording.rig])


def packed_silhouettes(recording: Recording) -> list[list[Packed]]:
    """The silhouettes of all frames of the selection: those on disk, or else what differs from the empty scene or the frames' median.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    list (frames) of list (cameras)
        As from `hmc.check.sync.evidence.pack`.
    """
    rig = recording.rig
    if recording.has_silhouettes:
        return [pack(frame.silhouettes or (None,) * len(rig), rig) for frame in iterate_frames(recording)]
    examples = []
    if not all(recording.n_background_frames):
        wanted = set(np.linspace(0, recording.n_frames - 1, LEARNT).round().astype(int) + recording.start)
        examples = [frame for frame in iterate_frames(recording) if frame.index in wanted]
    models = [learn_background(recording, c, examples) for c in range(len(rig))]
    packed = []
    for frame in iterate_frames(recording):
        masks: list[np.ndarray | None] = [None] * len(rig)
        for c, model in enumerate(models):
            if model is not None and frame.images[c] is not None:
                masks[c], models[c] = segment(model, frame.images[c])
        packed.append(pack(masks, rig))
    return packed


def masks_at(packed: Sequence[Sequence[Packed]], frames: Sequence[np.ndarray], moments: Sequence[int]) -> list[list[np.ndarray | None]]:
    """The silhouettes of some moments, each camera's of the frame that belongs to it; None where it has none.

    Parameters
    ----------
    packed
        As from `packed_silhouettes`.
    frames : sequence (cameras) of ndarray of int, shape (n_moments,)
    moments : sequence of int
    """
    n = len(packed)
    return [[unpack(packed[own[t]][c]) if 0 <= own[t] < n else None for c, own in enumerate(frames)] for t in moments]
