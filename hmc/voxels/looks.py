"""What each camera sees by itself, frame by frame: its image, its silhouette, and what it leaves to the others to decide.

Up to here no camera asks another, so cameras can be spread over processes: each reads, decodes and segments its own.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from hmc.camera.segmentation import BackgroundModel, segment_views, train_background
from hmc.io.recording import Recording, background_frames, iterate_frames, only_cameras
from hmc.processes import ahead
from hmc.voxels.floor_shadows import Scene
from hmc.voxels.frontend_settings import FrontendSettings

__all__ = ["Look", "look_at"]

T = TypeVar("T")

#: Of a pixel in shared memory, at most: image, mask, doubts, what was filled, the empty scene and where it was never seen. Bytes.
PIXEL_BYTES = 3 + 1 + 1 + 1 + 12 + 1
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
    scenes : tuple of Scene or None
        Of cameras that know the empty scene. Arrays in it change when the next frame is looked at.
    lines : tuple of str
        What was survived in reading, since the frame before.
    """

    index: int
    images: tuple[np.ndarray | None, ...]
    masks: tuple[np.ndarray | None, ...]
    doubtful: tuple[np.ndarray | None, ...]
    filled: tuple[np.ndarray | None, ...]
    scenes: tuple[Scene | None, ...]
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
        for look, _ in _look(recording, models, background, settings, first, last, pool):
            yield look
        return
    groups = [cameras[k::workers] for k in range(min(workers, len(cameras)))]
    order = np.argsort([c for group in groups for c in group]).tolist()
    scenes: list[Scene | None] = [None] * len(cameras)
    with ExitStack() as stack:
        parts = []
        for group in groups:
            own = {k: models[c] for k, c in enumerate(group) if c in models}
            taught = {k for k, c in enumerate(group) if c in background}
            part = only_cameras(recording, group)
            pixels = sum(int(np.prod(camera.size)) for camera in part.rig)
            make = partial(_look_apart, part, own, taught, settings, first, last)
            parts.append(stack.enter_context(closing(ahead(make, workers, PIXEL_BYTES * pixels + FRAME_BYTES, lend=True))))  # type: ignore[type-var]
        for looks in zip(*parts, strict=True):
            look = _joined(looks, order)
            # Copied where others may keep them, or they are wanted again.
            scenes = [before if now is None else _as_pixels(now) for before, now in zip(scenes, look.scenes, strict=True)]
            yield replace(
                look, images=_copies(look.images), masks=_copies(look.masks), doubtful=_copies(look.doubtful), scenes=tuple(scenes)
            )


def _look_apart(
    recording: Recording,
    models: Mapping[int, BackgroundModel],
    background: Collection[int],
    settings: FrontendSettings,
    first: int,
    last: int | None,
) -> Iterator[Look]:
    """`_look` in a process of its own: of the empty scene only what has changed is told, plane by plane, as arrays are shared."""
    told = [-1] * len(recording.rig)
    for look, changes in _look(recording, models, background, settings, first, last, None):
        new = (scene if now != before else None for scene, now, before in zip(look.scenes, changes, told, strict=True))
        told = changes
        yield replace(look, scenes=tuple(None if one is None else Scene(np.moveaxis(one.mean, -1, 0), one.unseen) for one in new))


def _as_pixels(planes: Scene) -> Scene:
    """A scene as it was, of arrays that last."""
    return Scene(np.moveaxis(planes.mean.copy(), 0, -1), None if planes.unseen is None else planes.unseen.copy())


def _copies(arrays: tuple[np.ndarray | None, ...]) -> tuple[np.ndarray | None, ...]:
    return tuple(None if array is None else array.copy() for array in arrays)


def _joined(looks: Sequence[Look], order: Sequence[int]) -> Look:
    """One frame as all cameras see it."""

    def all_of(values: Callable[[Look], tuple]) -> tuple:
        found = [value for look in looks for value in values(look)]
        return tuple(found[k] for k in order)

    return Look(
        looks[0].index,
        all_of(lambda look: look.images),
        all_of(lambda look: look.masks),
        all_of(lambda look: look.doubtful),
        all_of(lambda look: look.filled),
        all_of(lambda look: look.scenes),
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
) -> Iterator[tuple[Look, list[int]]]:
    """What some cameras see, and how often each one's scene has changed; with a pool, a frame is read while the one before is looked at."""
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
            scenes = tuple(None if model is None else Scene(model.mean, model.unseen) for model in seen)
            told, lines[:] = tuple(lines), []
            changes = [0 if model is None else model.changes for model in seen]
            yield Look(frame.index, frame.images, tuple(masks), doubtful, filled, scenes, told), changes


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
