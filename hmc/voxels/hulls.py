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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from hmc.camera.segmentation import BackgroundModel, empty_image
from hmc.errors import InputError
from hmc.io.masks import MaskStep, Report
from hmc.io.recording import Recording, background_frames
from hmc.voxels.background_initialisation import UnseenPlaces, learn_from_people, with_unseen_places
from hmc.voxels.carving import CarvingTables, carve_levels, shared_tables
from hmc.voxels.completion import Completion, CompletionTables, complete_masks, doubtful_hulls, make_completion_tables
from hmc.voxels.floor_light import tell_shades
from hmc.voxels.floor_shadows import cut_filled_shadows, cut_floor_shadows, lit_views
from hmc.voxels.frontend_settings import FrontendSettings
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.held import frames_to_hold, held_steps, without_faulty
from hmc.voxels.looks import Look, look_at
from hmc.voxels.watch import begin_watch, make_watch, watch_step

__all__ = ["FrontendSettings", "HullStep", "carve_step", "settle", "stream_hulls", "stream_masks"]

logger = logging.getLogger("hmc")

#: Images of the empty scene by which it is told whether a camera has moved.
SCENE_IMAGES = 5
#: What a camera takes for a person with this chance is not cut for what the floor shows. Less leaves shadows, more loses shoes and shanks
#: of the floor's color (`pale`: at .8 ankles are out by 45 and 38 mm for 38 and 25).
KEPT_CHANCE = 0.7


@dataclass(frozen=True)
class HullStep(MaskStep):
    """One frame's silhouettes and hulls.

    Attributes
    ----------
    strict, tolerant, loose : ndarray of bool, shape (nx, ny, nz)
        The visual hull of all cameras, the one in which a camera may be wrong, and, of four cameras or more, the one in which one
        more may be: what furniture hides from two cameras is still in it, and so is what most cameras only doubt
        (`hmc.voxels.completion.doubtful_hulls`). Empty where the frame is not `usable`.
    doubted : ndarray of bool, shape (nx, ny, nz), or None
        What three cameras see, and the others see or doubt. None where nobody doubts.
    """

    strict: np.ndarray
    tolerant: np.ndarray
    loose: np.ndarray
    doubted: np.ndarray | None = None


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
    workers: int = 1,
) -> Iterator[HullStep]:
    """Silhouettes and hulls of the selected frames, in order.

    Parameters
    ----------
    recording : Recording
    grid : VoxelGrid
    settings : FrontendSettings, optional
    first, last, warm_up, on_problem, workers
        As for `stream_masks`.
    masks : iterable of MaskStep, optional
        Silhouettes that were made before (`hmc.io.masks`), of the frames that are wanted; made here where left out.

    Yields
    ------
    HullStep
    """
    settings = settings or FrontendSettings()
    if masks is None:  # its processes are at work while the tables are made
        masks = stream_masks(recording, settings, first=first, last=last, warm_up=warm_up, on_problem=on_problem, workers=workers)
    tables = shared_tables(grid, recording.rig)
    for step in masks:
        yield carve_step(tables, step, settings)


def stream_masks(
    recording: Recording,
    settings: FrontendSettings | None = None,
    *,
    first: int | None = None,
    last: int | None = None,
    warm_up: int = 0,
    on_problem: Report | None = None,
    workers: int = 1,
) -> Iterator[MaskStep]:
    """Silhouettes of the selected frames, in order; processes begin with this call.

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
    workers : int
        Processes; cameras are spread over so many more than this one (`hmc.voxels.looks`). The result does not depend on it.

    Returns
    -------
    iterator of MaskStep
        A generator; close it where not all of it is taken.

    Raises
    ------
    InputError
        When the source of silhouettes that was asked for is not there.
    """
    settings = settings or FrontendSettings()
    report = on_problem or logger.warning
    first = recording.start if first is None else first
    start = max(recording.start, first - warm_up)
    scene = _empty_scene(recording, settings, report)
    pool = ThreadPoolExecutor(settings.threads or os.cpu_count() or 1)  # has no threads until it is asked, so that processes may fork
    looks = look_at(recording, scene.models, scene.background, settings, start, last, workers, pool)

    def steps() -> Iterator[MaskStep]:
        with pool, closing(looks):  # type: ignore[type-var]
            yield from _mask_steps(recording, scene, settings, (start, first), looks, pool, report)

    return held_steps(steps(), frames_to_hold(recording.rig, recording.fps))


