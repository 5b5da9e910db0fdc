"""Which file is which camera's: by its name, by a pattern, or by a table in recording.toml."""

from __future__ import annotations

import glob
import re
import unicodedata
from collections.abc import Mapping, Sequence
from os.path import realpath
from pathlib import Path
from typing import Any, NamedTuple

from hmc.errors import InputError
from hmc.io.door import check_folder
from hmc.io.files import matching

__all__ = ["FILES", "PLACE", "Found", "find_files", "tokens_of"]

#: Folders of a recording whose files are cameras', and keys of recording.toml that say which.
FILES = ("videos", "images", "background", "silhouettes")
#: Stands for a camera's name in a pattern.
PLACE = "{camera}"
VIDEO_SUFFIXES = frozenset({".mp4", ".avi", ".mov", ".mkv", ".m4v", ".mpg", ".mpeg", ".webm", ".wmv", ".mts", ".ts", ".h264"})
IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm"})
#: Words that programs call one camera by; Caliscope's videos are ports.
SAME_WORDS = {"camera": "cam", "port": "cam"}


class Found(NamedTuple):
    """Files of cameras that do not simply bear the camera's name.

    ``files`` has the file, folder or numbered images of each such camera; none at all where recording.toml says that there is one and
    none is there. A camera that is not in it has files of its name, or none. ``notes`` has a sentence for each camera whose
    file was guessed.
    """

    files: dict[str, tuple[Path, ...]]
    notes: dict[str, str]


def find_files(recording: Path, kind: str, names: Sequence[str], settings: Mapping[str, Any], folder: Path | None = None) -> Found:
    """Find the cameras' files in one of a recording's folders.

    What recording.toml says stands. Otherwise a file or folder that is called like the camera is the camera's. For cameras without one,
    names that differ in case, punctuation, leading zeros, or camera for cam, are the same; and where no camera has a file by now, a file
    with just one camera's name in its own is that camera's, if so all have one. Either must be clear: one file a camera, one camera a file.

    Parameters
    ----------
    recording : Path
        Its folder.
    kind : str
        One of `FILES`.
    names : sequence of str
        All cameras of the calibration.
    settings : mapping
        Of recording.toml, checked; of a trial whose session says where its videos are, ``videos`` is a path with `PLACE` in it.
    folder : Path, optional
        Where files of this kind are, if not in the recording's own folder of that name.

    Returns
    -------
    Found

    Raises
    ------
    InputError
        When recording.toml names a camera or file that is not there, or its pattern fits no file at all, it is not clear which file is
        meant, or the folder is none.
    """
    said = settings.get(kind, {})
    if isinstance(said, Path):
        return Found({name: _in_place(Path(str(said).replace(PLACE, name))) for name in names}, {})
    if isinstance(said, str):
        files = {name: _by_pattern(recording, kind, said, name) for name in names}
        if not any(files.values()):
            raise InputError(f'{recording / "recording.toml"}: `{kind}` = "{said}" fits no file of any camera; correct or remove it')
        return Found(files, {})
    strangers = [name for name in said if name not in names]
    if strangers:
        raise InputError(
            f"{recording / 'recording.toml'}: `{kind}` names '{strangers[0]}', no camera of the calibration ({', '.join(names)})"
        )
    files = {name: (recording / file,) for name, file in said.items()}
    for name, (file,) in files.items():
        if not file.exists():
            raise InputError(f"{recording / 'recording.toml'}: `{kind}` gives camera '{name}' the file {file}, which is not there")
    check_folder(folder or recording / kind)
    given = {realpath(path) for paths in files.values() for path in paths}
    items = [item for item in footage_items(folder or recording / kind) if realpath(item) not in given]  # of links that go round too
    exact = {item_name(item) for item in items}
    if kind == "videos":  # no guess goes before images that bear the camera's name
        exact |= {item_name(item) for item in footage_items(recording / "images")}
    wanted = [name for name in names if name not in said and name not in exact]
    free = [item for item in items if item_name(item) not in names]
    guessed = _guess(recording, kind, wanted, free, _same)
    if not guessed and len(wanted) == len(names) - len(said):
        guessed = _guess(recording, kind, wanted, free, _contained)
        guessed = guessed if len(guessed) == len(wanted) else {}
    notes = {name: f"{item}: taken for camera '{name}', by their names" for name, item in guessed.items()}
    return Found({**files, **{name: (item,) for name, item in guessed.items()}}, notes)


