"""The silhouettes of a result: PNGs in the form that recordings have them, kept so that what comes after a run need not segment again.

``silhouettes/CAMERA/000012.png`` is of frame 12 as the recording counts: one bit a pixel, white where a person is, as large as the camera's
recorded images. Where the run read smaller images, each of its pixels is a block here, so that the run's mask is had again bit for bit.
A camera that told nothing in a frame has no file of it. ``doubtful/CAMERA/`` has, of the few frames with any, where people may be besides
(`hmc.io.masks.MaskStep`).
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from hmc.camera.reduction import reduce_mask
from hmc.errors import InputError
from hmc.io.door import read_image
from hmc.io.masks import MaskStep
from hmc.io.recording import Recording
from hmc.io.results import read_run
from hmc.processes import ahead, share_out

__all__ = ["DOUBTFUL", "SILHOUETTES", "KeptSilhouettes", "open_silhouettes", "remove_silhouettes", "silhouettes_ahead", "write_silhouettes"]

#: Folders in a result's folder.
SILHOUETTES, DOUBTFUL = "silhouettes", "doubtful"
#: What is not complete is in a folder of this name.
PART = ".part"


@dataclass(frozen=True)
class KeptSilhouettes:
    """The silhouettes that a run left.

    Parameters
    ----------
    directory : Path
        Of the result.
    names : tuple of str
        Its cameras.
    first, last : int
        Its frames; `last` is not included.
    """

    directory: Path
    names: tuple[str, ...]
    first: int
    last: int

    def missing(self, recording: Recording, first: int | None = None, last: int | None = None) -> str:
        """What they lack of a recording's selection, or of a part of it, for a message; empty where they have all of it."""
        first = recording.start if first is None else first
        last = recording.start + recording.n_frames if last is None else last
        others = [name for name in recording.rig.names if name not in self.names]
        if others:
            return f"no camera {', '.join(others)}"
        return "" if self.first <= first and last <= self.last else f"frames {self.first} to {self.last - 1} only"

    def steps(self, recording: Recording, frames: Iterable[int]) -> Iterator[MaskStep]:
        """The silhouettes of some frames, without images, as large as the recording's images are read.

        Parameters
        ----------
        recording : Recording
            Its cameras are among `names`.
        frames : iterable of int
            Absolute frame numbers, in any order.

        Yields
        ------
        MaskStep

        Raises
        ------
        InputError
            When a file cannot be read or has not the size of the camera's images.
        """
        n = len(recording.rig)
        for index in frames:
            masks, doubts = (tuple(self._mask(kind, recording, camera, index) for camera in range(n)) for kind in (SILHOUETTES, DOUBTFUL))
            yield MaskStep(index, (None,) * n, masks, doubts)

    def _mask(self, kind: str, recording: Recording, camera: int, index: int) -> np.ndarray | None:
        path = _file(self.directory, kind, recording.rig.names[camera], index)
        if not path.is_file():
            return None
        image, factor = read_image(path, cv2.IMREAD_GRAYSCALE), recording.factors[camera]
        if image is None:
            raise InputError(f"{path}: cannot be read; remove {path.parents[1]} and the silhouettes are made anew")
        size = tuple(side // factor for side in image.shape[::-1])
        if size != recording.rig[camera].size:
            raise InputError(
                f"{path}: is {image.shape[1]} x {image.shape[0]}, not as large as this recording's images; remove {path.parents[1]} "
                "and the silhouettes are made anew"
            )
        return reduce_mask(image > 0, factor)


def open_silhouettes(directory: str | Path) -> KeptSilhouettes | None:
    """The silhouettes that a run left in a result's folder, or None where it left none.

    Raises
    ------
    InputError
        When there is a `run.toml` that is not TOML.
    """
    directory = Path(directory)
    run = directory / "run.toml"
    if not run.is_file() or not (directory / SILHOUETTES).is_dir():
        return None
    parameters = read_run(run).get("parameters", {})
    names, first, n_frames = (parameters.get(name) for name in ("cameras", "start", "frames"))
    if not (isinstance(names, list) and isinstance(first, int) and isinstance(n_frames, int)):
        return None
    return KeptSilhouettes(directory, tuple(names), first, first + n_frames)


def write_silhouettes(directory: str | Path, recording: Recording, lots: Sequence[Iterable[MaskStep]], workers: int = 1) -> int:
    """Write silhouettes into a result's folder. They appear there when all are written, in place of others from before.

    Parameters
    ----------
    directory : path
        Of the result.
    recording : Recording
        Of which they are; its images may be smaller than recorded.
    lots : sequence of iterable of MaskStep
        Each frame in one of them.
    workers : int
        Processes that share the lots, at most.

    Returns
    -------
    int
        Bytes of all files.

    Raises
    ------
    InputError
        When they cannot be written.
    """
    directory = Path(directory)
    try:
        with _told_of(directory):
            part = _begun(directory, recording)
            written = sum(share_out([partial(_write_lot, part, recording, steps) for steps in lots], workers))
            _put_in_place(directory)
    finally:
        shutil.rmtree(directory / PART, ignore_errors=True)
    return written


@contextmanager
def silhouettes_ahead(
    directory: str | Path, recording: Recording, steps: Callable[[], Iterable[MaskStep]], workers: int
) -> Iterator[Callable[[], int]]:
    """As `write_silhouettes`, by a process that begins with this call while this one does something else.

    Parameters
    ----------
    directory : path
    recording : Recording
    steps : callable
        Gives the frames; it is called there.
    workers : int
        With fewer than two all is written when it is asked for.

    Yields
    ------
    callable
        To be called once: waits until all is written, puts it in place, and tells the bytes of all files. Nothing is left of what is not
        asked for.

    Raises
    ------
    InputError
        When they cannot be written: from that call.
    """
    directory = Path(directory)

    def write() -> Iterator[int]:
        """The bytes of all files, when they are written."""
        yield _write_lot(_begun(directory, recording), recording, steps())

    written = ahead(write, workers)

    def finish() -> int:
        """Wait for them, and put them in place."""
        with _told_of(directory):
            n_bytes = next(written)
            _put_in_place(directory)
        return n_bytes

    try:
        yield finish
    finally:
        written.close()  # type: ignore[attr-defined]
        shutil.rmtree(directory / PART, ignore_errors=True)


@contextmanager
def _told_of(directory: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{directory / SILHOUETTES}: cannot be written ({error.strerror or error}); --no-silhouettes leaves it out"
        ) from None


def _begun(directory: Path, recording: Recording) -> Path:
    """The empty folder for what is not complete."""
    part = directory / PART
    shutil.rmtree(part, ignore_errors=True)
    for name in recording.rig.names:
        (part / SILHOUETTES / name).mkdir(parents=True)
    return part


def _put_in_place(directory: Path) -> None:
    remove_silhouettes(directory)
    for folder in (directory / PART / DOUBTFUL, directory / PART / SILHOUETTES):
        if folder.is_dir():
            folder.rename(directory / folder.name)


def _write_lot(directory: Path, recording: Recording, steps: Iterable[MaskStep]) -> int:
    """Write some frames, and tell the bytes of their files."""
    written = 0
    for step in steps:
        for kind, masks in ((SILHOUETTES, step.masks), (DOUBTFUL, step.doubtful)):
            for name, mask, factor, size in zip(recording.rig.names, masks, recording.factors, recording.file_sizes, strict=True):
                if mask is not None:
                    written += _write(_file(directory, kind, name, step.index), _as_recorded(mask, factor, size))
    return written


def remove_silhouettes(directory: str | Path) -> None:
    """Remove what `write_silhouettes` wrote into a result's folder."""
    for kind in (SILHOUETTES, DOUBTFUL):
        shutil.rmtree(Path(directory) / kind, ignore_errors=True)


def _file(directory: Path, kind: str, name: str, index: int) -> Path:
    return directory / kind / name / f"{index:06d}.png"


def _as_recorded(mask: np.ndarray, factor: int, size: tuple[int, int]) -> np.ndarray:
    """A mask, (h, w) bool, as a white one of uint8, as large as the files of (width, height) that it is of: blocks of each pixel."""
    white = mask.view(np.uint8) * np.uint8(255)
    if factor == 1:
        return white
    blocks = cv2.resize(white, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    out = np.zeros(size[::-1], np.uint8)
    out[: blocks.shape[0], : blocks.shape[1]] = blocks
    return out


def _write(path: Path, image: np.ndarray) -> int:
    path.parent.mkdir(parents=True, exist_ok=True)
    data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_BILEVEL, 1])[1].tobytes()
    path.write_bytes(data)
    return len(data)
