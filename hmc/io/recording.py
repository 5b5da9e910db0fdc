"""A calibrated multi-camera recording on disk, read frame by frame.

The form on disk is that of the Recording page of the documentation: ``calibration.toml`` (or another calibration format, see
`hmc.io.calibration`), ``videos/`` or ``images/``, and optionally ``silhouettes/``, ``background/``, ``recording.toml`` and ``truth/``.
Units are metres, Z is up and the floor is at z = 0.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from hmc.camera.coverage import estimate_room
from hmc.camera.model import Camera, Rig
from hmc.camera.odd import odd_cameras
from hmc.camera.reduction import reduce_image, reduce_mask, reduced_camera, reduction_factors
from hmc.camera.world import World
from hmc.errors import InputError
from hmc.io.calibration import build_camera, read_entries
from hmc.io.files import real_path
from hmc.io.footage import Footage, read_footage
from hmc.io.places import AnyPlaces, RecordingPlaces, places_of, to_places
from hmc.io.settings import read_settings
from hmc.io.sizes import fit_size, size_cure
from hmc.io.timing import go_by_time, rates_differ
from hmc.io.views import (
    all_rates,
    common_length,
    find_background,
    find_views,
    gaps,
    late_start,
    missing_views,
    put_in_time,
    shared_videos,
    unlike_lengths,
)
from hmc.io.world import world_of

__all__ = [
    "Frame",
    "Recording",
    "background_frames",
    "for_voxels",
    "iterate_frames",
    "only_cameras",
    "open_recording",
    "reduced",
    "spread_frames",
    "whole_recording",
]

logger = logging.getLogger("hmc")

DEFAULT_FPS = 30.0
#: Cameras are no further than this (median, metres) from the world's origin: beyond, the calibration is in millimetres.
MAX_CAMERA_DISTANCE_M = 150.0
#: So far away, in a unit that is not known, they are in millimetres rather than centimetres.
LEAST_MM = 900.0
#: No lens has a focal length below this share of the image's longer side (it would see 169 degrees): it is in another unit than pixels.
LEAST_FOCAL = 0.05
#: Silhouettes from files that lose detail are cut at the middle; from others, anything but black counts.
LOSSY_SUFFIXES = frozenset({".jpg", ".jpeg", ".webp"})


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of a recording, one entry a camera; None where that camera has no image.

    ``index`` counts from the start of the recording, whatever part is read. ``images`` are (h, w, 3) uint8 BGR, ``silhouettes``
    (h, w) bool; ``silhouettes`` as a whole is None where the recording has none.
    """

    index: int
    images: tuple[np.ndarray | None, ...]
    silhouettes: tuple[np.ndarray | None, ...] | None


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording that has been opened and checked; `iterate_frames` reads it.

    Parameters
    ----------
    path : Path
        Its folder.
    name : str
    fps : float
        Frames a second: of recording.toml, else of the first video (of the slowest, where they differ), else 30.
    rig : Rig
        The selected cameras.
    room : ndarray, shape (2, 3)
        Lower and upper corner, metres: of recording.toml, else estimated from the rig (`estimate_room`).
    n_frames : int
        Frames in the selection.
    start : int
        First frame of the selection, counted from the start of the recording.
    persons : int or None
        How many people are there at once at most, where that is known; trackers count no more.
    subject_height_m : tuple of float
        Statures that are known beforehand; may be empty.
    room_is_estimated : bool
    problems : tuple of str
        What was odd but could be lived with, one line each.
    factors : tuple of int
        How many times smaller than in their files the images and silhouettes of each camera are read (`reduced`); `rig` is that of the
        smaller ones. Empty where there is nothing to read.
    places : RecordingPlaces or None
        Where its parts lie, where not all of them lie in `path`.
    """

    path: Path
    name: str
    fps: float
    rig: Rig
    room: np.ndarray
    n_frames: int
    start: int
    persons: int | None
    subject_height_m: tuple[float, ...]
    room_is_estimated: bool = False
    problems: tuple[str, ...] = ()
    factors: tuple[int, ...] = ()
    places: RecordingPlaces | None = None
    _footage: tuple[Footage | None, ...] = field(default=(), repr=False)
    _silhouettes: tuple[Footage | None, ...] = field(default=(), repr=False)
    _background: tuple[Footage | None, ...] = field(default=(), repr=False)
    _times: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)

    @property
    def known_height_m(self) -> float | None:
        """The stature of the person in it, metres; None where it is not known, or another person may be there too."""
        return self.subject_height_m[0] if len(self.subject_height_m) == 1 and self.persons in (None, 1) else None

    @property
    def _own_views(self) -> tuple[Footage | None, ...]:
        """What frames are counted in, a camera: its images, or else its silhouettes."""
        return tuple(image or mask for image, mask in zip(self._footage, self._silhouettes, strict=True))

    @property
    def file_sizes(self) -> tuple[tuple[int, int], ...]:
        """Width and height of each camera's images in their files, pixels; of one without, as they are read."""
        return tuple(view.size if view else camera.size for camera, view in zip(self.rig, self._own_views, strict=True))

    @property
    def in_memory(self) -> bool:
        """Whether images or silhouettes are arrays (`hmc.io.memory.recording_of`), and `path` is a name alone."""
        return any(view is not None and view.arrays is not None for view in (*self._footage, *self._silhouettes))

    @property
    def has_images(self) -> bool:
        """Whether any camera has images (else there are only silhouettes)."""
        return any(footage is not None for footage in self._footage)

    @property
    def has_silhouettes(self) -> bool:
        """Whether ready-made silhouettes are there for any camera."""
        return any(footage is not None for footage in self._silhouettes)

    @property
    def n_background_frames(self) -> tuple[int, ...]:
        """Frames of the empty scene, per camera."""
        return tuple(0 if footage is None else footage.n_frames for footage in self._background)