def _mask_steps(
    recording: Recording,
    scene: _EmptyScene,
    settings: FrontendSettings,
    begin: tuple[int, int],
    looks: Iterator[Look],
    pool: ThreadPoolExecutor,
    report: Report,
) -> Iterator[MaskStep]:
    """Silhouettes from the second of two frames on, of what cameras see from the first on."""
    names, (index, first) = recording.rig.names, begin
    decided_together = (settings.ask_floor or settings.complete or settings.cut_shadows) and any(scene.known)
    tables = make_completion_tables(recording.room, recording.rig) if decided_together else None
    watch = make_watch(recording.rig, recording.room, recording.fps, _scene_images(recording, scene), settings.exclude)
    changed: dict[int, int] = {}  # camera whose whole image changed -> the frame in which that began
    state = begin_watch(watch)
    for look in looks:
        for line in look.lines:
            report(line)
        masks, index = look.masks, look.index
        if scene.places is not None:
            masks = with_unseen_places(scene.places, look.images, masks, pool)
        state = watch_step(watch, state, index, look.images, masks)
        for c, (image, mask) in enumerate(zip(look.images, look.masks, strict=True)):
            gone = scene.known[c] and image is not None and mask is None and not state.cameras[c].dark
            if gone:
                changed.setdefault(c, index)
            elif c in changed:
                report(_say_changed(names[c], changed.pop(c), index - 1))
        if index >= first:
            counting = without_faulty(masks, state.faults)
            yield MaskStep(index, look.images, *settle(tables, replace(look, masks=counting), settings), faults=state.faults)
    for c, began in changed.items():
        report(_say_changed(names[c], began, index))


def _scene_images(recording: Recording, scene: _EmptyScene) -> list[list[np.ndarray]]:
    """A few images of the empty scene of each camera; none where it is not known."""
    return [
        list(background_frames(recording, c, SCENE_IMAGES))
        if c in scene.background
        else [empty_image(scene.models[c])]
        if c in scene.models
        else []
        for c in range(len(recording.rig))
    ]


@dataclass(frozen=True)
class _EmptyScene:
    """What is known of the empty scene before the first frame.

    Parameters
    ----------
    models : mapping of int to BackgroundModel
        By camera, of those whose scene was learnt from the recording itself.
    background : frozenset of int
        Cameras with frames of the empty scene, which are yet to be learnt from.
    known : tuple of bool
        Of each camera, whether it is one of these.
    places : UnseenPlaces or None
        Where the scene was never seen; only for cameras that need it.
    """

    models: Mapping[int, BackgroundModel]
    background: frozenset[int]
    known: tuple[bool, ...]
    places: UnseenPlaces | None


def _empty_scene(recording: Recording, settings: FrontendSettings, report: Report) -> _EmptyScene:
    """Where each camera's empty scene is to be learnt from, and what the recording itself tells of it."""
    names, source = recording.rig.names, settings.source
    given = set(range(len(names))) if recording.has_silhouettes and source in ("auto", "silhouettes") else set()
    if source == "silhouettes" and not given:
        raise InputError(f"{recording.path}: there is no folder silhouettes/; put masks there or choose another source")
    models: dict[int, BackgroundModel] = {}
    places, background = None, set()
    for c in set(range(len(names))) - given if source != "median" else ():
        if recording.n_background_frames[c]:
            background.add(c)
        elif source == "background":
            raise InputError(f"{recording.path}: camera '{names[c]}' has no background frames; add them or choose another source")
    left = [c for c in range(len(names)) if c not in background and c not in given]
    if left:
        if not recording.has_images:
            raise InputError(f"{recording.path}: there are no images to find people in; add videos/ or images/")
        report(
            f"{', '.join(names[c] for c in left)}: no frames of the empty scene; the background is the median of the recording, "
            "so people who stay where they are may be missed"
        )
        with ThreadPoolExecutor(settings.threads or os.cpu_count() or 1) as pool:
            span = round(settings.median_span_s * recording.fps)
            models, places = learn_from_people(recording, left, settings.segmentation, settings.median_frames, span, pool)
        for line in _say_still(places):
            report(line)
    known = tuple(c in background or c in models for c in range(len(names)))
    return _EmptyScene(models, frozenset(background), known, places)


