"""Which way round a body is: as it was followed, or turned about.

A hull hardly tells a person's front from the back in one frame: feet, bent knees and elbows and the way of a walk do, over many. The body
turned about is refined beside the pose as it is, and the logarithms of the ratios of their costs are summed up: frame by frame while a
person is followed (`hmc.pose.recovery`), and over frames of the whole run when the recording is over (`hmc.pose.backward`), since who was
followed the wrong way round from the first pose on was found among others, in silhouettes that told little. Where these leave it open, the
colors of heads have a say (`hmc.pose.head_colors`).

Nobody turns about from one frame to the next. Where a followed heading does, one side of that moment was followed the wrong way round, if
nothing else speaks against it: evidence for the body turned about on one side is evidence against it on the other.
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
from hmc.search.paths import cheapest_path

__all__ = ["Stretch", "TurnedAbout", "TurnedSettings", "followed_wrongly", "stretches", "turn_about"]


#: Frames, and who is asked of in each, to evidence for the body turned about by person, frame by frame.
EvidenceIn = Callable[[Mapping[int, Sequence[int]]], Iterator[Mapping[int, float]]]


@dataclass(frozen=True)
class TurnedSettings:
    """When somebody counts as followed the wrong way round.

    Parameters
    ----------
    frames : int
        Frames of a stretch in which both ways are compared, evenly spread.
    first, sure : int, float
        After so many of them, also spread, nothing more is looked at of whom the mean evidence is below minus this; fewer turn nobody
        about, but may say that who was followed so is right.
    gap_s : float
        A person who was not followed for so long may have turned, seconds: nothing follows from the way round before.
    about : float
        What it takes of evidence, summed up over the frames looked at, to say that a person did turn about from one frame to the next.
    start : StartSettings
        What walking backwards costs, and what a search of limbs gains anybody.
    """

    frames: int = 12
    first: int = 4
    sure: float = 0.3
    gap_s: float = 0.25
    about: float = 1.0
    start: StartSettings = field(default_factory=StartSettings)


@dataclass(frozen=True)
class Stretch:
    """Frames over which a person was followed without a long gap, and without turning about from one frame to the next.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Rising.
    about : bool
        Whether it begins where the stretch before turned about; False of the first one, and after a long gap.
    """

    frames: np.ndarray
    about: bool


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
    """A person's frames, parted where the one who followed them turned about, and at long gaps.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        In which the person was fitted, rising.
    headings : ndarray, shape (n,)
        Radians about Z.
    fps : float
    settings : TurnedSettings
    """
    gap = np.diff(frames) > settings.gap_s * fps
    begins = np.flatnonzero(gap | (np.cos(np.diff(headings)) < 0)) + 1
    about = [False, *(~gap[begins - 1]).tolist()]
    return [Stretch(own, jumped) for own, jumped in zip(np.split(frames, begins), about, strict=True) if len(own)]


def followed_wrongly(
    followed: Mapping[int, Sequence[Stretch]], evidence_in: EvidenceIn, settings: TurnedSettings, heads_in: EvidenceIn | None = None
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
    heads_in : callable, optional
        The same of what the colors of heads say for the body turned about (`hmc.pose.head_colors`), nats; asked of where shapes leave it
        open which way round somebody is.

    Returns
    -------
    dict of int to list of int
        By person, rising; those of whom no frame is wrong are not in it. Stretch by stretch it is as the evidence has it in sum, with
        `TurnedSettings.about` against two stretches that are right, or wrong, on both sides of a moment of turning about. A stretch of
        which fewer than `TurnedSettings.first` frames tell is as its neighbors and its heads' colors have it, unless those frames say that
        it is right.
    """
    parts = [(person, stretch) for person, of in followed.items() for stretch in of]
    chosen = [spread_frames(stretch.frames, settings.frames) for _, stretch in parts]
    stride = max(1, settings.frames // settings.first)
    found: list[list[float]] = [[] for _ in parts]
    heads: list[list[float]] = [[] for _ in parts]

    def ask(asking: EvidenceIn, begin: Sequence[int], told_of: list[list[float]]) -> None:
        left = [k for k, told in enumerate(found) if len(told) < settings.first or np.mean(told) > -settings.sure]
        asked = sorted((frame, k) for k in left for first in begin for frame in chosen[k][first::stride])
        part_of = {(frame, parts[k][0]): k for frame, k in asked}
        by_frame = {frame: [parts[k][0] for _, k in some] for frame, some in groupby(asked, itemgetter(0))}
        for frame, told in zip(by_frame, asking(by_frame), strict=True):
            for person, evidence in told.items():
                told_of[part_of[frame, person]].append(evidence)

    ask(evidence_in, [0], found)
    ask(evidence_in, range(1, stride), found)
    if heads_in is not None:
        ask(heads_in, range(stride), heads)
    by_shape = [sum(told) if len(told) >= settings.first else min(0.0, sum(told)) for told in found]
    sums = iter([of_shape + sum(told) for of_shape, told in zip(by_shape, heads, strict=True)])
    wrong: dict[int, list[int]] = {}
    for person, of in followed.items():
        turned = _wrong_ones([next(sums) for _ in of], [stretch.about for stretch in of], settings.about)
        frames = [frame for stretch, is_wrong in zip(of, turned, strict=True) if is_wrong for frame in stretch.frames.tolist()]
        if frames:
            wrong[person] = frames
    return wrong


def _wrong_ones(evidence: Sequence[float], about: Sequence[bool], against: float) -> list[bool]:
    """Which of the stretches were followed the wrong way round: the most evidence in sum, less `against` for each two neighbors that are
    alike though the second begins by turning about."""
    own = [np.array([0.0, -told]) for told in evidence]
    return [bool(wrong) for wrong in cheapest_path(own, lambda k: against * about[k] * np.eye(2))]
