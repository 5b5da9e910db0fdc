"""What a run leaves on disk, and reading it back.

A result is a folder with the files of `hmc.io.result_files`. The tables are long, in metres, with one header line.
Nothing here is pickled, so loading a result never runs code; every file appears whole or not at all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.io.door import MAX_FRAME_NUMBER, read_arrays, read_toml_file
from hmc.io.files import atomic_write, write_toml
from hmc.io.provenance import code_state, library_versions
from hmc.io.tables import frame_column, integer_column, read_columns
from hmc.landmarks import ENOUGH_VIEWS, LANDMARKS, TRUSTED

__all__ = [
    "PoseStates", "PoseTable", "TrackTable", "no_table", "read_centroids", "read_joints", "read_pose", "read_run",
    "read_table", "read_tracks", "run_selection", "write_joints", "write_pose", "write_run", "write_tracks",
]  # fmt: skip

JOINT_COLUMNS = ("frame", "person", "joint", "x", "y", "z")
#: Beyond them: how many cameras show a landmark clear, and how likely it is near the truth.
VIEWS_COLUMN, TRUST_COLUMN = "views", "trust"
TRACK_COLUMNS = ("frame", "person", "x", "y", "z")
HEAD_COLUMNS = ("head_x", "head_y", "head_z")
#: No coordinate is farther off, metres.
MAX_METRES = 1e9
#: Nobody's landmarks are farther apart, metres.
LARGEST_M = 20.0


@dataclass(frozen=True)
class PoseTable:
    """Landmark positions, one row a person and frame.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Absolute frame numbers of the recording.
    persons : ndarray of int, shape (n,)
        Person numbers.
    positions : ndarray, shape (n, 15, 3)
        World, metres, in the order of `hmc.landmarks.LANDMARKS`; NaN where a landmark is missing.
    views : ndarray, shape (n, 15), optional
        Cameras that show each landmark clear of all else (`hmc.pose.clear_views`); NaN where it is not known.
    names : tuple of str
        Other points than the fifteen landmarks, as `hmc.landmarks.FOOT_POINTS`.
    trust : ndarray, shape (n, 15), optional
        How likely each landmark is within 60 mm of the truth, 0 to 1 (`hmc.pose.trust`); NaN where it is not known.

    Raises
    ------
    InputError
        When the shapes disagree.
    """

    frames: np.ndarray
    persons: np.ndarray
    positions: np.ndarray
    views: np.ndarray | None = None
    names: tuple[str, ...] = LANDMARKS
    trust: np.ndarray | None = None

    def __post_init__(self) -> None:
        more = {name: (len(self.names),) for name in (VIEWS_COLUMN, TRUST_COLUMN) if getattr(self, name) is not None}
        _set_rows(self, positions=(len(self.names), 3), **more)

    @property
    def doubtful(self) -> np.ndarray | None:
        """Which landmarks are not to be relied on, bool, shape (n, 15): by their trust, or, where that is not known, by too few views.

        Landmarks that are missing are not among them. None where neither is known of any.
        """
        if self.trust is None and self.views is None:
            return None
        nothing = np.full(self.positions.shape[:2], np.nan)
        views, trust = (nothing if values is None else values for values in (self.views, self.trust))
        doubtful = np.where(np.isfinite(trust), trust < TRUSTED, views < ENOUGH_VIEWS)
        return doubtful & np.isfinite(self.positions).all(axis=2)

    def where(self, chosen: np.ndarray) -> PoseTable:
        """The chosen rows: a mask, shape (n,), or row numbers."""
        views, trust = (None if values is None else values[chosen] for values in (self.views, self.trust))
        return PoseTable(self.frames[chosen], self.persons[chosen], self.positions[chosen], views, self.names, trust)

    def of(self, person: int) -> PoseTable:
        """The rows of one person."""
        return self.where(self.persons == person)


@dataclass(frozen=True)
class TrackTable:
    """Positions of whole persons, one row a person and frame.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Absolute frame numbers of the recording.
    persons : ndarray of int, shape (n,)
        Person numbers.
    positions : ndarray, shape (n, 3)
        Centroids in the world, metres.
    heads : ndarray, shape (n, 3), optional
        Centres of the heads in the world, metres.

    Raises
    ------
    InputError
        When the shapes disagree.
    """

    frames: np.ndarray
    persons: np.ndarray
    positions: np.ndarray
    heads: np.ndarray | None = None

    def __post_init__(self) -> None:
        _set_rows(self, positions=(3,), **({} if self.heads is None else {"heads": (3,)}))

    def where(self, chosen: np.ndarray) -> TrackTable:
        """The chosen rows: a mask, shape (n,), or row numbers."""
        heads = None if self.heads is None else self.heads[chosen]
        return TrackTable(self.frames[chosen], self.persons[chosen], self.positions[chosen], heads)

    def of(self, person: int) -> TrackTable:
        """The rows of one person."""
        return self.where(self.persons == person)

    def at(self, frame: int) -> dict[int, np.ndarray]:
        """Where each person is in a frame, shape (3,), metres."""
        rows = np.flatnonzero(self.frames == frame)
        return dict(zip(self.persons[rows].tolist(), self.positions[rows], strict=True))


@dataclass(frozen=True)
class PoseStates:
    """State vectors of an articulated body, one row a person and frame, with what is needed to build the bodies again.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Absolute frame numbers of the recording.
    persons : ndarray of int, shape (n,)
        Person numbers.
    states : ndarray, shape (n, n_dof)
        Metres and radians, as `dof_names` says.
    dof_names : tuple of str
        Name of every state variable.
    bodies : mapping
        Person number to that person's dimensions: a mapping from name (`height_m`, ...) to a number or an array of numbers.
    costs : ndarray, shape (n,), optional
        What the method minimised, of each row; NaN where there is none.
    fps : float, optional
        Frames a second of the recording.

    Raises
    ------
    InputError
        When the shapes disagree.
    """

    frames: np.ndarray
    persons: np.ndarray
    states: np.ndarray
    dof_names: tuple[str, ...]
    bodies: Mapping[int, Mapping[str, float | np.ndarray]] = field(default_factory=dict)
    costs: np.ndarray | None = None
    fps: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "dof_names", tuple(str(name) for name in self.dof_names))
        _set_rows(self, states=(len(self.dof_names),), **({} if self.costs is None else {"costs": ()}))


def _set_rows(table: Any, **tails: tuple[int, ...]) -> None:
    """Turn a table's fields into arrays and check that they have one row each for the same rows."""
    kind = type(table).__name__
    for name in ("frames", "persons"):
        values = np.asarray(getattr(table, name))
        if values.ndim != 1 or (values.size and values.dtype.kind not in "iu"):
            raise InputError(f"{kind}: `{name}` must be a row of whole numbers; got shape {values.shape} of {values.dtype}")
        object.__setattr__(table, name, values.astype(np.int64))
    n = len(table.frames)
    if len(table.persons) != n:
        raise InputError(f"{kind}: `frames` has {n} rows and `persons` {len(table.persons)}")
    for name, tail in tails.items():
        values = np.asarray(getattr(table, name), float)
        if values.shape != (n, *tail):
            raise InputError(f"{kind}: `{name}` must be {(n, *tail)}; got {values.shape}")
        object.__setattr__(table, name, values)


