"""Shifts, drifts and dropped frames of all cameras at once, what they are worth, and which cameras fit at no time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.check.sync.courses import Course, against, best_course, disagreement, weights
from hmc.check.sync.evidence import Evidence
from hmc.check.sync.shifts import Certainty, certainty, find_shifts, fractions, moved_curve

__all__ = ["TOLD", "CameraTime", "Synchrony", "find_synchrony", "joined"]

#: A camera's shift is believed when any other is so many standard errors worse, or this share of the others find it alone ...
LEAST_MARGIN, MOST_AGREEING = 2.5, 0.6
#: ... and its unlikeness is this far below its usual value, and this many of the others, at least, find the shift alone.
LEAST_DEPTH, LEAST_AGREEING = 0.3, 0.34
#: Others' agreement tells something when they are so many.
LEAST_PARTNERS = 3
#: The share of what stays unlike that may be due to time, and the frames on either side over which its rise is measured: where views stay
#: unlike for another reason, some shift happens to fit a little better. A real recording with one camera 28 px off gained 2 frames so.
BIAS, SIDE = 0.2, 4
#: Steps are believed where, whichever other camera is left out, no more than this share of the moments would have another frame.
MOST_DISAGREEING = 0.25
#: Who may be off by more frames than this is left as they are.
MOST_DOUBT = 3.0
#: Cameras of which the time is known.
TOLD = ("sure", "sound")
UNKNOWN = Certainty(np.nan, np.nan, np.nan)
#: What a course must gain beyond its charge, as a share of it.
LEAST_GAIN = 0.25
#: A camera fits at no time when it is so unlike the others at its best, and so many times as unlike as they are to each other.
MISFIT, TIMES = 0.15, 4.0


@dataclass(frozen=True)
class CameraTime:
    """What was found of one camera.

    Parameters
    ----------
    course : Course
        Its frames over the moments, both as the recording counts them now.
    fraction : float
        What is left of a frame; NaN where unknown.
    doubt : float
        Frames by which the shift may be off, as far as a calibration or silhouettes that are not quite right could feign it.
    certainty : Certainty
    before, after : float
        How unlike it is to the others as the recording has it now, and with the courses.
    status : str
        "sure", "weak" (too little to go by), "misfit" (it fits at no time), or "sound": only its sound tells.
    heard, heard_doubt : float
        The shift that its sound tells, and by how much that may be off; NaN where it tells nothing.
    fits : bool
        False of a camera with the status "sound" whose images fit at no time.
    unplaced : int
        Frames that it seems to have dropped, or to have twice, without it being told where: they are not in the course, and in the doubt.
    """

    course: Course
    fraction: float
    doubt: float
    certainty: Certainty
    before: float
    after: float
    status: str
    heard: float = float("nan")
    heard_doubt: float = float("nan")
    fits: bool = True
    unplaced: int = 0


@dataclass(frozen=True)
class Synchrony:
    """What was found of all cameras, in the rig's order.

    Parameters
    ----------
    cameras : tuple of CameraTime
    curves_before, curves_after : ndarray, shape (n_cameras, 2 * reach + 1)
        The mean unlikeness of each camera by how many frames later it is taken than now, to the others as they are now, and as their shifts
        were found; NaN where unknown.
    note : str
        Why sound tells nothing, where it might have; else empty.
    """

    cameras: tuple[CameraTime, ...]
    curves_before: np.ndarray
    curves_after: np.ndarray
    note: str = ""

    @property
    def known(self) -> bool:
        """Whether there is enough to go by: two cameras at least whose times are sure."""
        return sum(one.status in TOLD for one in self.cameras) >= 2

    @property
    def all_sure(self) -> bool:
        """Whether every camera's time is."""
        return all(one.status in TOLD for one in self.cameras)

    @property
    def in_time(self) -> bool:
        """Whether nothing is to be changed."""
        return all(one.course == Course() for one in self.cameras)


def find_synchrony(evidence: Evidence) -> Synchrony:
    """Find each camera's course.

    First one shift a camera; then, while something is gained, the drift or the dropped frames of the camera that gains most.

    Parameters
    ----------
    evidence : Evidence

    Returns
    -------
    Synchrony
    """
    n, moments = evidence.n_cameras, evidence.n_moments
    curves = evidence.curves()
    members = [c for c in range(n) if np.isfinite(curves[c]).any()]
    shifts = find_shifts(curves, members)
    sure = {c: certainty(evidence, shifts, members, c) for c in members}
    fitting = [c for c in members if _is_sure(sure[c], len(members) - 1)]
    if len(fitting) >= 2 and len(fitting) < len(members):
        # Without those that fit badly the others may fit at other shifts, and a bad one then be seen to fit.
        shifts = find_shifts(curves, fitting)
        for c in set(members) - set(fitting):
            both = find_shifts(curves, [*fitting, c])
            shifts[c] = both[c] - int(np.median(both[fitting] - shifts[fitting]))
        sure = {c: certainty(evidence, shifts, sorted({*fitting, c}), c) for c in members}
        fitting = [c for c in members if _is_sure(sure[c], len(fitting))]
    courses = {c: Course(int(shifts[c])) for c in range(n)}
    if len(fitting) >= 2:
        courses = _refined(evidence, courses, fitting)
        still = int(np.median([courses[c].shift for c in fitting]))
        courses = {c: _moved(course, -still) for c, course in courses.items()}
        shifts = shifts - still
    courses, unplaced = _placed(evidence, courses, shifts, fitting)
    frames = [courses[c].frames(moments) for c in range(n)]
    now = [np.arange(moments)] * n
    parts = fractions(curves, shifts, fitting)
    found = []
    for c in range(n):
        partners = [j for j in fitting if j != c]
        own = sure.get(c, UNKNOWN)
        costs = against(evidence, frames, partners, c)
        before, after = _middle(against(evidence, now, partners, c)), _middle(costs)
        part = float(parts[c]) if courses[c].is_plain else np.nan
        doubt = unplaced.get(c, 0) + (BIAS * after / rise if (rise := _rise(costs)) > 0 else np.inf)
        course = courses[c]
        if course.is_plain and course.shift and (after > before or not _told(course, part, doubt)):
            course, part, after = Course(), np.nan, before
        status = "sure" if len(fitting) >= 2 and c in fitting and doubt <= MOST_DOUBT else "weak"
        found.append(CameraTime(course, part, doubt, own, before, after, status, unplaced=unplaced.get(c, 0)))
    usual = float(np.median([found[c].after for c in fitting])) if fitting else np.nan
    for c, one in enumerate(found):
        if one.status != "sure":
            misfit = one.after >= max(MISFIT, TIMES * usual)
            found[c] = replace(one, course=Course(), fraction=np.nan, after=one.before, status="misfit" if misfit else "weak")
    return Synchrony(tuple(found), _all_curves(curves, 0 * shifts, fitting), _all_curves(curves, shifts, fitting))


