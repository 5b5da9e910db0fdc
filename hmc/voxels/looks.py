"""What each camera sees by itself, frame by frame: its image, its silhouette, and what it leaves to the others to decide.

Up to here no camera asks another, so cameras can be spread over processes: each reads, decodes and segments its own.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from hmc.camera.segmentation import BackgroundModel, SegmentationSettings, segment_views, train_background
from hmc.camera.shade import floor_pixels
from hmc.camera.silhouettes import in_planes
from hmc.io.recording import Frame, Recording, background_frames, iterate_frames, only_cameras
from hmc.processes import arrays_ahead
from hmc.voxels.floor_shadows import Scene
from hmc.voxels.frontend_settings import FrontendSettings

__all__ = ["Look", "look_at", "look_once"]

T = TypeVar("T")

#: Of a pixel in shared memory, at most, bytes: image, mask, doubts, filled or chance, the empty scene and where it was never seen.
PIXEL_BYTES = 3 + 1 + 1 + 1 + 12 + 1
#: Of a frame besides, bytes.
FRAME_BYTES = 1 << 16
#: Arrays of a camera that go between processes.
N_ARRAYS = 8


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
        As `hmc.camera.segmentation.BackgroundModel` has them; None of a camera with ready-made silhouettes, and `filled` of one with
        `chances`.
    chances : tuple of ndarray of uint8, shape (h, w), or None
        Of pixels that may be shadows, likewise; None of a camera with `filled`.
    gains : tuple of ndarray of float32, shape (rows, columns, 3), or None
        Of the image's light, likewise.
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
    chances: tuple[np.ndarray | None, ...]
    gains: tuple[np.ndarray | None, ...]
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
    """What all cameras see, frame by frame; processes begin with this call.

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

    Returns
    -------
    iterator of Look
        A generator; close it where not all of it is taken.
    """
    if workers < 2:
        return (look for look, _ in _look(recording, models, background, settings, first, last, pool))
    cameras = list(range(len(recording.rig)))
    groups = [cameras[k::workers] for k in range(min(workers, len(cameras)))]
    parts = []
    for group in groups:
        own = {k: models[c] for k, c in enumerate(group) if c in models}
        taught = {k for k, c in enumerate(group) if c in background}
        part = only_cameras(recording, group)
        item_bytes = PIXEL_BYTES * sum(int(np.prod(camera.size)) for camera in part.rig) + FRAME_BYTES
        make = partial(_arrays, part, own, taught, settings, first, last)
        parts.append(arrays_ahead(make, workers, item_bytes))
    return _together(parts, np.argsort([c for group in groups for c in group]).tolist())


def _together(parts: Sequence[Iterator[tuple[list[np.ndarray | None], Any]]], order: Sequence[int]) -> Iterator[Look]:
    """What groups of cameras see, as one; `order` says where among the groups each camera is."""
    scenes: list[Scene | None] = [None] * len(order)
    with ExitStack() as stack:
        for part in parts:
            stack.enter_context(closing(part))  # type: ignore[type-var]
        for found in zip(*parts, strict=True):
            flat = [array for arrays, _ in found for array in arrays]
            kinds = (tuple(flat[N_ARRAYS * k + kind] for k in order) for kind in range(N_ARRAYS))
            images, masks, doubtful, filled, chances, gains, means, unseen = kinds
            # Copied where others may keep them, or they are wanted again; of a mean, others gather channel by channel.
            new = zip(scenes, means, _copies(unseen), strict=True)
            scenes = [before if mean is None else Scene(in_planes(mean), hidden) for before, mean, hidden in new]
            lines = tuple(line for _, (_, own_lines) in found for line in own_lines)
            index = found[0][1][0]
            yield Look(index, _copies(images), _copies(masks), _copies(doubtful), filled, chances, gains, tuple(scenes), lines)


def look_once(
    models: Mapping[int, BackgroundModel],
    frame: Frame,
    settings: SegmentationSettings,
    pool: Executor | None = None,
    lines: tuple[str, ...] = (),
) -> tuple[Look, dict[int, BackgroundModel]]:
    """What the cameras see in one frame, and the models after it.

    Parameters
    ----------
    models : mapping of int to BackgroundModel
        By camera. Not to be used again: go on with those returned.
    frame : Frame
        Its silhouettes are taken as they are of cameras without a model.
    settings : SegmentationSettings
    pool : concurrent.futures.Executor, optional
        Threads to spread the cameras over.
    lines : tuple of str
        Of the look.

    Returns
    -------
    look : Look
    models : dict of int to BackgroundModel
    """
    found, after = segment_views(list(models.values()), [frame.images[c] for c in models], settings, pool)
    known = dict(zip(models, after, strict=True))
    masks = list(frame.silhouettes or (None,) * len(frame.images))
    for c, mask in zip(known, found, strict=True):
        masks[c] = mask
    seen = [known.get(c) for c in range(len(masks))]
    doubtful = tuple(None if model is None else model.doubtful for model in seen)
    filled = tuple(None if model is None else model.filled for model in seen)
    chances = tuple(None if model is None else model.chance for model in seen)
    gains = tuple(None if model is None else model.gains for model in seen)
    scenes = tuple(None if model is None else Scene(model.mean, model.unseen) for model in seen)
    return Look(frame.index, frame.images, tuple(masks), doubtful, filled, chances, gains, scenes, lines), known


def _arrays(
    recording: Recording,
    models: Mapping[int, BackgroundModel],
    background: Collection[int],
    settings: FrontendSettings,
    first: int,
    last: int | None,
) -> Iterator[tuple[list[np.ndarray | None], tuple[int, tuple[str, ...]]]]:
    """What some cameras see as arrays, `N_ARRAYS` a camera, beside its number and lines; of the empty scene only what has changed."""
    told = [-1] * len(recording.rig)
    for look, changes in _look(recording, models, background, settings, first, last, None):
        arrays: list[np.ndarray | None] = []
        for c, scene in enumerate(look.scenes):
            new = scene if changes[c] != told[c] else None
            arrays += [look.images[c], look.masks[c], look.doubtful[c], look.filled[c], look.chances[c], look.gains[c]]
            arrays += [None, None] if new is None else [new.mean, new.unseen]
        told = changes
        yield arrays, (look.index, look.lines)


def _copies(arrays: tuple[np.ndarray | None, ...]) -> tuple[np.ndarray | None, ...]:
    return tuple(None if array is None else array.copy() for array in arrays)


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
    segmentation = settings.segmentation.at_rate(recording.fps)
    for c in sorted(background):
        empty = background_frames(recording, c, settings.background_frames)
        floor = floor_pixels(recording.rig.cameras[c], recording.room)
        known[c] = train_background(empty, segmentation, floor=floor, factor=recording.factors[c])
    with ExitStack() as stack:
        frames: Iterable = iterate_frames(recording, first, last, lines.append)
        if pool is not None:
            frames = _read_ahead(frames, stack.enter_context(ThreadPoolExecutor(1)))
        for frame in frames:
            told, lines[:] = tuple(lines), []
            look, known = look_once(known, frame, segmentation, pool, told)
            yield look, [known[c].changes if c in known else 0 for c in range(len(recording.rig))]


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
