"""Scores of poses without each landmark's constant offset: definitions of joints told apart from mistakes (`hmc.metrics.offsets`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.errors import InputError
from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import mean_and_deviation
from hmc.metrics.offsets import LEAST_FRAMES, TRUNK, OffsetErrors, constant_offsets
from hmc.metrics.persons import frames_in_words
from hmc.metrics.scores.poses import PersonErrors

__all__ = ["OffsetEvaluation", "evaluate_offsets"]

#: Which way of the trunk's left is outward: to the left for landmarks of the left side, and for those of no side.
OUTWARD = np.array([-1.0 if name.startswith("r_") else 1.0 for name in LANDMARKS])
#: Landmarks that have a counterpart on the other side.
PAIRED = np.array([name.startswith(("l_", "r_")) for name in LANDMARKS])


@dataclass(frozen=True)
class OffsetEvaluation:
    """Constant offsets of a recording's poses, and the errors without them.

    Attributes
    ----------
    rows : tuple of dict
        The table, a row a landmark and ``overall``, for all persons and for each. ``mean_mm`` is the error as estimated, over the frames
        that are compared, ``mean_without_mm`` the same without the offset; ``offset_mm`` is the offset's length, and ``forward_mm``,
        ``outward_mm``, ``up_mm`` are its parts along the true trunk. Outward is to the left for landmarks of the left side and to the right
        for those of the right side, so that what is mirrored has one sign; for pelvis, neck and head_top it is to the left. Where a row is
        of several landmarks (``overall``) or persons (``all``), these four are plain means of theirs, of ``outward_mm`` overall of the
        paired landmarks alone: opposite offsets cancel in the parts and not in the length. ``frames``: how many the figures are of, 0 where
        there is no offset.
    summary : dict
        ``mean_mm``, ``mean_without_mm``, ``offset_mm`` and ``frames`` of all persons overall; ``constant_share``, the share of the mean
        error that goes with the offsets, in-sample, NaN where there is no error.
    notes : tuple of str
        What was left out, one line each.
    """

    rows: tuple[dict, ...]
    summary: dict
    notes: tuple[str, ...]


def evaluate_offsets(persons: Sequence[PersonErrors]) -> OffsetEvaluation:
    """Offsets of each person's landmarks, and the errors without them.

    The offsets come of the frames that they are taken off: what remains is an in-sample figure (`hmc.metrics.offsets.constant_offsets`).

    Parameters
    ----------
    persons : sequence of PersonErrors
        As `hmc.metrics.scores.evaluate_pose` matches them: ``evaluate_offsets(hmc.evaluate(people, recording).persons)``.

    Returns
    -------
    OffsetEvaluation

    Raises
    ------
    InputError
        When the truth has no trunk in any frame with an estimate, hence no axes along which they could be measured.
    """
    found = {person.person: constant_offsets(person.estimate, person.truth) for person in persons}
    without_trunk = any((own.missing | own.flat).any() for own in found.values())
    if without_trunk and not any(own.compared.any() for own in found.values()):
        raise InputError(
            f"no offsets: in no frame with an estimate does the truth have a trunk ({', '.join(TRUNK)}, not all in a line) to measure "
            "them along"
        )
    columns = {str(name): _offset_columns(own) for name, own in found.items()}
    rows = _rows("all", list(found.values()), _mean(np.stack(list(columns.values()))))
    overall = rows[-1]
    for name, own in found.items():
        rows += _rows(str(name), [own], columns[str(name)])
    summary = {name: overall[name] for name in ("mean_mm", "mean_without_mm", "offset_mm", "frames")}
    summary["constant_share"] = 1 - overall["mean_without_mm"] / overall["mean_mm"] if overall["mean_mm"] > 0 else float("nan")
    notes = [note for person in persons for note in _notes(person, found[person.person])]
    return OffsetEvaluation(tuple(rows), summary, tuple(notes))


def _offset_columns(found: OffsetErrors) -> np.ndarray:
    """Length of every landmark's offset, and its parts forward, outward and up; then their mean, shape (16, 4), metres."""
    forward, left, up = found.offsets.T
    table = np.column_stack([np.linalg.norm(found.offsets, axis=1), forward, left * OUTWARD, up])
    mean = _mean(table)
    mean[2] = _mean(table[PAIRED, 2])
    return np.vstack([table, mean])


def _rows(label: str, parts: Sequence[OffsetErrors], offsets: np.ndarray) -> list[dict]:
    errors = np.concatenate([part.errors for part in parts])
    known = np.isfinite(errors)
    columns = {
        "mean_mm": _means(errors),
        "mean_without_mm": _means(np.concatenate([part.remaining for part in parts])),
        **dict(zip(("offset_mm", "forward_mm", "outward_mm", "up_mm"), offsets.T, strict=True)),
    }
    frames = [*known.sum(axis=0), known.any(axis=1).sum()]
    return [
        {"person": label, "landmark": name}
        | {column: float(1000 * values[place]) for column, values in columns.items()}
        | {"frames": int(frames[place])}
        for place, name in enumerate((*LANDMARKS, "overall"))
    ]


def _means(errors: np.ndarray) -> np.ndarray:
    """Mean error of every landmark, then the mean over frames of a frame's mean, as `hmc.metrics.landmarks.score` has it; shape (16,)."""
    return np.append(_mean(errors), _mean(_mean(errors.T)))


def _mean(values: np.ndarray) -> np.ndarray:
    """Mean along the first axis of what is known; NaN where nothing is."""
    return mean_and_deviation(values, np.isfinite(values), 0)[0]


def _notes(person: PersonErrors, found: OffsetErrors) -> list[str]:
    notes = []
    for left_out, why in (
        (found.missing, "the truth lacks a landmark of the trunk (pelvis, neck, a hip or a shoulder)"),
        (found.flat, "the true trunk is flat there: hips and shoulders lie along the spine"),
    ):
        if left_out.any():
            notes.append(f"person {person.person}: no offsets from {frames_in_words(person.frames[left_out])}: {why}")
    few = [name for name, count in zip(LANDMARKS, found.compared, strict=True) if 0 < count < LEAST_FRAMES]
    if few:
        no_one = found.compared.max() < LEAST_FRAMES
        which = "no landmark has an offset" if no_one else f"{', '.join(few)} {'has' if len(few) == 1 else 'have'} no offset"
        notes.append(f"person {person.person}: {which}, compared in fewer than {LEAST_FRAMES} frames; any constant would explain so few")
    return notes