def carve_step(tables: CarvingTables, step: MaskStep, settings: FrontendSettings) -> HullStep:
    """One frame's silhouettes with their hulls.

    Parameters
    ----------
    tables : CarvingTables
        Of the grid.
    step : MaskStep
    settings : FrontendSettings
    """
    strict, tolerant, loose = _hulls(tables, step, settings)
    doubted = None
    if step.usable and any(doubt is not None for doubt in step.doubtful):
        maybe, doubted = doubtful_hulls(tables, step.masks, step.doubtful)
        loose[maybe] = True
    return HullStep(step.index, step.images, step.masks, step.doubtful, strict, tolerant, loose, doubted, faults=step.faults)


def _hulls(tables: CarvingTables, step: MaskStep, settings: FrontendSettings) -> Sequence[np.ndarray]:
    """Of all cameras, and where one and two more may be wrong."""
    if not step.usable:
        return tuple(np.zeros(tables.grid.shape, bool) for _ in range(3))
    n_masks = sum(mask is not None for mask in step.masks)
    tolerance = settings.tolerance if n_masks >= 4 else 0
    levels = (0, tolerance, tolerance + 1 if n_masks >= 4 else tolerance)
    return carve_levels(tables, step.masks, levels, outside=settings.outside, min_views=settings.min_views)


def settle(tables: CompletionTables | None, look: Look, settings: FrontendSettings) -> tuple[tuple, tuple]:
    """Silhouettes after the cameras settled one another's doubts, and the doubts that are left.

    Parameters
    ----------
    tables : CompletionTables or None
        None: nothing is settled.
    look : Look
    settings : FrontendSettings

    Returns
    -------
    masks, doubtful : tuples of ndarray of bool, shape (h, w), or None; one a camera
    """
    masks, doubtful = look.masks, look.doubtful
    none: tuple[None, ...] = (None,) * len(masks)
    if tables is None:
        return masks, none
    views = lit_views(look.images, look.scenes, look.gains) if settings.ask_floor or settings.cut_shadows else none
    if settings.ask_floor:
        masks = tell_shades(tables, views, look.chances, masks)
    if settings.cut_shadows:
        masks = cut_filled_shadows(tables, masks, look.filled, doubtful)
    done = complete_masks(tables, masks, doubtful) if settings.complete else Completion(masks, none, False)
    if done.much:  # people who look like what is around them: what is dark on the floor there may be their shoes
        return done.masks, doubtful
    if not settings.cut_shadows:
        return done.masks, done.left
    cut = cut_floor_shadows(tables, views, done.masks)
    return tuple(map(_with_sure_shades, cut, done.masks, look.chances)) if settings.ask_floor else cut, done.left


def _with_sure_shades(cut: np.ndarray | None, mask: np.ndarray | None, chance: np.ndarray | None) -> np.ndarray | None:
    """A cut silhouette with what its camera surely takes for a person: shoes of the floor's color, which stand in their own shadow."""
    return cut if cut is mask or cut is None or mask is None or chance is None else cut | (mask & (chance >= round(255 * KEPT_CHANCE)))


def _say_still(places: UnseenPlaces) -> Iterator[str]:
    for place in (one.place for one in places.still):
        at = f"({place.x:.1f}, {place.y:.1f}) m"
        yield f"a person who hardly moves stands at {at}: told by colors, which is less sure; film the empty scene"
    for place in places.doubted:
        at = f"({place.x:.1f}, {place.y:.1f}) m"
        yield f"a person may stand at {at} and hardly move: the images stir there, but the views do not show one body; not counted"


def _say_changed(name: str, first: int, last: int) -> str:
    frames = f"frame {first}" if first == last else f"frames {first} to {last}"
    return f"{name}: {frames}: nearly the whole image changed at once (a light switched?); not used"