def joined(first: Synchrony, second: Synchrony) -> Synchrony:
    """What the first is sure of, and of the other cameras what the second found; the second alone where they share too little."""
    both = [k for k, (one, other) in enumerate(zip(first.cameras, second.cameras, strict=True)) if one.status == other.status == "sure"]
    plain = [k for k in both if first.cameras[k].course.is_plain and second.cameras[k].course.is_plain]
    if not first.known or len(plain) < 2:
        return second if sum(one.status == "sure" for one in second.cameras) > sum(one.status == "sure" for one in first.cameras) else first
    apart = int(np.median([first.cameras[k].course.shift - second.cameras[k].course.shift for k in plain]))
    cameras = [
        one if one.status == "sure" or other.status != "sure" else replace(other, course=_moved(other.course, apart))
        for one, other in zip(first.cameras, second.cameras, strict=True)
    ]
    return replace(first, cameras=tuple(cameras))


def _is_sure(one: Certainty, partners: int) -> bool:
    if np.isnan(one.depth) or one.depth < LEAST_DEPTH or one.agreeing < LEAST_AGREEING:
        return False
    return one.margin >= LEAST_MARGIN or (partners >= LEAST_PARTNERS and one.agreeing >= MOST_AGREEING)


def _refined(evidence: Evidence, courses: dict[int, Course], members: Sequence[int]) -> dict[int, Course]:
    courses = dict(courses)
    settled: set[int] = set()
    for _ in range(2 * len(members)):
        frames = [courses[c].frames(evidence.n_moments) for c in range(evidence.n_cameras)]
        weighed = weights(evidence, frames)
        best: tuple[float, int, Course] | None = None
        for c in members:
            if courses[c].is_plain and c not in settled:
                course, gain = best_course(against(evidence, frames, members, c, weighed))
                if gain > LEAST_GAIN and course != Course() and (best is None or gain > best[0]):
                    best = gain, c, _moved(course, courses[c].shift)
        if best is None:
            return courses
        courses[best[1]] = best[2]
    return courses


def _placed(
    evidence: Evidence, courses: dict[int, Course], shifts: np.ndarray, members: Sequence[int]
) -> tuple[dict[int, Course], dict[int, int]]:
    """Courses without steps of which the other cameras do not agree where they are, and how many frames those are, by camera."""
    frames = [courses[c].frames(evidence.n_moments) for c in range(evidence.n_cameras)]
    doubtful = [c for c in members if courses[c].steps and disagreement(evidence, frames, members, c, courses[c]) > MOST_DISAGREEING]
    unplaced = {c: sum(abs(change) for _, change in courses[c].steps) for c in doubtful}
    return {c: Course(int(shifts[c])) if c in unplaced else course for c, course in courses.items()}, unplaced


def _moved(course: Course, by: int) -> Course:
    return replace(course, shift=course.shift + by)


def _told(course: Course, part: float, doubt: float) -> bool:
    """Whether a shift is more than what a calibration that is not quite right would feign."""
    return abs(course.shift + (0 if np.isnan(part) else part)) >= doubt


def _rise(costs: np.ndarray) -> float:
    """By how much more unlike a camera is for every frame that it is moved, over some frames on either side."""
    sides = [costs[:, costs.shape[1] // 2 + k] for k in (-SIDE, SIDE)]
    now = costs[:, costs.shape[1] // 2]
    rises = [float((side - now)[known].mean()) for side in sides if (known := np.isfinite(side) & np.isfinite(now)).any()]
    return float(np.mean(rises)) / SIDE if rises else 0.0


def _middle(costs: np.ndarray) -> float:
    own = costs[:, costs.shape[1] // 2]
    own = own[np.isfinite(own)]
    return float(own.mean()) if len(own) else float("nan")


def _all_curves(curves: np.ndarray, shifts: np.ndarray, members: Sequence[int]) -> np.ndarray:
    """Each camera's mean curve against the members, these being where `shifts` have them; (n, size), NaN where none is known."""
    n, _, size = curves.shape
    found = np.full((n, size), np.nan)
    for c in range(n):
        own = [moved_curve(curves[j, c], -int(shifts[j]), np.nan) for j in members if j != c]
        if own:
            stack = np.stack(own)
            known = np.isfinite(stack)
            number = known.sum(axis=0)
            found[c] = np.where(number > 0, np.where(known, stack, 0).sum(axis=0) / np.maximum(number, 1), np.nan)
    return found
