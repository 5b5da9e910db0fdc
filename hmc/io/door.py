"""The door through which files are read: each is looked at before it is opened, and nothing is decoded that is beyond a limit.

A regular file and nothing else is opened, as a pipe or a socket would be waited for without end. Limits are far above what recordings
have; an environment variable raises each of them.
"""

from __future__ import annotations

import codecs
import json
import math
import os
import re
import stat
import struct
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np

from hmc.errors import InputError, is_utf8

__all__ = [
    "LIMITS", "MAX_DEPTH", "MAX_FRAME_NUMBER", "check_file", "check_folder", "check_image", "kept_arrays", "limit", "open_text",
    "read_arrays", "read_bytes", "read_image", "read_json_file", "read_text_file", "read_toml_file", "read_xml_file",
]  # fmt: skip

#: What each environment variable raises, and how much is read where it is not set.
LIMITS = {
    "HMC_MAX_SETTINGS_MB": 8.0,  # calibrations, recording.toml, session.toml, recipes, settings, run.toml
    "HMC_MAX_TABLE_MB": 256.0,  # joints.csv, tracks.csv, truth, times, keypoints, motions, cells, journals
    "HMC_MAX_ARRAYS_MB": 512.0,  # all arrays of a pose.npz, unpacked
    "HMC_MAX_IMAGE_MPIXEL": 40.0,  # one image or frame of a video
}
#: No frame has a higher number: 92 hours at 30 frames a second.
MAX_FRAME_NUMBER = 10_000_000
#: Tables and lists in one another.
MAX_DEPTH = 64
#: So near a JPEG's end its mark of the end must be; cameras add data of their own behind it.
JPEG_TAIL = 2**16
MEGA = 1e6

# A key of TOML with many dots makes a table in a table for each, at a cost that grows with their square.
_MANY_DOTS = re.compile(r"(?<![\w-])(?:(?:[\w-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+){64}")


def limit(name: str) -> float:
    """What an environment variable of `LIMITS` says, or the default.

    Raises
    ------
    InputError
        When it says no number above 0.
    """
    said = os.environ.get(name)
    try:
        value = LIMITS[name] if said is None else float(said)
    except ValueError:
        value = math.nan
    if not value > 0:
        raise InputError(f"{name}={said}: must be a number above 0, or not be set (then it is {LIMITS[name]:g})")
    return value


def check_file(path: str | Path, most: str = "") -> int:
    """Bytes of a regular file; follows links.

    Parameters
    ----------
    path : path
    most : str, optional
        Which of the `LIMITS` in megabytes holds for it.

    Raises
    ------
    InputError
        When there is none, it is something else (a folder, a pipe, a device) or larger than that, or has a name that is no text.
    """
    if not is_utf8(os.fspath(path)):
        raise InputError(f"{os.fspath(path)!r}: its name is no text in UTF-8; rename it")
    try:
        found = os.stat(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "no regular file (a pipe, socket or device)"
        raise InputError(f"{path}: cannot be read ({kind}); put a file in its place")
    if most and found.st_size > limit(most) * MEGA:
        raise InputError(
            f"{path}: {found.st_size / MEGA:.0f} MB, more than the {limit(most):g} MB that are read of such a file; if it is right, "
            f"set {most} higher"
        )
    return found.st_size


def check_folder(path: str | Path) -> None:
    """Refuse what bears a folder's name and is none: a file, or a link to a disk that is not there. No such name at all is fine.

    Raises
    ------
    InputError
    """
    if os.path.lexists(path) and not os.path.isdir(path):
        what = "a link that leads nowhere" if os.path.islink(path) and not os.path.exists(path) else "a file"
        raise InputError(f"{path}: {what}, where a folder should be; put the folder there, or remove it")


def read_bytes(path: str | Path, most: str = "HMC_MAX_TABLE_MB") -> bytes:
    """All of a file.

    Raises
    ------
    InputError
        As `check_file`, and when the system does not let it be read.
    """
    check_file(path, most)
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def read_text_file(path: str | Path, most: str = "HMC_MAX_TABLE_MB", guess: bool = False) -> str:
    """The text of a file in UTF-8, with or without a byte order mark.

    Parameters
    ----------
    path : path
    most : str
        Which of the `LIMITS` holds.
    guess : bool
        Take UTF-16 too, and what is neither for Latin-1: for what other programs wrote.

    Raises
    ------
    InputError
        As `read_bytes`, and when it is no such text.
    """
    try:
        return _decoded(read_bytes(path, most), guess)
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not text in UTF-8 ({error.reason} at byte {error.start}); save it in that encoding, or remove it"
        ) from None