def open_recording(
    path: AnyPlaces, cameras: Sequence[str] | None = None, start: int = 0, frames: int | None = None, any_world: bool = False
) -> Recording:
    """Open a recording or a part of it.

    The recording is as long as at least two of its cameras last (the one, if there is one); a camera that ends sooner is None from there
    on. Where there are no images, the silhouettes count.

    Parameters
    ----------
    path : str, Path or RecordingPlaces
        Folder of the recording, or where its parts lie.
    cameras : sequence of str, optional
        Names of the cameras to use, in this order; by default all.
    start : int
        First frame.
    frames : int, optional
        At most this many frames; by default all that follow.
    any_world : bool
        The calibration may be of any units and axes: for who is to find them out. The room then means nothing.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        When something essential is missing or wrong; the message says which file and what to do.

    Examples
    --------
    >>> import hmc
    >>> recording = hmc.open_recording("data/synthetic/tiny", cameras=["cam_00", "cam_02"], frames=10)
    >>> recording.n_frames, recording.rig.names, recording.fps
    (10, ('cam_00', 'cam_02'), 15.0)
    """
    places = to_places(path)
    path = places.path
    if not places.there:
        raise InputError(f"{path}: no such folder; a recording is a folder with calibration.toml and videos/ or images/")
    settings, entries = places.read_settings(), places.read_entries()
    all_names = [entry.name for entry in entries]
    if cameras is not None:
        cameras = [cameras] if isinstance(cameras, str) else cameras
        by_name = {entry.name: entry for entry in entries}
        unknown = [name for name in cameras if name not in by_name]
        if unknown or not cameras:
            raise InputError(f"{path}: no camera named '{', '.join(unknown)}' in the calibration; it has {', '.join(by_name)}")
        entries = [by_name[name] for name in cameras]
    names = [entry.name for entry in entries]
    starts = settings.get("first_frame", {})
    strangers = [name for name in starts if name not in all_names]
    if strangers:
        raise InputError(
            f"{path / 'recording.toml'}: `first_frame` names '{strangers[0]}', no camera of the calibration ({', '.join(all_names)})"
        )
    footage, silhouettes = find_views(path, names, all_names, settings=settings)
    both = [image or mask for image, mask in zip(footage, silhouettes, strict=True)]
    there = {name: view for name, view in zip(names, both, strict=True) if view is not None}
    rates = all_rates(path, there, all_names, settings)
    by_stamps = rates_differ(rates)
    fps = settings.get("fps") or (min(rates) if by_stamps else next(iter(rates), DEFAULT_FPS))
    times = go_by_time(path, there, fps, by_stamps, starts)
    footage, silhouettes = (
        [put_in_time(view, starts.get(name, 0), times.get(name)) for name, view in zip(names, views, strict=True)]
        for views in (footage, silhouettes)
    )
    both = [image or mask for image, mask in zip(footage, silhouettes, strict=True)]
    sizes = {name: view.size for name, view in zip(names, both, strict=True) if view is not None}
    try:
        world = World() if any_world else world_of(settings)
        rig = Rig(tuple(fitted(build_camera(entry, sizes, world), sizes, settings) for entry in entries))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    units = () if any_world else wrong_units(rig, path)
    wrong_views = (*missing_views(path, names, both), *shared_videos(path, names, footage))
    sizes_wrong = (*wrong_sizes(rig, footage), *wrong_sizes(rig, silhouettes))
    for problem in (*wrong_views, *sizes_wrong, *wrong_focal_lengths(rig), *units):
        raise InputError(problem)

    lengths = {name: view.n_frames for name, view in zip(names, both, strict=True) if view is not None}
    total = common_length(list(lengths.values()))
    problems = [
        *([] if any_world else odd_cameras(rig)),
        *gaps(footage),
        *late_start(path, both),
        *(note for view in (*footage, *silhouettes) if view is not None for note in view.notes),
        *unlike_lengths(path, lengths),
    ]
    stated = settings.get("frames")
    if stated is not None and stated > total:
        problems.append(f"{path / 'recording.toml'}: says {stated} frames, but there are {total}")
    total = min(total, stated or total)
    for name, value in (("start", start), ("frames", frames)):
        if value is not None and not isinstance(value, int | np.integer):
            raise InputError(f"`{name}` must be a whole number of frames; got {value!r}")
    if start < 0 or start >= total or (frames is not None and frames < 1):
        raise InputError(
            f"{path}: nothing to read from frame {start} on ({'all' if frames is None else frames} frames); it has {total} frames, "
            f"0 to {total - 1}: choose other --start and --frames"
        )

    background = find_background(places.background_folder, path, rig, all_names, settings, problems)
    room = settings.get("room")
    return Recording(
        path=path,
        name=settings.get("name", real_path(path).name),
        fps=float(fps),
        rig=rig,
        room=estimate_room(rig) if room is None else room,
        n_frames=min(total - start, frames or total),
        start=start,
        persons=settings.get("persons"),
        subject_height_m=settings.get("subject_height_m", ()),
        room_is_estimated=room is None,
        problems=tuple(problems),
        factors=(1,) * len(rig),
        places=places,
        _footage=tuple(footage),
        _silhouettes=tuple(silhouettes),
        _background=tuple(background),
        _times=times,
    )


