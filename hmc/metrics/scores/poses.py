"""Scores of poses against truth, by landmark and person, with what is covered and what looks odd."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hmc.errors import InputError
from hmc.io.results import PoseTable
from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import landmark_errors, score
from hmc.metrics.persons import GATE_M, LIMB_PAIRS, distances_apart, exchange_sides, frames_in_words, match_persons, swapped_frames
from hmc.metrics.threshold import choose_threshold

__all__ = [
    "AUTO", "THRESHOLDS_M", "PersonErrors", "PoseEvaluation", "evaluate_pose", "known_thresholds", "score_rows",
]  # fmt: skip

#: Largest errors at which a landmark counts as matched: the thesis's, and a stricter one, as the first saturates.
THRESHOLDS_M = (0.1, 0.05)
#: In place of a threshold: those that the errors themselves suggest.
AUTO: Literal["auto"] = "auto"
#: Units of scores in columns, a metre's worth of them, and the step to which a threshold that was chosen is rounded.
UNITS = {"mm": (1000.0, 1e-4), "px": (1.0, 0.1)}
#: A frame whose mean error is above this has lost the pose.
LOST_M = 0.15
#: Fewer swapped frames than this are a moment of doubt, not worth a line.
MIN_SWAPPED_FRAMES = 3


@dataclass(frozen=True)
class PersonErrors:
    """One true person against what was estimated for it.

    Attributes
    ----------
    person : int
        Number in the truth.
    estimated_as : tuple of int
        Numbers in the estimate; several where a track was lost and begun anew.
    frames : ndarray of int, shape (n,)
        Frames with truth.
    estimate, truth : ndarray, shape (n, 15, 3)
        Metres; NaN where missing.
    doubtful : ndarray, shape (n, 15)
        1 where the estimate says that it is doubtful (`PoseTable.doubtful`), 0 where it is not; NaN where that is not known.
    """

    person: int
    estimated_as: tuple[int, ...]
    frames: np.ndarray
    estimate: np.ndarray
    truth: np.ndarray
    doubtful: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """`landmark_errors` of this person, shape (n, 15), metres."""
        return landmark_errors(self.estimate, self.truth)


@dataclass(frozen=True)
class PoseEvaluation:
    """Scores of the poses of a recording.

    Attributes
    ----------
    persons : tuple of PersonErrors
        One a true person.
    rows : tuple of dict
        The table, a row a landmark and `overall`, for all persons and for each: the columns carry their units.
    summary : dict
        Plain numbers: coverage, overall scores, initialisation and the rest.
    notes : tuple of str
        What a reader should know before trusting the figures, one line each.
    thresholds_m : tuple of float
        Of MMTP and MMTA, metres.
    """

    persons: tuple[PersonErrors, ...]
    rows: tuple[dict, ...]
    summary: dict
    notes: tuple[str, ...]
    thresholds_m: tuple[float, ...]


def evaluate_pose(estimate: PoseTable, truth: PoseTable, thresholds_m: Sequence[float | Literal["auto"]] = THRESHOLDS_M) -> PoseEvaluation:
    """Score estimated landmarks against true ones.

    Estimated persons are matched with true ones once for the recording (`match_persons`). A true landmark without an estimate counts
    against MMTA and the coverage, and stays out of the means.

    Parameters
    ----------
    estimate, truth : PoseTable
    thresholds_m : sequence of float or "auto"
        Thresholds of MMTP and MMTA, metres; ``"auto"`` for those that the errors suggest (`known_thresholds`).

    Returns
    -------
    PoseEvaluation

    Raises
    ------
    InputError
        When the truth is empty, or a threshold cannot be chosen.
    """
    if not len(truth.frames):
        raise InputError("the truth has no row in these frames, so nothing can be scored; choose others, or another truth")
    names = match_persons(truth.frames, truth.persons, truth.positions, estimate.frames, estimate.persons, estimate.positions)
    persons = tuple(_person_errors(estimate, truth, int(person), names) for person in np.unique(truth.persons))
    groups = {"all": np.concatenate([person.errors for person in persons])}
    groups |= {str(person.person): person.errors for person in persons}
    known, chosen = known_thresholds(groups["all"], thresholds_m)
    rows = tuple({"person": label} | row for label, errors in groups.items() for row in score_rows(errors, known))
    frame_means = {person.person: _frame_means(person.errors) for person in persons}
    first = [means[np.flatnonzero(np.isfinite(means))[0]] for means in frame_means.values() if np.isfinite(means).any()]
    later = [means[np.isfinite(means)][1:] for means in frame_means.values()]
    covered = sum(int(np.isfinite(means).sum()) for means in frame_means.values())
    with_truth = sum(int((~np.isnan(person.errors)).any(axis=1).sum()) for person in persons)
    unmatched = ~np.isin(estimate.persons, list(names)) if names else np.ones(len(estimate.persons), bool)
    summary = {
        "true_persons": len(persons),
        "person_frames": with_truth,
        "person_frames_estimated": covered,
        "coverage": covered / with_truth if with_truth else float("nan"),
        "person_frames_unmatched": int(unmatched.sum()),
        "initialisation_mean_mm": _mean_mm(np.array(first)),
        "tracking_mean_mm": _mean_mm(np.concatenate(later)) if later else float("nan"),
        "sides_exchanged_mean_mm": _mean_mm(np.concatenate([_frame_means(_with_sides_exchanged(person)) for person in persons])),
        "persons": {str(person.person): {"estimated_as": list(person.estimated_as)} for person in persons},
    }
    summary |= {key: value for key, value in rows[len(LANDMARKS)].items() if key not in ("person", "landmark", "frames", "true_frames")}
    summary |= chosen
    summary |= _by_trust(groups["all"], np.concatenate([person.doubtful for person in persons]), known)
    notes = _notes(persons, frame_means, estimate.persons[unmatched])
    if not names:
        notes += _apart(estimate, truth)
    return PoseEvaluation(persons, rows, summary, tuple(notes), known)


def known_thresholds(
    errors: np.ndarray, thresholds: Sequence[float | Literal["auto"]], unit: Literal["mm", "px"] = "mm"
) -> tuple[tuple[float, ...], dict[str, float]]:
    """Thresholds as numbers: in place of ``"auto"`` those that the errors suggest by both tests (Canton 2009, Eq. 5.7 and 5.8).

    Parameters
    ----------
    errors : ndarray, shape (n, 15)
        From `hmc.metrics.landmarks.landmark_errors`, of all persons; metres, or pixels.
    thresholds : sequence of float or "auto"
        In the unit of the errors.
    unit : {"mm", "px"}
        Of the results.

    Returns
    -------
    thresholds : tuple of float
        In the unit of the errors, none twice. One that was chosen is rounded up, to a tenth of a millimetre or pixel.
    chosen : dict
        What the tests say, in `unit`, by name; empty where nothing was to be chosen.

    Raises
    ------
    InputError
        When there are too few errors to choose from.
    """
    factor, step = UNITS[unit]
    known: list[float] = []
    chosen: dict[str, float] = {}
    for threshold in thresholds:
        if threshold != AUTO:
            known.append(float(threshold))
            continue
        for test in ("lilliefors", "r2"):
            value = choose_threshold(errors, test).threshold
            known.append(round(float(np.ceil(value / step) * step), 6))
            chosen[f"threshold_{test}_{unit}"] = factor * value
    return tuple(dict.fromkeys(known)), chosen


def score_rows(errors: np.ndarray, thresholds: Sequence[float], unit: Literal["mm", "px"] = "mm") -> list[dict]:
    """Scores as rows of a table: one a landmark, then ``overall``; the columns carry their units.

    Parameters
    ----------
    errors : ndarray, shape (n, 15)
        From `hmc.metrics.landmarks.landmark_errors`; metres, or pixels.
    thresholds : sequence of float
        Of MMTP and MMTA, in the unit of the errors.
    unit : {"mm", "px"}
        Of the columns.
    """
    factor, _ = UNITS[unit]
    columns: dict[str, np.ndarray] = {}
    for threshold in thresholds:
        joint, overall = score(errors, threshold, by="joint"), score(errors, threshold)
        at = f"at_{threshold * factor:g}{unit}"
        columns[f"mean_{unit}"] = np.append(joint.mean, overall.mean) * factor
        columns[f"deviation_{unit}"] = np.append(joint.deviation, overall.deviation) * factor
        columns[f"mmtp_{unit}_{at}"] = np.append(joint.mmtp, overall.mmtp) * factor
        columns[f"sigma_mmtp_{unit}_{at}"] = np.append(joint.sigma_mmtp, overall.sigma_mmtp) * factor
        columns[f"mmta_{at}"] = np.append(joint.mmta, overall.mmta)
    estimated, expected = np.isfinite(errors), ~np.isnan(errors)
    counts = {
        "frames": [*estimated.sum(axis=0), estimated.any(axis=1).sum()],
        "true_frames": [*expected.sum(axis=0), expected.any(axis=1).sum()],
    }
    return [
        {"landmark": name}
        | {key: float(values[place]) for key, values in columns.items()}
        | {key: int(values[place]) for key, values in counts.items()}
        for place, name in enumerate((*LANDMARKS, "overall"))
    ]


def _person_errors(estimate: PoseTable, truth: PoseTable, person: int, names: Mapping[int, int]) -> PersonErrors:
    true_rows = np.flatnonzero(truth.persons == person)
    estimated_as = tuple(sorted(name for name, true_name in names.items() if true_name == person))
    rows = np.flatnonzero(np.isin(estimate.persons, estimated_as))
    positions = np.full((len(true_rows), len(LANDMARKS), 3), np.nan)
    doubtful = np.full((len(true_rows), len(LANDMARKS)), np.nan)
    _, a, b = np.intersect1d(truth.frames[true_rows], estimate.frames[rows], return_indices=True)
    positions[a] = estimate.positions[rows[b]]
    told = estimate.doubtful
    if told is not None:
        doubtful[a] = told[rows[b]]
    return PersonErrors(person, estimated_as, truth.frames[true_rows], positions, truth.positions[true_rows], doubtful)


def _by_trust(errors: np.ndarray, doubtful: np.ndarray, thresholds_m: Sequence[float]) -> dict[str, dict[str, float]]:
    """Scores of the landmarks that are to be trusted, and of those that are doubtful; empty where it is not known."""
    scores = {}
    for name, of_these in (("trusted", doubtful == 0), ("doubtful", doubtful == 1)):
        chosen = errors[of_these & np.isfinite(errors)]
        if len(chosen):
            matched = {f"mmta_at_{1000 * threshold:g}mm": float((chosen <= threshold).mean()) for threshold in thresholds_m}
            scores[name] = {"landmarks": len(chosen), "mean_mm": _mean_mm(chosen), **matched}
    return scores


def _apart(estimate: PoseTable, truth: PoseTable) -> list[str]:
    """What is said where nobody matches anybody: how far the nearest two are apart."""
    apart = []
    for true in (truth.of(person) for person in np.unique(truth.persons)):
        for found in (estimate.of(person) for person in np.unique(estimate.persons)):
            apart.append(distances_apart(true.frames, true.positions, found.frames, found.positions))
    medians = [float(np.median(values)) for values in apart if len(values)]
    if not medians:
        return ["the estimate and the truth have no frame in common" if len(estimate.frames) else "nobody has a pose in the estimate"]
    return [
        f"the nearest estimated and true person are {min(medians):.2f} m apart, median over frames, and match within {GATE_M:g} m: look "
        "whether result and truth have the same world (origin, axes) and count the same frames"
    ]


def _frame_means(errors: np.ndarray) -> np.ndarray:
    """Mean error of every frame over what was estimated; NaN where nothing was."""
    return np.asarray(score(errors, THRESHOLDS_M[0], by="frame").mean)


def _with_sides_exchanged(person: PersonErrors) -> np.ndarray:
    return landmark_errors(exchange_sides(person.estimate), person.truth)


def _mean_mm(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    return float(values.mean() * 1000) if len(values) else float("nan")


def _notes(persons: Sequence[PersonErrors], frame_means: Mapping[int, np.ndarray], unmatched: np.ndarray) -> list[str]:
    notes = []
    for person in persons:
        if not person.estimated_as:
            notes.append(f"person {person.person} was never estimated")
            continue
        means = frame_means[person.person]
        missing = person.frames[~np.isfinite(means) & (~np.isnan(person.truth)).any(axis=(1, 2))]
        if len(missing):
            notes.append(f"person {person.person}: no estimate in {frames_in_words(missing)}")
        if len(person.estimated_as) > 1:
            parts = ", ".join(map(str, person.estimated_as))
            notes.append(f"person {person.person}: its track was lost and begun anew; estimated persons {parts} together stand for it")
        lost = np.where(np.isfinite(means), means, 0) > LOST_M
        if lost.any():
            notes.append(f"person {person.person}: mean error above {LOST_M * 1000:g} mm in {frames_in_words(person.frames[lost])}")
        for limbs in LIMB_PAIRS:
            swapped, as_is, exchanged = swapped_frames(person.estimate, person.truth, limbs)
            if swapped.sum() >= MIN_SWAPPED_FRAMES:
                notes.append(
                    f"person {person.person}: left and right {limbs} seem swapped in {frames_in_words(person.frames[swapped])}: their mean "
                    f"error there is {_mean_mm(as_is[swapped]):.0f} mm, and {_mean_mm(exchanged[swapped]):.0f} mm with the sides exchanged"
                )
    for name, count in zip(*np.unique(unmatched, return_counts=True), strict=True):
        notes.append(f"estimated person {name} ({count} frames) matches no true person")
    return notes
