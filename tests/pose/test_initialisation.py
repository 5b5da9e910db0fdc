"""First poses of rendered people from one frame, with nothing known."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose
from posed import COST, body_of, mean_error, plain_subject

from hmc.body.exchange import swapped_poses
from hmc.body.joints import DOF_NAMES, N_DOF, mirror_state
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import canton_body
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.pose.starts.templates import FLOOR_M, FLOOR_TEMPLATES, TEMPLATES, first_poses, lying_height, template_states


def turn(one: float, other: float) -> float:
    """Angle between two headings, degrees."""
    return float(np.degrees(np.abs(np.angle(np.exp(1j * (one - other))))))


@pytest.mark.parametrize("body", [body_of()[0], canton_body(1.6)], ids=["default", "canton"])
def test_templates_stand_on_the_floor_within_the_limits(body):
    headings = np.array([0.0, 1.0, -2.0])
    states = template_states(body, np.array([0.5, -0.7]), 0.2, headings)
    assert states.shape == (3, len(TEMPLATES), N_DOF)
    assert np.all((states >= body.limits.low) & (states <= body.limits.high))
    assert_allclose(states[:, :, 3], np.repeat(headings[:, None], len(TEMPLATES), axis=1))
    assert_allclose(states[..., :2], np.broadcast_to([0.5, -0.7], states[..., :2].shape))
    points = landmarks(body, states[0])
    ankles = points[:, [landmark_index("l_ankle"), landmark_index("r_ankle")], 2].min(1) - 0.2
    assert np.all(ankles > -0.12) and np.all(ankles < 0.35)  # kneeling included
    # Heights are over the floor, and templates turn about the vertical through the pelvis.
    higher = template_states(body, np.array([0.5, -0.7]), 1.2, headings)
    assert_allclose(higher[..., 2], states[..., 2] + 1.0)
    centre = np.array([0.5, -0.7])
    radius = np.linalg.norm(landmarks(body, states)[..., :2] - centre, axis=-1)
    assert_allclose(radius[0], radius[2], atol=1e-9)


def test_templates_come_in_both_hands_or_are_symmetric():
    """Nobody is left-handed by construction: the mirror image of every template is a template."""
    body, _ = body_of()
    states = template_states(body, np.zeros(2), 0.0, np.zeros(1))[0]
    for state, name in zip(states, TEMPLATES, strict=True):
        assert np.abs(states - mirror_state(state)).max(1).min() < 1e-9, name


def test_templates_of_who_is_on_the_floor_are_low_and_above_it():
    body, _ = body_of()
    states = template_states(body, np.zeros(2), 0.0, np.zeros(1), 0.0)[0]
    low = states[-len(FLOOR_TEMPLATES) :]
    points = landmarks(body, low)
    assert np.all(points[..., 2].max(1) < FLOOR_M) and np.all(points[..., 2].min(1) > -0.12)
    assert len(states) == len(TEMPLATES) + len(low)  # who sits low, kneels or is a child has one of the others
    for state, name in zip(low, FLOOR_TEMPLATES, strict=True):
        assert np.abs(low - mirror_state(state)).max(1).min() < 1e-9, name


def test_who_lies_is_looked_for_where_they_lie_and_who_stands_is_not():
    target = act("walk").targets[0]
    lying = target.surface[:, [2, 0, 1]]  # the height becomes a length
    lying = lying - [0, 0, np.quantile(lying[:, 2], 0.005)]
    for bottom, found in ((0.2, 0.2), (0.9, 0.9 + np.median(lying[:, 2]))):
        assert lying_height(replace(target, surface=lying + [0, 0, bottom]), 0.2) == pytest.approx(found)
    assert lying_height(target, 0.0) is None


@pytest.mark.parametrize(("motion", "heading_deg"), [("gesture", 40), ("walk", -130)])
def test_one_of_the_first_poses_is_near_the_truth(motion, heading_deg):
    acted = act(motion, heading_deg=heading_deg)
    body, _ = body_of(acted.height_m)
    states, costs = first_poses(np.random.default_rng(0), plain_subject(acted.height_m), acted.targets[2], COST)
    assert len(states) == len(costs) <= 6 and np.all(np.diff(costs) >= 0)
    assert np.all((states >= body.limits.low) & (states <= body.limits.high))
    assert min(turn(state[3], acted.heading) for state in states) < 45
    # Whatever way round, the body fills the hull: pelvis and head are where they should be.
    found = landmarks(body, states)
    for name in ("pelvis", "head_top"):
        k = landmark_index(name)
        assert np.linalg.norm(found[0, k] - acted.landmarks[2, k]) < 0.15
    both_ways = [mean_error(found, acted.landmarks[2]) for found in (*found, *landmarks(body, swapped_poses(body, states[0])))]
    assert min(both_ways) < 0.10


def test_first_poses_are_different_poses():
    acted = act("gesture")
    body, _ = body_of(acted.height_m)
    states, _ = first_poses(np.random.default_rng(1), plain_subject(acted.height_m), acted.targets[0], COST, keep=4)
    found = landmarks(body, states)
    for a in range(len(found)):
        for b in range(a):
            assert np.linalg.norm(found[a] - found[b], axis=1).max() > 0.05


def test_a_person_on_a_stage():
    """The floor need not be at zero."""
    acted = act("walk")
    target = acted.targets[0]
    raised = replace(
        target, origin=target.origin + [0, 0, 1.5], surface=target.surface + [0, 0, 1.5], rays=target.rays + [0, 0, 1.5, 0, 0, 0]
    )
    plain, cost = first_poses(np.random.default_rng(3), plain_subject(acted.height_m), target, COST, floor_z=0.0)
    high, high_cost = first_poses(np.random.default_rng(3), plain_subject(acted.height_m), raised, COST, floor_z=1.5)
    assert_allclose(high[0][:3], plain[0][:3] + [0, 0, 1.5], atol=0.03)
    assert high_cost[0] == pytest.approx(cost[0], rel=0.2)


def test_swapped_poses_hold_the_same_places_the_other_way_round():
    body, _ = body_of()
    state = neutral_state("down", body.limits)
    state[[DOF_NAMES.index(n) for n in ("l_hip_y", "r_hip_y", "l_shoulder_z", "root_rz")]] = -0.4, 0.3, -0.5, 0.7
    points = landmarks(body, state)
    about, legs, arms = swapped_poses(body, state)
    for other in (about, legs, arms):
        assert np.all((other >= body.limits.low) & (other <= body.limits.high))
    assert turn(about[3], state[3]) > 135
    assert max(turn(legs[3], state[3]), turn(arms[3], state[3])) < 45

    def place(s, name):
        return landmarks(body, s)[landmark_index(name)]

    def exchanged(name):
        return ("r_" if name[0] == "l" else "l_") + name[2:]

    for name in LANDMARKS:
        if name[:2] in ("l_", "r_"):
            assert np.linalg.norm(place(about, name) - points[landmark_index(exchanged(name))]) < 0.12
    for side in ("l_", "r_"):
        for changed, kept, ends in ((legs, arms, "ankle"), (arms, legs, "wrist")):
            end = landmark_index(side + ends)
            swap = landmark_index(exchanged(side + ends))
            assert np.linalg.norm(place(changed, side + ends) - points[swap]) < 0.15
            assert np.linalg.norm(place(kept, side + ends) - points[end]) < 0.1