def read_joints(path: str | Path, names: Sequence[str] = LANDMARKS) -> PoseTable:
    """Read a table `frame, person, joint, x, y, z`; `views` and `trust` too where there are such columns.

    A landmark without a row, or with an empty or `nan` coordinate, is missing (NaN). Columns beyond these are ignored.

    Parameters
    ----------
    path : path
    names : sequence of str
        Of the points in it.

    Returns
    -------
    PoseTable
        Sorted by frame, then person.

    Raises
    ------
    InputError
        When the file is missing, a column is missing, a value is no number, a joint is unknown or given twice, or people are larger than
        metres make them.
    """
    path = Path(path)
    columns, lines = read_columns(path, JOINT_COLUMNS)
    frames = frame_column(path, columns["frame"], lines)
    persons = integer_column(path, "person", columns["person"], lines)
    places = {name: place for place, name in enumerate(names)}
    joints = np.array([places.get(name.strip(), -1) for name in columns["joint"]], int)
    if (joints < 0).any():
        row = int(np.argmax(joints < 0))
        raise InputError(f"{path}, line {lines[row]}: no landmark named {columns['joint'][row]!r}; they are {', '.join(names)}")
    xyz = _points(path, ("x", "y", "z"), columns, lines)
    keys, rows = np.unique(np.stack([frames, persons], axis=1), axis=0, return_inverse=True)
    cells = rows.ravel() * len(names) + joints
    _refuse_twice(path, cells, lines, "this frame, person and joint")
    positions = np.full((len(keys) * len(names), 3), np.nan)
    positions[cells] = xyz
    _refuse_other_units(path, positions.reshape(len(keys), len(names), 3))
    more: dict[str, np.ndarray] = {}
    for name, what in ((VIEWS_COLUMN, "a number of cameras"), (TRUST_COLUMN, "a number from 0 to 1")):
        if name in columns:
            more[name] = np.full((len(keys), len(names)), np.nan)
            more[name].flat[cells] = _numbers(path, name, columns[name], lines, what)
    return PoseTable(keys[:, 0], keys[:, 1], positions.reshape(len(keys), len(names), 3), names=tuple(names), **more)


