"""Left and right leg told apart over time: a hull hardly shows which leg is which, but legs swing on and do not turn back half-way.

A filter that follows frame by frame may exchange the legs where they pass each other, and back again when they next pass. Here every frame
also has the pose with exchanged legs, refined, and the better choice for a whole stretch of frames is the path of least cost through both
(Viterbi, 1967): each pose's own cost, and the jump of the legs' velocity from one frame to the next.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.body.exchange import swapped_pose
from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel
from hmc.pose.method import Alternatives, StepResult, Subject
from hmc.pose.objectives.objective import cost_at
from hmc.pose.steps.polish import PolishSettings, fine_objective
from hmc.pose.steps.refine import refine
from hmc.pose.views.person_view import PersonView
from hmc.search.paths import cheapest_path

__all__ = ["LegSettings", "TellLegs", "choose_legs", "leg_alternatives", "limb_points", "no_alternatives"]

#: Exchanged legs are refined until a step gains less than this share: half of what they count more than they cost (`LegSettings.doubt`).
TOLERANCE = 0.01
_LEGS = np.concatenate([LIMBS[leg].landmarks for leg in ("l_leg", "r_leg")])
_LIMBS = np.concatenate([limb.landmarks for limb in LIMBS.values()])


#: Legs can be told apart where none of these is missing.
LEG_DOFS = np.concatenate([np.r_[LIMBS[leg].dofs, LIMBS[leg].end_dofs] for leg in ("r_leg", "l_leg")])
#: Frames a second up to which the weight of a jump was chosen.
RATE = 30.0


@dataclass(frozen=True)
class LegSettings:
    """How the legs are told apart.

    Parameters
    ----------
    lag_s : float
        A frame is decided when the person has been followed this much longer, seconds.
    doubt : float
        Share by which exchanged legs count more than they cost: where hulls are poor, small differences say nothing.
    jump_weight : float
        Cost, square metres, of a jump of the legs' velocity by one metre a second, up to `RATE` frames a second; more in proportion.
    largest_jump_m_s : float
        A greater jump costs no more than this one, so that a frame that went wrong does not decide alone.
    reach_s : float
        Velocities are taken over this time before and after, seconds.
    arms_too : bool
        Arms are told apart as well.
    """

    lag_s: float = 1.0
    doubt: float = 0.02
    jump_weight: float = 2e-5
    largest_jump_m_s: float = 2.8
    reach_s: float = 0.2
    arms_too: bool = False

    def reach(self, fps: float) -> int:
        """`reach_s` in frames."""
        return max(1, round(self.reach_s * fps))


def limb_points(body: BodyModel, states: np.ndarray, settings: LegSettings) -> np.ndarray:
    """Points by whose motion limbs are told apart, world, metres: states (n, 37) to points (n, k, 3)."""
    return landmarks(body, states)[:, _LIMBS if settings.arms_too else _LEGS]


def leg_alternatives(
    rng: np.random.Generator, subject: Subject, state: np.ndarray, view: PersonView, polish: PolishSettings
) -> Alternatives:
    """A pose and the one with exchanged legs.

    Parameters
    ----------
    rng : numpy.random.Generator
    subject : Subject
    state : ndarray, shape (37,)
    view : PersonView
        With hulls.
    polish : PolishSettings
        How the exchanged legs are refined.
    """
    if view.target is None:
        return no_alternatives(state)
    objective = fine_objective(rng, subject, view, polish)
    start = swapped_pose(subject.body, state, "legs")
    exchanged, info = refine(objective, start, replace(polish.refine, tolerance=TOLERANCE))
    return Alternatives(np.stack([state, exchanged]), np.array([cost_at(objective, state), info.cost]))


def no_alternatives(state: np.ndarray, n: int = 2) -> Alternatives:
    """The same pose (37,) again, for a frame that tells nothing of the legs."""
    return Alternatives(np.repeat(state[None], n, axis=0), np.zeros(n))


@dataclass(frozen=True)
class TellLegs:
    """What offers the pose with exchanged legs beside that of any step: a `hmc.pose.method.FindAlternatives`.

    Parameters
    ----------
    polish : PolishSettings
        How the exchanged legs are refined.
    """

    polish: PolishSettings

    def __call__(self, rng: np.random.Generator, stepped: StepResult, view: PersonView) -> Alternatives:
        """The pose and the one with exchanged legs; twice the pose in a frame without a fit, or where a leg is missing."""
        tracked, info = stepped
        tells = info.status == "fitted" and (info.missing is None or not info.missing[LEG_DOFS].any())
        return leg_alternatives(rng, tracked.subject, tracked.state, view, self.polish) if tells else no_alternatives(tracked.state)


def choose_legs(frames: np.ndarray, costs: np.ndarray, legs: np.ndarray, fps: float, settings: LegSettings) -> np.ndarray:
    """Which of the poses of each frame make the least costly path.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Rising; frames may be missing.
    costs : ndarray, shape (n, m)
        Of the m poses a frame, that of the filter first; square metres.
    legs : ndarray, shape (n, m, k, 3)
        Their knees and ankles, metres; or the k points of whatever limbs are told apart.
    fps : float
    settings : LegSettings

    Returns
    -------
    ndarray of int, shape (n,)
    """
    reach = settings.reach(fps)
    # Costs are summed over frames, of which there are more at a higher rate; a jump comes once.
    weight = settings.jump_weight * max(1.0, fps / RATE)
    costs = costs * np.where(np.arange(costs.shape[1]) == 0, 1.0, 1.0 + settings.doubt)

    def between(k: int) -> np.ndarray:
        return weight * np.minimum(_jumps(frames, legs, k, reach, fps), settings.largest_jump_m_s**2)

    return cheapest_path(costs, between)


def _jumps(frames: np.ndarray, legs: np.ndarray, k: int, reach: int, fps: float) -> np.ndarray:
    """Mean squared change of velocity from each pose before frame k to each pose in it, (m, m): before, in the step, and after."""
    first, last = max(0, k - 1 - reach), min(len(legs) - 1, k + reach)
    step = (legs[None, k] - legs[k - 1][:, None]) / (frames[k] - frames[k - 1])
    before = (legs[k - 1] - legs[first])[:, None] / (frames[k - 1] - frames[first]) if first < k - 1 else step
    after = (legs[last] - legs[k])[None] / (frames[last] - frames[k]) if last > k else step
    squares = [((one - other) ** 2).sum(-1).mean(-1) for one, other in ((step, before), (after, step), (after, before))]
    return np.mean(squares, axis=0) * fps**2
