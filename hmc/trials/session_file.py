"""``session.toml``: many trials of one rig on one day, of which each is a recording that lacks what the session gives it.

Paths in it are from its own folder. All faults of a file are told at once.
"""

from __future__ import annotations

import difflib
import fnmatch
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from hmc.errors import InputError
from hmc.io.calibration import find_calibration
from hmc.io.door import read_toml_file
from hmc.io.files import matching, real_path
from hmc.io.naming import PLACE
from hmc.io.places import RecordingPlaces
from hmc.io.settings import check_settings

__all__ = ["Session", "SessionPerson", "Trial", "chosen_trials", "places_in_session", "read_session"]

#: In the pattern of videos, where a trial's name goes.
TRIAL = "{trial}"
KEYS = ("name", "calibration", "background", "trials", "videos", "recording", "pose", "person", "trial")
PERSON_KEYS = ("name", "height_m")
TRIAL_KEYS = ("name", "folder", "videos", "persons", "start", "frames", "recording", "pose")


@dataclass(frozen=True)
class SessionPerson:
    """Someone who is in trials; the stature is None where it is not known."""

    name: str
    height_m: float | None = None

    def __str__(self) -> str:
        return self.name if self.height_m is None else f"{self.name} ({self.height_m:g} m)"


@dataclass(frozen=True)
class Trial:
    """One recording of a session.

    Parameters
    ----------
    name : str
        Of its folder in the results too.
    places : RecordingPlaces
    persons : tuple of SessionPerson
        Who is in it, where that is said.
    pose : mapping
        Options of `hmc pose`, by their names without the dashes; those of ``start`` and ``frames`` too.
    """

    name: str
    places: RecordingPlaces
    persons: tuple[SessionPerson, ...] = ()
    pose: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Session:
    """A session as its file says.

    Parameters
    ----------
    path : Path
        The file.
    name : str
    base : RecordingPlaces
        Of a recording in none of its trials: what the session gives alone.
    trials : tuple of Trial
        Those that the pattern finds, by name, then others in the file's order.
    """

    path: Path
    name: str
    base: RecordingPlaces
    trials: tuple[Trial, ...]


def read_session(path: str | Path) -> Session:
    """Read a session's file.

    Parameters
    ----------
    path : path
        The file, or the folder in which ``session.toml`` is.

    Raises
    ------
    InputError
        When it cannot be read, or anything in it is wrong: one line that has all faults.
    """
    path = Path(path)
    path = path / "session.toml" if path.is_dir() else path
    if not path.exists():
        raise InputError(f"{path}: no such file; a session is a TOML file that names the trials (docs/sessions.md)")
    table = read_toml_file(path)
    reading = _Reading(path, [])
    session = reading.session(table)
    if reading.faults:
        count = f"{len(reading.faults)} faults: " if len(reading.faults) > 1 else ""
        raise InputError(f"{path}: {count}{'; '.join(reading.faults)}")
    return session


def chosen_trials(session: Session, names: Iterable[str] | None) -> tuple[Trial, ...]:
    """The trials of these names, which may have * and ? in them, in the session's order; None: all.

    Raises
    ------
    InputError
        When a name is no trial's.
    """
    if names is None:
        return session.trials
    known, wanted = [trial.name for trial in session.trials], list(names)
    for name in wanted:
        if not fnmatch.filter(known, name):
            raise InputError(f"{session.path}: no trial named `{name}`{_nearest(name, known)} (trials: {', '.join(known)})")
    return tuple(trial for trial in session.trials if any(fnmatch.fnmatchcase(trial.name, name) for name in wanted))


def places_in_session(session: Session, recording: str | Path) -> RecordingPlaces:
    """Where the parts of a recording lie, as the session has them: those of a trial, or a folder with what is the same for all trials."""
    recording = Path(recording)
    for trial in session.trials:
        if real_path(trial.places.path) == real_path(recording):
            return trial.places
    base = session.base
    return replace(base, path=recording)


