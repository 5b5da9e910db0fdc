"""What each camera sees by itself, frame by frame: its image, its silhouette, and what it leaves to the others to decide.

Up to here no camera asks another, so cameras can be spread over processes: each reads, decodes and segments its own.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from hmc.camera.segmentation import BackgroundModel, segment_views, train_background
from hmc.io.recording import Recording, background_frames, iterate_frames, only_cameras
from hmc.processes import ahead
from hmc.voxels.floor_shadows import floor_darkness
from hmc.voxels.frontend_settings import FrontendSettings

__all__ = ["Look", "look_at"]

T = TypeVar("T")

#: Of a pixel in shared memory, at most: image, mask, doubts, what was filled, darkness; a silhouette that was ready besides. Bytes.
PIXEL_BYTES = 3 + 1 + 1 + 1 + 4
#: Of a frame besides, bytes.
FRAME_BYTES = 1 << 16


@dataclass(frozen=True)
class Look:
    """One frame as some cameras see it, each by itself; tuples have one entry a camera.

    Parameters
    ----------
    index : int
        Absolute frame number.
    images : tuple of ndarray of uint8, shape (h, w, 3), or None
    masks : tuple of ndarray of bool, shape (h, w), or None
    doubtful, filled : tuples of ndarray of bool, shape (h, w), or None
        As `hmc.camera.segmentation.BackgroundModel` has them; None of a camera with ready-made silhouettes.
    darkness : tuple of ndarray of float32, shape (h, w), or None
        As from `hmc.voxels.floor_shadows.floor_darkness`; None where it is not asked for.
    lines : tuple of str
        What was survived in reading, since the frame before.
    """

    index: int
    images: tuple[np.ndarray | None, ...]
    masks: tuple[np.ndarray | None, ...]
    doubtful: tuple[np.ndarray | None, ...]
    filled: tuple[np.ndarray | None, ...]
    darkness: tuple[np.ndarray | None, ...]
    lines: tuple[str, ...]


def look_at(
    recording: Recording,
    models: Mapping[int, BackgroundModel],
    background: Collection[int],
    settings: FrontendSettings,
    first: int,
    last: int | None,
    workers: int,
    pool: Executor,
) -> Iterator[Look]:
    """What all cameras see, frame by frame.

    Parameters
    ----------
    recording : Recording
    models : mapping of int to BackgroundModel
        By camera. Not to be used again.
    background : collection of int
        Cameras whose model is learnt from their frames of the empty scene.
    settings : FrontendSettings
    first, last : int
        Frames, as of `hmc.io.recording.iterate_frames`.
    workers : int
        With two or more, cameras are spread over so many processes; else they are looked at in this one.
    pool : concurrent.futures.Executor
        Threads for this process.

    Yields
    ------
    Look
    """
    cameras = list(range(len(recording.rig)))
    if workers < 2:
        yield from _look(recording, models, background, settings, first, last, pool)
        return
    with ExitStack() as stack:
        parts = []
        for group in [cameras[k::workers] for k in range(min(workers, len(cameras)))]:
            own = {k: models[c] for k, c in enumerate(group) if c in models}
            taught = {k for k, c in enumerate(group) if c in background}
            part = only_cameras(recording, group)
            pixels = sum(int(np.prod(camera.size)) for camera in part.rig)
            make = partial(_look, part, own, taught, settings, first, last, None)
            parts.append(stack.enter_context(closing(ahead(make, workers, PIXEL_BYTES * pixels + FRAME_BYTES, lend=True))))  # type: ignore[type-var]
        order = np.argsort([c for k in range(len(parts)) for c in cameras[k::workers]]).tolist()
        for looks in zip(*parts, strict=True):
            yield _joined(looks, order)


def _joined(looks: Sequence[Look], order: Sequence[int]) -> Look:
    """One frame as all cameras see it; arrays are copied where others may keep them."""

    def all_of(values: Callable[[Look], tuple], copied: bool) -> tuple:
        found = [value for look in looks for value in values(look)]
        return tuple(found[k].copy() if copied and found[k] is not None else found[k] for k in order)

    return Look(
        looks[0].index,
        all_of(lambda look: look.images, copied=True),
        all_of(lambda look: look.masks, copied=True),
        all_of(lambda look: look.doubtful, copied=True),
        all_of(lambda look: look.filled, copied=False),
        all_of(lambda look: look.darkness, copied=False),
        tuple(line for look in looks for line in look.lines),
    )


def _look(
    recording: Recording,
    models: Mapping[int, BackgroundModel],
    background: Collection[int],
    settings: FrontendSettings,
    first: int,
    last: int | None,
    pool: Executor | None,
) -> Iterator[Look]:
    """What some cameras see; with a pool, a frame is read while the one before is looked at."""
    lines: list[str] = []
    known = dict(models)
    for c in sorted(background):
        known[c] = train_background(background_frames(recording, c, settings.background_frames), settings.segmentation)
    with ExitStack() as stack:
        frames: Iterable = iterate_frames(recording, first, last, lines.append)
        if pool is not None:
            frames = _read_ahead(frames, stack.enter_context(ThreadPoolExecutor(1)))
        for frame in frames:
            found, after = segment_views(list(known.values()), [frame.images[c] for c in known], settings.segmentation, pool)
            known = dict(zip(known, after, strict=True))
            masks = list(frame.silhouettes or (None,) * len(recording.rig))
            for c, mask in zip(known, found, strict=True):
                masks[c] = mask
            seen = [known.get(c) for c in range(len(masks))]
            doubtful = tuple(None if model is None else model.doubtful for model in seen)
            filled = tuple(None if model is None else model.filled for model in seen)
            told, lines[:] = tuple(lines), []
            yield Look(frame.index, frame.images, tuple(masks), doubtful, filled, _darkness(frame.images, masks, seen, settings), told)


def _darkness(images: Sequence, masks: Sequence, models: Sequence, settings: FrontendSettings) -> tuple[np.ndarray | None, ...]:
    return tuple(
        floor_darkness(image, model, mask) if settings.cut_shadows and not (image is None or model is None or mask is None) else None
        for image, mask, model in zip(images, masks, models, strict=True)
    )


def _read_ahead(items: Iterable[T], reader: ThreadPoolExecutor) -> Iterator[T]:
    """Pass items on, with the next one being read meanwhile."""
    iterator = iter(items)
    done = object()
    coming = reader.submit(next, iterator, done)
    try:
        while (item := coming.result()) is not done:
            coming = reader.submit(next, iterator, done)
            yield item  # type: ignore[misc]
    finally:
        coming.cancel()
