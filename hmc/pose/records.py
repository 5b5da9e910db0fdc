"""Decided rows as records of a journal, and back; particles in files beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hmc.body.joints import DOF_NAMES, canton_limits, default_limits
from hmc.body.model import BodyModel
from hmc.body.proportions import make_body
from hmc.io.files import atomic_write
from hmc.io.journal import append_journal, open_journal
from hmc.pose.person import Decided
from hmc.pose.steps.annealed import PoseState, pose_init
from hmc.pose.steps.preset import PosePreset
from hmc.search.filters import ParticleState

__all__ = ["body_of", "from_record", "keep_decided", "keep_particles", "kept_decided", "kept_particles", "to_record"]

#: Before the names of the memory's arrays in a file of particles.
_MEMORY = "memory_"


def body_of(dimensions: dict[str, float], preset: PosePreset) -> BodyModel:
    """The body of these dimensions with the preset's joint limits."""
    return make_body(dimensions, canton_limits() if preset.body == "canton" else default_limits())


def keep_decided(journal: str | Path | None, preset: PosePreset, decided: Decided, before: int) -> None:
    """Add rows to a run's journal, with what the filter goes on from beside it.

    Parameters
    ----------
    journal : path or None
        None: nothing is kept.
    preset : PosePreset
        Particles are kept where it goes on from them.
    decided : Decided
    before : int
        The last frame of the person that was decided before these rows; -1: there was none.
    """
    if journal is None:
        return
    if decided.pose is not None and (preset.refine is None or decided.pose.memory):
        keep_particles(journal, decided.person, decided.frames[-1], before, decided.pose)
    append_journal(journal, to_record(decided))


def kept_decided(journal: str | Path | None, key: str, preset: PosePreset) -> Iterator[Decided]:
    """The rows that a stopped run left, in order; the last ones of each person with what the filter goes on from.

    Parameters
    ----------
    journal, key
        As for `hmc.io.journal.open_journal`.
    preset : PosePreset
        As they were kept with.
    """
    records = open_journal(journal, key)
    last = {record["person"]: k for k, record in enumerate(records)}
    for k, record in enumerate(records):
        kept = None
        if journal is not None and last[record["person"]] == k:
            kept = kept_particles(journal, record["person"], record["frames"][-1])
        yield from_record(record, preset, *(kept or ()))


def to_record(decided: Decided) -> dict[str, Any]:
    """Plain values; the particles are not among them (`keep_particles`)."""
    record: dict[str, Any] = {
        "person": decided.person,
        "frames": list(decided.frames),
        "states": [None if np.isnan(state).any() else state for state in decided.states],
        "costs": [cost if np.isfinite(cost) else None for cost in decided.costs],
        "status": list(decided.status),
    }
    if decided.pose is not None and decided.body is not None:
        if decided.missing is not None:
            record["missing"] = [np.flatnonzero(row).tolist() for row in decided.missing]
        record |= {"pose": decided.pose.state, "velocity": decided.pose.velocity, "body": decided.body.dimensions}
    return record


def from_record(
    record: dict[str, Any],
    preset: PosePreset,
    particles: ParticleState | None = None,
    memory: dict[str, np.ndarray] | None = None,
) -> Decided:
    """What `to_record` made into a record, with these particles and this memory of the filter's."""
    started = "body" in record
    missing = None
    if "missing" in record:
        missing = np.zeros((len(record["frames"]), len(DOF_NAMES)), bool)
        for row, dofs in zip(missing, record["missing"], strict=True):
            row[dofs] = True
    return Decided(
        record["person"],
        tuple(record["frames"]),
        np.array([np.full(len(DOF_NAMES), np.nan) if state is None else state for state in record["states"]], float),
        tuple(np.nan if cost is None else cost for cost in record["costs"]),
        tuple(record["status"]),
        pose_init(np.array(record["pose"]), np.array(record["velocity"]), particles, memory) if started else None,
        body_of(record["body"], preset) if started else None,
        missing,
    )


def keep_particles(journal: str | Path, person: int, frame: int, before: int, pose: PoseState) -> None:
    """Keep a person's particles and the filter's memory beside the journal, to be called before the frame's record is added.

    There are two files a person, and that of the frame `before`, which the last record is of, is left alone: it is needed should
    the run stop between the two writes.
    """
    first, second = _particle_files(journal, person)
    with atomic_write(second if _frame_of(first) == before else first, "wb") as out:
        arrays: dict[str, Any] = {f"{_MEMORY}{name}": values for name, values in pose.memory.items()}
        np.savez(out, frame=frame, particles=pose.particles.particles, log_weights=pose.particles.log_weights, **arrays)


def kept_particles(journal: str | Path, person: int, frame: int) -> tuple[ParticleState, dict[str, np.ndarray]] | None:
    """The particles and the memory kept for this frame, if any."""
    for file in _particle_files(journal, person):
        if _frame_of(file) == frame:
            with np.load(file, allow_pickle=False) as data:
                memory = {name.removeprefix(_MEMORY): data[name] for name in data.files if name.startswith(_MEMORY)}
                return ParticleState(data["particles"], data["log_weights"]), memory
    return None


def _particle_files(journal: str | Path, person: int) -> list[Path]:
    path = Path(journal)
    return [path.with_name(f"{path.name}.{person}.{turn}.npz") for turn in (0, 1)]


def _frame_of(file: Path) -> int | None:
    """Frame of a file of particles, None where there is no file."""
    if not file.exists():
        return None
    with np.load(file, allow_pickle=False) as data:
        return int(data["frame"])