def _refuse_other_units(path: Path, positions: np.ndarray) -> None:
    """A person's landmarks are not farther apart than `LARGEST_M` in most frames: else they are in millimetres, say."""
    known = positions[np.isfinite(positions).all(axis=2).any(axis=1)]
    apart = float(np.median(np.linalg.norm(np.nanmax(known, axis=1) - np.nanmin(known, axis=1), axis=1))) if len(known) else 0.0
    if apart > LARGEST_M:
        raise InputError(f"{path}: a person's landmarks are {apart:.4g} apart; they are to be metres: divide millimetres by 1000")


def write_joints(path: str | Path, table: PoseTable) -> None:
    """Write a table `frame, person, joint, x, y, z`: metres to six decimals, sorted by frame, then person; missing landmarks as `nan`.

    With last columns `views` and `trust` (three decimals) where the table has them; empty where they are not known.
    """
    order = np.lexsort([table.persons, table.frames])
    more = [(name, digits) for name, digits in ((VIEWS_COLUMN, 0), (TRUST_COLUMN, 3)) if getattr(table, name) is not None]
    with atomic_write(path) as file:
        file.write(",".join((*JOINT_COLUMNS, *(name for name, _ in more))) + "\n")
        for row in order:
            start = f"{table.frames[row]},{table.persons[row]},"
            ends = [""] * len(table.names)
            for name, digits in more:
                values = getattr(table, name)[row]
                ends = [f"{end},{value:.{digits}f}" if value >= 0 else f"{end}," for end, value in zip(ends, values, strict=True)]
            file.writelines(
                f"{start}{name},{x:.6f},{y:.6f},{z:.6f}{end}\n"
                for name, (x, y, z), end in zip(table.names, table.positions[row], ends, strict=True)
            )


def read_tracks(path: str | Path) -> TrackTable:
    """Read a table `frame, person, x, y, z`; `head_x, head_y, head_z` too where there are such columns.

    Returns
    -------
    TrackTable
        Sorted by frame, then person.

    Raises
    ------
    InputError
        When the file is missing, a column is missing, a value is no number, or a person stands twice in a frame.
    """
    return _read_positions(Path(path), heads_needed=False)


