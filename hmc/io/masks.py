"""Silhouettes kept on disk between two passes over a recording, so that the second need not read and segment it again.

One file, to which each frame is appended, packed to bits and deflated: 1.2 kB a silhouette of 640 x 480 (measured), and as much again
for doubts in the few frames that have any. An hour of seven cameras at 30 frames a second takes 0.9 GB. What is read back is bit for bit
what was kept. Frames of which a killed run wrote only a part, and all after one that is damaged, are dropped.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

import numpy as np

from hmc.io.camera_faults import CameraFault

__all__ = ["MaskStep", "Report", "keep_masks", "kept_frames", "kept_masks"]

Masks = tuple[np.ndarray | None, ...]
#: Called with one line for everything that was survived.
Report = Callable[[str], None]

#: Before each frame: its number, the bytes that follow, and a checksum of both.
FRAME = struct.Struct("<III")
#: Before each mask: height and width (0 where there is none), and the bytes that follow.
MASK = struct.Struct("<III")
#: Quickest: others save a tenth of the bytes for thrice the time.
DEFLATE_LEVEL = 1


@dataclass(frozen=True)
class MaskStep:
    """One frame's silhouettes.

    Attributes
    ----------
    index : int
        Absolute frame number.
    images : tuple of ndarray of uint8, shape (h, w, 3), or None; one a camera
    masks : tuple of ndarray of bool, shape (h, w), or None; one a camera
        None where the camera tells nothing in this frame.
    doubtful : tuple of ndarray of bool, shape (h, w), or None; one a camera
        Where people may be besides; None in a frame in which little was lost, and for silhouettes from disk.
    faults : tuple of CameraFault or None; one a camera
        What is wrong with a camera in this frame; empty where nobody looked.
    """

    index: int
    images: tuple[np.ndarray | None, ...]
    masks: tuple[np.ndarray | None, ...]
    doubtful: tuple[np.ndarray | None, ...]
    faults: tuple[CameraFault | None, ...] = field(default=(), kw_only=True)

    @property
    def usable(self) -> bool:
        """Whether two cameras at least (the one, of a rig of one) have a silhouette."""
        return sum(mask is not None for mask in self.masks) >= min(2, len(self.masks))


Step = TypeVar("Step", bound=MaskStep)


def keep_masks(path: str | Path, key: str, first: int, steps: Iterable[Step], on_problem: Report) -> Iterator[Step]:
    """Pass frames on, and keep their silhouettes.

    Parameters
    ----------
    path : path
        What it holds of the frames before `first` stays, if it has the same key.
    key : str
        Says what the silhouettes depend on.
    first : int
        Number of the first frame that comes.
    steps : iterable of MaskStep
    on_problem : callable
        Called with one line when the disk does not take them; the frames are passed on all the same.

    Yields
    ------
    MaskStep
        Each as it came, once it is kept.
    """
    path = Path(path)
    keeping = True
    for step in steps:
        if keeping:
            try:
                if step.index == first:
                    _begin(path, key, first)
                record = b"".join(_packed(mask) for mask in (*step.masks, *step.doubtful))
                with open(path, "ab") as file:
                    file.write(FRAME.pack(step.index, len(record), zlib.crc32(record, step.index)) + record)
            except OSError as error:
                keeping = False
                with suppress(OSError):
                    path.unlink()
                on_problem(f"{path}: silhouettes cannot be kept ({error.strerror or error}); they are made twice, which takes longer")
        yield step


def kept_masks(path: str | Path, key: str, first: int, last: int) -> Iterator[MaskStep] | None:
    """The silhouettes of consecutive frames, without their images; None where not all of them were kept.

    Parameters
    ----------
    path : path
    key : str
        As they were kept with.
    first, last : int
        Frame numbers; `last` is not included.

    Returns
    -------
    iterator of MaskStep, or None
    """
    return kept_frames(path, key, range(first, last))


def kept_frames(path: str | Path, key: str, frames: Iterable[int]) -> Iterator[MaskStep] | None:
    """The silhouettes of some frames in any order, as `kept_masks` gives those of consecutive ones.

    Parameters
    ----------
    path, key
        As for `kept_masks`.
    frames : iterable of int
    """
    places, frames = _places(Path(path), key), list(frames)
    if any(index not in places for index in frames):
        return None
    return (_read(Path(path), index, places[index]) for index in frames)


def _header(key: str) -> bytes:
    return b"hmc masks 2 " + sha256(key.encode()).hexdigest().encode() + b"\n"


def _begin(path: Path, key: str, first: int) -> None:
    """Cut the file off before a frame; a file of another key is begun anew."""
    places = _places(path, key)
    header = _header(key)
    ends = [start + length for index, (start, length) in places.items() if index < first]
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file():  # a pipe would be waited for
        path.unlink(missing_ok=True)
    with open(path, "r+b" if places else "wb") as file:
        file.write(header)
        file.truncate(max(ends, default=len(header)))


def _places(path: Path, key: str) -> dict[int, tuple[int, int]]:
    """Where in the file each whole frame's masks begin, and how many bytes they are."""
    header, places = _header(key), dict[int, tuple[int, int]]()
    if not path.is_file():
        return places
    size = path.stat().st_size
    with open(path, "rb") as file:
        if file.read(len(header)) != header:
            return places
        while len(head := file.read(FRAME.size)) == FRAME.size:
            index, length, checksum = FRAME.unpack(head)
            start = file.tell()
            if start + length > size or zlib.crc32(file.read(length), index) != checksum:
                break
            places[index] = start, length
    return places


def _read(path: Path, index: int, place: tuple[int, int]) -> MaskStep:
    start, length = place
    with open(path, "rb") as file:
        file.seek(start)
        masks = tuple(_unpacked(file.read(length)))
    n = len(masks) // 2
    return MaskStep(index, (None,) * n, masks[:n], masks[n:])


def _packed(mask: np.ndarray | None) -> bytes:
    if mask is None:
        return MASK.pack(0, 0, 0)
    data = zlib.compress(np.packbits(mask).tobytes(), DEFLATE_LEVEL)
    return MASK.pack(*mask.shape, len(data)) + data


def _unpacked(record: bytes) -> Iterator[np.ndarray | None]:
    at = 0
    while at < len(record):
        height, width, length = MASK.unpack_from(record, at)
        at += MASK.size + length
        data = np.frombuffer(zlib.decompress(record[at - length : at]), np.uint8) if length else None
        yield None if data is None else np.unpackbits(data, count=height * width).reshape(height, width).view(bool)
