"""A proposed pose refined on the symmetric cost, and limbs that got lost looked for: steps that any method takes.

The cost and the search are ours (`hmc.pose.objectives.symmetric`, `hmc.pose.steps.refine`, `hmc.pose.steps.limb_search`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from hmc.pose.method import PoseStep, StepInfo, Subject, Tracked, unseen
from hmc.pose.objectives.keypoints import KeypointCost, KeypointSettings
from hmc.pose.objectives.objective import Objective, Sum
from hmc.pose.objectives.symmetric import Symmetric, SymmetricSettings
from hmc.pose.steps.limb_search import SearchSettings, lost_limbs, search_limbs
from hmc.pose.steps.proposal import Proposal, Propose, shows_enough
from hmc.pose.steps.refine import RefineInfo, RefineSettings, refine_all
from hmc.pose.views.keypoint_pose import keypoint_pose
from hmc.pose.views.person_view import PersonView
from hmc.pose.views.rays import points_to_cover

__all__ = [
    "MakeObjective",
    "PolishSettings",
    "Trial",
    "after_proposal",
    "best_searched",
    "best_trial",
    "fine_objective",
    "polish",
    "polished",
]

#: A refined start, and what its refinement came to.
Trial: TypeAlias = tuple[np.ndarray, RefineInfo]


@dataclass(frozen=True)
class PolishSettings:
    """How a proposed pose is refined.

    Parameters
    ----------
    symmetric : SymmetricSettings
    hull_points : int
        Rays and points of the hull that have to be covered.
    refine : RefineSettings
    search : SearchSettings or None
        Search for a limb that got lost; None: there is none.
    keypoints : KeypointSettings
        What a detector's keypoints weigh, where there are any.
    """

    symmetric: SymmetricSettings = field(default_factory=SymmetricSettings)
    hull_points: int = 600
    refine: RefineSettings = field(default_factory=RefineSettings)
    search: SearchSettings | None = field(default_factory=SearchSettings)
    keypoints: KeypointSettings = field(default_factory=KeypointSettings)


def fine_objective(rng: np.random.Generator, subject: Subject, view: PersonView, settings: PolishSettings) -> Objective:
    """What a frame asks of a person's pose: the symmetric cost at as many points as a refinement takes, and the keypoints' where there are
    any.

    Raises
    ------
    ValueError
        When the frame has no hulls of the person.
    """
    if view.target is None:
        raise ValueError("the frame has no hulls of this person")
    asked = points_to_cover(rng, view.target, settings.hull_points, settings.symmetric.ray_share)
    by_hulls = Symmetric(subject.body, subject.points, view.target, asked, settings.symmetric)
    if view.keypoints is None:
        return by_hulls
    return Sum([by_hulls, KeypointCost(subject.body, view.keypoints, subject.capture.beside, settings.keypoints)])


#: What a refinement minimises: ``make(rng, subject, view)``.
MakeObjective = Callable[[np.random.Generator, Subject, PersonView], Objective]


def polish(
    rng: np.random.Generator, objective: Objective, starts: Sequence[np.ndarray], anchor: np.ndarray, settings: PolishSettings
) -> tuple[np.ndarray, float, int]:
    """The best of several starts, refined, with limbs that the hulls contradict looked for.

    Parameters
    ----------
    rng : numpy.random.Generator
    objective : Objective
    starts : sequence of ndarray, shape (37,)
    anchor : ndarray, shape (37,)
        Pose on which what no data speaks of is held.
    settings : PolishSettings

    Returns
    -------
    state : ndarray, shape (37,)
    cost : float
        Square metres.
    evaluations : int
    """
    # Each to the end: a start that has moved a limb across costs more than one that has lost it until late in the refinement.
    return best_searched(rng, objective, refine_all(objective, starts, settings.refine, anchor=anchor), settings)


def best_searched(
    rng: np.random.Generator, objective: Objective, trials: Sequence[Trial], settings: PolishSettings
) -> tuple[np.ndarray, float, int]:
    """The best of several refined starts, with limbs that the hulls contradict looked for; as `polish`, which refines them first."""
    estimate, info = best_trial(trials)
    evaluations = sum(one.evaluations for _, one in trials)
    if settings.search is None or info.misfit is None:
        return estimate, info.cost, evaluations
    limbs = lost_limbs(rng, objective.body, estimate, info.misfit, settings.search)
    estimate, cost, more = search_limbs(rng, objective, (estimate, info.cost), limbs, settings.refine, settings.search, info.misfit)
    return estimate, cost, evaluations + more


def best_trial(trials: Sequence[Trial]) -> Trial:
    """The refined start of least cost."""
    return min(trials, key=lambda trial: trial[1].cost_after)


def polished(propose: Propose, settings: PolishSettings, make_objective: MakeObjective | None = None) -> PoseStep:
    """The step that refines what a search proposes, and the last pose beside it.

    Parameters
    ----------
    propose : callable
        `hmc.pose.steps.proposal.Propose`.
    settings : PolishSettings
    make_objective : callable, optional
        What is minimised; `fine_objective` by default.
    """

    def step(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[Tracked, StepInfo]:
        if view.target is None or not shows_enough(view.target):
            return unseen(tracked)
        found = propose(rng, tracked, view)
        starts = [found.best, tracked.state] if found.status == "fitted" else [tracked.state]
        starts += keypoint_pose(tracked.subject.body, view.keypoints, tracked.state)
        if make_objective is None:
            objective: Objective = fine_objective(rng, tracked.subject, view, settings)
        else:
            objective = make_objective(rng, tracked.subject, view)
        return after_proposal(tracked, found, polish(rng, objective, starts, tracked.state, settings))

    return step


def after_proposal(tracked: Tracked, found: Proposal, refined: tuple[np.ndarray, float, int]) -> tuple[Tracked, StepInfo]:
    """What a step gives back of a proposal that was refined; state, cost and evaluations as from `polish`."""
    estimate, cost, more = refined
    info = StepInfo(
        "fitted",
        cost,
        found.evaluations + more,
        annealed=found.annealed,
        structural=found.structural,
        levels=found.levels,
        details=found.details,
    )
    return Tracked(tracked.subject, estimate, estimate - tracked.state, found.memory), info