def footage_items(folder: Path) -> list[Path]:
    """Folders, videos and images in a folder, by name."""
    if not folder.is_dir():
        return []
    return [item for item in shown(folder) if item.is_dir() or item.suffix.lower() in VIDEO_SUFFIXES | IMAGE_SUFFIXES]


def shown(folder: Path) -> list[Path]:
    """What is in a folder, by name, but for names that begin with a dot: what a Mac or a network drive leaves beside files, under nearly
    their names (``._cam_00.mp4``)."""
    return sorted(item for item in folder.iterdir() if not item.name.startswith("."))


def item_name(item: Path) -> str:
    """What a folder or file is called, without a suffix."""
    return item.name if item.is_dir() else item.stem


def tokens_of(name: str) -> tuple[str, ...]:
    """A name's words and numbers, without case, punctuation and leading zeros: ``Camera_01`` and ``cam1`` are ("cam", "1")."""
    # Some systems write an umlaut as two signs, which look the same and are not.
    parts = re.findall(r"[^\W\d_]+|\d+", unicodedata.normalize("NFC", name).casefold())
    return tuple(part.lstrip("0") or "0" if part.isdigit() else SAME_WORDS.get(part, part) for part in parts)


def _same(camera: tuple[str, ...], file: tuple[str, ...]) -> bool:
    return _joined(camera) == _joined(file)


def _joined(tokens: tuple[str, ...]) -> str:
    """Words and numbers without what parts them, but for two numbers in a row."""
    return re.sub(r"(?<=\d) (?=\d)", "_", " ".join(tokens)).replace(" ", "")


def _contained(camera: tuple[str, ...], file: tuple[str, ...]) -> bool:
    return any(file[i : i + len(camera)] == camera for i in range(len(file) - len(camera) + 1))


def _guess(recording: Path, kind: str, names: Sequence[str], items: Sequence[Path], like) -> dict[str, Path]:
    """The one item that is like each camera's name; what is not clear is an error that proposes how to say it."""
    tokens = {name: tokens_of(name) for name in names if tokens_of(name)}
    labels = {item: tokens_of(item_name(item)) for item in items}
    fitting = {name: [item for item in items if like(own, labels[item])] for name, own in tokens.items()}
    for name, candidates in fitting.items():
        rivals = [other for other in fitting if other != name and candidates and candidates[0] in fitting[other]]
        if len(candidates) > 1 or rivals:
            what = f"camera '{name}' may be {' or '.join(item.name for item in candidates[:2])}" if len(candidates) > 1 else ""
            what = what or f"{candidates[0].name} may be camera '{name}' or '{rivals[0]}'"
            pattern = _pattern_of(recording, kind, names, candidates[0])
            if pattern is not None:
                raise InputError(f'{recording / kind}: {what}; if these are numbered images, write in recording.toml: {kind} = "{pattern}"')
            file = candidates[0].relative_to(recording).as_posix()
            raise InputError(f'{recording / kind}: {what}; say which in recording.toml: {kind} = {{ "{name}" = "{file}", ... }}')
    return {name: candidates[0] for name, candidates in fitting.items() if candidates}


def _pattern_of(recording: Path, kind: str, names: Sequence[str], image: Path) -> str | None:
    """The pattern by which each camera has images of its own, of those that begin with its name; None where there is none."""
    if image.suffix.lower() not in IMAGE_SUFFIXES or not image.is_file():
        return None
    for part in ("_", "-", "."):
        pattern = f"{kind}/{PLACE}{part}*{image.suffix}"
        if all(next(recording.glob(pattern.replace(PLACE, glob.escape(name))), None) is not None for name in names):
            return pattern
    return None


def _in_place(path: Path) -> tuple[Path, ...]:
    """The file or folder at a path, or the one there whose name has a suffix more; none where there is none."""
    if path.exists():
        return (path,)
    return tuple(sorted(path.parent.glob(f"{glob.escape(path.name)}.*"))[:1])


def _by_pattern(recording: Path, kind: str, pattern: str, name: str) -> tuple[Path, ...]:
    try:
        files = matching(recording, pattern.replace(PLACE, glob.escape(name)))
    except InputError as error:
        raise InputError(f"{recording / 'recording.toml'}: `{kind}` is no pattern for files in the recording's folder ({error})") from None
    if len(files) > 1 and any(file.suffix.lower() not in IMAGE_SUFFIXES for file in files):
        raise InputError(
            f"{recording / 'recording.toml'}: `{kind}` = \"{pattern}\" fits {len(files)} files of camera '{name}' "
            f"({', '.join(file.name for file in files[:2])}, ...); one video a camera, please"
        )
    return tuple(files)
