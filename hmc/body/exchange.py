"""The same stick figure with left and right exchanged: what a hull confuses with a pose."""

from __future__ import annotations

from typing import Literal

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import mirror_state
from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel, neutral_state
from hmc.landmarks import LANDMARKS

__all__ = ["swapped_pose", "swapped_poses"]

#: The landmark on the other side of each, or itself.
_OTHER_SIDE = [LANDMARKS.index({"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]) for name in LANDMARKS]
#: Landmarks that change places: hips and shoulders stay where the trunk holds them unless the whole body turns.
_EXCHANGED = {
    "all": np.arange(len(LANDMARKS)),
    "legs": np.concatenate([LIMBS["r_leg"].landmarks, LIMBS["l_leg"].landmarks]),
    "arms": np.concatenate([LIMBS["r_arm"].landmarks, LIMBS["l_arm"].landmarks]),
}
#: Steps towards exchanged legs.
LEG_STEPS = 8
_LEG_ANGLES = np.concatenate([np.r_[LIMBS[leg].dofs, LIMBS[leg].end_dofs] for leg in ("r_leg", "l_leg")])


def swapped_pose(body: BodyModel, state: np.ndarray, what: Literal["all", "legs", "arms"]) -> np.ndarray:
    """The same stick figure with left and right exchanged: the whole body turned about, the legs alone, or the arms alone.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
    what : {"all", "legs", "arms"}

    Returns
    -------
    ndarray, shape (37,)
        Within the joint limits, so it fits the hull as well as the body can that way round.
    """
    points = landmarks(body, state)
    moved, start = points.copy(), state.copy()
    moved[_EXCHANGED[what]] = points[_OTHER_SIDE][_EXCHANGED[what]]
    if what == "all":
        start[3] += np.pi
        start[4:] = neutral_state("down", body.limits)[4:]
    if what != "legs":
        return fit_landmarks(body, moved, start)[0]
    start[_LEG_ANGLES] = mirror_state(state)[_LEG_ANGLES]  # nearly what is looked for, so that some steps do
    return fit_landmarks(body, moved, start, LEG_STEPS)[0]


def swapped_poses(body: BodyModel, state: np.ndarray) -> np.ndarray:
    """The poses that a hull confuses with a pose: turned about, legs exchanged, arms exchanged (`swapped_pose`).

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)

    Returns
    -------
    ndarray, shape (3, 37)
    """
    return np.array([swapped_pose(body, state, "all"), swapped_pose(body, state, "legs"), swapped_pose(body, state, "arms")])
