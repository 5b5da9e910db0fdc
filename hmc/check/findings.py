"""What is wrong with a recording: everything that can be found, not only the first fault.

`hmc.io.recording.open_recording` stops at the first fault that makes a recording useless; here each part is looked at alone, and what is
merely odd is told too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from os.path import realpath
from pathlib import Path
from typing import Any

import numpy as np

from hmc.camera.coverage import estimate_room, in_view
from hmc.camera.model import Camera, Rig
from hmc.camera.odd import odd_cameras
from hmc.check.cures import sync_command
from hmc.check.keypoints import KeypointAgreement, keypoint_agreement, keypoint_findings
from hmc.check.moments import probe_masks
from hmc.check.silhouettes import hull_findings
from hmc.check.world_findings import floor_lines, world_findings
from hmc.errors import InputError
from hmc.io.calibration import CalibrationEntry, build_camera
from hmc.io.door import read_text_file
from hmc.io.footage import Footage, read_footage
from hmc.io.keypoints import open_keypoints
from hmc.io.naming import FILES, find_files, footage_items, item_name
from hmc.io.places import AnyPlaces, places_of, to_places
from hmc.io.recording import (
    Frame,
    Recording,
    fitted,
    iterate_frames,
    open_recording,
    wrong_focal_lengths,
    wrong_sizes,
    wrong_units,
)
from hmc.io.timing import rates_differ
from hmc.io.views import find_views, gaps, missing_views, shared_videos
from hmc.io.world import world_of

__all__ = ["Finding", "Inspection", "check_opened", "check_recording", "inspect_recording"]

#: Takes a severity and sentences.
Say = Callable[[str, Iterable[str]], None]

#: Frames that are read unless all are asked for, and how many of them the silhouettes are compared in.
PROBE_FRAMES = 90
COMPARED_FRAMES = 3
#: Files without a camera that are told one by one, at most.
MANY_FILES = 12
#: Background frames below which an adaptive model is not settled yet.
FEW_BACKGROUND_FRAMES = 10


@dataclass(frozen=True)
class Finding:
    """One finding: ``severity`` is "error" (the recording cannot be used), "warning" (results will suffer) or "note"."""

    severity: str
    sentence: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.sentence}"


@dataclass(frozen=True, eq=False)
class Inspection:
    """All findings, and as much of the recording as could be had for a picture: rig, room and one image a camera (or None).

    ``keypoints`` says how far the cameras' keypoints agree, where a 2-D detector left some; ``floor`` are lines of the floor on which
    people stand (`hmc.check.world_findings.floor_lines`), where it is not the calibration's.
    """

    findings: tuple[Finding, ...]
    rig: Rig | None = None
    room: np.ndarray | None = None
    images: tuple[np.ndarray | None, ...] = ()
    recording: Recording | None = None
    keypoints: KeypointAgreement | None = None
    floor: np.ndarray | None = None

    @property
    def usable(self) -> bool:
        """Whether nothing was found that stands in the way of a run."""
        return not any(finding.severity == "error" for finding in self.findings)

    @property
    def out_of_time(self) -> bool:
        """Whether a finding asks for `hmc.check.cures.sync_command`."""
        return self.recording is not None and any(sync_command(places_of(self.recording)) in finding.sentence for finding in self.findings)


def check_recording(path: AnyPlaces, cameras: Sequence[str] | None = None, read_all: bool = False) -> list[Finding]:
    """Find what is wrong with a recording.

    Parameters
    ----------
    path : str, Path or RecordingPlaces
        Folder of the recording, or where its parts lie.
    cameras : sequence of str, optional
        Look at these cameras only.
    read_all : bool
        Read every frame; by default the first 90.

    Returns
    -------
    list of Finding
        Errors first, then warnings, then notes; empty when there is nothing to say.
    """
    return list(inspect_recording(path, cameras, read_all).findings)


def check_opened(recording: Recording) -> list[Finding]:
    """As `check_recording`, of a recording as it was opened: its cameras, its parts wherever they lie, and images in memory.

    Parameters
    ----------
    recording : Recording
    """
    if recording.in_memory:
        return _check_arrays(recording)
    places, names = places_of(recording), recording.rig.names
    with suppress(InputError):  # told by what follows
        if {entry.name for entry in places.read_entries()} == set(names):
            return check_recording(places)
    return check_recording(places, names)


def _check_arrays(recording: Recording) -> list[Finding]:
    """What needs no files."""
    found: list[Finding] = []

    def say(severity: str, sentences: Iterable[str]) -> None:
        found.extend(Finding(severity, sentence) for sentence in sentences)

    say("error", wrong_focal_lengths(recording.rig))
    _say_of_rig(recording.rig, say)
    say(*coverage(recording.rig, recording.room))
    say("note", ["no `room` is given; it is estimated from the rig"] if recording.room_is_estimated else [])
    say("note", background(recording))
    if not any(finding.severity == "error" for finding in found):
        try:
            _say_of_frames(recording, False, say)
        except InputError as error:
            say("error", [str(error)])
    return list(_sorted(found))


def _say_of_rig(rig: Rig, say: Say) -> None:
    say("warning", odd_cameras(rig))
    say("note", [sentence for camera in rig for sentence in orientation(camera)])


def _say_of_frames(recording: Recording, read_all: bool, say: Say) -> np.ndarray | None:
    """Lines of the floor on which people stand, where it is not the calibration's."""
    warnings, errors, floor = _read(recording, read_all)
    say("error", errors)
    say("warning", warnings)
    return floor


