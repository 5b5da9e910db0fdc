"""The files of a recording, camera by camera: images, silhouettes and the empty scene, opened side by side."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.io.footage import Footage, find_footage, in_time, number_files, number_images, open_files, starting_at
from hmc.io.layouts import layout_line, shifted_line
from hmc.io.naming import Found, find_files, footage_items, item_name, shown
from hmc.io.timing import nearest_frames

__all__ = [
    "all_rates",
    "common_length",
    "find_background",
    "find_views",
    "gaps",
    "late_start",
    "missing_views",
    "put_in_time",
    "shared_videos",
    "unlike_lengths",
]


def find_views(
    path: Path,
    names: Sequence[str],
    all_names: Sequence[str],
    count: bool = True,
    on_error: Callable[[str, str], None] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> tuple[list[Footage | None], list[Footage | None]]:
    """The images (in ``videos/``, else in ``images/``) and the silhouettes of each camera.

    Parameters
    ----------
    path : Path
        Folder of the recording.
    names : sequence of str
        The cameras wanted.
    all_names : sequence of str
        All cameras of the calibration: numbered images count from the smallest number of all, whichever are wanted.
    count : bool
        As `hmc.io.footage.open_video`.
    on_error : callable, optional
        Called with a camera's name and what is wrong with its files, which then count as missing; by default that is raised.
    settings : mapping, optional
        Of recording.toml, checked: which files are which camera's (`hmc.io.naming.find_files`).
    """

    def located(kind: str) -> Found:
        try:
            return find_files(path, kind, all_names, settings or {})
        except InputError as error:
            if on_error is None:
                raise
            for name in names:
                on_error(name, str(error))
            return Found({}, {})

    def find(kind: str, files: Found, wanted: Sequence[str], first: int) -> list[Footage | None]:
        def one(name: str) -> Footage | None:
            return _open(path / kind, files, name, first, count)

        return [settled(name, found) for name, found in zip(wanted, _side_by_side(one, wanted), strict=True)]

    def settled(name: str, found: Future[Footage | None]) -> Footage | None:
        try:
            return found.result()
        except InputError as error:
            if on_error is None:
                raise
            on_error(name, str(error))
            return None

    videos, images, masks = located("videos"), located("images"), located("silhouettes")
    footage = find("videos", videos, names, 0)
    for name, sentence in _in_both(path, names, footage, (settings or {}).get("videos", {})):
        if on_error is None:
            raise InputError(sentence)
        on_error(name, sentence)
    left = [name for name, found in zip(names, footage, strict=True) if found is None]
    first = _first_number(path / "images", images, all_names)
    others = dict(zip(left, find("images", images, left, first), strict=True))
    footage = [found or others[name] for name, found in zip(names, footage, strict=True)]
    if not any(footage):
        first = _first_number(path / "silhouettes", masks, all_names)
    return footage, find("silhouettes", masks, names, first)


def _in_both(path: Path, names: Sequence[str], videos: Sequence[Footage | None], said: Any) -> Iterator[tuple[str, str]]:
    """Cameras with a video and with images too, where recording.toml (`videos`, as checked) does not say that the video is meant; and what
    to do."""
    items = {item_name(item): item for item in footage_items(path / "images") if not item.is_dir() or shown(item)}
    for name, video in zip(names, videos, strict=True):
        if video is not None and name in items and isinstance(said, dict) and name not in said:
            file, other = (one.relative_to(path) for one in (video.path, items[name]))
            yield (
                name,
                (
                    f"{path}: both {file} and {other} are of camera '{name}'; leave one, or say in recording.toml that the video is meant: "
                    f'videos = {{ "{name}" = "{file}" }}'
                ),
            )


def find_background(
    folder: Path, path: Path, rig: Rig, all_names: Sequence[str], settings: Mapping[str, Any], problems: list[str]
) -> list[Footage | None]:
    """The empty scene of each camera, in a folder of the recording's at `path` or another; what cannot be used is left out and added to the
    problems."""
    background: list[Footage | None] = []
    try:
        files = find_files(path, "background", all_names, settings, folder)
    except InputError as error:
        problems.append(f"{error}; going on without background")
        return [None] * len(rig)
    problems.extend(note for name, note in files.notes.items() if name in rig.names)
    coming = _side_by_side(lambda name: _open(folder, Found(files.files, {}), name, None, False), rig.names)
    for camera, outcome in zip(rig, coming, strict=True):
        found = None
        try:
            found = outcome.result()
        except InputError as error:
            problems.append(f"{error}; going on without this background")
        if found is not None and found.size != camera.size:
            (width, height), (w, h) = found.size, camera.size
            problems.append(f"{found.path}: background is {width} x {height} and the camera {w} x {h}; going on without it")
            found = None
        background.append(found)
    return background


def _open(folder: Path, files: Found, name: str, first: int | None, count: bool) -> Footage | None:
    """A camera's footage: the files that were found for it, else what bears its name."""
    if name not in files.files:
        return find_footage(folder, name, first, count)
    found = open_files(files.files[name], first, count)
    if found is not None and name in files.notes:
        found = replace(found, notes=(*found.notes, files.notes[name]))
    return found


def _side_by_side(find: Callable[[str], Footage | None], names: Sequence[str]) -> list[Future[Footage | None]]:
    """What is found of each camera, in threads: decoders, which do most of the work, let each other run."""
    with ThreadPoolExecutor() as pool:
        return [pool.submit(find, name) for name in names]


def _first_number(folder: Path, files: Found, names: Sequence[str]) -> int:
    places = [files.files.get(name, (folder / name,)) for name in names]
    folders = [number_images(place[0]) for place in places if len(place) == 1 and place[0].is_dir()]
    return min((min(numbers, default=0) for numbers in (*folders, *(number_files(place) for place in places if len(place) > 1))), default=0)


