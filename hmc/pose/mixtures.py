"""Two poses of each frame, all mixtures of their limbs, and the way through them that time bears out.

One pass over a recording may have lost an arm where another has it, and the other way round for a leg. So every limb, and the rest of the
body, is taken from the one pose or from the other, and which are right is the path of least cost through all mixtures of all frames
(Viterbi, 1967): what the silhouettes say of each, and the jump of the limbs' velocities from one frame to the next (`hmc.pose.legs`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from hmc.body.dimensions import FitBodySettings
from hmc.body.limbs import CHAIN_OF_DOF, LIMBS
from hmc.body.model import BodyModel
from hmc.pose.anew import AnewSettings
from hmc.pose.legs import LegSettings, choose_legs, limb_points
from hmc.pose.part_colors import ColorSettings
from hmc.pose.steps.polish import PolishSettings
from hmc.pose.turned import TurnedSettings

__all__ = ["N_MIXTURES", "BackwardSettings", "choose_path", "mixed_poses", "mixture"]

#: Frames between whose poses one path is looked for, and how many before them are known and after them looked at.
BLOCK, CONTEXT, AHEAD = 600, 30, 60
#: Every way to take the rest of the body, and each limb, from one pose (0) or another (1); the column of each angle is its chain.
_TAKEN = np.array(list(product((0, 1), repeat=1 + len(LIMBS))), bool)
N_MIXTURES = len(_TAKEN)


@dataclass(frozen=True)
class BackwardSettings:
    """What the second pass does.

    Parameters
    ----------
    polish : PolishSettings
        How poses are refined and lost limbs looked for.
    fit_body : FitBodySettings or None
        How the body is fitted anew; None: it stays.
    body_frames : int
        Frames to which it is fitted, at most.
    path : LegSettings
        What a jump of the limbs' velocities costs.
    hidden_places, own_rays, best_way, standing_feet : bool
        False, to see what each is for: nothing is learnt of what furniture hides; rays that another's pose covers ask all the same; the
        backward pass's poses stay as they are, and none of the first pass's are taken; feet that stand are not held to the floor.
    anew : AnewSettings or None
        Where a pose is looked for anew (`hmc.pose.anew`); None: nowhere.
    turned : TurnedSettings or None
        When somebody was followed the wrong way round (`hmc.pose.turned`); None: never.
    colors : ColorSettings or None
        Which limbs are looked for by the colors of the person's parts (`hmc.pose.limb_colors`); None: none.
    smooth_s : float or None
        The time over which the poses are smoothed in the end, seconds (`hmc.motion.smoothing.local_polynomial`); None: they are not.
    """

    polish: PolishSettings
    fit_body: FitBodySettings | None = field(default_factory=FitBodySettings)
    body_frames: int = 20
    path: LegSettings = field(default_factory=lambda: LegSettings(jump_weight=6e-5, arms_too=True))
    hidden_places: bool = True
    own_rays: bool = True
    best_way: bool = True
    standing_feet: bool = True
    anew: AnewSettings | None = field(default_factory=AnewSettings)
    turned: TurnedSettings | None = field(default_factory=TurnedSettings)
    colors: ColorSettings | None = field(default_factory=ColorSettings)
    smooth_s: float | None = 0.2


def mixed_poses(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """One pose, another, and all with some of the limbs, or the rest of the body, taken from the one and some from the other.

    Parameters
    ----------
    one, other : ndarray, shape (..., 37)

    Returns
    -------
    ndarray, shape (..., 32, 37)
        The first is `one`, the last `other`.
    """
    return mixture(one[..., None, :], other[..., None, :], np.arange(N_MIXTURES))


def mixture(one: np.ndarray, other: np.ndarray, picks: np.ndarray) -> np.ndarray:
    """One of the `mixed_poses` of each pair of poses, without making all of them.

    Parameters
    ----------
    one, other : ndarray, shape (..., 37)
    picks : ndarray of int, shape (...)

    Returns
    -------
    ndarray, shape (..., 37)
    """
    return np.where(_TAKEN[picks][..., CHAIN_OF_DOF], other, one)


def choose_path(
    body: BodyModel, frames: np.ndarray, one: np.ndarray, other: np.ndarray, costs: np.ndarray, fps: float, settings: LegSettings
) -> np.ndarray:
    """Which mixture of every frame's two poses is on the least costly path; block by block, so that memory is bounded.

    Parameters
    ----------
    body : BodyModel
    frames : ndarray of int, shape (n,)
        Rising.
    one, other : ndarray, shape (n, 37)
    costs : ndarray, shape (n, 32)
        Of their `mixed_poses`, square metres.
    fps : float
    settings : LegSettings

    Returns
    -------
    ndarray of int, shape (n,)
        Places among the mixtures.
    """
    picks = np.zeros(len(frames), int)
    for start in range(0, len(frames), BLOCK):
        known, end = max(0, start - CONTEXT), min(len(frames), start + BLOCK + AHEAD)
        poses, told = mixed_poses(one[known:end], other[known:end]), costs[known:end].copy()
        decided = picks[known:start]
        poses[: len(decided)] = poses[np.arange(len(decided)), decided][:, None]
        told[: len(decided)] = 0.0
        points = _points(body, poses, settings)
        picks[start:end] = choose_legs(frames[known:end], told, points, fps, settings)[len(decided) :]
    return picks


def _points(body: BodyModel, poses: np.ndarray, settings: LegSettings) -> np.ndarray:
    flat = limb_points(body, poses.reshape(-1, poses.shape[-1]), settings)
    return flat.reshape(*poses.shape[:2], *flat.shape[1:])
