"""Keypoints of a recording: where they are found, and reading them frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hmc.camera.reduction import reduce_pixels
from hmc.errors import InputError
from hmc.io.door import check_folder
from hmc.io.footage import Footage
from hmc.io.keypoints.csv_forms import read_csv_table
from hmc.io.keypoints.json_forms import last_number, read_json_frame, read_json_table
from hmc.io.keypoints.people import NOBODY, RawPeople, confidence_outside, is_normalised, to_pixels
from hmc.io.places import places_of
from hmc.io.recording import Recording

__all__ = ["KeypointSource", "open_keypoints"]

#: Folders of a recording that may hold keypoints, and whether tables in them are meant: the second is Pose2Sim's, and somebody's result may
#: bear that name too.
FOLDERS = (("keypoints", True), ("pose", False))
TABLE_SUFFIXES = frozenset({".csv", ".json"})

#: Where more of a camera's points lie far outside of its images, by their confidence, they are of images of another size.
MOST_OUTSIDE = 0.2
#: Files of frames that are looked at for it.
LOOKED_AT = 20

#: People of a frame, by the number that the files give it.
Reader = Callable[[int], np.ndarray]
#: ``change(index, people)``: what is made of the people of a frame, one array a camera.
Change = Callable[[int, tuple[np.ndarray, ...]], tuple[np.ndarray, ...]]


@dataclass(frozen=True, eq=False)
class KeypointSource:
    """Keypoints of a recording, read when they are asked for.

    Parameters
    ----------
    path : Path
        The folder in which they were found.
    cameras : tuple of str
        Names of the recording's cameras, in the rig's order.
    present : tuple of bool
        Which of them have keypoints at all.
    factors : tuple of int
        How many times smaller than recorded the images are to whose pixels points are given (`reduced`).
    """

    path: Path
    cameras: tuple[str, ...]
    present: tuple[bool, ...]
    factors: tuple[int, ...]
    _readers: tuple[Reader | None, ...] = field(repr=False)
    _offsets: tuple[int, ...] = field(repr=False)
    _views: tuple[Footage | None, ...] = field(repr=False)
    _change: Change | None = field(default=None, repr=False)
    _outside: tuple[str, ...] = field(default=(), repr=False)

    @property
    def notes(self) -> list[str]:
        """A line where some cameras have no keypoints: their files may bear other names; and one for each whose points are mostly outside
        of its images."""
        without = [name for name, present in zip(self.cameras, self.present, strict=True) if not present]
        missing = [f"{self.path}: no keypoints of {', '.join(without)}; those of the other cameras are used"] if without else []
        return [*missing, *self._outside]

    def changed(self, change: Change) -> KeypointSource:
        """The same keypoints with every frame's people, in pixels as recorded, passed through ``change(index, people)``, which returns as
        many arrays."""
        before = self._change
        return replace(self, _change=change if before is None else lambda index, people: change(index, before(index, people)))

    def reduced(self, factors: Sequence[int]) -> KeypointSource:
        """The same keypoints in pixels of images so many times smaller than recorded, one factor a camera; whatever they were in before."""
        return replace(self, factors=tuple(factors))

    def frame(self, index: int) -> tuple[np.ndarray, ...]:
        """People of one frame, in no particular order.

        Parameters
        ----------
        index : int
            Absolute number of the frame in the recording.

        Returns
        -------
        tuple (cameras) of ndarray, shape (n_people, 26, 3)
            x, y and confidence of `hmc.io.keypoints.KEYPOINTS`: pixels of the camera's image (with the lens's distortion), as recorded or
            so many times smaller as `factors` say; confidence in 0..1. What is not given is NaN with confidence 0. Nobody, no file of this
            frame, or a camera without keypoints: n_people is 0.

        Raises
        ------
        InputError
            When a file of this frame is not as it should be; one line with its name.
        """
        numbers = [index if view is None else view.in_file(index) for view in self._views]
        people = tuple(
            NOBODY.copy() if reader is None or number is None else reader(number + offset)
            for reader, offset, number in zip(self._readers, self._offsets, numbers, strict=True)
        )
        people = people if self._change is None else self._change(index, people)
        return tuple(_in_smaller(one, factor) for one, factor in zip(people, self.factors, strict=True))


def _in_smaller(people: np.ndarray, factor: int) -> np.ndarray:
    return people if factor == 1 else np.concatenate([reduce_pixels(people[..., :2], factor), people[..., 2:]], axis=-1)


@dataclass(frozen=True, eq=False)
class _Folder:
    """The files of one camera, one a frame, by the numbers in their names: ``numbers`` (n,) ascending, ``names`` (n,) of str."""

    path: Path
    numbers: np.ndarray
    names: np.ndarray
    size: tuple[int, int]

    @property
    def outside(self) -> float:
        """The share of points, by their confidence, that some of the files have far outside of the image."""
        return _share_outside(self._some(), self.size)

    def _some(self) -> Iterator[tuple[RawPeople, bool]]:
        for place in np.unique(np.linspace(0, len(self.names) - 1, LOOKED_AT).round().astype(int)):
            try:
                raw = read_json_frame(self.path / str(self.names[place]))
            except InputError:
                continue  # told when its frame is read
            yield raw, is_normalised(raw.points)

    def __call__(self, number: int) -> np.ndarray:
        place = int(np.searchsorted(self.numbers, number))
        if place == len(self.numbers) or self.numbers[place] != number:
            return NOBODY.copy()
        raw = read_json_frame(self.path / str(self.names[place]))
        return to_pixels(raw, self.size, is_normalised(raw.points))


@dataclass(frozen=True, eq=False)
class _Table:
    """The people of one camera's file: those of frame ``numbers[k]`` are ``people[starts[k]:starts[k + 1]]``."""

    numbers: np.ndarray
    starts: np.ndarray
    people: np.ndarray
    outside: float

    def __call__(self, number: int) -> np.ndarray:
        place = int(np.searchsorted(self.numbers, number))
        if place == len(self.numbers) or self.numbers[place] != number:
            return NOBODY.copy()
        return self.people[self.starts[place] : self.starts[place + 1]].copy()


