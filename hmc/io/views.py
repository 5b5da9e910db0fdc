"""The files of a recording, camera by camera: images, silhouettes and the empty scene, opened side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.io.footage import Footage, find_footage, number_files, number_images, open_files, starting_at
from hmc.io.naming import Found, find_files

__all__ = ["find_background", "find_views"]


def find_views(
    path: Path,
    names: Sequence[str],
    all_names: Sequence[str],
    count: bool = True,
    on_error: Callable[[str, str], None] | None = None,
    starts: Mapping[str, int] | None = None,
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
    starts : mapping of str to int, optional
        The frame of a camera's files that is frame 0 of the recording, where it is not the first.
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
            found = _open(path / kind, files, name, first, count)
            return found and starting_at(found, (starts or {}).get(name, 0))

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
    left = [name for name, found in zip(names, footage, strict=True) if found is None]
    first = _first_number(path / "images", images, all_names)
    others = dict(zip(left, find("images", images, left, first), strict=True))
    footage = [found or others[name] for name, found in zip(names, footage, strict=True)]
    if not any(footage):
        first = _first_number(path / "silhouettes", masks, all_names)
    return footage, find("silhouettes", masks, names, first)


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