@dataclass(frozen=True)
class _Reading:
    """Reads tables of one file; what is wrong is added to the faults, and something harmless stands in its place."""

    path: Path
    faults: list[str]

    def session(self, table: Mapping[str, Any]) -> Session:
        folder = self.path.parent
        self.known_keys(table, KEYS, "")
        people = self.people(table.get("person", []))
        settings = self.recording(table.get("recording", {}), "[recording]")
        calibration, background = (self.place(table, key) for key in ("calibration", "background"))
        if calibration is not None:
            try:
                find_calibration(calibration)
            except InputError as error:
                self.faults.append(f"`calibration`: {error}")
        if background is not None and not background.is_dir():
            self.faults.append(f"`background`: {background} is no folder; give one with a video or a subfolder of images a camera")
        base = RecordingPlaces(folder, calibration, background, None, settings, self.path)
        pose = self.table(table.get("pose", {}), "[pose]")
        videos = self.pattern(table.get("videos"), "`videos`")
        folders = self.by_pattern(table)
        said = self.listed(table.get("trial", []))
        names = dict.fromkeys([*folders, *said])
        found = {name: self.trial(name, said.get(name, {}), folders.get(name), base, pose, people, videos) for name in names}
        if not found and not self.faults:
            self.faults.append('no trials; say where they are: trials = "trials/*", or [[trial]] name = ...')
        return Session(self.path, self.text(table, "name", real_path(folder).name), base, tuple(found.values()))

    def listed(self, tables: Any) -> dict[str, Mapping[str, Any]]:
        """The tables of trials by their names."""
        said: dict[str, Mapping[str, Any]] = {}
        for k, one in enumerate(self.tables(tables, "trial")):
            where = f"[[trial]] {one.get('name', k + 1)}"
            self.known_keys(one, TRIAL_KEYS, where)
            name = self.text(one, "name", "", where)
            if not name:
                self.faults.append(f"{where}: `name` must be a text")
                continue
            if name in said:
                self.faults.append(f"{where}: there are two trials of this name; rename one")
            said[name] = one
        return said

    def trial(
        self,
        name: str,
        table: Mapping[str, Any],
        found: Path | None,
        base: RecordingPlaces,
        pose: Mapping[str, Any],
        people: Mapping[str, SessionPerson],
        videos: str | None,
    ) -> Trial:
        where, root = f"[[trial]] {name}", self.path.parent
        if name.startswith(".") or set(name) & set("/\\,*?[") or not name.isprintable():
            self.faults.append(
                f"[[trial]] {name!r}: a trial's name must begin with no dot and have none of / \\ , * ? [ in it, nor what cannot be "
                "printed; rename it"
            )
        pattern = self.pattern(table.get("videos"), f"{where} `videos`") or videos
        folder = root / self.text(table, "folder", "", where) if "folder" in table else found or root / name
        if "folder" in table and not folder.is_dir():
            self.faults.append(f"{where} `folder`: {folder} is no folder")
        elif not folder.is_dir() and pattern is None:
            self.faults.append(f"{where}: {folder} is no folder; give `folder`, or `videos` with {PLACE} in it")
        names = table.get("persons")
        if names is not None and not (isinstance(names, list) and all(isinstance(one, str) for one in names)):
            self.faults.append(f"{where} `persons` must be a list of names; got {names!r}")
            names = None
        for one in names or ():
            if one not in people:
                self.faults.append(f"{where} `persons`: no [[person]] named `{one}`{_nearest(one, people)}")
        who = tuple(people.values()) if names is None and len(people) == 1 else tuple(people[one] for one in names or () if one in people)
        heights = [one.height_m for one in who if one.height_m is not None]
        own = self.recording(table.get("recording", {}), f"{where} recording")
        settings = {**base.settings, **own}
        if who and "persons" not in (own if names else settings):  # whom a trial names goes before a number for all trials
            settings["persons"] = len(who)
        if heights:
            settings["subject_height_m"] = tuple(heights)
        selection = {key: table[key] for key in ("start", "frames") if key in table}
        options = {**pose, **self.table(table.get("pose", {}), f"{where} pose"), **selection}
        filled = None if pattern is None else str(root / pattern.replace(TRIAL, name))
        return Trial(name, replace(base, path=folder, videos=filled, settings=settings), who, options)

    def by_pattern(self, table: Mapping[str, Any]) -> dict[str, Path]:
        """Folders by their names."""
        pattern = table.get("trials")
        if pattern is None:
            return {}
        if not isinstance(pattern, str) or not pattern or Path(pattern).is_absolute():
            self.faults.append(f'`trials` must be a pattern of folders from here, as "trials/*"; got {pattern!r}')
            return {}
        found: dict[str, Path] = {}
        try:
            folders = matching(self.path.parent, pattern)
        except InputError as error:
            self.faults.append(f"`trials`: {pattern!r} is no pattern of folders from here ({error})")
            return {}
        for folder in folders:
            if folder.is_dir() and not folder.name.startswith("."):
                if folder.name in found:
                    self.faults.append(f"`trials`: {found[folder.name]} and {folder} have one name; rename one")
                found[folder.name] = folder
        if not found:
            self.faults.append(f"`trials`: no folder is like {pattern!r}")
        return found

    def people(self, tables: Any) -> dict[str, SessionPerson]:
        people: dict[str, SessionPerson] = {}
        for k, one in enumerate(self.tables(tables, "person")):
            where = f"[[person]] {one.get('name', k + 1)}"
            self.known_keys(one, PERSON_KEYS, where)
            name, height = self.text(one, "name", f"person {k + 1}", where), one.get("height_m")
            if height is not None and (isinstance(height, bool) or not isinstance(height, int | float) or not 0.5 <= height <= 2.6):
                self.faults.append(f"{where} `height_m` must be a stature in metres, such as 1.77; got {height!r}")
                height = None
            if name in people:
                self.faults.append(f"{where}: there are two persons of this name; rename one")
            people[name] = SessionPerson(name, height)
        return people

    def recording(self, table: Any, where: str) -> dict[str, Any]:
        checked: dict[str, Any] = {}
        for key, value in self.table(table, where).items():
            if key == "subject_height_m":
                self.faults.append(f"{where} `{key}`: statures stand with the persons: [[person]] name = ..., height_m = ...")
                continue
            try:
                checked |= check_settings({key: value}, Path(where))
            except InputError as error:
                self.faults.append(str(error))
        return checked

    def place(self, table: Mapping[str, Any], key: str) -> Path | None:
        value = table.get(key)
        if value is not None and not (isinstance(value, str) and value):
            self.faults.append(f"`{key}` must be a path; got {value!r}")
            return None
        return None if value is None else self.path.parent / value

    def pattern(self, value: Any, where: str) -> str | None:
        if value is not None and not (isinstance(value, str) and PLACE in value):
            self.faults.append(f'{where} must be a path with {PLACE} in it, as "raw/{TRIAL}_{PLACE}.mp4"; got {value!r}')
            return None
        return value

    def known_keys(self, table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
        for key in table:
            if key not in known:
                self.faults.append(f"{where}{' ' * bool(where)}unknown key `{key}`{_nearest(key, known)} (known: {', '.join(known)})")

    def text(self, table: Mapping[str, Any], key: str, otherwise: str, where: str = "") -> str:
        value = table.get(key, otherwise)
        if not isinstance(value, str):
            self.faults.append(f"{where}{' ' * bool(where)}`{key}` must be a text; got {value!r}")
            return otherwise
        return value

    def table(self, value: Any, where: str) -> Mapping[str, Any]:
        if not isinstance(value, dict):
            self.faults.append(f"{where} must be a table; got {value!r}")
            return {}
        return value

    def tables(self, value: Any, name: str) -> list[Mapping[str, Any]]:
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            self.faults.append(f"`{name}` must be tables: [[{name}]], one each")
            return []
        return value


def _nearest(name: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(known), 1, 0.0)
    return f"; did you mean `{near[0]}`?" if near else ""