def iterate_frames(
    recording: Recording,
    first: int | None = None,
    last: int | None = None,
    on_problem: Callable[[str], None] | None = None,
    only: Container[int] | None = None,
) -> Iterator[Frame]:
    """Read the selected frames in order; memory does not grow with their number.

    Parameters
    ----------
    recording : Recording
    first, last : int, optional
        A part of the selection, counted from the start of the recording; ``last`` is not included.
    on_problem : callable, optional
        Called with one line for everything that was survived: an unreadable image, a camera that drops out. By default the line is
        logged as a warning of the logger "hmc".
    only : container of int, optional
        Frames that are wanted, of these; all by default. Others are passed over.

    Yields
    ------
    Frame
    """
    end = recording.start + recording.n_frames
    first = recording.start if first is None else max(first, recording.start)
    last = end if last is None else min(last, end)
    report = on_problem or logger.warning
    readers: list[Iterator[np.ndarray | None]] = []
    for views, what in ((recording._footage, ""), (recording._silhouettes, " silhouettes")):
        for camera, view in zip(recording.rig, views, strict=True):
            readers.append(iter([None] * 0) if view is None else read_footage(view, first, last, report, f"{camera.name}{what}", only))
    n, factors = len(recording.rig), recording.factors
    masks_of = recording._silhouettes
    try:
        for index in range(first, last):
            found = [next(reader, None) for reader in readers]
            if only is not None and index not in only:
                continue
            images = tuple(None if image is None else reduce_image(image, factor) for image, factor in zip(found[:n], factors, strict=True))
            masks = tuple(
                None if image is None or view is None else reduce_mask(to_mask(image, view), factor)
                for image, view, factor in zip(found[n:], masks_of, factors, strict=True)
            )
            yield Frame(index, images, masks if recording.has_silhouettes else None)
    finally:
        for reader in readers:
            if hasattr(reader, "close"):
                reader.close()


