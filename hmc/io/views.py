"""The images and silhouettes of each camera of a recording, found in its folder and put in time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.footage import Footage, find_footage, in_time, number_images, starting_at
from hmc.io.timing import nearest_frames

__all__ = ["all_rates", "common_length", "find_views", "gaps", "missing_views", "put_in_time", "side_by_side"]


def find_views(
    path: Path,
    names: Sequence[str],
    all_names: Sequence[str],
    count: bool = True,
    on_error: Callable[[str, str], None] | None = None,
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
    """

    def find(folder: Path, wanted: Sequence[str], first: int) -> list[Footage | None]:
        coming = side_by_side(lambda name: find_footage(folder, name, first, count), wanted)
        return [settled(name, found) for name, found in zip(wanted, coming, strict=True)]

    def settled(name: str, found: Future[Footage | None]) -> Footage | None:
        try:
            return found.result()
        except InputError as error:
            if on_error is None:
                raise
            on_error(name, str(error))
            return None

    images = path / "images"
    first = _first_number(images, all_names)
    footage = find(path / "videos", names, 0)
    left = [name for name, found in zip(names, footage, strict=True) if found is None]
    others = dict(zip(left, find(images, left, first), strict=True))
    footage = [found or others[name] for name, found in zip(names, footage, strict=True)]
    if not any(footage):
        first = _first_number(path / "silhouettes", all_names)
    return footage, find(path / "silhouettes", names, first)


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


def all_rates(path: Path, views: Mapping[str, Footage], all_names: Sequence[str]) -> list[float]:
    """The rates that the videos of a recording state, of all its cameras, whichever of them are read."""
    rates = [view.fps for view in views.values()]
    folder = path / "videos"
    others = [name for name in all_names if name not in views] if folder.is_dir() else []
    for name in others:
        try:
            found = find_footage(folder, name, count=False)
        except InputError:
            continue  # it is not read
        rates.append(None if found is None else found.fps)
    return [rate for rate in rates if rate]


def side_by_side(find: Callable[[str], Footage | None], names: Sequence[str]) -> list[Future[Footage | None]]:
    """What is found of each camera, in threads: decoders, which do most of the work, let each other run."""
    with ThreadPoolExecutor() as pool:
        return [pool.submit(find, name) for name in names]


def _first_number(folder: Path, names: Sequence[str]) -> int:
    numbers = [min(number_images(folder / name), default=0) for name in names if (folder / name).is_dir()]
    return min(numbers, default=0)


def gaps(views: Sequence[Footage | None]) -> list[str]:
    """A sentence for each camera whose numbered images have holes."""
    sentences = []
    for view in views:
        taken = [] if view is None else [frame for frame in range(view.n_frames) if view.in_file(frame) is not None]
        missing = [] if view is None or view.images is None else sorted(set(taken) - view.images.keys())
        if view is not None and missing:
            sentences.append(f"{view.path}: {len(missing)} of {view.n_frames} images are missing, the first is frame {missing[0]}")
    return sentences


def common_length(lengths: Sequence[int]) -> int:
    """Frames of which at least two cameras have an image; of the one, if there is one."""
    ordered = sorted(lengths, reverse=True)
    return ordered[min(1, len(ordered) - 1)] if ordered else 0


def missing_views(path: Path, names: Sequence[str], views: Sequence[Footage | None]) -> list[str]:
    """One sentence for each camera without images and silhouettes."""
    if not any(views):
        return [f"{path}: no videos/, images/ or silhouettes/ with the cameras' names ({', '.join(names)})"]
    return [
        f"{path}: camera '{name}' of the calibration has no video, images or silhouettes; name them so, or leave it out: --cameras"
        for name, view in zip(names, views, strict=True)
        if view is None
    ]
