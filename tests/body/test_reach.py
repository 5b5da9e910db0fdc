"""Reaching limbs against forward kinematics and scipy's rotations."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.body import reach as module
from hmc.body.kinematics import segment_transforms
from hmc.body.limbs import LIMBS
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body, make_body
from hmc.body.reach import limb_joint, limb_lengths, reach
from hmc.body.twists import rotations_about

LOWER = {name: limb.segments[1] for name, limb in LIMBS.items()}


def ends(body, limb, states):
    """Where the limb's end is: along the forearm or down the shank."""
    rotations, positions = segment_transforms(body, states)
    along = {"r_arm": [0, -1, 0], "l_arm": [0, 1, 0]}.get(limb, [0, 0, -1])
    upper, _ = limb_lengths(body, limb)
    joint = segment_transforms(body, states)[1][:, LIMBS[limb].segments[0]]
    assert_allclose(np.linalg.norm(positions[:, LOWER[limb]] - joint, axis=1), upper)
    return positions[:, LOWER[limb]] + rotations[:, LOWER[limb]] @ (limb_lengths(body, limb)[1] * np.array(along))


@pytest.mark.parametrize("limb", LIMBS)
def test_ends_come_where_they_were(limb):
    rng = np.random.default_rng(3)
    body, n = make_body(default_body(1.75).dimensions | {"arms_longer_left": 0.08, "legs_longer_left": -0.08}), 300
    state = neutral_state("down")
    state[:3] = rng.normal(size=3)
    state[3:9] = rng.uniform(-0.4, 0.4, 6)
    states = np.repeat(state[None], n, axis=0)
    dofs = LIMBS[limb].dofs
    # Points that the limb can reach, for these poses do.
    states[:, dofs] = rng.uniform(body.limits.low[dofs] * 0.7, body.limits.high[dofs] * 0.7, (n, 4))
    points = ends(body, limb, states)
    found = np.repeat(state[None], n, axis=0)
    found[:, dofs] = reach(body, state, limb, points, rng.uniform(-np.pi, np.pi, n))
    assert np.all(found >= body.limits.low - 1e-12) and np.all(found <= body.limits.high + 1e-12)
    error = np.linalg.norm(ends(body, limb, found) - points, axis=1)
    inside = np.all((found[:, dofs] > body.limits.low[dofs] + 1e-9) & (found[:, dofs] < body.limits.high[dofs] - 1e-9), axis=1)
    assert inside.mean() > 0.15 and error[inside].max() < 1e-6
    # Far points stretch the limb.
    centre, _ = limb_joint(body, state, limb)
    far = reach(body, state, limb, centre + 10 * (points - centre), np.zeros(n))
    assert_allclose(far[:, 3], 0, atol=2e-3)


def test_rotations_agree_with_scipy():
    rng = np.random.default_rng(4)
    axes = rng.normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = rng.uniform(-3, 3, 50)
    turn = rotations_about(axes, angles)
    assert_allclose(turn, Rotation.from_rotvec(axes * angles[:, None]).as_matrix(), atol=1e-12)
    for triple in module._angles(turn):
        assert_allclose(Rotation.from_euler("XYZ", triple).as_matrix(), turn, atol=1e-9)
    others = np.roll(axes, 1, axis=0)
    others[0], others[1] = -axes[0], axes[1]
    between = module._between(axes, others)
    assert_allclose(np.einsum("nij,nj->ni", between, axes), others, atol=1e-9)
    assert_allclose(np.linalg.det(between), 1)