def put_in_time(view: Footage | None, first: int, times: np.ndarray | None) -> Footage | None:
    """A camera's files as the recording counts frames.

    Parameters
    ----------
    view : Footage or None
        From its first frame on.
    first : int
        The frame that is frame 0 of the recording, of a camera that counts frames.
    times : ndarray, shape (n,), or None
        When its frames were taken, in frames of the recording, of one that goes by time (`hmc.io.timing.go_by_time`).

    Raises
    ------
    InputError
        When it has no frame from there on.
    """
    if view is None or times is None:
        return view and starting_at(view, first)
    places = nearest_frames(times[: view.n_frames])
    if not len(places):
        raise InputError(f"{view.path}: has no frame from the recording's first on; correct its times or `first_frame` in recording.toml")
    return in_time(view, places.tolist())


def all_rates(path: Path, views: Mapping[str, Footage], all_names: Sequence[str], settings: Mapping[str, Any]) -> list[float]:
    """The rates that the videos of a recording state, of all its cameras in the calibration's order, whichever of them are read.

    Parameters
    ----------
    path : Path
        Folder of the recording.
    views : mapping of str to Footage
        Of the cameras that are read.
    all_names : sequence of str
        All cameras of the calibration.
    settings : mapping
        As `find_views`.

    Raises
    ------
    InputError
        When it is not clear which file is which camera's.
    """
    others = [name for name in all_names if name not in views]
    files = find_files(path, "videos", all_names, settings) if others else Found({}, {})
    coming = _side_by_side(lambda name: _open(path / "videos", files, name, None, False), others)
    rates = {name: view.fps for name, view in views.items()}
    for name, outcome in zip(others, coming, strict=True):
        with suppress(InputError):  # it is not read
            found = outcome.result()
            rates[name] = None if found is None else found.fps
    return [rate for name in all_names if (rate := rates.get(name))]


def gaps(views: Sequence[Footage | None]) -> list[str]:
    """A sentence for each camera whose numbered images have holes."""
    sentences = []
    for view in views:
        if view is None or view.images is None:
            continue
        images = view.images
        missing = (frame for frame in range(view.n_frames) if frame not in images and view.in_file(frame) is not None)
        first = next(missing, None)
        if first is not None:
            n = 1 + sum(1 for _ in missing)
            sentences.append(f"{view.path}: {n} of {view.n_frames} images are missing, the first is frame {first}")
    return sentences


def late_start(path: Path, views: Sequence[Footage | None]) -> list[str]:
    """A sentence where times of all cameras begin late: the recording begins with frames that no camera has."""
    places = [view.places for view in views if view is not None]
    if not places or any(own is None or own[:1] != (-1,) for own in places):
        return []
    first = min(next((frame for frame, place in enumerate(own) if place >= 0), len(own)) for own in places if own is not None)
    return [
        f"{path / 'times'}: no camera that is read has a frame before frame {first}; times count from the recording's first frame: take "
        "from all of them what the earliest has"
    ]


def common_length(lengths: Sequence[int]) -> int:
    """Frames of which at least two cameras have an image; of the one, if there is one."""
    ordered = sorted(lengths, reverse=True)
    return ordered[min(1, len(ordered) - 1)] if ordered else 0


def unlike_lengths(path: str | Path, lengths: Mapping[str, int]) -> list[str]:
    """A sentence where cameras differ in how many frames they have, by name: which have how many, and how many are used."""
    if len(set(lengths.values())) < 2:
        return []
    told = ", ".join(f"{name} {n}" for name, n in lengths.items())
    return [f"{path}: cameras differ in length ({told}); {common_length(list(lengths.values()))} frames are used"]


def shared_videos(path: Path, names: Sequence[str], views: Sequence[Footage | None]) -> list[str]:
    """One sentence for each two cameras with one video, by links too: whose it is cannot be told."""
    first: dict[str, tuple[str, Footage]] = {}
    sentences = []
    for name, view in zip(names, views, strict=True):
        if view is not None and view.images is None and view.arrays is None:
            found = view.path.stat()
            other, video = first.setdefault(f"{found.st_dev}/{found.st_ino}", (name, view))
            if other != name:
                sentences.append(f"{path}: cameras '{other}' and '{name}' have one video, {video.path}; give each its own")
    return sentences


def missing_views(path: Path, names: Sequence[str], views: Sequence[Footage | None], told: Collection[str] = ()) -> list[str]:
    """One sentence for each camera without images and silhouettes, but for those of which more is told already."""
    lost = [name for name, view in zip(names, views, strict=True) if view is None and name not in told]
    if not lost:
        return []
    used = {view.path for view in views if view is not None}
    spare = next((item for item in footage_items(path / "videos") if item not in used and item_name(item) not in names), None)
    shifted = shifted_line(path, names)
    if shifted is not None and not told:
        return [
            f"{path}: videos and cameras are numbered from different numbers, so the same name may mean different cameras; if both are "
            f"in the same order, write in recording.toml: {shifted}"
        ]
    line = None if any(views) else layout_line(path, names)
    if line is not None and not told:
        return [f"{path}: no videos/, images/ or silhouettes/ with the cameras' names; write in recording.toml: {line}"]
    cure = f'say whose is whose in recording.toml: videos = {{ "{lost[0]}" = "videos/{spare.name if spare else "FILE.mp4"}", ... }}'
    if not any(views) and not told:
        return [f"{path}: no videos/, images/ or silhouettes/ with the cameras' names ({', '.join(names)}); name them so, or {cure}"]
    return [
        f"{path}: camera '{name}' of the calibration has no video, images or silhouettes; name them so, {cure}, or leave it out: --cameras"
        for name in lost
    ]
