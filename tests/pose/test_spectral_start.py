"""First poses from the voxels' own skeleton: near the truth without a heading."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from posed import COST, body_of, mean_error, plain_subject, subject_of, view_of

from hmc.body.kinematics import landmarks
from hmc.body.proportions import default_body
from hmc.landmarks import LANDMARKS
from hmc.pose.method import begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.spectral.reading import read_body
from hmc.pose.starts.spectral import body_state, spectral_poses, strict_voxels
from hmc.pose.steps.presets import PRESETS


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


@pytest.mark.parametrize("heading_deg", [40, -130, 120])
@pytest.mark.parametrize("motion", ["gesture", "box"])
def test_one_of_the_first_poses_is_near_the_truth(motion, heading_deg):
    acted = act(motion, frames=3, heading_deg=heading_deg)
    body, _ = body_of(acted.height_m)
    states, costs = spectral_poses(np.random.default_rng(0), plain_subject(acted.height_m), acted.targets[2], COST)
    found = landmarks(body, states)
    assert 1 < len(states) == len(costs) <= 6 and np.all(np.diff(costs) >= 0)
    assert min(mean_error(one, acted.landmarks[2]) for one in found) < 0.05
    # No two are the same pose.
    apart = [np.linalg.norm(one - other, axis=1).max() for k, one in enumerate(found) for other in found[:k]]
    assert min(apart) > 0.05


@pytest.mark.parametrize(("motion", "heading_deg", "backwards"), [("gesture", -130, False), ("box", 120, False), ("walk", 40, True)])
def test_a_filter_started_in_the_middle_of_an_action_is_at_the_truth_within_ten_frames(motion, heading_deg, backwards):
    """Standing in one place, or walking backwards: where the person goes does not say which way round they are."""
    acted = act(motion, frames=13, heading_deg=heading_deg)
    order = range(12, -1, -1) if backwards else range(13)
    targets, truth = [acted.targets[k] for k in order], acted.landmarks[list(order)]
    body, _ = body_of(acted.height_m)
    states, _ = spectral_poses(np.random.default_rng(0), plain_subject(acted.height_m), targets[2], COST)
    preset, errors = PRESETS["default"], []
    step, tracked = annealed_pose_step(preset), begin_tracking(subject_of(acted, preset), states[0])
    for k in range(3, 13):
        tracked, _ = step(np.random.default_rng(k), tracked, view_of(targets[k]))
        errors.append(mean_error(landmarks(body, tracked.state), truth[k]))
    assert errors[-1] < 0.06 and np.median(errors) < 0.06, np.round(1000 * np.array(errors))


def test_a_head_at_the_limit_is_not_taken_for_an_arm():
    # In this frame the head is a little too slim for one, and an arm is larger than it.
    acted = act("gesture", frames=3, heading_deg=-130)
    voxels, points = strict_voxels(acted.targets[2])
    shapes = read_body(voxels, points, acted.targets[2].voxel_size_m, acted.height_m).segmentation.shapes
    assert np.linalg.norm(shapes["head"].tip - acted.landmarks[2, LANDMARKS.index("head_top")]) < 0.1
    assert max(shapes[leg].tip[2] for leg in ("leg_1", "leg_2")) < 0.15


def test_a_hull_without_limbs_still_has_first_poses():
    acted = act("gesture")
    target = acted.targets[0]
    blob = np.zeros_like(target.tolerant)
    blob[5:9, 5:9, 5:9] = True
    little = replace(target, tolerant=blob, distance=np.where(blob, 0, target.distance + 1).astype(np.float32))
    states, _ = spectral_poses(np.random.default_rng(0), plain_subject(acted.height_m), little, COST)
    assert len(states) >= 1
