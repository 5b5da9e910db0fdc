"""The table of limbs, by names and by what moves; and the angles at rest."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hmc.body.joints import DOF_NAMES, N_DOF, SEGMENTS, mirror_state
from hmc.body.kinematics import dof_masks, landmark_masks
from hmc.body.limbs import CHAIN_OF_DOF, CHAIN_OF_PART, LIMBS
from hmc.body.model import PARTS, neutral_state
from hmc.body.prior import POSTURE
from hmc.body.proportions import default_body, landmark_segments
from hmc.body.rest import HANGING_DEG, RELAXED_DEG, SWARM_DEG
from hmc.landmarks import LANDMARKS


@pytest.mark.parametrize("name", ["r_arm", "l_arm", "r_leg", "l_leg"])
def test_names_of_a_limb(name):
    limb, side, arm = LIMBS[name], name[0], name.endswith("arm")
    assert (limb.is_arm, limb.is_left) == (arm, side == "l")
    ball, hinge = ("shoulder", "elbow_z") if arm else ("hip", "knee_y")
    assert [DOF_NAMES[k] for k in limb.dofs] == [*(f"{side}_{ball}_{axis}" for axis in "xyz"), f"{side}_{hinge}"]
    links = ("upper_arm", "forearm") if arm else ("thigh", "shank")
    assert [PARTS[k] for k in limb.parts] == [SEGMENTS[k].name for k in limb.segments] == [f"{side}_{link}" for link in links]
    assert [LANDMARKS[k] for k in limb.landmarks] == [f"{side}_{part}" for part in (("elbow", "wrist") if arm else ("knee", "ankle"))]


@pytest.mark.parametrize("limb", LIMBS.values(), ids=list(LIMBS))
def test_a_limb_moves_its_own_segments_and_landmarks_alone(limb):
    moved = dof_masks()[:, limb.dofs].any(axis=1)
    feet = {k for k, one in enumerate(SEGMENTS) if one.name == f"{limb.name[0]}_foot" and not limb.is_arm}
    assert set(np.flatnonzero(moved)) == set(limb.segments) | feet
    assert set(np.flatnonzero(dof_masks()[:, limb.end_dofs].any(axis=1))) == feet
    assert set(np.flatnonzero(landmark_masks(default_body(1.7))[:, limb.dofs].any(axis=1))) == set(limb.landmarks)
    assert set(landmark_segments()[limb.landmarks]) == {limb.segments[1]}


def test_chains_are_the_trunk_and_the_limbs():
    assert list(LIMBS) == ["r_arm", "l_arm", "r_leg", "l_leg"]
    assert CHAIN_OF_PART.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert len(CHAIN_OF_DOF) == N_DOF
    for number, limb in enumerate(LIMBS.values(), 1):
        assert np.flatnonzero(CHAIN_OF_DOF == number).tolist() == [*limb.dofs, *limb.end_dofs]


def test_rest_is_the_same_on_both_sides():
    for angles in (HANGING_DEG, RELAXED_DEG, SWARM_DEG):
        state = np.array([angles.get(name, 0.0) for name in DOF_NAMES])
        assert_allclose(mirror_state(state), state)
        assert set(angles) <= set(DOF_NAMES)
    for rest in (neutral_state("down"), POSTURE[0]):
        assert_allclose(mirror_state(rest), rest)
    down = dict(zip(DOF_NAMES, np.degrees(neutral_state("down")), strict=True))
    assert [down[name] for name in ("r_shoulder_x", "l_shoulder_x", "r_elbow_z", "l_elbow_z")] == pytest.approx([80, -80, 15, -15])
    assert np.count_nonzero(neutral_state("down")) == 4
