"""Where else a recording's files lie, when not where they are looked for: the line of recording.toml that says so."""

from __future__ import annotations

import glob
import re
from collections.abc import Sequence
from pathlib import Path

from hmc.io.naming import IMAGE_SUFFIXES, PLACE, VIDEO_SUFFIXES, footage_items, item_name

__all__ = ["layout_line", "shifted_line"]

#: Where laboratories put the videos and images of a camera, without the suffix.
VIDEO_PLACES = (PLACE, f"{PLACE}/*", f"{PLACE}_*", f"*/{PLACE}")
IMAGE_PLACES = (f"{PLACE}/*", f"{PLACE}_*")


def layout_line(recording: Path, names: Sequence[str]) -> str | None:
    """The line of recording.toml by which every camera has its video or images.

    Parameters
    ----------
    recording : Path
        Its folder.
    names : sequence of str
        All cameras of the calibration.

    Returns
    -------
    str or None
        None where no usual layout fits all cameras, each with files of its own.
    """
    for kind, places, suffixes in (("videos", VIDEO_PLACES, VIDEO_SUFFIXES), ("images", IMAGE_PLACES, IMAGE_SUFFIXES)):
        for place in places:
            for suffix in sorted(_suffixes(recording, place, names, suffixes)):
                found = [sorted(recording.glob(_of(place, name) + suffix)) for name in names]
                files = [file for own in found for file in own]
                # The empty scene is no trial, and `cam_1*` must not take the files of `cam_10`.
                if any("background" in file.relative_to(recording).parts for file in files) or len(set(files)) < len(files):
                    continue
                if all(len(own) == 1 if kind == "videos" else own for own in found):
                    return f'{kind} = "{place}{suffix}"'
    return None


def shifted_line(recording: Path, names: Sequence[str]) -> str | None:
    """The line for videos that are numbered as the cameras are, but from another number.

    Such as ``cam_00`` to ``cam_03`` of the cameras ``cam_01`` to ``cam_04``: each of these videos but the first bears a
    camera's name, and it is another camera's. Parameters and value as `layout_line`.
    """
    files = {item_name(item): item for item in footage_items(recording / "videos")}
    cameras, videos = _numbers(names), _numbers(files)
    if len(cameras) < 2 or len(cameras) != len(videos) or len({text for _, text in (*cameras, *videos)}) > 1:
        return None
    if len({video[0] - camera[0] for camera, video in zip(sorted(cameras), sorted(videos), strict=True)} | {0}) != 2:
        return None
    ordered = zip(sorted(cameras), sorted(videos), strict=True)
    entries = [f'"{cameras[camera]}" = "videos/{files[videos[video]].name}"' for camera, video in ordered]
    return f"videos = {{ {', '.join(entries)} }}"


def _suffixes(recording: Path, place: str, names: Sequence[str], suffixes: frozenset[str]) -> set[str]:
    return {file.suffix for file in recording.glob(_of(place, names[0]) + ".*") if file.suffix.lower() in suffixes}


def _of(place: str, name: str) -> str:
    return place.replace(PLACE, glob.escape(name))


def _numbers(names) -> dict[tuple[int, str], str]:
    """Names by their last number and what else is in them; those without a number are left out."""
    found = {name: re.fullmatch(r"(.*?)(\d+)(\D*)", name) for name in names}
    return {(int(match[2]), f"{match[1]}#{match[3]}"): name for name, match in found.items() if match}