def open_keypoints(recording: Recording) -> KeypointSource | None:
    """Find what a 2-D keypoint detector left in a recording's folder.

    Looked for are ``keypoints/CAMERA/*.json`` (one file a frame), ``keypoints/CAMERA.csv`` and ``keypoints/CAMERA.json`` (one file a
    camera), ``keypoints/CAMERADLC*.csv`` (DeepLabCut), then ``pose/CAMERA_json/*.json`` and ``pose/CAMERA/*.json`` (Pose2Sim).
    Files of frames are read when they are asked for, files of cameras here. A file that counts in its camera's own frames follows
    ``first_frame`` and times of the recording.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    KeypointSource or None
        None when there are none, or none of the selected cameras.

    Raises
    ------
    InputError
        When there are keypoints but of no camera of the calibration, a camera has them twice, or the file of a camera is broken.
    """
    strangers: list[tuple[Path, list[str]]] = []
    rig = recording.rig
    for name, tables in FOLDERS:
        folder = recording.path / name
        items = list(_items(folder, tables))
        found = [_item_of(camera.name, items) for camera in rig]
        if not any(found):
            if items:
                strangers.append((folder, [item.name for item in items]))
            continue
        offsets, readers, outside = [], [], []
        for camera, item, view in zip(rig, found, recording._own_views, strict=True):
            size = camera.size if view is None else view.size
            reader, first = (None, 0) if item is None else _reader(item, size)
            if item is not None and reader is not None and (share := reader.outside) > MOST_OUTSIDE:
                outside.append(_line_outside(item, camera.name, share, size))
            readers.append(reader)
            offsets.append(first + (0 if view is None else view.first_number))
        present = tuple(item is not None for item in found)
        own = recording._own_views
        return KeypointSource(folder, rig.names, present, recording.factors, tuple(readers), tuple(offsets), own, _outside=tuple(outside))
    all_names = [entry.name for entry in places_of(recording).read_entries()] if strangers else []
    for folder, names in strangers:
        if not any(_item_of(name, [folder / one for one in names]) for name in all_names):
            raise InputError(
                f"{folder}: holds keypoints of {_listed(names)}, but the calibration's cameras are {_listed(all_names)}; name them alike"
            )
    return None