def read_centroids(path: str | Path) -> TrackTable:
    """Read the true centroids, `frame, person, x, y, z, head_x, head_y, head_z`: as `read_tracks`, and the heads must be there."""
    return _read_positions(Path(path), heads_needed=True)


def _read_positions(path: Path, heads_needed: bool) -> TrackTable:
    columns, lines = read_columns(path, TRACK_COLUMNS + (HEAD_COLUMNS if heads_needed else ()))
    frames = frame_column(path, columns["frame"], lines)
    persons = integer_column(path, "person", columns["person"], lines)
    positions = _points(path, ("x", "y", "z"), columns, lines)
    heads = _points(path, HEAD_COLUMNS, columns, lines) if set(HEAD_COLUMNS) <= set(columns) else None
    _, cells = np.unique(np.stack([frames, persons], axis=1), axis=0, return_inverse=True)
    _refuse_twice(path, cells.ravel(), lines, "this frame and person")
    order = np.lexsort([persons, frames])
    return TrackTable(frames[order], persons[order], positions[order], None if heads is None else heads[order])


def read_table(directory: str | Path) -> PoseTable | TrackTable:
    """The `joints.csv` of a result, or its `tracks.csv` where it has no other.

    Raises
    ------
    InputError
        When there is neither of them, or it is none of its kind.
    """
    joints, tracks = (Path(directory) / name for name in ("joints.csv", "tracks.csv"))
    if not joints.exists() and not tracks.exists():
        raise no_table(directory)
    return read_joints(joints) if joints.exists() else read_tracks(tracks)


def no_table(directory: str | Path) -> InputError:
    """What is said of a folder that is no result."""
    return InputError(f"{directory}: neither joints.csv nor tracks.csv; give the folder that `hmc pose` or `hmc track` wrote")


def write_tracks(path: str | Path, table: TrackTable) -> None:
    """Write a table `frame, person, x, y, z`, with `head_x, head_y, head_z` where the table has heads; sorted by frame, then person."""
    order = np.lexsort([table.persons, table.frames])
    values = table.positions if table.heads is None else np.hstack([table.positions, table.heads])
    with atomic_write(path) as file:
        file.write(",".join(TRACK_COLUMNS + (() if table.heads is None else HEAD_COLUMNS)) + "\n")
        for row in order:
            file.write(f"{table.frames[row]},{table.persons[row]}," + ",".join(f"{value:.6f}" for value in values[row]) + "\n")


def _points(path: Path, names: Sequence[str], columns: Mapping[str, Sequence[str]], lines: np.ndarray) -> np.ndarray:
    """Three columns of numbers as (n, 3); an empty cell is NaN."""
    points = np.stack([_numbers(path, name, columns[name], lines, "a number of metres") for name in names], axis=1)
    for wrong, what in ((np.isinf(points), "an infinite coordinate"), (np.abs(points) > MAX_METRES, "a coordinate beyond any room")):
        if wrong.any():
            raise InputError(f"{path}, line {lines[np.argmax(wrong.any(axis=1))]}: {what}; write nan where there is none")
    return points


def _numbers(path: Path, name: str, cells: Sequence[str], lines: np.ndarray, what: str) -> np.ndarray:
    """A column of numbers, shape (n,); an empty cell is NaN."""
    numbers = np.empty(len(lines))
    for row, cell in enumerate(cells):
        try:
            numbers[row] = float(cell) if cell.strip() else np.nan
        except ValueError:
            raise InputError(f"{path}, line {lines[row]}: `{name}` must be {what}; got {cell!r}") from None
    return numbers


def _refuse_twice(path: Path, cells: np.ndarray, lines: np.ndarray, what: str) -> None:
    _, first = np.unique(cells, return_index=True)
    if len(first) < len(cells):
        row = np.setdiff1d(np.arange(len(cells)), first)[0]
        raise InputError(f"{path}, line {lines[row]}: {what} stood in an earlier line already")


