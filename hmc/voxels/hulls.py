"""From a recording to visual hulls, a frame at a time: images, silhouettes, voxels.

>>> for step in stream_hulls(recording, grid):                       # doctest: +SKIP
...     print(step.index, step.strict.sum(), step.tolerant.sum())

Where the silhouettes come from, camera by camera (``FrontendSettings.source = "auto"``): ready-made ones where the recording has them;
else the images against a background learnt from frames of the empty scene; else against a temporal median of the recording from which
people were cut out with the help of all cameras, and where they hardly ever leave a place, by their colors
(`hmc.voxels.background_initialisation`).

Nothing grows with the length of the recording.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from hmc.camera.segmentation import BackgroundModel, SegmentationSettings, segment_views, train_background
from hmc.errors import InputError
from hmc.io.masks import MaskStep, Report
from hmc.io.recording import Frame, Recording, background_frames, iterate_frames
from hmc.voxels.background_initialisation import UnseenPlaces, learn_from_people, with_unseen_places
from hmc.voxels.carving import CarvingTables, carve_levels, shared_tables
from hmc.voxels.completion import CompletionTables, complete_masks, doubtful_hull, make_completion_tables
from hmc.voxels.floor_shadows import cut_filled_shadows, cut_floor_shadows
from hmc.voxels.grid import VoxelGrid

__all__ = ["FrontendSettings", "HullStep", "stream_hulls", "stream_masks"]

logger = logging.getLogger("hmc")

T = TypeVar("T")

SOURCES = ("auto", "silhouettes", "background", "median")


@dataclass(frozen=True)
class FrontendSettings:
    """Parameters of the chain from images to hulls.

    Attributes
    ----------
    segmentation : SegmentationSettings
    source : {"auto", "silhouettes", "background", "median"}
        Where the silhouettes come from; a source other than "auto" must be there.
    background_frames : int
        At most this many frames of the empty scene are learnt from.
    median_frames, median_span : int
        Images of which the median is taken, and the number of frames, around the selection, over which they are spread.
    complete : bool
        Whether cameras decide one another's doubtful pixels (`hmc.voxels.completion`).
    cut_shadows : bool
        Whether shadows on the floor, on which cameras agree, leave the silhouettes (`hmc.voxels.floor_shadows`).
    tolerance : int
        Cameras that may miss a voxel of the tolerant hull. Used where four cameras or more have a silhouette; with fewer, the tolerant
        hull is the strict one.
    outside : {"ignore", "carve", "keep"}
        What a camera says of a voxel that it does not see (`hmc.voxels.carving`).
    min_views : int, optional
        Cameras that must see a voxel (`hmc.voxels.carving.carve`).
    threads : int
        Threads over which cameras are spread; 0: as many as there are processors. The result does not depend on it.
    """

    segmentation: SegmentationSettings = field(default_factory=SegmentationSettings)
    source: str = "auto"
    background_frames: int = 200
    median_frames: int = 20
    median_span: int = 1800
    complete: bool = True
    cut_shadows: bool = True
    tolerance: int = 1
    outside: str = "ignore"
    min_views: int | None = None
    threads: int = 0

    def __post_init__(self) -> None:
        if self.source not in SOURCES:
            raise InputError(f"`source` must be one of {', '.join(SOURCES)}; got {self.source!r}")


@dataclass(frozen=True)
class HullStep(MaskStep):
    """One frame's silhouettes and hulls.

    Attributes
    ----------
    strict, tolerant, loose : ndarray of bool, shape (nx, ny, nz)
        The visual hull of all cameras, the one in which a camera may be wrong, and, of four cameras or more, the one in which one
        more may be: what furniture hides from two cameras is still in it, and so is what most cameras only doubt
        (`hmc.voxels.completion.doubtful_hull`). Empty where the frame is not `usable`.
    """

    strict: np.ndarray
    tolerant: np.ndarray
    loose: np.ndarray


def stream_hulls(
    recording: Recording,
    grid: VoxelGrid,
    settings: FrontendSettings | None = None,
    *,
    first: int | None = None,
    last: int | None = None,
    warm_up: int = 0,
    masks: Iterable[MaskStep] | None = None,
    on_problem: Report | None = None,
) -> Iterator[HullStep]:
    """Silhouettes and hulls of the selected frames, in order.

    Parameters
    ----------
    recording : Recording
    grid : VoxelGrid
    settings : FrontendSettings, optional
    first, last, warm_up, on_problem
        As for `stream_masks`.
    masks : iterable of MaskStep, optional
        Silhouettes that were made before (`hmc.io.masks`), of the frames that are wanted; made here where left out.

    Yields
    ------
    HullStep
    """
    settings = settings or FrontendSettings()
    tables = shared_tables(grid, recording.rig)
    if masks is None:
        masks = stream_masks(recording, settings, first=first, last=last, warm_up=warm_up, on_problem=on_problem)
    for step in masks:
        yield HullStep(step.index, step.images, step.masks, step.doubtful, *_hulls(tables, step, settings))


def stream_masks(
    recording: Recording,
    settings: FrontendSettings | None = None,
    *,
    first: int | None = None,
    last: int | None = None,
    warm_up: int = 0,
    on_problem: Report | None = None,
) -> Iterator[MaskStep]:
    """Silhouettes of the selected frames, in order.

    Parameters
    ----------
    recording : Recording
    settings : FrontendSettings, optional
    first, last : int, optional
        A part of the selection, in absolute frame numbers; `last` is not included.
    warm_up : int
        So many frames before `first` are segmented too, not yielded, so that the background has adapted as if they had been. Where that
        reaches the start of the selection, the silhouettes are exactly those of a run from there.
    on_problem : callable, optional
        Called with one line for everything that was survived. By default the line is a warning of the logger "hmc".

    Yields
    ------
    MaskStep

    Raises
    ------
    InputError
        When the source of silhouettes that was asked for is not there.
    """
    settings = settings or FrontendSettings()
    report = on_problem or logger.warning
    first = recording.start if first is None else first
    start = max(recording.start, first - warm_up)
    models, places = _learn(recording, settings, report)
    names = recording.rig.names
    decided_together = (settings.complete or settings.cut_shadows) and any(models)
    tables = make_completion_tables(recording.room, recording.rig) if decided_together else None
    changed: dict[int, int] = {}  # camera whose whole image changed -> the frame in which that began
    with ThreadPoolExecutor(settings.threads or os.cpu_count() or 1) as pool, ThreadPoolExecutor(1) as reader:
        for frame in _read_ahead(iterate_frames(recording, start, last, report), reader):
            masks, models = _segment(frame, models, settings, pool)
            for c, (image, mask) in enumerate(zip(frame.images, masks, strict=True)):
                gone = models[c] is not None and image is not None and mask is None
                if gone:
                    changed.setdefault(c, frame.index)
                elif c in changed:
                    report(_say_changed(names[c], changed.pop(c), frame.index - 1))
            if frame.index >= first:
                if places is not None:
                    masks = with_unseen_places(places, frame.images, masks, pool)
                masks, doubtful = _settle(tables, frame, models, masks, settings)
                yield MaskStep(frame.index, frame.images, masks, doubtful)
        for c, began in changed.items():
            report(_say_changed(names[c], began, frame.index))


def _learn(recording: Recording, settings: FrontendSettings, report: Report) -> tuple[tuple, UnseenPlaces | None]:
    """What is known of the empty scene, and what of the places where it was never seen; the latter only for cameras that need it."""
    names, source = recording.rig.names, settings.source
    given = set(range(len(names))) if recording.has_silhouettes and source in ("auto", "silhouettes") else set()
    if source == "silhouettes" and not given:
        raise InputError(f"{recording.path}: there is no folder silhouettes/; put masks there or choose another source")
    models: dict[int, BackgroundModel] = {}
    places = None
    for c in set(range(len(names))) - given if source != "median" else ():
        if recording.n_background_frames[c]:
            models[c] = train_background(background_frames(recording, c, settings.background_frames), settings.segmentation)
        elif source == "background":
            raise InputError(f"{recording.path}: camera '{names[c]}' has no background frames; add them or choose another source")
    left = [c for c in range(len(names)) if c not in models and c not in given]
    if left:
        if not recording.has_images:
            raise InputError(f"{recording.path}: there are no images to find people in; add videos/ or images/")
        report(
            f"{', '.join(names[c] for c in left)}: no frames of the empty scene; the background is the median of the recording, "
            "so people who stay where they are may be missed"
        )
        with ThreadPoolExecutor(settings.threads or os.cpu_count() or 1) as pool:
            learnt, places = learn_from_people(recording, left, settings.segmentation, settings.median_frames, settings.median_span, pool)
        models |= learnt
        for line in _say_still(places):
            report(line)
    return tuple(models.get(c) for c in range(len(names))), places


def _hulls(tables: CarvingTables, step: MaskStep, settings: FrontendSettings) -> tuple[np.ndarray, ...]:
    if not step.usable:
        return tuple(np.zeros(tables.grid.shape, bool) for _ in range(3))
    n_masks = sum(mask is not None for mask in step.masks)
    tolerance = settings.tolerance if n_masks >= 4 else 0
    levels = (0, tolerance, tolerance + 1 if n_masks >= 4 else tolerance)
    hulls = carve_levels(tables, step.masks, levels, outside=settings.outside, min_views=settings.min_views)
    if any(doubt is not None for doubt in step.doubtful):
        hulls[2][doubtful_hull(tables, step.masks, step.doubtful)] = True
    return hulls


def _segment(frame: Frame, models: tuple, settings: FrontendSettings, pool: ThreadPoolExecutor) -> tuple[tuple, tuple]:
    """Masks of all cameras and the models after them; ready-made masks where a camera has no model."""
    ready = frame.silhouettes or (None,) * len(models)
    ours = [c for c, model in enumerate(models) if model is not None]
    found, after = segment_views([models[c] for c in ours], [frame.images[c] for c in ours], settings.segmentation, pool)
    masks, models = list(ready), tuple(models)
    for c, mask in zip(ours, found, strict=True):
        masks[c] = mask
    new = dict(zip(ours, after, strict=True))
    return tuple(masks), tuple(new.get(c) for c in range(len(models)))


def _settle(tables: CompletionTables | None, frame: Frame, models: tuple, masks: tuple, settings: FrontendSettings) -> tuple[tuple, tuple]:
    """Silhouettes after the cameras settled one another's doubts, and the doubts of frames in which much is left to doubt."""
    none, much = (None,) * len(masks), False
    if tables is None:
        return masks, none
    doubtful = tuple(None if model is None else model.doubtful for model in models)
    if settings.cut_shadows:
        filled = tuple(None if model is None else model.filled for model in models)
        masks = cut_filled_shadows(tables, masks, filled, doubtful)
    if settings.complete:
        masks, much = complete_masks(tables, masks, doubtful)
    if much:  # people who look like what is around them: what is dark on the floor there may be their shoes
        return masks, doubtful
    return cut_floor_shadows(tables, frame.images, models, masks) if settings.cut_shadows else masks, none


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


def _say_still(places: UnseenPlaces) -> Iterator[str]:
    for place in (one.place for one in places.still):
        at = f"({place.x:.1f}, {place.y:.1f}) m"
        yield f"a person who hardly moves stands at {at}: found by swaying and told by colors, which is less sure; film the empty scene"
    for place in places.doubted:
        at = f"({place.x:.1f}, {place.y:.1f}) m"
        yield f"a person may stand at {at} and hardly move: the images stir there, but the views do not show one body; not counted"


def _say_changed(name: str, first: int, last: int) -> str:
    frames = f"frame {first}" if first == last else f"frames {first} to {last}"
    return f"{name}: {frames}: nearly the whole image changed at once (a light switched?); not used"