def inspect_recording(path: AnyPlaces, cameras: Sequence[str] | None = None, read_all: bool = False) -> Inspection:
    """As `check_recording`, with what a picture of the rig needs. Parameters as there."""
    places = to_places(path)
    path = places.path
    found: list[Finding] = []

    def say(severity: str, sentences: Iterable[str]) -> None:
        found.extend(Finding(severity, sentence) for sentence in sentences)

    if not places.there:
        return Inspection((Finding("error", f"{path}: no such folder"),))
    settings: dict[str, Any] = {}
    try:
        settings = places.read_settings()
        say("note", empty_settings(path))
    except InputError as error:
        say("error", [str(error)])
    room = settings.get("room")
    try:
        entries = places.read_entries()
    except InputError as error:
        say("error", [str(error)])
        return Inspection(tuple(found))
    unknown = [name for name in cameras or () if name not in {entry.name for entry in entries}]
    if unknown:
        say("error", [f"{path}: no camera named '{unknown[0]}' in the calibration; it has {', '.join(entry.name for entry in entries)}"])
    all_names = [entry.name for entry in entries]
    files, guesses = named_files(path, all_names, settings)
    if cameras is None:
        say("note", unused_views(path, all_names, files))
    entries = [entry for entry in entries if cameras is None or entry.name in cameras]

    views = _views_by_camera(path, [entry.name for entry in entries], all_names, settings, say)
    rig = _usable_rig(entries, {name: view.size for name, view in views.items()}, settings, say)
    if rig is None:
        return Inspection(_sorted(found))
    own = [views.get(camera.name) for camera in rig]
    say("error", wrong_sizes(rig, own))
    say("error", wrong_focal_lengths(rig))
    say("error", wrong_units(rig, path))
    say("warning", gaps(own))
    say("note", rates([view.fps for view in own if view is not None]))
    _say_of_rig(rig, say)
    if not wrong_units(rig):
        room = estimate_room(rig) if room is None else room
        say(*coverage(rig, room))

    recording = keypoints = floor = None
    images = tuple(None if view is None else next(read_footage(view, 0, 1, lambda line: None, ""), None) for view in own)
    if not any(finding.severity == "error" for finding in found):
        try:
            recording = open_recording(places, cameras=cameras)
        except InputError as error:
            say("error", [str(error)])
    if recording is not None:
        say("warning", [problem for problem in recording.problems if problem not in guesses])
        say("note", [problem for problem in recording.problems if problem in guesses])
        if recording.room_is_estimated:
            low, high = recording.room.round(1).tolist()
            say("note", [f"recording.toml gives no `room`; estimated from the rig: {low} to {high} m"])
        say("note", background(recording))
        floor = _say_of_frames(recording, read_all, say)
        try:
            source = open_keypoints(recording)
            keypoints = None if source is None else keypoint_agreement(recording, source)
            say("warning", [] if source is None else source.notes)
            say("warning", [] if keypoints is None else keypoint_findings(keypoints, places))
        except InputError as error:
            say("warning", [str(error)])
    return Inspection(_sorted(found), rig, room, images, recording, keypoints, floor)


