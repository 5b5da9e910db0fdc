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

#: Landmarks that move freely of the trunk.
_LOOSE = {"legs": ("knee", "ankle"), "arms": ("elbow", "wrist")}
#: Steps towards exchanged legs.
LEG_STEPS = 8
_LEG_ANGLES = np.concatenate([LIMBS["r_leg"].dofs, LIMBS["l_leg"].dofs])


def swapped_pose(body: BodyModel, state: np.ndarray, what: Literal["all", "legs", "arms"]) -> np.ndarray:
    """The same stick figure with left and right exchanged: the whole body turned about, the legs alone, or the arms alone.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (27,)
    what : {"all", "legs", "arms"}

    Returns
    -------
    ndarray, shape (27,)
        Within the joint limits, so it explains the hull as well as the body can that way round.
    """
    points = landmarks(body, state)
    moved, start = points.copy(), state.copy()
    for index, name in enumerate(LANDMARKS):
        if name[:2] not in ("l_", "r_"):
            continue
        # Hips and shoulders stay where the trunk holds them unless the whole body turns.
        if what == "all" or name[2:] in _LOOSE[what]:
            moved[index] = points[LANDMARKS.index(("r_" if name[0] == "l" else "l_") + name[2:])]
    if what == "all":
        start[3] += np.pi
        start[4:] = neutral_state("down", body.limits)[4:]
    if what != "legs":
        return fit_landmarks(body, moved, start)[0]
    start[_LEG_ANGLES] = mirror_state(state)[_LEG_ANGLES]  # nearly what is looked for, so that some steps do
    return fit_landmarks(body, moved, start, LEG_STEPS)[0]


def swapped_poses(body: BodyModel, state: np.ndarray) -> np.ndarray:
    """All that a hull confuses with a pose: turned about, legs exchanged, arms exchanged (`swapped_pose`).

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (27,)

    Returns
    -------
    ndarray, shape (3, 27)
    """
    return np.array([swapped_pose(body, state, "all"), swapped_pose(body, state, "legs"), swapped_pose(body, state, "arms")])
