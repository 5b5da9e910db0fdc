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
from hmc.pose.objectives.residuals import residual_values
from hmc.pose.steps.annealed import PoseFilter
from hmc.pose.steps.refine import refine
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.rays import points_to_explain

__all__ = ["LegChoice", "LegSettings", "choose_legs", "leg_choice", "leg_points"]

#: Exchanged legs are refined until a step gains less than this share: half of what they count more than they cost (`LegSettings.doubt`).
TOLERANCE = 0.01
_LEGS = np.concatenate([LIMBS[leg].landmarks for leg in ("l_leg", "r_leg")])


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
        Cost, square metres, of a jump of the legs' velocity by one metre a second.
    largest_jump_m_s : float
        A greater jump costs no more than this one, so that a frame that went wrong does not decide alone.
    reach_s : float
        Velocities are taken over this time before and after, seconds.
    """

    lag_s: float = 1.0
    doubt: float = 0.02
    jump_weight: float = 2e-5
    largest_jump_m_s: float = 2.8
    reach_s: float = 0.2

    def reach(self, fps: float) -> int:
        """`reach_s` in frames."""
        return max(1, round(self.reach_s * fps))


@dataclass(frozen=True)
class LegChoice:
    """The poses of one frame, between which the frames around it decide.

    Parameters
    ----------
    states : ndarray, shape (m, 27)
        As followed, and with exchanged legs; of markers, other exchanges too.
    costs : ndarray, shape (m,)
        Square metres, from the same points; zero in a frame that tells nothing.
    """

    states: np.ndarray
    costs: np.ndarray


def leg_points(body: BodyModel, states: np.ndarray) -> np.ndarray:
    """Knees and ankles, world, metres: states of shape (n, 27) to points of shape (n, 4, 3)."""
    return landmarks(body, states)[:, _LEGS]


def leg_choice(rng: np.random.Generator, filt: PoseFilter, state: np.ndarray, target: HullTarget | None) -> LegChoice:
    """A pose and the one with exchanged legs.

    Parameters
    ----------
    rng : numpy.random.Generator
    filt : PoseFilter
        Of a preset with `refine`.
    state : ndarray, shape (27,)
    target : HullTarget or None
        None in a frame that has no hull, or whose pose was not fitted: there is nothing to choose then.
    """
    body, samples, preset = filt.body, filt.samples, filt.preset
    if target is None or preset.refine is None:
        states, costs = np.stack([state, state]), np.zeros(2)
    else:
        points = points_to_explain(rng, target, preset.fine_hull_points, preset.symmetric.ray_share)
        start = swapped_pose(body, state, "legs")
        rough = replace(preset.refine, tolerance=TOLERANCE)
        exchanged, info = refine(body, samples, start, target, points, preset.symmetric, rough)
        values = residual_values(body, samples, state, target, points, preset.symmetric)
        states, costs = np.stack([state, exchanged]), np.array([float(values @ values), info.cost])
    return LegChoice(states, costs)


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
    costs = costs * np.where(np.arange(costs.shape[1]) == 0, 1.0, 1.0 + settings.doubt)
    best = costs[0]
    came_from = []
    for k in range(1, len(frames)):
        jumps = _jumps(frames, legs, k, reach, fps)
        steps = best[:, None] + settings.jump_weight * np.minimum(jumps, settings.largest_jump_m_s**2)
        came_from.append(steps.argmin(0))
        best = steps.min(0) + costs[k]
    path = [int(best.argmin())]
    for choice in reversed(came_from):
        path.append(int(choice[path[-1]]))
    return np.array(path[::-1])


def _jumps(frames: np.ndarray, legs: np.ndarray, k: int, reach: int, fps: float) -> np.ndarray:
    """Mean squared change of velocity from each pose before frame k to each pose in it, (m, m): before, in the step, and after."""
    first, last = max(0, k - 1 - reach), min(len(legs) - 1, k + reach)
    step = (legs[None, k] - legs[k - 1][:, None]) / (frames[k] - frames[k - 1])
    before = (legs[k - 1] - legs[first])[:, None] / (frames[k - 1] - frames[first]) if first < k - 1 else step
    after = (legs[last] - legs[k])[None] / (frames[last] - frames[k]) if last > k else step
    squares = [((one - other) ** 2).sum(-1).mean(-1) for one, other in ((step, before), (after, step), (after, before))]
    return np.mean(squares, axis=0) * fps**2