def write_pose(path: str | Path, poses: PoseStates) -> None:
    """Write state vectors and bodies to an `.npz` file of plain arrays."""
    arrays = {"frames": poses.frames, "persons": poses.persons, "states": poses.states, "dof_names": np.array(poses.dof_names, dtype=str)}
    if poses.costs is not None:
        arrays["costs"] = poses.costs
    if poses.fps is not None:
        arrays["fps"] = np.asarray(poses.fps, float)
    for person, body in poses.bodies.items():
        for name, value in body.items():
            arrays[f"body/{int(person)}/{name}"] = np.asarray(value, float)
    with atomic_write(path, "wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_pose(path: str | Path) -> PoseStates:
    """Read back what `write_pose` wrote; never unpickles.

    Raises
    ------
    InputError
        When the file is missing, damaged, or not such a file.
    """
    data = read_arrays(path)
    try:
        bodies: dict[int, dict[str, np.ndarray]] = {}
        for key, values in data.items():
            if key.startswith("body/"):
                _, person, name = key.split("/", 2)
                values = np.asarray(values, float)
                if not np.isfinite(values).all():
                    raise ValueError(f"{key} is not finite")
                bodies.setdefault(int(person), {})[name] = values
        names = tuple(str(name) for name in data["dof_names"])
        _refuse_far(data["frames"])
        fps = float(data["fps"]) if "fps" in data else None
        if fps is not None and not 0 < fps < np.inf:
            raise ValueError(f"fps is {fps}")
        return PoseStates(data["frames"], data["persons"], data["states"], names, bodies, data.get("costs"), fps)
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise InputError(f"{path}: not a pose file of this program ({error})") from error


def _refuse_far(frames: np.ndarray) -> None:
    """Frame numbers that no recording has."""
    if frames.size and (frames.dtype.kind not in "iu" or frames.min() < 0 or frames.max() > MAX_FRAME_NUMBER):
        raise ValueError(f"frames must be from 0 to {MAX_FRAME_NUMBER}")


def write_run(path: str | Path, method: str, parameters: Mapping[str, Any], seed: int | None, **more: Any) -> None:
    """Write how a result came about: `method`, `seed`, a table of every parameter, the versions of the libraries, and which code it was.

    Parameters
    ----------
    path : path
        The `run.toml`.
    method : str
    parameters : mapping
        Plain values, nested mappings, sequences, arrays or dataclasses; keys carry their units. What is None is left out.
    seed : int or None
    **more
        Further values or tables, as `recording="..."`, `report={...}`.
    """
    run = {"method": method, "seed": seed, **more, "parameters": parameters, "versions": library_versions() | code_state()}
    write_toml(path, run)


def read_run(path: str | Path) -> dict[str, Any]:
    """Read a `run.toml`.

    Raises
    ------
    InputError
        When the file is missing or is not TOML.
    """
    return read_toml_file(path)


def run_selection(directory: str | Path, start: int | None = None, frames: int | None = None) -> tuple[int, int | None]:
    """Which frames of a result are meant: those that are asked for, and where nothing is asked those that its run was about.

    Parameters
    ----------
    directory : path
        Of the result; its `run.toml` says what the run was about, and without one that was everything.
    start, frames : int, optional
        The first that is asked for, and how many. From a first one behind the run's last: all that follow.

    Returns
    -------
    start : int
    frames : int or None
        None: all that follow.

    Raises
    ------
    InputError
        When there is a `run.toml` that is not TOML.
    """
    path = Path(directory) / "run.toml"
    parameters = read_run(path).get("parameters") if path.exists() else None
    values = [parameters.get(name) if isinstance(parameters, dict) else None for name in ("start", "frames")]
    of_run, n_of_run = (value if isinstance(value, int) else None for value in values)
    first = of_run or 0
    begin = first if start is None else start
    if frames is not None or n_of_run is None:
        return begin, frames
    return begin, first + n_of_run - begin if begin < first + n_of_run else None
