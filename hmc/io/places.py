"""Where the parts of a recording lie: its own folder, and elsewhere what that lacks.

A trial of a session has no calibration and no empty scene of its own: the session has one for all of its trials. What the folder itself has
goes before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hmc.errors import InputError
from hmc.io.calibration import CalibrationEntry, find_calibration, read_entries
from hmc.io.calibration.read import PATTERNS
from hmc.io.files import real_path
from hmc.io.naming import FILES, find_files
from hmc.io.settings import read_settings

if TYPE_CHECKING:
    from hmc.io.recording import Recording

__all__ = ["AnyPlaces", "RecordingPlaces", "places_of", "to_places"]

#: So many of the patterns of calibrations match nothing else: a camera's own .xml or .yml beside a trial's videos is none.
OF_RIGS = 10
#: Files of a recording on which its results depend, besides the calibration and what recording.toml names.
SOURCES = (
    "recording.toml",
    "videos/*",
    "videos/*/*",
    "images/*/*",
    "images/*",
    "silhouettes/*",
    "silhouettes/*/*",
    "background/*",
    "background/*/*",
    "keypoints/*",
    "keypoints/*/*",
    "markers/*",
    "times/*",
    "pose/*/*",
)
#: The folders of a recording in which they lie, and the truth.
FOLDERS = (*dict.fromkeys(pattern.partition("/")[0] for pattern in SOURCES if "/" in pattern), "truth")


@dataclass(frozen=True)
class RecordingPlaces:
    """Where the parts of a recording lie.

    Parameters
    ----------
    path : Path
        Its own folder; it need not be there where there is a pattern of videos.
    calibration : Path or None
        File or folder of the calibration, where its own folder has none.
    background : Path or None
        Folder with a video or a subfolder of images a camera, where its own folder has none.
    videos : str or None
        Path of the cameras' videos with ``{camera}`` in it, where its own folder has no videos/.
    settings : mapping
        Keys of ``recording.toml``, checked, where its own does not say.
    session : Path or None
        File of the session that gives all this, for commands that are proposed.
    """

    path: Path
    calibration: Path | None = None
    background: Path | None = None
    videos: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    session: Path | None = None

    @property
    def there(self) -> bool:
        """Whether there may be a recording: its folder is there, or not needed."""
        return self.path.is_dir() or self.videos is not None

    def read_settings(self) -> dict[str, Any]:
        """Checked settings, as `hmc.io.settings.read_settings`."""
        own = self.path / "videos"
        elsewhere = {} if self.videos is None or own.is_dir() else {"videos": Path(self.videos)}
        return {**self.settings, **elsewhere, **read_settings(self.path)}

    def read_entries(self) -> list[CalibrationEntry]:
        """What the calibration states, as `hmc.io.calibration.read_entries`."""
        return read_entries(self.calibration_place)

    @property
    def calibration_place(self) -> Path:
        """The file or folder that the calibration is looked for in."""
        if self.calibration is None:
            return self.path
        folders = (self.path, self.path / "calibration")
        own = any(next(folder.glob(pattern), None) is not None for folder in folders for pattern in PATTERNS[:OF_RIGS])
        return self.path if own else self.calibration

    @property
    def background_folder(self) -> Path:
        """The folder of the empty scene."""
        own = self.path / "background"
        return own if self.background is None or own.is_dir() else self.background

    def files_digest(self) -> str:
        """Digest of the files on which results depend: which there are, how long they are and when each last changed."""
        told = sha256()
        shown = (file for file in self._sources() if file.is_file() and not file.name.startswith("."))
        for name, file in sorted({relpath(file, self.path): file for file in shown}.items()):
            status = file.stat()
            told.update(f"{name}\0{status.st_size}\0{status.st_mtime_ns}\0".encode("utf-8", "surrogateescape"))
        return told.hexdigest()[:16]

    def has(self, path: Path) -> bool:
        """Whether a file is one of the recording's, or would lie among those of its cameras."""
        files = [*self._sources(), *self.path.glob("truth/**/*")]
        folders = {real_path(file.parent) for file in files} - {real_path(self.path)}
        return real_path(path.parent) in folders or any(path.exists() and path.samefile(file) for file in files if file.exists())

    def looked_through(self, folder: Path) -> bool:
        """Whether a folder is, or lies in, one of the recording's in which its parts are looked for, such as videos/."""
        own, asked = Path(real_path(self.path)), Path(real_path(folder))
        return any(asked.is_relative_to(own / name) for name in FOLDERS)

    def _sources(self) -> list[Path]:
        files = [file for pattern in SOURCES for file in self.path.glob(pattern)]
        with suppress(InputError):  # told where it is read
            files += [both for file in find_calibration(self.calibration_place) for both in (file, *_other_of_pair(file))]
        files += self._named_files()
        if self.background is not None and self.background_folder == self.background:
            files += [*self.background.glob("*"), *self.background.glob("*/*")]
        return files

    def _named_files(self) -> Iterator[Path]:
        """What recording.toml or the session says is the cameras', and what is in folders of theirs."""
        try:
            settings, names = self.read_settings(), [entry.name for entry in self.read_entries()]
        except InputError:  # told where they are read
            return
        for kind in FILES:
            with suppress(InputError):
                for file in (file for own in find_files(self.path, kind, names, settings).files.values() for file in own):
                    yield file
                    yield from file.glob("*")


def _other_of_pair(file: Path) -> list[Path]:
    """EasyMocap's calibration is two files, of which the first is found."""
    return [file.with_stem("extri")] if file.stem.lower() == "intri" else []


#: A recording's folder, or where its parts lie.
AnyPlaces = str | Path | RecordingPlaces


def to_places(given: AnyPlaces) -> RecordingPlaces:
    """The places of a recording of which only the folder is given."""
    return given if isinstance(given, RecordingPlaces) else RecordingPlaces(Path(given))


def places_of(recording: Recording) -> RecordingPlaces:
    """Where the parts of an opened recording lie."""
    return recording.places or RecordingPlaces(recording.path)