def _decoded(data: bytes, guess: bool) -> str:
    if guess and data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    if guess and data[1:2] == b"\0":
        return data.decode("utf-16-le", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        if guess:
            return data.decode("latin-1")
        raise


def open_text(path: str | Path, most: str = "HMC_MAX_TABLE_MB") -> IO[str]:
    """A file of text in UTF-8 to be read line by line; line ends stay as they are.

    Raises
    ------
    InputError
        As `check_file`, and when the system does not let it be opened. What is read later may raise `UnicodeDecodeError`.
    """
    check_file(path, most)
    try:
        return open(path, encoding="utf-8-sig", newline="")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def read_toml_file(path: str | Path, guess: bool = False) -> dict[str, Any]:
    """The tables of a TOML file. Arguments as `read_text_file`.

    Raises
    ------
    InputError
        As `read_text_file`, and when it is no TOML, or too deep.
    """
    data = read_bytes(path, "HMC_MAX_SETTINGS_MB")
    try:
        text = _decoded(data, guess)
        if _MANY_DOTS.search(text):
            raise ValueError(f"a key of more than {MAX_DEPTH} parts")
        values = tomllib.loads(text)
    except (ValueError, RecursionError, OverflowError) as error:
        raise InputError(f"{path}: not a TOML file ({_short(error)}); mend or remove it") from None
    except Exception as error:  # tomllib of some versions stumbles over faulty text by an error of its own making
        raise InputError(f"{path}: not a TOML file ({type(error).__name__}); mend or remove it") from None
    _refuse_huge(path, values)
    return values


def read_json_file(path: str | Path, most: str = "HMC_MAX_TABLE_MB", guess: bool = False) -> Any:
    """The values of a JSON file. Arguments as `read_text_file`.

    Raises
    ------
    InputError
        As `read_text_file`, and when it is no JSON, or too deep.
    """
    data = read_bytes(path, most)
    try:
        return json.loads(_decoded(data, guess))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a JSON file ({_short(error)}); mend or remove it") from None


class _Tree(ElementTree.TreeBuilder):
    """Builds a tree, but of no document that declares entities, which can make a small file fill the memory, or is deep."""

    depth = 0

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise ValueError("a document type or entities are declared, which nothing here needs")

    def start(self, tag: Any, attrs: Any) -> ElementTree.Element:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ValueError(f"more than {MAX_DEPTH} elements in one another")
        return super().start(tag, attrs)

    def end(self, tag: Any) -> ElementTree.Element:
        self.depth -= 1
        return super().end(tag)


def read_xml_file(path: str | Path, what: str) -> ElementTree.Element:
    """The root of an XML file, read without entities.

    Raises
    ------
    InputError
        When it is no XML; the line says that it is not `what`.
    """
    text = read_text_file(path, "HMC_MAX_SETTINGS_MB", guess=True).strip()
    parser = ElementTree.XMLParser(target=_Tree())
    try:
        parser.feed(text)
        return parser.close()
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not {what} ({_short(error)})") from None


def read_arrays(path: str | Path) -> dict[str, np.ndarray]:
    """The arrays of an npz file. Their headers are looked at before one is unpacked; nothing is unpickled.

    Raises
    ------
    InputError
        When it cannot be read, is no such file, is damaged, or holds more than `HMC_MAX_ARRAYS_MB`.
    """
    most = limit("HMC_MAX_ARRAYS_MB")
    check_file(path, "HMC_MAX_ARRAYS_MB")
    try:
        with zipfile.ZipFile(path) as archive:
            _refuse_bomb(archive, most)
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except MemoryError:
        raise InputError(f"{path}: holds more than there is memory for") from None
    except Exception as error:  # zipfile and NumPy stumble over damaged archives in many ways
        raise InputError(f"{path}: not a file of arrays, or a damaged one ({_short(error)})") from None


@contextmanager
def kept_arrays(path: str | Path) -> Iterator[dict[str, np.ndarray]]:
    """The arrays of a file that a run keeps for itself and makes again where it is not there; what the block stumbles over is the file's.

    Raises
    ------
    InputError
        As `read_arrays`, and when the block raises what arrays of other names, shapes or places lead to.
    """
    try:
        yield read_arrays(path)
    except InputError as error:
        raise InputError(f"{error}; remove it: it is made again") from None
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError(f"{path}: other arrays than are kept there ({_short(error)}); remove it: it is made again") from None


def _refuse_bomb(archive: zipfile.ZipFile, most: float) -> None:
    """Neither the archive's list nor the arrays' own headers may promise more bytes."""
    total = 0.0
    for entry in archive.infolist():
        with archive.open(entry) as file:
            version = np.lib.format.read_magic(file)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(file)
        if dtype.hasobject or dtype.kind == "c" or any(side < 0 for side in shape):
            raise ValueError(f"{entry.filename} holds no plain numbers")
        stated = float(math.prod(shape)) * dtype.itemsize
        if stated > entry.file_size:
            raise ValueError(f"{entry.filename} says that it has {math.prod(shape)} entries, which are not there")
        total += max(stated, entry.file_size)
    if total > most * MEGA:
        raise ValueError(f"{total / MEGA:.0f} MB, more than the {most:g} MB that are read; if it is right, set HMC_MAX_ARRAYS_MB higher")


def check_image(path: str | Path) -> None:
    """Refuse what is no regular file, and an image that says in its header that it is larger than `HMC_MAX_IMAGE_MPIXEL`.

    Of PNG, JPEG and BMP; other formats are left to the decoder, which has a limit of its own.

    Raises
    ------
    InputError
    """
    check_file(path)
    try:
        with open(path, "rb") as file:
            size = _image_size(file)
    except (OSError, struct.error):
        return  # the decoder tells that it cannot be read
    most = limit("HMC_MAX_IMAGE_MPIXEL")
    if size is not None and size[0] * size[1] > most * MEGA:
        raise InputError(
            f"{path}: {size[0]} x {size[1]} pixels, more than the {most:g} million that are read; make it smaller, or set "
            "HMC_MAX_IMAGE_MPIXEL higher"
        )


def read_image(path: str | Path, flag: int | None = None) -> np.ndarray | None:
    """An image as OpenCV reads it, (h, w, 3) uint8 BGR, or as `flag` of `cv2.imread` says; None where it cannot be read, or is cut off.

    Raises
    ------
    InputError
        As `check_image`.
    """
    import cv2

    check_image(path)
    if _is_cut_off(path):
        return None
    try:
        return cv2.imread(str(path), cv2.IMREAD_COLOR if flag is None else flag)
    except cv2.error:
        return None


def _is_cut_off(path: str | Path) -> bool:
    """Whether a JPEG has no end: decoders give such an image gray from there on."""
    try:
        with open(path, "rb") as file:
            if file.read(3) != b"\xff\xd8\xff":
                return False
            file.seek(max(0, os.fstat(file.fileno()).st_size - JPEG_TAIL))
            return b"\xff\xd9" not in file.read()
    except OSError:
        return False  # the decoder tells that it cannot be read


def _image_size(file: IO[bytes]) -> tuple[int, int] | None:
    """Width and height as the header has them; None where that is not known."""
    head = file.read(32)
    if head.startswith(b"\x89PNG"):
        width, height = struct.unpack_from(">II", head, 16)
        return width, height
    if head.startswith(b"BM"):
        width, height = struct.unpack_from("<ii", head, 18)
        return abs(width), abs(height)
    if not head.startswith(b"\xff\xd8"):
        return None
    file.seek(2)
    for _ in range(1000):
        marker = file.read(2)
        if len(marker) < 2 or marker[0] != 0xFF:
            return None
        if 0xC0 <= marker[1] <= 0xCF and marker[1] not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", file.read(7)[3:])
            return width, height
        (length,) = struct.unpack(">H", file.read(2))
        file.seek(max(length - 2, 0), 1)
    return None


def _refuse_huge(path: str | Path, value: Any, where: str = "") -> None:
    """Whole numbers that no array holds: TOML has none above 64 bits, but its reader takes them."""
    if isinstance(value, Mapping):
        for key, one in value.items():
            _refuse_huge(path, one, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list):
        for one in value:
            _refuse_huge(path, one, where)
    elif isinstance(value, int) and abs(value) >= 2**63:
        raise InputError(f"{path}: `{where[:60]}` is a number beyond 64 bits; mend it")


def _short(error: BaseException) -> str:
    return (str(error).strip() or type(error).__name__).replace("\n", " ")[:120]
