"""Decided rows as records of a journal, and back; what a method remembers of a person in files beside it. The same for all methods."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.body.proportions import make_body
from hmc.errors import InputError
from hmc.io.door import read_arrays
from hmc.io.files import atomic_write
from hmc.io.journal import append_journal, open_journal
from hmc.pose.method import StepInfo, Tracked, begin_tracking
from hmc.pose.person import DecidedFrames, PoseTask

__all__ = ["from_record", "keep_decided", "kept_decided", "to_record", "with_angles"]

_logger = logging.getLogger("hmc")

#: Before the names of the memory's arrays in a file.
_MEMORY = "memory_"


def keep_decided(journal: str | Path | None, decided: DecidedFrames, before: int) -> None:
    """Add rows to a run's journal, with what the method goes on from beside it.

    Parameters
    ----------
    journal : path or None
        None: nothing is kept.
    decided : DecidedFrames
    before : int
        The last frame of the person that was decided before these rows; -1: there was none.
    """
    if journal is None:
        return
    if decided.tracked is not None and decided.tracked.memory:
        _keep_memory(journal, decided, before)
    append_journal(journal, to_record(decided))


def with_angles(key: str) -> str:
    """What a journal of poses depends on: the run's key, and which angles its states have."""
    return f"{key}\n{' '.join(DOF_NAMES)}"


def kept_decided(
    journal: str | Path | None, key: str, task: PoseTask, on_problem: Callable[[str], None] = _logger.warning
) -> Iterator[DecidedFrames]:
    """The rows that a stopped run left, in order; the last ones of each person with what the method goes on from.

    Parameters
    ----------
    journal, key
        As for `hmc.io.journal.open_journal`.
    task : PoseTask
        As they were kept with.
    on_problem : callable
        Called with one line where the journal is damaged, or what the method goes on from does not fit it: then it is begun anew.
    """
    records = open_journal(journal, with_angles(key), on_problem)
    last = {record["person"]: k for k, record in enumerate(records)}
    memories = {k: _kept_memory(journal, person, records[k]) for person, k in last.items()} if journal is not None else {}
    if any(memory is None for memory in memories.values()) and journal is not None:
        on_problem(f"{journal}: what the method remembers of a person is damaged or of another frame; poses are begun anew")
        Path(journal).unlink()
        records, last = open_journal(journal, with_angles(key), on_problem), {}
    for k, record in enumerate(records):
        decided = from_record(record, task)
        if last[record["person"]] == k and decided.body is not None and journal is not None:
            subject = task.method.equip(decided.body, task.capture)
            memory = memories[k] or {}
            pose, velocity = np.array(record["pose"], float), np.array(record["velocity"], float)
            decided = replace(decided, tracked=begin_tracking(subject, pose, velocity, memory))
        yield decided


def to_record(decided: DecidedFrames) -> dict[str, Any]:
    """Plain values; the memory is not among them."""
    infos = decided.infos
    record: dict[str, Any] = {
        "person": decided.person,
        "frames": list(decided.frames),
        "states": [None if np.isnan(state).any() else state for state in decided.states],
        "costs": [info.cost if np.isfinite(info.cost) else None for info in infos],
        "status": [info.status for info in infos],
    }
    if any(info.missing is not None for info in infos):
        record["missing"] = [[] if info.missing is None else np.flatnonzero(info.missing).tolist() for info in infos]
    if any(info.details for info in infos):
        record["details"] = [dict(info.details) for info in infos]
    if decided.tracked is not None and decided.body is not None:
        if decided.tracked.memory:
            record["remembers"] = sorted(decided.tracked.memory)
        record |= {"pose": decided.tracked.state, "velocity": decided.tracked.velocity, "body": decided.body.dimensions}
    return record


def from_record(record: dict[str, Any], task: PoseTask) -> DecidedFrames:
    """What `to_record` made into a record, without what the method goes on from."""
    n = len(record["frames"])
    missing: list[np.ndarray | None] = [None] * n
    for k, dofs in enumerate(record.get("missing", ())):
        missing[k] = np.isin(np.arange(len(DOF_NAMES)), dofs) if dofs else None
    details = record.get("details", [{}] * n)
    infos = tuple(
        StepInfo(status, np.nan if cost is None else cost, missing=lost, details=told)
        for status, cost, lost, told in zip(record["status"], record["costs"], missing, details, strict=True)
    )
    states = np.array([np.full(len(DOF_NAMES), np.nan) if state is None else state for state in record["states"]], float)
    body = make_body(record["body"], task.method.limits) if "body" in record else None
    return DecidedFrames(record["person"], tuple(record["frames"]), states, infos, None, body)


def _keep_memory(journal: str | Path, decided: DecidedFrames, before: int) -> None:
    """Keep a person's memory beside the journal, to be called before the frame's record is added.

    There are two files a person, and that of the frame `before`, which the last record is of, is left alone: it is needed should
    the run stop between the two writes.
    """
    first, second = _memory_files(journal, decided.person)
    tracked: Tracked | None = decided.tracked
    arrays: dict[str, Any] = {f"{_MEMORY}{name}": values for name, values in (tracked.memory if tracked else {}).items()}
    with atomic_write(second if _frame_of(first) == before else first, "wb") as out:
        np.savez(out, frame=decided.frames[-1], **arrays)


def _kept_memory(journal: str | Path, person: int, record: dict[str, Any]) -> dict[str, np.ndarray] | None:
    """The memory that belongs to a record; empty where there was none, None where it is lost."""
    names = record.get("remembers", [])
    for file in _memory_files(journal, person) if names else ():
        kept = _arrays_of(file)
        if _frame_in(kept) == record["frames"][-1] and {f"{_MEMORY}{name}" for name in names} == kept.keys() - {"frame"}:
            return {name: kept[f"{_MEMORY}{name}"] for name in names}
    return None if names else {}


def _memory_files(journal: str | Path, person: int) -> list[Path]:
    path = Path(journal)
    return [path.with_name(f"{path.name}.{person}.{turn}.npz") for turn in (0, 1)]


def _frame_of(file: Path) -> int | None:
    """Frame of a file of a memory, None where there is no such file."""
    return _frame_in(_arrays_of(file))


def _arrays_of(file: Path) -> dict[str, np.ndarray]:
    """The arrays of a file of a memory; none where it is damaged."""
    try:
        return read_arrays(file) if file.exists() else {}
    except InputError:
        return {}


def _frame_in(kept: dict[str, np.ndarray]) -> int | None:
    frame = kept.get("frame")
    return int(frame) if frame is not None and frame.ndim == 0 and frame.dtype.kind in "iu" else None