def only_cameras(recording: Recording, cameras: Sequence[int]) -> Recording:
    """The same selection of some cameras alone, by their places in ``recording.rig``; room and frames stay."""
    footage, silhouettes, background = (
        tuple(views[c] for c in cameras) for views in (recording._footage, recording._silhouettes, recording._background)
    )
    rig = Rig(tuple(recording.rig[c] for c in cameras))
    factors = tuple(recording.factors[c] for c in cameras)
    return replace(recording, rig=rig, factors=factors, _footage=footage, _silhouettes=silhouettes, _background=background)


def whole_recording(recording: Recording) -> Recording:
    """All frames of the same cameras, as large as they are read in this selection."""
    total = common_length([view.n_frames for view in recording._own_views if view is not None])
    return replace(recording, start=0, n_frames=min(total, places_of(recording).read_settings().get("frames") or total))


def reduced(recording: Recording, factors: Sequence[int]) -> Recording:
    """The same selection with smaller images, silhouettes and cameras; what is in metres stays.

    Parameters
    ----------
    recording : Recording
    factors : sequence of int, one a camera
        How many times smaller (`hmc.camera.reduction`).
    """
    rig = Rig(tuple(reduced_camera(camera, factor) for camera, factor in zip(recording.rig, factors, strict=True)))
    return replace(recording, rig=rig, factors=tuple(one * more for one, more in zip(recording.factors, factors, strict=True)))


def for_voxels(recording: Recording, voxel_size_m: float) -> Recording:
    """The recording with images no larger than voxels of this size show (`hmc.camera.reduction.reduction_factors`).

    Parameters
    ----------
    recording : Recording
    voxel_size_m : float
        Side of the smallest voxels that are to be used, metres.

    Examples
    --------
    >>> import hmc
    >>> recording = hmc.open_recording("data/synthetic/tiny")
    >>> for_voxels(recording, 0.03) is recording  # its images are small
    True
    """
    factors = reduction_factors(recording.rig, recording.room, voxel_size_m)
    return recording if max(factors) == 1 else reduced(recording, factors)


def to_mask(image: np.ndarray, view: Footage) -> np.ndarray:
    """A silhouette image as a mask, (h, w) bool."""
    lossless = view.images is not None and next(iter(view.images.values())).suffix.lower() not in LOSSY_SUFFIXES
    return image.max(axis=2) > (0 if lossless else 127)