def _items(folder: Path, tables: bool) -> Iterator[Path]:
    """Folders with JSON files and, where they are meant, tables, by name."""
    if tables:
        check_folder(folder)
    if folder.is_dir():
        for item in sorted(folder.iterdir()):
            if not item.name.startswith("."):
                if item.is_dir():
                    if next(item.glob("*.json"), None) is not None:
                        yield item
                elif tables and item.suffix.lower() in TABLE_SUFFIXES:
                    yield item


def _item_of(camera: str, items: Sequence[Path]) -> Path | None:
    """The folder or table of a camera.

    Raises
    ------
    InputError
        When it has several.
    """
    own = [item for item in items if item.name in (camera, f"{camera}_json") or _is_table_of(camera, item)]
    if len(own) > 1:
        raise InputError(f"{own[0].parent}: both {own[0].name} and {own[1].name} hold keypoints of camera '{camera}'; leave one")
    return own[0] if own else None


def _is_table_of(camera: str, item: Path) -> bool:
    suffix = item.suffix.lower()
    return (item.stem == camera and suffix in TABLE_SUFFIXES) or (suffix == ".csv" and item.stem.startswith(f"{camera}DLC"))


def _reader(item: Path, size: tuple[int, int]) -> tuple[_Folder | _Table, int]:
    """The reader of a camera's folder or file, and the number that it gives the first frame of a video."""
    if item.is_dir():
        return _open_folder(item, size), 0
    frames, first = (read_csv_table(item), 0) if item.suffix.lower() == ".csv" else read_json_table(item)
    return _open_table(frames, size), first


def _open_folder(path: Path, size: tuple[int, int]) -> _Folder:
    names = sorted(item.name for item in path.glob("*.json") if not item.name.startswith("."))
    found = [last_number(Path(name).stem) for name in names]
    numbers = np.array([number for number in found if number is not None], np.int64)
    if len(numbers) < len(names):
        raise InputError(f"{path / names[found.index(None)]}: no number of a frame in its name, as in cam_00_000000000012_keypoints.json")
    order = np.argsort(numbers, kind="stable")
    numbers, sorted_names = numbers[order], np.array(names)[order]
    twice = np.flatnonzero(numbers[1:] == numbers[:-1])
    if len(twice):
        one, other = sorted_names[twice[0] : twice[0] + 2]
        raise InputError(f"{path}: both {one} and {other} are of frame {numbers[twice[0]]}; leave one")
    return _Folder(path, numbers, sorted_names, size)


def _open_table(frames: dict[int, RawPeople], size: tuple[int, int]) -> _Table:
    numbers = sorted(frames)
    # One file has one form: that of a frame with few points is told by the others.
    normalised = is_normalised(np.concatenate([frames[number].points for number in numbers])) if numbers else False
    people = [to_pixels(frames[number], size, normalised) for number in numbers]
    starts = np.concatenate([[0], np.cumsum([len(own) for own in people], dtype=int)]).astype(int)
    outside = _share_outside(((frames[number], normalised) for number in numbers), size)
    return _Table(np.array(numbers, np.int64), starts, np.concatenate([NOBODY, *people]), outside)


def _share_outside(people: Iterable[tuple[RawPeople, bool]], size: tuple[int, int]) -> float:
    """Of people and whether their coordinates are shares: which share of their points, by their confidence, is far outside of the image."""
    out, given = np.sum([(0.0, 0.0), *(confidence_outside(raw, size, normalised) for raw, normalised in people)], axis=0).tolist()
    return out / given if given else 0.0


def _line_outside(item: Path, camera: str, share: float, size: tuple[int, int]) -> str:
    return (
        f"{item}: {share:.0%} of its points are far outside of the images of '{camera}' ({size[0]} x {size[1]}) and left out; if they were "
        'found in images of another size, say it in the files ("image_size": [1920, 1080], or columns image_width, image_height)'
    )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