def _sorted(found: Sequence[Finding]) -> tuple[Finding, ...]:
    order = ("error", "warning", "note")
    return tuple(sorted(dict.fromkeys(found), key=lambda finding: order.index(finding.severity)))


def _views_by_camera(
    path: Path, names: Sequence[str], all_names: Sequence[str], settings: Mapping[str, Any], say: Say
) -> dict[str, Footage]:
    """The images, or else the silhouettes, of each camera that has some; what is wrong with the others is told."""
    unreadable = set()

    def on_error(name: str, sentence: str) -> None:
        unreadable.add(name)
        say("error", [sentence])

    footage, silhouettes = find_views(path, names, all_names, count=False, on_error=on_error, settings=settings)
    views = {name: image or mask for name, image, mask in zip(names, footage, silhouettes, strict=True)}
    say("error", missing_views(path, names, [views[name] for name in names], unreadable))
    say("error", shared_videos(path, names, footage))
    return {name: view for name, view in views.items() if view is not None}


def _usable_rig(
    entries: Sequence[CalibrationEntry], sizes: dict[str, tuple[int, int]], settings: Mapping[str, Any], say: Say
) -> Rig | None:
    cameras: list[Camera] = []
    for entry in entries:
        try:
            cameras.append(fitted(build_camera(entry, sizes, world_of(settings)), sizes, settings))
        except InputError as error:
            say("error", [str(error)])
    try:
        return Rig(tuple(cameras))
    except InputError as error:
        if cameras:
            say("error", [str(error)])
        return None


def empty_settings(path: Path) -> list[str]:
    """A sentence on a ``recording.toml`` without a letter in it, which is as good as none: was it saved?"""
    file = path / "recording.toml"
    if not file.is_file() or read_text_file(file).strip():
        return []
    return [f"{file} is empty: frames a second, the room and all else are taken from the videos or estimated; was it saved?"]


def named_files(path: Path, names: Sequence[str], settings: Mapping[str, Any]) -> tuple[set[Path], set[str]]:
    """Files that are cameras' without bearing their names, and the sentences on those that were guessed."""
    files: set[Path] = set()
    guesses: set[str] = set()
    for kind in FILES:
        try:
            found = find_files(path, kind, names, settings)
        except InputError:
            continue  # told where the files are opened
        files.update(Path(realpath(file)) for own in found.files.values() for file in own)
        guesses.update(found.notes.values())
    return files, guesses


def unused_views(path: Path, names: Sequence[str], files: set[Path]) -> list[str]:
    """A sentence for each video or image folder without a camera in the calibration; of many in one folder, one for all."""
    sentences = []
    for kind in FILES:
        unused = [
            item
            for item in footage_items(path / kind)
            if item_name(item) not in names and not any(Path(realpath(item)) in (file, *file.parents) for file in files)
        ]
        if len(unused) > MANY_FILES:
            sentences.append(
                f"{path / kind}: {len(unused)} files and folders with no camera's name ({unused[0].name}, ...); they are not used"
            )
        else:
            sentences.extend(f"{item}: no camera of this name in the calibration; it is not used" for item in unused)
    return sentences


def rates(fps: Sequence[float | None]) -> list[str]:
    """A sentence when the videos' frame rates differ by more than 1 %."""
    known = [rate for rate in fps if rate]
    if rates_differ(known):
        return [f"videos differ in frame rate ({min(known):g} to {max(known):g} a second); their frames are matched by their time stamps"]
    return []


