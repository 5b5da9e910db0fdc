"""Videos and folders of numbered images behind one interface: how many frames, how large, and the frames in order.

Frames stream: a reader holds one decoder and one image. A frame that cannot be read is None, never an exception.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.calibration import natural_key
from hmc.io.door import MAX_FRAME_NUMBER, check_file, limit, read_image
from hmc.io.naming import IMAGE_SUFFIXES, VIDEO_SUFFIXES, footage_items, item_name, shown

__all__ = [
    "IMAGE_SUFFIXES",
    "VIDEO_SUFFIXES",
    "Footage",
    "find_footage",
    "in_time",
    "open_files",
    "open_images",
    "open_video",
    "read_footage",
    "stamps",
    "starting_at",
]

#: A video is over when this many frames in a row cannot be decoded.
MAX_FAILURES = 25
#: Frames a second of a video of which nothing tells them.
DEFAULT_FPS = 30.0
#: So much of a file tells text from a video.
HEAD_BYTES = 64
#: Letters, digits and signs of text, in ASCII.
TEXT_BYTES = frozenset({*range(0x20, 0x7F), *b"\t\r\n"})
#: The largest value of an image of 12 bits.
MOST_OF_12_BITS = 2**12 - 1
#: After a video's last frame.
END = 2**62


@dataclass(frozen=True)
class Footage:
    """The frames of one camera.

    Parameters
    ----------
    path : Path
        The video, or the folder (or single file) of images.
    n_frames : int
        One past the last frame.
    size : tuple of int
        (width, height) in pixels.
    images : dict from frame to Path, or None
        None for a video. Frames may be missing.
    fps : float or None
        As the video's header says.
    notes : tuple of str
        What was odd when it was opened.
    skipped : int
        Frames of the file before frame 0, of a camera that began before the others.
    places : tuple of int, or None
        Of a camera that goes by time (`hmc.io.timing`): the frame of the file for each frame, -1 where it has none.
    first_number : int
        What the names of numbered images call the first frame of the files; 0 of a video, and of images that are counted in their order.
    arrays : sequence of ndarray or None, optional
        The frames themselves, where they are in memory: images (h, w, 3), or silhouettes (h, w) of bool or uint8. `path` is then a name.
    """

    path: Path
    n_frames: int
    size: tuple[int, int]
    images: dict[int, Path] | None = None
    fps: float | None = None
    notes: tuple[str, ...] = ()
    skipped: int = 0
    arrays: Sequence[np.ndarray | None] | np.ndarray | None = field(default=None, repr=False, compare=False)
    places: tuple[int, ...] | None = None
    first_number: int = 0

    def in_file(self, frame: int) -> int | None:
        """Which frame of the file a frame is, counted from the file's beginning; None where the camera took none."""
        if self.places is None:
            return frame + self.skipped
        return self.places[frame] if frame < len(self.places) and self.places[frame] >= 0 else None


def find_footage(folder: Path, name: str, first_number: int | None = None, count: bool = True) -> Footage | None:
    """The footage of camera ``name`` in a folder: ``name.mp4`` (any common suffix), ``name/*.png`` or a single ``name.png``.

    Parameters
    ----------
    folder : Path
    name : str
    first_number : int, optional
        See `open_images`.
    count : bool
        See `open_video`.

    Returns
    -------
    Footage or None
        None when there is none.

    Raises
    ------
    InputError
        When it is there but cannot be read, or there are two.
    """
    own = [item for item in footage_items(folder) if item_name(item) == name]
    if len(own) > 1:
        raise InputError(
            f"{folder}: both {own[0].name} and {own[1].name} are of camera '{name}'; leave one, or say which in recording.toml: "
            f'{folder.name} = {{ "{name}" = "{folder.name}/{own[0].name}" }}'
        )
    return open_files(own, first_number, count)


def open_files(files: Sequence[Path], first_number: int | None = None, count: bool = True) -> Footage | None:
    """The footage in the given place: a video, a folder of images, or images. Arguments and errors as `find_footage`."""
    if not files:
        return None
    path = files[0]
    if path.is_dir():
        return _open_folder(path, first_number, count)
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        return open_video(path, count)
    if len(files) == 1:
        return _footage_of_images(path, {0: path})
    return _footage_in_order(path.parent, files, first_number)


