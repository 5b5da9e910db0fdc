"""Work where it is needed: a frame whose pose is as expected needs no search.

Particles are for motion that is not foreseen, and for poses that got lost. Where the pose to which the last frame's motion leads, refined,
fits as well as the frames before did, it is the answer; else the last frame's pose is refined too, and where neither fits there is the
whole search. Deutscher and Reid (2005) and Canton (2009, Eq. 3.11) measure by the survival rate whether particles are enough; here what is
left of the data when a pose has been fitted says whether any are needed at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.body.limbs import LIMBS
from hmc.pose.method import PoseStep, StepInfo, Tracked, unseen
from hmc.pose.objectives.objective import Misfit
from hmc.pose.steps.polish import PolishSettings, Trial, after_proposal, best_searched, best_trial, fine_objective
from hmc.pose.steps.proposal import Proposal, Propose, shows_enough
from hmc.pose.steps.refine import refine_all
from hmc.pose.views.keypoint_pose import keypoint_pose
from hmc.pose.views.person_view import PersonView

__all__ = ["SparingSettings", "sparing"]

#: Of the entry in a pose's memory: the logarithm of the usual cost.
_NAME = "usual"


@dataclass(frozen=True)
class SparingSettings:
    """When a frame counts as expected.

    Parameters
    ----------
    ratio : float
        The cost is at most so many times the usual one ...
    far_m, outside_share : float
        ... and no limb has more than this share of its surface that far outside the tolerant hull, metres.
    memory_s : float
        Time over which the usual cost is a mean (of its logarithm), seconds.
    """

    ratio: float = 1.1
    far_m: float = 0.05
    outside_share: float = 0.25
    memory_s: float = 1.0


def sparing(propose: Propose, settings: PolishSettings, when: SparingSettings) -> PoseStep:
    """A step that searches only in frames that are not as expected, and refines what the search proposes beside what was expected.

    Parameters
    ----------
    propose : callable
        `hmc.pose.steps.proposal.Propose`: the search.
    settings : PolishSettings
        How expected and proposed poses are refined, and limbs looked for.
    when : SparingSettings
    """

    def step(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[Tracked, StepInfo]:
        if not shows_enough(view.target):
            return unseen(tracked)
        usual = float(tracked.memory.get(_NAME, np.nan))
        objective = fine_objective(rng, tracked.subject, view, settings)

        def refined(starts: Sequence[np.ndarray], before: list[Trial]) -> list[Trial]:
            ended = [state for state, _ in before]
            return [*before, *refine_all(objective, starts, settings.refine, tracked.state, ended_before=ended)]

        trials, found = refined([_moved(tracked)], []), Proposal(tracked.state, tracked.state)  # of no search
        if not _fits(trials, usual, when):
            trials = refined([tracked.state, *keypoint_pose(tracked.subject.body, view.keypoints, tracked.state)], trials)
        if not _fits(trials, usual, when):
            found = propose(rng, tracked, view)
            if found.status == "fitted":
                trials = refined([found.best], trials)
        after, info = after_proposal(tracked, found, best_searched(rng, objective, trials, settings))
        if not info.cost > 0:
            return after, info
        level = float(np.log(info.cost))
        share = min(1.0, 1 / (when.memory_s * tracked.subject.capture.fps))
        usual = level if np.isnan(usual) else usual + share * (level - usual)
        return Tracked(after.subject, after.state, after.velocity, {**after.memory, _NAME: np.array(usual)}), info

    return step


def _moved(tracked: Tracked) -> np.ndarray:
    """The pose to which the last frame's motion leads, shape (37,)."""
    limits = tracked.subject.body.limits
    return np.clip(tracked.state + tracked.velocity, limits.low, limits.high)


def _fits(trials: Sequence[Trial], usual: float, when: SparingSettings) -> bool:
    """Whether the best of some is as good as the frames before; never in the first one, whose usual cost is not a number."""
    _, info = best_trial(trials)
    if info.misfit is None or not 0 < info.cost <= when.ratio * np.exp(usual):
        return False
    return _largest_outside(info.misfit, when.far_m) <= when.outside_share


def _largest_outside(misfit: Misfit, far_m: float) -> float:
    """Of the limb that is worst off, the share of its surface that is far outside."""
    far = misfit.outside > far_m
    of_limbs = [np.isin(misfit.part, limb.parts) for limb in LIMBS.values()]
    return max((float(far[own].mean()) for own in of_limbs if own.any()), default=0.0)
