"""Cones of many particles: their coordinates against plain loops, and nothing near is ever left out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from posed import body_of

from hmc.body.cone_maps import cone_maps, cones_near, spread
from hmc.body.cones import cone_distance
from hmc.body.joints import N_DOF
from hmc.body.kinematics import place_segments, segment_transforms
from hmc.body.model import neutral_state
from hmc.pose.objectives.symmetric import body_distance

BODY, _ = body_of()


def states_around_standing(deviation: float, n: int = 12) -> np.ndarray:
    return neutral_state("down") + np.random.default_rng(0).normal(0, deviation, (n, N_DOF))


def test_maps_lead_to_the_coordinates_of_the_cones():
    states, cones = states_around_standing(0.5), BODY.cones
    maps = cone_maps(cones, place_segments(BODY, states, np.zeros(3)))
    point = np.array([0.2, -0.1, 0.3])
    for n, state in enumerate(states):
        rotations, positions = segment_transforms(BODY, state)
        for c, segment in enumerate(cones.segment):
            local = cones.bases[c] @ (rotations[segment].T @ (point - positions[segment]) - cones.start[c])
            assert_allclose(maps.to_cone[c, :, :, n] @ [*point, 1], local, atol=1e-5)
            assert_allclose(maps.start[c, :, n], rotations[segment] @ cones.start[c] + positions[segment], atol=1e-5)
            assert_allclose(maps.axis[c, :, n], rotations[segment] @ cones.bases[c, 2], atol=1e-5)


@pytest.mark.parametrize("deviation", [0.02, 0.2, 1.0])
@pytest.mark.parametrize("reach", [0.0, 0.06])
def test_what_is_not_near_is_farther_in_every_particle(deviation, reach):
    states, cones = states_around_standing(deviation), BODY.cones
    maps = cone_maps(cones, place_segments(BODY, states, np.zeros(3)))
    points = np.random.default_rng(1).normal(0, 0.5, (60, 3))
    near, _ = cones_near(cones, maps, points, reach)
    assert deviation > 0.5 or not near.all()
    for state in states:
        rotations, positions = segment_transforms(BODY, state)
        for c, segment in enumerate(cones.segment):
            distance = cone_distance(cones, c, (points - positions[segment]) @ rotations[segment])
            assert np.all(distance[~near[c]] > reach)


@pytest.mark.parametrize("deviation", [0.02, 0.3])
def test_rays_that_are_not_near_pass_farther_off_in_every_particle(deviation):
    states, cones = states_around_standing(deviation), BODY.cones
    maps = cone_maps(cones, place_segments(BODY, states, np.zeros(3)))
    rng = np.random.default_rng(1)
    points, directions = rng.normal(0, 0.7, (60, 3)), rng.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[::4] = 0
    near = cones_near(cones, maps, points, 0.06, directions)[0]
    assert not near.all()
    np.testing.assert_array_equal(near[:, ::4], cones_near(cones, maps, points, 0.06)[0][:, ::4])
    along = points + np.linspace(-3, 3, 601)[:, None, None] * directions
    for state in states:
        rotations, positions = segment_transforms(BODY, state)
        for c, segment in enumerate(cones.segment):
            distance = cone_distance(cones, c, (along - positions[segment]) @ rotations[segment]).min(0)
            assert np.all(distance[~near[c]] > 0.06)


@pytest.mark.parametrize("deviation", [0.002, 0.01, 0.05])
def test_what_is_held_is_in_the_body_in_every_particle(deviation):
    states, cones = states_around_standing(deviation), BODY.cones
    maps = cone_maps(cones, place_segments(BODY, states, np.zeros(3)))
    rng = np.random.default_rng(3)
    points = np.concatenate([maps.start.mean(axis=2) + at * (maps.axis.mean(axis=2) * cones.lengths[:, None]) for at in (0.2, 0.5, 0.9)])
    points = np.repeat(points, 20, axis=0) + rng.normal(0, 0.03, (60 * len(cones.part), 3))
    directions = rng.normal(size=points.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[::2] = 0
    _, held = cones_near(cones, maps, points, 0.06, directions)
    assert deviation > 0.005 or min(held[::2].mean(), held[1::2].mean()) > 0.01
    assert held.mean() < 0.9
    uncovered = body_distance(BODY, states, np.concatenate([points, directions], axis=1))
    assert not uncovered[:, held].any()


def test_of_one_pose_with_slack_nothing_is_lost():
    cones, state = BODY.cones, neutral_state("down")
    rng = np.random.default_rng(4)
    points = rng.normal(0, 0.4, (300, 3))
    near = cones_near(cones, cone_maps(cones, place_segments(BODY, state[None], np.zeros(3))), points, 0.06, slack=0.05)[0]
    for _ in range(20):
        maps = cone_maps(cones, place_segments(BODY, state[None] + rng.normal(0, 0.03, N_DOF), np.zeros(3)))
        ends = maps.start + maps.axis * cones.lengths[:, None, None]
        before = cone_maps(cones, place_segments(BODY, state[None], np.zeros(3)))
        moved = [
            np.linalg.norm(a - b, axis=1).max()
            for a, b in ((maps.start, before.start), (ends, before.start + before.axis * cones.lengths[:, None, None]))
        ]
        if max(moved) < 0.05:
            now, _ = cones_near(cones, maps, points, 0.06)
            assert near[now].all()


def test_spread_is_the_farthest_from_the_mean():
    points = np.random.default_rng(2).normal(size=(4, 3, 9))
    middle, far = spread(points)
    assert_allclose(middle, points.mean(axis=2))
    assert_allclose(far, [max(np.linalg.norm(p - m) for p in each.T) for each, m in zip(points, middle, strict=True)])