def _open_folder(folder: Path, first_number: int | None, count: bool) -> Footage:
    """A camera's folder: its images, or the one video in it, as cameras that name files themselves leave it."""
    videos = [path for path in shown(folder) if path.suffix.lower() in VIDEO_SUFFIXES]
    if not videos or number_images(folder):
        return open_images(folder, first_number)
    if len(videos) > 1:
        raise InputError(
            f"{folder}: {len(videos)} videos in a camera's folder ({videos[0].name}, {videos[1].name}); leave one, or join them"
        )
    return open_video(videos[0], count)


def open_video(path: Path, count: bool = True) -> Footage:
    """Look a video over: size, rate and a frame count that can be believed.

    The header's count is taken when the last frame it states is there and none follows; otherwise the frames are counted one by one.

    Parameters
    ----------
    path : Path
    count : bool
        If False, believe the header, which is quicker.

    Raises
    ------
    InputError
        When the file cannot be opened or holds no frame.
    """
    check_file(path)
    if _is_text(path):
        raise InputError(f"{path}: is text, no video (a list of other files?); put the video in its place")
    capture = cv2.VideoCapture(str(path))
    try:
        width, height = (capture.get(prop) for prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        if width * height > limit("HMC_MAX_IMAGE_MPIXEL") * 1e6:
            raise InputError(f"{path}: {width:.0f} x {height:.0f} pixels are too many; make it smaller, or set HMC_MAX_IMAGE_MPIXEL higher")
        image = capture.read()[1] if capture.isOpened() else None
        if image is None:
            raise InputError(f"{path}: this video cannot be read (empty, cut off or of an unknown codec); copy or convert it again")
        stated = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        fps = capture.get(cv2.CAP_PROP_FPS)
        if stated == 1 or not count:
            believed = stated > 0 and (not count or not capture.grab())
        else:
            believed = stated > 1 and capture.set(cv2.CAP_PROP_POS_FRAMES, stated - 1) and capture.grab() and not capture.grab()
    finally:
        capture.release()
    n_frames = stated if believed else _count(path)
    notes = (f"{path.name}: its header states {stated} frames, {n_frames} can be read (cut off?)",) if stated > n_frames else ()
    return Footage(path, n_frames, (image.shape[1], image.shape[0]), fps=fps if 0 < fps < 1e4 else None, notes=notes)


def _is_text(path: Path) -> bool:
    """Whether a file begins with letters alone, which no video does: decoders take lists of other files, which may lie anywhere."""
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return False  # the decoder tells that it cannot be read
    return bool(head) and all(byte in TEXT_BYTES for byte in head)


def _count(path: Path) -> int:
    capture = cv2.VideoCapture(str(path))
    try:
        return max(_grab(capture), default=-1) + 1
    finally:
        capture.release()


def _grab(capture: cv2.VideoCapture) -> Iterator[int]:
    """Grab frame after frame and give the index of each.

    Frames are counted, as every container allows, until one cannot be decoded. A decoder loses some frames there without a word, so
    from then on time stamps tell which frame it is.
    """
    fps = capture.get(cv2.CAP_PROP_FPS)
    index, shift, failures, damaged = -1, 0.0, 0, False
    while failures < MAX_FAILURES:
        if not capture.grab():
            failures, damaged = failures + 1, True
            continue
        failures = 0
        stamp = capture.get(cv2.CAP_PROP_POS_MSEC) * fps / 1000
        if damaged:
            index = max(index + 1, round(stamp + shift))
        else:
            index += 1
            shift = index - stamp
        yield index


def open_images(folder: Path, first_number: int | None = None) -> Footage:
    """Look a folder of images over. The last number in a file's name is its frame; without numbers that tell all of them apart, the natural
    order counts.

    Parameters
    ----------
    folder : Path
    first_number : int, optional
        The number that frame 0 bears; by default 0. The recording's smallest over all cameras is meant.

    Raises
    ------
    InputError
        When the folder has no image, none can be read, or two of one name.
    """
    return _footage_in_order(folder, _images_in(folder), first_number)


def number_images(folder: Path) -> dict[int, Path]:
    """The images of a folder by the number in their names (or their place in the natural order), before any shift."""
    return number_files(_images_in(folder))


def number_files(files: Iterable[Path]) -> dict[int, Path]:
    """As `number_images`, of the images given."""
    files = sorted(files, key=lambda path: natural_key(path.name))
    by_number = {number: path for path in files if (number := _number(path)) is not None}
    return by_number if len(by_number) == len(files) else dict(enumerate(files))


def _images_in(folder: Path) -> list[Path]:
    return [path for path in shown(folder) if path.suffix.lower() in IMAGE_SUFFIXES]


def _number(path: Path) -> int | None:
    """The last number in a file's name."""
    found = re.findall(r"\d+", path.stem)
    return int(found[-1]) if found else None


def _footage_in_order(path: Path, files: Sequence[Path], first_number: int | None) -> Footage:
    """The footage of several images, with a note where some of their numbers tell frames apart and others do not: a copy, or a picture of
    another kind among them, would move the frames after it."""
    names, numbers = dict[Path, Path](), dict[int | None, Path]()
    note = ""
    for file in files:
        other = names.setdefault(file.parent / file.stem.casefold(), file)
        if other is not file:
            raise InputError(f"{path}: both {other.name} and {file.name} are of one frame; leave one")
        number = _number(file)
        other = numbers.setdefault(number, file)
        if number is None:
            note = note or f"{file.name} has no number"
        elif other is not file:
            note = note or f"{other.name} and {file.name} have one number"
    footage = _footage_of_images(path, number_files(files), first_number or 0)
    if not note or len(numbers) == 1:
        return footage
    return replace(footage, notes=(*footage.notes, f"{path}: {note}; all are counted in the order of their names, a copy among them too"))


def _footage_of_images(path: Path, images: dict[int, Path], first_number: int = 0) -> Footage:
    images = {number - first_number: file for number, file in images.items() if number >= first_number}
    if not images:
        raise InputError(f"{path}: no image in this folder ({', '.join(sorted(IMAGE_SUFFIXES))}); fill or remove it")
    if max(images) > MAX_FRAME_NUMBER:
        raise InputError(f"{images[max(images)]}: a frame number in its name is above {MAX_FRAME_NUMBER}; rename or remove it")
    for file in images.values():
        try:
            image = read_image(file, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
        except InputError:
            if len(images) == 1:
                raise
            continue
        if image is not None:
            _refuse_unlike(file, image)
            return Footage(path, max(images) + 1, (image.shape[1], image.shape[0]), images, first_number=first_number)
    raise InputError(f"{path}: none of its {len(images)} images can be read; copy or convert them again")


def _refuse_unlike(path: Path, image: np.ndarray) -> None:
    """Refuse what has no whole numbers of 8 or 16 bits, and what has 16 and uses no more than 12 of them: read as 8 bits it is black.
    What is all black may be so."""
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: its values are {image.dtype}, as no camera has them; convert its images to 8 or 16 bits a value")
    if image.dtype == np.uint16 and 0 < image.max() <= MOST_OF_12_BITS:
        raise InputError(
            f"{path}: 16 bits a value, but none above {image.max()}, which is as good as black (a camera of 10 or 12 bits?); stretch its "
            "images to the full range, or convert them to 8 bits"
        )


def starting_at(footage: Footage, first: int) -> Footage:
    """The footage without its first frames: `first` becomes frame 0.

    Raises
    ------
    InputError
        When it has no frame from there on.
    """
    if first >= footage.n_frames:
        raise InputError(
            f"{footage.path}: has {footage.n_frames} frames, but `first_frame` of recording.toml says that it begins with {first}"
        )
    images = None if footage.images is None else {number - first: file for number, file in footage.images.items() if number >= first}
    return replace(footage, n_frames=footage.n_frames - first, images=images, skipped=footage.skipped + first)


def in_time(footage: Footage, places: Sequence[int]) -> Footage:
    """The footage with these frames of its files for the frames of the recording, -1 for none (`Footage.places`)."""
    images = footage.images
    if images is not None:
        images = {frame: images[place] for frame, place in enumerate(places) if place in images}
    return replace(footage, n_frames=len(places), images=images, places=tuple(int(place) for place in places))


def stamps(footage: Footage) -> np.ndarray:
    """When each frame of a video is to be shown, by its container: (n_frames,) seconds, the first at 0.

    Nothing is decoded where the container has a packet for every frame, which is some hundred times quicker; else the whole video is.
    """
    found = _packet_times(footage.path)
    if len(found) != footage.n_frames or not (np.diff(found) > 0).all():
        found = _decoded_times(footage)
    known = np.flatnonzero(np.isfinite(found))
    if len(known) > 1 and not (np.diff(found[known]) > 0).all():
        return np.arange(footage.n_frames) / (footage.fps or DEFAULT_FPS)  # a container without time stamps
    return found[: known[-1] + 1] - found[known[0]] if len(known) else found[:0]


def _packet_times(path: Path) -> np.ndarray:
    """The times of a video's packets, in the order in which frames are shown, seconds; none where OpenCV gives none."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
    times = []
    try:
        while capture.grab():
            times.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1000)
    finally:
        capture.release()
    return np.sort(times)  # packets come in the order of decoding


def _decoded_times(footage: Footage) -> np.ndarray:
    """The time of each decoded frame, (n_frames,) seconds; NaN of frames that cannot be decoded."""
    capture = cv2.VideoCapture(str(footage.path))
    found = np.full(footage.n_frames, np.nan)
    try:
        for index in _grab(capture):
            if index >= footage.n_frames:
                break
            found[index] = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
    finally:
        capture.release()
    return found


def read_footage(
    footage: Footage, first: int, last: int, on_problem: Callable[[str], None], label: str, only: Container[int] | None = None
) -> Iterator[np.ndarray | None]:
    """Frames ``first`` to ``last`` (not included) of one camera, in order.

    Parameters
    ----------
    footage : Footage
    first, last : int
    on_problem : callable
        Called with one line for each fault.
    label : str
        What the lines call this footage.
    only : container of int, optional
        Frames that are wanted; others are passed over, as None, as quickly as the files allow.

    Yields
    ------
    ndarray, shape (h, w, 3), uint8 BGR, or None
        None where the frame is missing, unreadable or of another size.
    """
    images, wanted = footage.images, range(first, last) if only is None else only
    if footage.arrays is not None:
        frames: Iterable[np.ndarray | None] = (_as_image(one) for one in islice(_from(footage.arrays, first), last - first))
    else:
        frames = _read_video(footage, first, last, wanted) if images is None else _read_images(images, first, last, wanted)
    lost: list[int] = []

    def say_lost() -> None:
        if lost:
            on_problem(f"{label}: {_frames(lost)} cannot be read; left out")
            lost.clear()

    try:
        for index, image in enumerate(frames, first):
            if image is not None and image.shape[1::-1] != footage.size:
                on_problem(
                    f"{label}: frame {index} is {image.shape[1]} x {image.shape[0]} and not {footage.size[0]} x {footage.size[1]}; left out"
                )
                image = None
            elif (
                image is None
                and index in wanted
                and index < footage.n_frames
                and footage.arrays is None
                and _should_be_there(footage, index)
            ):
                lost.append(index)
            # A caller that knows how many frames there are asks for no more after the last.
            if image is not None or index + 1 == last:
                say_lost()
            yield image
    finally:
        say_lost()


def _should_be_there(footage: Footage, index: int) -> bool:
    """Whether files of a camera have a frame; False of images in memory."""
    if footage.arrays is not None:
        return False
    return footage.in_file(index) is not None if footage.images is None else index in footage.images


def _from(arrays: Sequence[np.ndarray | None] | np.ndarray, first: int) -> Iterator[np.ndarray | None]:
    return (arrays[k] for k in range(first, len(arrays)))


def _as_image(array: np.ndarray | None) -> np.ndarray | None:
    """An image in memory as files have it: silhouettes with three channels, 255 where somebody is."""
    if array is None or array.ndim == 3:
        return array
    return np.repeat((array.view(np.uint8) * np.uint8(255 if array.dtype == bool else 1))[..., None], 3, axis=2)


def _frames(indices: list[int]) -> str:
    return f"frame {indices[0]}" if len(indices) == 1 else f"frames {indices[0]} to {indices[-1]}"


def _read_video(footage: Footage, first: int, last: int, only: Container[int]) -> Iterator[np.ndarray | None]:
    capture = cv2.VideoCapture(str(footage.path))
    try:
        # Grabbing up to the first frame is slower than seeking, but exact for every codec and container.
        grabbed = _grab(capture)
        index = -1
        for frame in range(first, min(last, footage.n_frames)):
            wanted = footage.in_file(frame)
            while wanted is not None and index < wanted:
                index = next(grabbed, END)
            yield capture.retrieve()[1] if index == wanted and frame in only else None
        for _ in range(max(first, footage.n_frames), last):
            yield None
    finally:
        capture.release()


def _read_images(images: dict[int, Path], first: int, last: int, only: Container[int]) -> Iterator[np.ndarray | None]:
    for index in range(first, last):
        try:
            yield read_image(images[index]) if index in images and index in only else None
        except InputError:
            yield None  # told as a frame that cannot be read
