"""Work where it is needed: a frame whose pose is as expected needs no search.

Particles are for motion that is not foreseen, and for poses that got lost. Where the pose to which the last frame's motion leads, refined,
fits as well as the frames before did, nothing is drawn; everywhere else the whole step is done. Deutscher and Reid (2005) and Canton (2009,
Eq. 3.11) measure by the survival rate whether particles are enough; here what is left of the data when a pose has been fitted says whether
any are needed at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.limbs import LIMBS
from hmc.pose.method import PoseStep, StepInfo, Tracked
from hmc.pose.objectives.objective import Misfit
from hmc.pose.steps.polish import PolishSettings, fine_objective, refined_starts, searched
from hmc.pose.steps.proposal import shows_enough
from hmc.pose.steps.refine import RefineInfo
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

    ratio: float = 1.05
    far_m: float = 0.05
    outside_share: float = 0.25
    memory_s: float = 1.0


def sparing(step: PoseStep, settings: PolishSettings, when: SparingSettings) -> PoseStep:
    """A step that is done only in frames that are not as expected.

    Parameters
    ----------
    step : callable
        `PoseStep`, of a cost in the terms of `settings`.
    settings : PolishSettings
        How the expected pose is refined, and limbs looked for.
    when : SparingSettings
    """

    def spared(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[Tracked, StepInfo]:
        if not shows_enough(view.target):
            return step(rng, tracked, view)
        usual = float(tracked.memory.get(_NAME, np.nan))
        found = _as_expected(rng, tracked, view, settings, when, usual) if np.isfinite(usual) else None
        after, info = found or step(rng, tracked, view)
        if not info.cost > 0:
            return after, info
        level = float(np.log(info.cost))
        share = min(1.0, 1 / (when.memory_s * tracked.subject.capture.fps))
        usual = level if np.isnan(usual) else usual + share * (level - usual)
        return Tracked(after.subject, after.state, after.velocity, {**after.memory, _NAME: np.array(usual)}), info

    return spared


def _as_expected(
    rng: np.random.Generator, tracked: Tracked, view: PersonView, settings: PolishSettings, when: SparingSettings, usual: float
) -> tuple[Tracked, StepInfo] | None:
    """The pose to which the last motion leads, refined; None where it does not fit as usual. The random numbers go on either way."""
    limits = tracked.subject.body.limits
    moved = np.clip(tracked.state + tracked.velocity, limits.low, limits.high)
    objective = fine_objective(rng, tracked.subject, view, settings)
    starts = [moved, tracked.state, *keypoint_pose(tracked.subject.body, view.keypoints, tracked.state)]
    estimate, info, evaluations = refined_starts(objective, starts, tracked.state, settings)
    if not _fits(info, usual, when):
        return None
    estimate, cost, more = searched(rng, objective, estimate, info, settings)
    return Tracked(tracked.subject, estimate, estimate - tracked.state), StepInfo("fitted", cost, evaluations + more)


def _fits(info: RefineInfo, usual: float, when: SparingSettings) -> bool:
    if info.misfit is None or not 0 < info.cost <= when.ratio * np.exp(usual):
        return False
    return _largest_outside(info.misfit, when.far_m) <= when.outside_share


def _largest_outside(misfit: Misfit, far_m: float) -> float:
    """Of the limb that is worst off, the share of its surface that is far outside."""
    far = misfit.outside > far_m
    of_limbs = [np.isin(misfit.part, limb.parts) for limb in LIMBS.values()]
    return max((float(far[own].mean()) for own in of_limbs if own.any()), default=0.0)