def background_frames(recording: Recording, camera_index: int, limit: int | None = None) -> Iterator[np.ndarray]:
    """Frames of the empty scene of one camera; none if there are none.

    Parameters
    ----------
    recording : Recording
    camera_index : int
        Place of the camera in ``recording.rig``.
    limit : int, optional
        At most this many.

    Yields
    ------
    ndarray, shape (h, w, 3), uint8 BGR
    """
    view = recording._background[camera_index]
    if view is None:
        return
    n = view.n_frames if limit is None else min(limit, view.n_frames)
    with closing(read_footage(view, 0, n, logger.warning, f"{recording.rig[camera_index].name} background")) as reader:  # type: ignore[type-var]
        yield from (reduce_image(image, recording.factors[camera_index]) for image in reader if image is not None)


def fitted(camera: Camera, sizes: Mapping[str, tuple[int, int]], settings: Mapping[str, Any]) -> Camera:
    """The camera for images of their size, where recording.toml says how they came to have another than the calibration's."""
    fit, size = settings.get("image_size"), sizes.get(camera.name)
    return camera if fit is None or size is None else fit_size(camera, size, fit)


def read_rig(path: Path) -> Rig:
    """The rig of a recording as `open_recording` has it, whether or not there are images. Errors as there."""
    settings, entries = read_settings(path), read_entries(path)
    names, sizes = [entry.name for entry in entries], {}
    if "image_size" in settings or any(entry.size is None for entry in entries):
        footage, masks = find_views(path, names, names, count=False, on_error=lambda name, sentence: None, settings=settings)
        views = {name: image or mask for name, image, mask in zip(names, footage, masks, strict=True)}
        sizes = {name: view.size for name, view in views.items() if view is not None}
    try:
        return Rig(tuple(fitted(build_camera(entry, sizes, world_of(settings)), sizes, settings) for entry in entries))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def wrong_sizes(rig: Rig, views: Sequence[Footage | None]) -> list[str]:
    """One sentence for each camera whose images have not the size of its calibration."""
    return [
        f"{view.path}: images are {_by(view.size)} but the calibration of '{camera.name}' says {_by(camera.size)}; "
        f"{size_cure(camera.size, view.size, camera.matrix[:2, 2])}"
        for camera, view in zip(rig, views, strict=True)
        if view is not None and view.size != camera.size
    ]


def wrong_units(rig: Rig, path: Path | None = None) -> list[str]:
    """A sentence, with the command to run, when cameras stand so far away that the calibration must be in millimetres or centimetres."""
    distance = float(np.median(np.linalg.norm([camera.translation for camera in rig], axis=1)))
    if distance <= MAX_CAMERA_DISTANCE_M:
        return []
    unit, name, other = ("cm", "centimetres", "mm") if distance < LEAST_MM else ("mm", "millimetres", "cm")
    return [
        f"calibration: cameras stand {distance:,.0f} m from the origin, which looks like {name}; "
        f'write units = "{unit}" (or "{other}") in recording.toml, or let it be found out by: '
        f"hmc world {quote(str(path)) if path else 'RECORDING'}"
    ]


def wrong_focal_lengths(rig: Rig) -> list[str]:
    """A sentence for each camera with a focal length that is no number of pixels."""
    return [
        f"camera '{camera.name}': a focal length of {camera.matrix[0, 0]:.4g} for {_by(camera.size)} pixels, which no lens has; is it in "
        "millimetres, or a share of the image? `matrix` must be in pixels: calibrate again, or multiply it by pixels a unit"
        for camera in rig
        if min(camera.matrix[0, 0], camera.matrix[1, 1]) < LEAST_FOCAL * max(camera.size)
    ]


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"


def spread_frames(frames: np.ndarray, most: int) -> list[int]:
    """So many of these frames at most, well spread: ndarray of int, shape (n,), rising, to a list."""
    return frames[np.unique(np.linspace(0, len(frames) - 1, min(most, len(frames))).round().astype(int))].tolist()
