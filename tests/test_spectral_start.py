"""First poses from the voxels' own skeleton: near the truth without a heading."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from posed import COST, body_of, mean_error

from hmc.pose.body.kinematics import landmarks
from hmc.pose.body.proportions import default_body
from hmc.pose.spectral_start import body_state, spectral_poses, strict_voxels


def test_a_body_takes_up_the_landmarks_of_another():
    body = default_body(1.8)
    acted = act("gesture")
    found = landmarks(body, body_state(body, acted.landmarks[3]))
    assert mean_error(found, acted.landmarks[3]) < 0.05


def test_strict_voxels_are_those_of_the_hull():
    target = act("gesture").targets[0]
    voxels, points = strict_voxels(target)
    assert len(voxels) * target.voxel_size_m**3 == pytest.approx(target.volume_m3)
    assert np.abs(points.min(0) - target.surface.min(0)).max() < 1e-9


@pytest.mark.parametrize("heading_deg", [40, -130])
def test_one_of_the_first_poses_is_near_the_truth(heading_deg):
    acted = act("gesture", heading_deg=heading_deg)
    body, points = body_of(acted.height_m)
    states, costs = spectral_poses(np.random.default_rng(0), body, points, acted.targets[2], COST)
    assert len(states) == len(costs) and np.all(np.diff(costs) >= 0)
    assert min(mean_error(found, acted.landmarks[2]) for found in landmarks(body, states)) < 0.12


def test_a_hull_without_limbs_still_has_first_poses():
    acted = act("gesture")
    body, points = body_of(acted.height_m)
    target = acted.targets[0]
    blob = np.zeros_like(target.tolerant)
    blob[5:9, 5:9, 5:9] = True
    little = replace(target, tolerant=blob, distance=np.where(blob, 0, target.distance + 1).astype(np.float32))
    states, _ = spectral_poses(np.random.default_rng(0), body, points, little, COST)
    assert len(states) >= 1
