"""A result in the formats of other programs (docs/exports.md): which format takes what, and what was done about gaps."""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.errors import InputError
from hmc.io.export.bvh import write_bvh
from hmc.io.export.c3d import MOST_FRAMES, write_c3d
from hmc.io.export.glb import MovingBody, write_glb
from hmc.io.export.mot import write_mot
from hmc.io.export.osim import refuse_other_model, write_osim
from hmc.io.export.tables import write_csv, write_parquet
from hmc.io.export.trc import write_trc
from hmc.landmarks import FOOT_POINTS, LANDMARKS
from hmc.motion.body_tree import flesh_meshes, joint_tree
from hmc.motion.gaps import complete_states
from hmc.motion.trajectory import Trajectory

__all__ = ["FORMATS", "Exported", "export_trajectories", "format_of"]


@dataclass(frozen=True)
class Exported:
    """What was written: the files, and what a user should know, one line each."""

    paths: tuple[Path, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Format:
    """Whether a format needs states, whether each person is written without regard to the others, and what writes it."""

    states: bool
    apart: bool
    write: Callable[[Path, Sequence[Trajectory]], Exported]


def format_of(path: str | Path) -> str:
    """The format that a file's suffix names.

    Raises
    ------
    InputError
        When there is none.
    """
    suffix = _suffix(Path(path))
    if suffix not in FORMATS:
        raise InputError(f"{path}: no format of that suffix; there are {', '.join(FORMATS)}")
    return suffix


def _suffix(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")


def export_trajectories(found: Sequence[Trajectory], out: str | Path, kind: str | None = None) -> Exported:
    """Write trajectories as files of another program.

    Parameters
    ----------
    found : sequence of Trajectory
        At least one.
    out : path
        The file. Where there are several persons and the format holds one, ``_person_N`` is put before the suffix.
    kind : str, optional
        A key of `FORMATS`; by default what the suffix says.

    Returns
    -------
    Exported

    Raises
    ------
    InputError
        When there is no such format, the suffix is another's, it needs angles and the result has none, there are more frames than it
        holds (C3D), or a package is missing.
    """
    out = Path(out)
    suffix = _suffix(out)
    if kind and suffix in FORMATS and suffix != kind:
        raise InputError(f"{out}: ends as {suffix} does, and {kind} is asked for: other programs go by the ending; change one of them")
    kind = kind or format_of(out)
    chosen = FORMATS[kind]
    if chosen.states and any(one.states is None for one in found):
        raise InputError(f"{kind} needs the body's angles, and this result has no pose.npz; trc, c3d, csv and parquet do without")
    if not chosen.apart or len(found) == 1:
        return chosen.write(out, found)
    parts = [chosen.write(_of_person(out, one), [one]) for one in found]
    return Exported(tuple(path for part in parts for path in part.paths), tuple(note for part in parts for note in part.notes))


def _of_person(out: Path, one: Trajectory) -> Path:
    return out.with_stem(f"{out.stem}_person_{one.person}")


def _span(found: Sequence[Trajectory]) -> tuple[int, int]:
    """The first and the last frame in which anybody is there."""
    return min(int(one.frames[0]) for one in found), max(int(one.frames[-1]) for one in found)


def _trc(path: Path, found: Sequence[Trajectory]) -> Exported:
    (one,) = found
    names, positions = one.points
    write_trc(path, names, one.frames, positions, one.fps)
    return Exported((path,), ())


def _c3d(path: Path, found: Sequence[Trajectory]) -> Exported:
    first, last = _span(found)
    labels, parts = [], []
    for one in found:
        names, positions = one.points
        spread = np.full((last - first + 1, len(names), 3), np.nan)
        spread[one.frames - first] = positions
        parts.append(spread)
        labels += [name if len(found) == 1 else f"person_{one.person}:{name}" for name in names]
    write_c3d(path, labels, first, np.concatenate(parts, axis=1), found[0].fps)
    said = (
        f"{path}: its header has no number above {MOST_FRAMES} and counts from 1, which is frame {first} of the recording; "
        f"TRIAL:ACTUAL_START_FIELD says {first + 1}"
    )
    return Exported((path,), (said,) if last + 1 > MOST_FRAMES else ())


def _bvh(path: Path, found: Sequence[Trajectory]) -> Exported:
    """A file a person. Rows have no times and programs play every file from its first, so all files have the frames of all persons."""
    first, last = _span(found)
    paths, notes = [], []
    for one in found:
        own = path if len(found) == 1 else _of_person(path, one)
        tree, states, said = _moving(one)
        notes += said
        before, behind = int(one.frames[0]) - first, last - int(one.frames[-1])
        if before or behind:
            notes.append(
                f"person {one.person}: is there in frames {one.frames[0]} to {one.frames[-1]} of the recording, which are rows "
                f"{before + 1} to {before + len(states)} of {last - first + 1}; the first pose is held before and the last behind, so that "
                "all BVH files begin and end together"
            )
        write_bvh(own, tree, np.pad(states, ((before, behind), (0, 0)), mode="edge"), one.fps)
        paths.append(own)
    return Exported(tuple(paths), tuple(notes))


def _mot(path: Path, found: Sequence[Trajectory]) -> Exported:
    (one,) = found
    tree, states, notes = _moving(one)
    refuse_other_model(path.with_suffix(".osim"))
    write_mot(path, tree.dof_names, one.times_s, states)
    write_osim(path.with_suffix(".osim"), tree)
    return Exported((path, path.with_suffix(".osim")), notes)


def _glb(path: Path, found: Sequence[Trajectory]) -> Exported:
    bodies, notes = [], []
    for k, one in enumerate(found):
        tree, states, said = _moving(one)
        color = colorsys.hsv_to_rgb((0.58 + 0.31 * k) % 1.0, 0.45, 0.85)
        bodies.append(MovingBody(f"person_{one.person}", tree, one.times_s, states, flesh_meshes(one.body), color))  # type: ignore[arg-type]
        notes += said
    write_glb(path, bodies)
    return Exported((path,), tuple(notes))


def _moving(one: Trajectory):
    """The tree, states without gaps, and a note where they had some."""
    states, filled = complete_states(one)
    said = f"person {one.person}: the format has no gaps; what is not known in {filled} of {len(states)} frames is put straight between"
    return joint_tree(one.body), states, (said,) if filled else ()  # type: ignore[arg-type]


def _csv(path: Path, found: Sequence[Trajectory]) -> Exported:
    write_csv(path, _columns(found))
    return Exported((path,), ())


def _parquet(path: Path, found: Sequence[Trajectory]) -> Exported:
    write_parquet(path, _columns(found), {"units": "metres, seconds, radians", "axes": "right-handed, z up, floor at z = 0"})
    return Exported((path,), ())


def _columns(found: Sequence[Trajectory]) -> dict[str, np.ndarray]:
    """Columns of all persons: landmarks, views and trust where they are known, the body's degrees of freedom where there are any."""
    columns = {
        "frame": np.concatenate([one.frames for one in found]),
        "time_s": np.concatenate([one.times_s for one in found]),
        "person": np.concatenate([np.full(len(one.frames), one.person) for one in found]),
    }
    feet = [one.feet for one in found]
    every = [*LANDMARKS, *(FOOT_POINTS if any(one is not None for one in feet) else ())]
    positions = np.full((len(columns["frame"]), len(every), 3), np.nan)
    positions[:, : len(LANDMARKS)] = np.concatenate([one.positions for one in found])
    if len(every) > len(LANDMARKS):
        shape = len(FOOT_POINTS), 3
        positions[:, len(LANDMARKS) :] = np.concatenate(
            [np.full((len(one.frames), *shape), np.nan) if own is None else own for one, own in zip(found, feet, strict=True)]
        )
    columns |= {f"{name}_{axis}_m": positions[:, k, a] for k, name in enumerate(every) for a, axis in enumerate("xyz")}
    for what, of_each in (("views", [one.views for one in found]), ("trust", [one.trust for one in found])):
        if any(values is not None for values in of_each):
            whole = [
                np.full(one.positions.shape[:2], np.nan) if values is None else values for one, values in zip(found, of_each, strict=True)
            ]
            columns |= {f"{name}_{what}": values for name, values in zip(LANDMARKS, np.concatenate(whole).T, strict=True)}
    if any(one.states is not None for one in found):
        states = np.concatenate([np.full((len(one.frames), len(DOF_NAMES)), np.nan) if one.states is None else one.states for one in found])
        columns |= {f"{name}_{'m' if k < 3 else 'rad'}": states[:, k] for k, name in enumerate(DOF_NAMES)}
    return columns


FORMATS: dict[str, _Format] = {
    "trc": _Format(False, True, _trc),
    "c3d": _Format(False, False, _c3d),
    "bvh": _Format(True, False, _bvh),
    "mot": _Format(True, True, _mot),
    "glb": _Format(True, False, _glb),
    "csv": _Format(False, False, _csv),
    "parquet": _Format(False, False, _parquet),
}
