"""Which way round a body is: as it was followed, or turned about.

A hull hardly tells a person's front from the back in one frame: feet, bent knees and elbows and the way of a walk do, over many. The body
turned about is refined beside the pose as it is, and the logarithms of the ratios of their costs are summed up: frame by frame while a
person is followed (`hmc.pose.recovery`), and over frames of the whole run when the recording is over (`hmc.pose.backward`), since who was
followed the wrong way round from the first pose on was found among others, in silhouettes that told little.
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

__all__ = ["TurnedAbout", "TurnedSettings", "followed_wrongly", "turn_about"]


@dataclass(frozen=True)
class TurnedSettings:
    """When somebody counts as followed the wrong way round.

    Parameters
    ----------
    frames : int
        Frames of the whole run in which both ways are compared, evenly spread.
    first, sure : int, float
        After so many of them, also spread, nothing more is looked at of whom the mean evidence is below minus this; of fewer nothing
        is said.
    drift : float
        What is taken from each logarithm of a ratio of costs: the body turned about has had its limbs looked for.
    start : StartSettings
        What walking backwards costs.
    """

    frames: int = 12
    first: int = 4
    sure: float = 0.2
    drift: float = 0.1
    start: StartSettings = field(default_factory=StartSettings)


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
        raises a cost.
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
    return TurnedAbout(turned, turned_cost, float(np.log(cost * factors[0]) - np.log(turned_cost * factors[1])))


def followed_wrongly(
    frames: Mapping[int, Sequence[int]],
    evidence_in: Callable[[Mapping[int, Sequence[int]]], Iterator[Mapping[int, float]]],
    settings: TurnedSettings,
) -> frozenset[int]:
    """Who was followed the wrong way round.

    Parameters
    ----------
    frames : mapping of int to sequence of int
        The frames in which each person was fitted, in order of time.
    evidence_in : callable
        ``evidence_in(persons) -> iterator over the frames of evidence by person``, of the persons asked of by frame, as `TurnedAbout` has
        it; a person of whom a frame shows too little is not in it.
    settings : TurnedSettings

    Returns
    -------
    frozenset of int
        Those of whom the mean evidence over all frames looked at is above `TurnedSettings.drift`; nobody of whom there are fewer than
        `TurnedSettings.first`.
    """
    chosen = {person: spread_frames(np.asarray(of), settings.frames) for person, of in frames.items()}
    stride = max(1, settings.frames // settings.first)
    found: dict[int, list[float]] = {person: [] for person in chosen}
    for begin in ([0], range(1, stride)):
        left = [person for person, told in found.items() if not told or np.mean(told) > -settings.sure]
        asked = sorted((frame, person) for person in left for k in begin for frame in chosen[person][k::stride])
        by_frame = {frame: [person for _, person in some] for frame, some in groupby(asked, itemgetter(0))}
        for told in evidence_in(by_frame):
            for person, evidence in told.items():
                found[person].append(evidence)
    return frozenset(person for person, told in found.items() if len(told) >= settings.first and np.mean(told) > settings.drift)
