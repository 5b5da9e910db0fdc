"""Which way round a body is: as it was followed, or turned about.

A hull hardly tells a person's front from the back in one frame: feet, bent knees and elbows and the way of a walk do, over many. The body
turned about is refined beside the pose as it is, and the logarithms of the ratios of their costs are summed up: frame by frame while a
person is followed (`hmc.pose.recovery`), and over frames of the whole run when the recording is over (`hmc.pose.backward`), since who was
followed the wrong way round from the first pose on was found among others, in silhouettes that told little.

Nobody turns about from one frame to the next. Where a followed heading does, one side of that moment was followed the wrong way round, and
evidence for the body turned about on one side is evidence against it on the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import itemgetter

import numpy as np

from hmc.body.exchange import swapped_pose
from hmc.io.recording import spread_frames
from hmc.pose.method import Subject
from hmc.pose.objectives.objective import cost_at
from hmc.pose.starts.candidates import StartSettings, search_all, walk_factor
from hmc.pose.steps.polish import PolishSettings, fine_objective
from hmc.pose.steps.refine import refine
from hmc.pose.views.person_view import PersonView

__all__ = ["Stretch", "TurnedAbout", "TurnedSettings", "followed_wrongly", "stretches", "turn_about"]


@dataclass(frozen=True)
class TurnedSettings:
    """When somebody counts as followed the wrong way round.

    Parameters
    ----------
    frames : int
        Frames of a stretch in which both ways are compared, evenly spread.
    first, sure : int, float
        After so many of them, also spread, nothing more is looked at of whom the mean evidence is below minus this; of fewer nothing
        is said.
    gap_s : float
        A person who was not followed for so long may have turned, seconds: another stretch begins.
    start : StartSettings
        What walking backwards costs, and what a search of limbs gains anybody.
    """

    frames: int = 12
    first: int = 4
    sure: float = 0.3
    gap_s: float = 0.25
    start: StartSettings = field(default_factory=StartSettings)


@dataclass(frozen=True)
class Stretch:
    """Frames over which a person was followed without a long gap.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Rising.
    sides : ndarray of int, shape (n,)
        1 where they were followed the way round of the first frame, -1 the other way round.
    """

    frames: np.ndarray
    sides: np.ndarray


@dataclass(frozen=True)
class TurnedAbout:
    """A frame's pose turned about, and what speaks for it.

    Parameters
    ----------
    state : ndarray, shape (37,)
    cost : float
        Square metres.
    evidence : float
        The logarithm of the ratio of costs, of the pose as it is over that one's, both refined to the same points; walking backwards
        raises a cost, and what the search of the turned one's limbs gains anybody is taken off.
    """

    state: np.ndarray
    cost: float
    evidence: float


def turn_about(
    rng: np.random.Generator, subject: Subject, state: np.ndarray, view: PersonView, polish: PolishSettings, start: StartSettings
) -> TurnedAbout:
    """A pose turned about, beside the pose as it is.

    Arms and legs of a body that has been followed the wrong way round have gone astray too: those of the turned one are looked for.

    Parameters
    ----------
    rng : numpy.random.Generator
    subject : Subject
    state : ndarray, shape (37,)
    view : PersonView
        With hulls.
    polish : PolishSettings
    start : StartSettings
    """
    objective = fine_objective(rng, subject, view, polish)
    as_it_is, _ = refine(objective, state, polish.refine)
    turned, _ = refine(objective, swapped_pose(subject.body, state, "all"), polish.refine)
    cost = cost_at(objective, as_it_is)
    turned, turned_cost = search_all(rng, objective, turned, polish)
    factors = walk_factor(np.array([as_it_is[3], turned[3]]), view.velocity, start)
    return TurnedAbout(turned, turned_cost, float(np.log(cost * factors[0]) - np.log(turned_cost * factors[1])) - start.searched)


def stretches(frames: np.ndarray, headings: np.ndarray, fps: float, settings: TurnedSettings) -> list[Stretch]:
    """A person's frames, with the moments at which the one who followed them turned about.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        In which the person was fitted, rising.
    headings : ndarray, shape (n,)
        Radians about Z.
    fps : float
    settings : TurnedSettings
    """
    found = []
    for own in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames) > settings.gap_s * fps) + 1):
        about = np.cos(np.diff(headings[own], prepend=headings[own[:1]])) < 0
        found.append(Stretch(frames[own], 1 - 2 * (np.cumsum(about) % 2)))
    return found


def followed_wrongly(
    followed: Mapping[int, Sequence[Stretch]],
    evidence_in: Callable[[Mapping[int, Sequence[int]]], Iterator[Mapping[int, float]]],
    settings: TurnedSettings,
) -> dict[int, list[int]]:
    """In which frames people were followed the wrong way round.

    Parameters
    ----------
    followed : mapping of int to sequence of Stretch
        By person, in order of time.
    evidence_in : callable
        ``evidence_in(persons) -> iterator over the frames of evidence by person``, of the persons asked of by frame, as `TurnedAbout` has
        it; a person of whom a frame shows too little is not in it.
    settings : TurnedSettings

    Returns
    -------
    dict of int to list of int
        By person, rising; those of whom no frame is wrong are not in it. Of a stretch these are the frames of the side for which the mean
        evidence over the frames looked at is; none of a stretch of which there are fewer than `TurnedSettings.first`.
    """
    parts = [(person, stretch) for person, of in followed.items() for stretch in of]
    side_of = [dict(zip(stretch.frames.tolist(), stretch.sides.tolist(), strict=True)) for _, stretch in parts]
    chosen = [spread_frames(stretch.frames, settings.frames) for _, stretch in parts]
    stride = max(1, settings.frames // settings.first)
    found: list[list[float]] = [[] for _ in parts]
    for begin in ([0], range(1, stride)):
        left = [k for k, told in enumerate(found) if not told or np.mean(told) > -settings.sure]
        asked = sorted((frame, k) for k in left for first in begin for frame in chosen[k][first::stride])
        part_of = {(frame, parts[k][0]): k for frame, k in asked}
        by_frame = {frame: [parts[k][0] for _, k in some] for frame, some in groupby(asked, itemgetter(0))}
        for frame, told in zip(by_frame, evidence_in(by_frame), strict=True):
            for person, evidence in told.items():
                k = part_of[frame, person]
                found[k].append(side_of[k][frame] * evidence)
    wrong: dict[int, list[int]] = {}
    for (person, stretch), signed in zip(parts, found, strict=True):
        if len(signed) >= settings.first:
            frames = stretch.frames[stretch.sides == (1 if np.mean(signed) > 0 else -1)].tolist()
            if frames:
                wrong.setdefault(person, []).extend(frames)
    return wrong
