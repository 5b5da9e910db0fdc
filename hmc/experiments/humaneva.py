"""HumanEva-I as it is released, made into recordings: for those who hold the dataset.

Source: the dataset's release (Sigal, Balan and Black 2010) and its support code, v1.1. A subject's folder has
``Calibration_Data/C1.cal``, ``Image_Data/Walking_1_(C1).avi``, ``Mocap_Data/Walking_1.c3d`` and ``Sync_Data/Walking_1_(C1).ofs``, for the
cameras C1 to C3 (color) and BW1 to BW4; ``Background/Background_1_(C1).avi`` and so on lie beside the subjects. Videos are not copied: the
recording links to them.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from hmc.errors import InputError
from hmc.io.c3d import PointData, read_c3d
from hmc.io.calibration import build_camera, natural_key, write_calibration
from hmc.io.calibration.cal import read_cal
from hmc.io.files import real_path, write_toml
from hmc.io.footage import open_images, open_video
from hmc.io.recording import open_recording
from hmc.io.results import PoseTable, write_joints
from hmc.landmarks import LANDMARKS

__all__ = ["JOINTS", "Sync", "Take", "color_cameras", "convert_take", "find_takes", "landmark_positions", "read_sync", "synchronise"]

#: The first frames of a video are doubles of one another, for an error of the codec; the support code begins with frame 6, counted from 1.
FIRST_FRAME = 6
#: Landmarks and the points of the motion capture that are their joint centres, as the support code takes them.
JOINTS = {
    "neck": "TRXO", "l_shoulder": "LCLO", "l_elbow": "LHUO", "l_wrist": "LRAO", "r_shoulder": "RCLO", "r_elbow": "RHUO", "r_wrist": "RRAO",
    "l_hip": "LFEP", "l_knee": "LFEO", "l_ankle": "LTIO", "r_hip": "RFEP", "r_knee": "RFEO", "r_ankle": "RTIO",
}  # fmt: skip
#: From the base of the neck to the crown, along the head's upward axis (HEDO to HEDP), as the support code takes it, metres.
HEAD_LENGTH_M = 0.316103
#: Markers on the body; the support code leaves out frames that lack one of them, because joint centres are then wrong.
MARKERS = (
    "RASI LASI LPSI RPSI STRN CLAV C7 T10 RBAK LFHD RFHD LBHD RBHD LSHO RSHO LUPA RUPA LELB RELB LFRM RFRM LFRA RFRA LWRA LWRB RWRA RWRB "
    "LFIN RFIN LTHI RTHI LKNE RKNE LTIB RTIB LANK RANK LHEE RHEE LTOE RTOE"
).split()
#: Names of its cameras in color, and of those in grey.
_COLOR, _GREY = re.compile(r"C\d+"), re.compile(r"BW\d+")
_VIDEO = re.compile(r"(?P<action>[A-Za-z]+)_(?P<trial>\d+)_\((?P<camera>B?W?C?\d+)\)")


@dataclass(frozen=True)
class Sync:
    """What an ``.ofs`` file says: frame `image` of the video was taken with frame `mocap`, and a frame lasts `scale` of those. From 1."""

    image: float
    mocap: float
    scale: float


@dataclass(frozen=True)
class Take:
    """A sequence of a subject's: its files by the names of its cameras.

    Attributes
    ----------
    folder : Path
        The subject's.
    name : str
        As Walking_1.
    videos, calibrations, offsets : mapping of str to Path
    mocap : Path or None
        None where the truth is withheld.
    """

    folder: Path
    name: str
    videos: Mapping[str, Path]
    calibrations: Mapping[str, Path]
    offsets: Mapping[str, Path]
    mocap: Path | None

    @property
    def title(self) -> str:
        """Subject and sequence, as S1_Walking_1."""
        return f"{self.folder.name}_{self.name}"


def color_cameras(names: Sequence[str]) -> tuple[str, ...]:
    """The cameras in color of a HumanEva-I recording, C1 to C3; none of any other recording.

    The thesis's reconstructions from three cameras are from these (Canton 2009, section 6.7.1.1).

    Parameters
    ----------
    names : sequence of str
        Of a recording's cameras.
    """
    known = all(_COLOR.fullmatch(name) or _GREY.fullmatch(name) for name in names) and any(_GREY.fullmatch(name) for name in names)
    return tuple(name for name in names if _COLOR.fullmatch(name)) if known else ()


def find_takes(root: Path) -> list[Take]:
    """The sequences with videos in a copy of the dataset, or in the folder of one subject.

    Raises
    ------
    InputError
        When there are none.
    """
    subjects = [root] if (root / "Image_Data").is_dir() else sorted(path.parent for path in root.glob("*/Image_Data"))
    found = [take for folder in subjects for take in _takes_of(folder)]
    if not found:
        raise InputError(f"{root}: no HumanEva-I here; expected S1/Image_Data/Walking_1_(C1).avi and so on")
    return found


def _takes_of(folder: Path) -> Iterator[Take]:
    videos: dict[str, dict[str, Path]] = {}
    for path in sorted((folder / "Image_Data").iterdir(), key=lambda path: natural_key(path.name)):
        match = _VIDEO.fullmatch(path.stem if path.is_file() else path.name)
        if match and (path.is_dir() or path.suffix.lower() == ".avi"):
            videos.setdefault(f"{match['action']}_{match['trial']}", {})[match["camera"]] = path
    # the release and its copies write Data and DATA
    places = {path.name.lower(): path for path in folder.iterdir() if path.is_dir()}
    nowhere = folder / "missing"
    calibration, sync, mocap = (places.get(name, nowhere) for name in ("calibration_data", "sync_data", "mocap_data"))
    for name, own in videos.items():
        truth = mocap / f"{name}.c3d"
        yield Take(
            folder,
            name,
            own,
            {camera: calibration / f"{camera}.cal" for camera in own},
            {camera: sync / f"{name}_({camera}).ofs" for camera in own},
            truth if truth.is_file() else None,
        )


def read_sync(path: Path) -> Sync:
    """Read an ``.ofs`` file: three numbers.

    Raises
    ------
    InputError
        When it is missing or does not hold them.
    """
    try:
        numbers = [float(word) for word in path.read_text(encoding="utf-8", errors="replace").split()[:3]]
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); HumanEva's synchronisation files hold three numbers") from error
    if len(numbers) < 3 or not numbers[2] > 0:
        raise InputError(f"{path}: holds {len(numbers)} numbers; expected the frame of the video, the frame of the mocap, and the scale")
    return Sync(*numbers)


def synchronise(syncs: Mapping[str, Sync]) -> tuple[dict[str, int], float, float]:
    """Where every camera is at the first moment that all of them and the motion capture have.

    Parameters
    ----------
    syncs : mapping of str to Sync
        By camera.

    Returns
    -------
    starts : dict of str to int
        Frame of each video, from 0.
    mocap, scale : float
        Frame of the motion capture at that moment, from 1, and how many of its frames a frame of the videos lasts.
    """
    scale = float(np.mean([sync.scale for sync in syncs.values()]))
    # the moment of each video's first frame, in frames of the motion capture
    moment = max(1.0, *(sync.mocap - (sync.image - 1) * sync.scale for sync in syncs.values()))
    starts = {camera: round(sync.image + (moment - sync.mocap) / sync.scale) - 1 for camera, sync in syncs.items()}
    return starts, moment, scale


def landmark_positions(points: PointData, moments: np.ndarray) -> np.ndarray:
    """Landmarks at some moments, between the two nearest frames.

    Parameters
    ----------
    points : PointData
        With the joint centres of `JOINTS` and the head's axes.
    moments : ndarray, shape (n,)
        Frames of the motion capture, from 1, not whole.

    Returns
    -------
    ndarray, shape (n, 15, 3)
        Metres; NaN after the end, and where one of the body's markers is missing.

    Raises
    ------
    InputError
        When a joint centre is not among the points.
    """

    def track(label: str) -> np.ndarray:
        found = points.of(label)
        if found is None:
            raise InputError(f"the motion capture has no point {label}; joint centres as HumanEva's release computes them are needed")
        return found

    joints = {name: track(label) for name, label in JOINTS.items()}
    up = track("HEDP") - track("HEDO")
    joints["head_top"] = joints["neck"] + HEAD_LENGTH_M * up / np.linalg.norm(up, axis=-1, keepdims=True)
    joints["pelvis"] = (joints["l_hip"] + joints["r_hip"]) / 2
    tracks = np.stack([joints[name] for name in LANDMARKS], axis=1)
    markers = [points.labels.index(label) for label in MARKERS if label in points.labels]
    tracks[np.isnan(points.positions[:, markers]).any(axis=(1, 2))] = np.nan
    before = np.floor(moments).astype(int) - 1
    share = (moments - 1 - before)[:, None, None]
    inside = (before >= 0) & (before + (share[:, 0, 0] > 0) < len(tracks))
    first = np.where(inside, before, 0)
    second = np.minimum(first + 1, len(tracks) - 1)
    found = np.where(share > 0, (1 - share) * tracks[first] + share * tracks[second], tracks[first])
    found[~inside] = np.nan
    return found


def convert_take(take: Take, out: Path, frames: int | None = None, on_problem: Callable[[str], None] = lambda line: None) -> Path:
    """Make a recording of a take.

    Parameters
    ----------
    take : Take
    out : Path
        The recording is made in it, under the sequence's title.
    frames : int, optional
        At most so many.
    on_problem : callable
        Called with a line for everything that is left out.

    Returns
    -------
    Path
        The recording.

    Raises
    ------
    InputError
        When calibration, synchronisation or motion capture are not what they should be.
    """
    videos = dict(take.videos)
    for camera in take.videos:
        lacking = next((path for path in (take.calibrations[camera], take.offsets[camera]) if not path.is_file()), None)
        if lacking is not None:
            on_problem(f"{take.title}: camera {camera} is left out; {lacking} is not there")
            del videos[camera]
    if not videos:
        raise InputError(f"{take.folder}: {take.name} has no camera with calibration, video and synchronisation")
    starts, moment, scale = synchronise({camera: read_sync(take.offsets[camera]) for camera in videos})
    starts = {camera: start + FIRST_FRAME - 1 for camera, start in starts.items()}
    moment += (FIRST_FRAME - 1) * scale
    folder = out / take.title
    views = {camera: open_images(path) if path.is_dir() else open_video(path, count=False) for camera, path in videos.items()}
    rig = [build_camera(read_cal(take.calibrations[camera]), {camera: view.size}) for camera, view in views.items()]
    settings = {"name": take.title, "fps": 60.0, "units": "m", "up": "z", "persons": 1, "frames": frames, "first_frame": starts}
    height = _height_m(take.folder)
    write_toml(folder / "recording.toml", settings | ({"subject_height_m": [height]} if height else {}))
    write_calibration(folder / "calibration.toml", rig)
    for camera, path in videos.items():
        _link(path, folder / ("images" if path.is_dir() else "videos") / (camera if path.is_dir() else f"{camera}{path.suffix}"))
    _link_background(take, videos, starts, folder, on_problem)
    if take.mocap is None:
        on_problem(f"{take.title}: has no motion capture (it is withheld for testing); the recording has no truth")
    else:
        _write_truth(take.mocap, folder, moment, scale)
    return folder


def _write_truth(mocap: Path, folder: Path, moment: float, scale: float) -> None:
    n_frames = open_recording(folder).n_frames
    try:
        positions = landmark_positions(read_c3d(mocap), moment + scale * np.arange(n_frames))
    except InputError as error:
        raise InputError(f"{mocap}: {error}" if str(mocap) not in str(error) else str(error)) from error
    seen = np.flatnonzero(~np.isnan(positions).any(axis=(1, 2)))
    write_joints(folder / "truth" / "joints.csv", PoseTable(seen, np.zeros(len(seen), int), positions[seen]))


def _link_background(
    take: Take, videos: Mapping[str, Path], starts: Mapping[str, int], folder: Path, on_problem: Callable[[str], None]
) -> None:
    """Link to the empty scene that is most like the sequence: three were filmed, over a week."""
    place = take.folder.parent / "Background"
    sets: dict[str, dict[str, Path]] = {}
    for path in sorted(place.glob("Background_*_(*).avi")) if place.is_dir() else ():
        match = _VIDEO.fullmatch(path.stem)
        if match and match["camera"] in videos:
            sets.setdefault(match["trial"], {})[match["camera"]] = path
    if not sets:
        on_problem(f"{take.title}: no {place}/Background_1_(C1).avi; silhouettes are cut from the sequence itself")
        return
    firsts = {camera: _frame(path, starts[camera]) for camera, path in videos.items()}
    best = min(sets.values(), key=lambda own: _difference(own, firsts))
    for camera, path in best.items():
        _link(path, folder / "background" / f"{camera}{path.suffix}")


def _difference(backgrounds: Mapping[str, Path], firsts: Mapping[str, np.ndarray | None]) -> float:
    """How far an empty scene is from the first frames, in levels: the median over pixels, so that who stands there does not count."""
    differences = []
    for camera, path in backgrounds.items():
        empty, image = _frame(path, 0), firsts[camera]
        if empty is not None and image is not None and empty.shape == image.shape:
            differences.append(float(np.median(cv2.absdiff(empty, image))))
    return float(np.mean(differences)) if differences else float("inf")


def _frame(path: Path, index: int) -> np.ndarray | None:
    """A frame of a video, or of a folder of images."""
    if path.is_dir():
        images = open_images(path).images or {}
        return cv2.imread(str(images[index]), cv2.IMREAD_COLOR) if index in images else None
    capture = cv2.VideoCapture(str(path))
    try:
        for _ in range(index):
            capture.grab()
        return capture.read()[1]
    finally:
        capture.release()


def _height_m(folder: Path) -> float | None:
    """The subject's stature of the file of measurements (millimetres), where it is there."""
    for path in folder.glob("*/*.mp"):
        match = re.search(r"^\$?Height\s*=\s*([\d.]+)", path.read_text(encoding="utf-8", errors="replace"), re.MULTILINE)
        if match and 1000 < float(match[1]) < 2300:
            return float(match[1]) / 1000
    return None


def _link(source: Path, place: Path) -> None:
    """Point to a file or folder, or copy it where there are no links."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.is_symlink() or place.is_file():
            place.unlink()
        elif place.is_dir():
            shutil.rmtree(place)
        try:
            os.symlink(real_path(source), place)
        except OSError:
            (shutil.copytree if source.is_dir() else shutil.copyfile)(source, place)
    except OSError as error:
        raise InputError(f"{place}: cannot be written ({error.strerror})") from error
