"""A proposed pose refined on the symmetric cost, and limbs that got lost looked for: steps that any method takes.

The cost and the search are ours (`hmc.pose.objectives.symmetric`, `hmc.pose.steps.refine`, `hmc.pose.steps.limb_search`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hmc.pose.method import PoseStep, StepInfo, Subject, Tracked, unseen
from hmc.pose.objectives.keypoints import KeypointCost, KeypointSettings
from hmc.pose.objectives.objective import Objective, Sum
from hmc.pose.objectives.symmetric import Symmetric, SymmetricSettings
from hmc.pose.steps.limb_search import SearchSettings, lost_limbs, search_limbs
from hmc.pose.steps.proposal import Propose, shows_enough
from hmc.pose.steps.refine import RefineInfo, RefineSettings, refine_all
from hmc.pose.views.keypoint_pose import keypoint_pose
from hmc.pose.views.person_view import PersonView
from hmc.pose.views.rays import points_to_cover

__all__ = ["MakeObjective", "PolishSettings", "fine_objective", "polish", "polished", "refined_starts", "searched"]


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
    estimate, info, evaluations = refined_starts(objective, starts, anchor, settings)
    estimate, cost, more = searched(rng, objective, estimate, info, settings)
    return estimate, cost, evaluations + more


def refined_starts(
    objective: Objective, starts: Sequence[np.ndarray], anchor: np.ndarray, settings: PolishSettings
) -> tuple[np.ndarray, RefineInfo, int]:
    """The best of several starts, refined, with what its refinement came to, and the evaluations of all; as for `polish`."""
    # Each to the end: a start that has moved a limb across costs more than one that has lost it until late in the refinement.
    trials = refine_all(objective, starts, settings.refine, anchor=anchor)
    estimate, info = min(trials, key=lambda trial: trial[1].cost_after)
    return estimate, info, sum(one.evaluations for _, one in trials)


def searched(
    rng: np.random.Generator, objective: Objective, estimate: np.ndarray, info: RefineInfo, settings: PolishSettings
) -> tuple[np.ndarray, float, int]:
    """A refined pose with limbs that the hulls contradict looked for; state, cost and evaluations as for `polish`."""
    if settings.search is None or info.misfit is None:
        return estimate, info.cost, 0
    limbs = lost_limbs(rng, objective.body, estimate, info.misfit, settings.search)
    return search_limbs(rng, objective, (estimate, info.cost), limbs, settings.refine, settings.search, info.misfit)


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
        estimate, cost, more = polish(rng, objective, starts, tracked.state, settings)
        after = Tracked(tracked.subject, estimate, estimate - tracked.state, found.memory)
        evaluations = found.evaluations + more
        return after, StepInfo(
            "fitted", cost, evaluations, annealed=found.annealed, structural=found.structural, levels=found.levels, details=found.details
        )

    return step