def orientation(camera: Camera) -> list[str]:
    """A sentence when the image is upside down or lies on its side."""
    right_up, down_up = camera.rotation[0, 2], camera.rotation[1, 2]
    if abs(camera.rotation[2, 2]) > 0.95:
        return []  # looks straight down or up: there is no upright
    if down_up > abs(right_up):
        return [f"camera '{camera.name}' is mounted upside down (fine, the calibration says so)"]
    if abs(right_up) > abs(down_up):
        return [f"camera '{camera.name}' lies on its side (fine, the calibration says so)"]
    return []


def coverage(rig: Rig, room: np.ndarray) -> tuple[str, list[str]]:
    """Severity and sentences on how much of the room, up to 2 m, the cameras see."""
    top = min(room[1, 2], room[0, 2] + 2.0)
    axes = [np.linspace(room[0, i], high, 15) for i, high in enumerate((room[1, 0], room[1, 1], top))]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    seen = np.array([in_view(camera, points) for camera in rig])
    if not seen.any():
        return "error", ["no camera sees anything of the room; do calibration and `room` share origin, axes and units (metres, z up)?"]
    blind = [
        f"camera '{camera.name}' sees {'nothing' if not views.any() else f'only {views.mean():.1%}'} of the room; is its calibration right?"
        for camera, views in zip(rig, seen, strict=True)
        if views.mean() < 0.02
    ]
    several = float((seen.sum(axis=0) >= min(2, len(rig))).mean())
    if several < 0.5:
        blind.append(f"only {several:.0%} of the room is seen by two cameras or more; give a smaller `room` in recording.toml")
    if len(rig) < 3:
        blind.append(f"{len(rig)} camera{'s' * (len(rig) > 1)} cannot tell a body's shape; a pose needs four or more around the room")
    return "warning", blind


def background(recording: Recording) -> list[str]:
    """A sentence when there are no or few frames of the empty scene."""
    if recording.has_silhouettes and not recording.has_images:
        return []
    counts = dict(zip(recording.rig.names, recording.n_background_frames, strict=True))
    none = [name for name, n in counts.items() if n == 0]
    few = [name for name, n in counts.items() if 0 < n < FEW_BACKGROUND_FRAMES]
    sentences = []
    if none and not recording.has_silhouettes:
        subject = "no camera has" if len(none) == len(counts) else f"{', '.join(none)} have no"
        sentences.append(f"{subject} frames of the empty scene in background/; the temporal median of the recording takes their place")
    if few:
        sentences.append(f"{', '.join(few)} have fewer than {FEW_BACKGROUND_FRAMES} frames of the empty scene; 30 or more are better")
    return sentences


def _read(recording: Recording, read_all: bool) -> tuple[list[str], list[str], np.ndarray | None]:
    """Warnings of what turns up while reading, why the calibration's world is not the recording's room, and lines of the floor then."""
    sentences: list[str] = []
    n = min(recording.n_frames, PROBE_FRAMES)
    wanted = {recording.start + round(i) for i in np.linspace(0, n - 1, COMPARED_FRAMES)}
    probes: list[Frame] = []
    dark: set[str] = set()
    for frame in iterate_frames(recording, last=None if read_all else recording.start + n, on_problem=sentences.append):
        if frame.index in wanted:
            probes.append(frame)
    for camera, image in zip(recording.rig, probes[0].images, strict=True):
        if image is not None and image.max() < 10:
            dark.add(camera.name)
    sentences.extend(f"camera '{name}': its first image is black" for name in sorted(dark))
    masks = probe_masks(recording, probes)
    wrong_world, off_floor, ground = world_findings(recording, masks)
    sentences.extend(off_floor)
    if not wrong_world:
        sentences.extend(hull_findings(recording, masks, told_floor=bool(off_floor)))
    return sentences, wrong_world, None if ground is None else floor_lines(ground)
