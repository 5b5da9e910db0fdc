"""People by keypoints alone: whose detections are whose, against all ways to tell, ghosts, and who is whom over time."""

from itertools import combinations, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from posed import body_of

from hmc.body.keypoint_places import BODY_KEYPOINTS, MIRRORED
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.camera.model import Rig, look_at, project
from hmc.io.keypoints import KEYPOINTS
from hmc.pose.keypoint_tracks import link_people
from hmc.pose.views.keypoint_groups import find_people
from hmc.pose.views.keypoints import lines_of
from hmc.pose.views.line_meeting import meeting_points
from hmc.synthetic.keypoints import body_keypoints

OF_BODY = [KEYPOINTS.index(name) for name in BODY_KEYPOINTS]
TRUNK = [k for k, name in enumerate(BODY_KEYPOINTS) if name.endswith(("shoulder", "hip"))]
PLACES = np.array([(-0.9, 0.1), (0.0, -0.2), (0.8, 0.3)])


@pytest.fixture(scope="module")
def rig() -> Rig:
    """Four cameras around the room."""
    corners = [(3.2, 2.9, 2.2), (-3.0, 3.1, 1.8), (-3.1, -2.8, 2.4), (2.8, -3.2, 2.0)]
    return Rig(tuple(look_at(f"cam_{k:02d}", (640, 480), corner, [0, 0, 0.9], 75) for k, corner in enumerate(corners)))


def person(x: float, y: float, heading: float = 0.0) -> np.ndarray:
    """Keypoints of somebody who stands there, shape (15, 3)."""
    body, _ = body_of()
    state = neutral_state("down", body.limits)
    state[:4] = x, y, 0.95, heading
    return body_keypoints(landmarks(body, state))[OF_BODY]


def seen(rig: Rig, people, orders=None, noise_px: float = 0.0, seed: int = 0) -> list[np.ndarray]:
    """Detections of these people, in each camera in another order."""
    rng = np.random.default_rng(seed)
    found = []
    for c, camera in enumerate(rig):
        uv = np.array([project(camera, one)[0] for one in people]).reshape(-1, len(OF_BODY), 2)
        uv = uv + rng.normal(0, noise_px, uv.shape)
        order = range(len(people)) if orders is None else orders[c]
        found.append(np.concatenate([uv, np.ones((*uv.shape[:2], 1))], axis=2)[list(order)])
    return found


def misfit(rig: Rig, detections, members) -> float:
    """Mean distance of one person's lines from where they meet: written for this test."""
    directions = np.array([lines_of(camera, given[k])[0] for camera, given, k in zip(rig, detections, members, strict=True)])
    points = meeting_points(rig.centres, directions, np.full(directions.shape[:2], 1e3))
    towards = points - rig.centres[:, None]
    along = (towards * directions).sum(-1, keepdims=True)
    return float(np.linalg.norm(towards - along * directions, axis=-1).mean())


def best_of_all(rig: Rig, detections) -> set[tuple[int, ...]]:
    """Whose detections are whose, by trying all ways."""
    n = len(detections[0])
    ways = product(*[list(permutations(range(n)))] * (len(rig) - 1))
    costs = {}
    for way in ways:
        groups = tuple((k, *(order[k] for order in way)) for k in range(n))
        costs[groups] = sum(misfit(rig, detections, group) for group in groups)
    return set(min(costs, key=costs.__getitem__))


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6))
def test_two_people_are_told_as_the_best_of_all_ways_tells_them(rig, seed):
    rng = np.random.default_rng(seed)
    middle, way = rng.uniform(-0.6, 0.6, 2), rng.normal(size=2)
    step = way / np.linalg.norm(way) * rng.uniform(0.3, 0.8)
    people = [person(*(middle + sign * step), rng.uniform(-3, 3)) for sign in (-1, 1)]
    orders = [rng.permutation(2) for _ in rig]
    detections = seen(rig, people, orders, 3.0, seed)
    found = find_people(rig, detections)
    groups = {tuple(row) for row in found.members.tolist()}
    assert groups == best_of_all(rig, detections) == {tuple(int(np.flatnonzero(order == k)[0]) for order in orders) for k in (0, 1)}


@pytest.mark.parametrize("seed", [0, 1])
def test_three_people_are_told_as_the_best_of_all_ways_tells_them(rig, seed):
    rng = np.random.default_rng(seed)
    people = [person(*place, rng.uniform(-3, 3)) for place in PLACES]
    orders = [rng.permutation(3) for _ in rig]
    detections = seen(rig, people, orders, 3.0, seed)
    found = find_people(rig, detections)
    groups = [tuple(row) for row in found.members.tolist()]
    assert set(groups) == {tuple(int(np.flatnonzero(order == k)[0]) for order in orders) for k in range(3)}
    if seed == 0:  # 216 ways
        assert set(groups) == best_of_all(rig, detections)
    for group, position, head in zip(groups, found.positions, found.heads, strict=True):
        whom = people[orders[0][group[0]]]
        assert np.linalg.norm(position - whom[TRUNK].mean(axis=0)) < 0.03
        assert abs(head[2] - 1.78) < 0.08 and np.linalg.norm(head[:2] - position[:2]) < 0.15


def test_a_camera_that_does_not_see_somebody_and_one_that_turns_them(rig):
    people = [person(*place) for place in PLACES[:2]]
    detections = seen(rig, people)
    detections[1] = detections[1][:1]
    detections[2][0] = detections[2][0][MIRRORED]
    members = {tuple(row) for row in find_people(rig, detections).members.tolist()}
    assert members == {(0, 0, 0, 0), (1, -1, 1, 1)}


def test_ghosts_are_refused(rig):
    nobody = find_people(rig, [np.zeros((0, 15, 3))] * 4)
    assert nobody.positions.shape == (0, 3) and nobody.members.shape == (0, 4)
    alone = seen(rig, [person(0, 0)])
    assert not len(find_people(rig, [alone[0], *[np.zeros((0, 15, 3))] * 3]).positions), "one camera tells no place"
    small = (person(0, 0) - [0, 0, 0.9]) / 3 + [0, 0, 0.9]
    assert not len(find_people(rig, seen(rig, [small])).positions), "a doll"
    twice = [np.concatenate([one, one + [2.0, 1.0, 0.0]]) for one in alone]
    assert len(find_people(rig, twice).positions) == 1
    room = np.array([[1.0, -2, 0], [3, 2, 3]])
    assert not len(find_people(rig, alone, room).positions) and len(find_people(rig, alone, room - [1.0, 0, 0]).positions)
    assert len(find_people(rig, seen(rig, [person(*place) for place in PLACES]), most=2).positions) == 2


def places_of(*paths):
    """Positions and heads frame by frame of people on straight lines: (first frame, last frame, from, to), metres."""
    end = max(path[1] for path in paths) + 1
    found = [[] for _ in range(end)]
    for first, last, start, stop in paths:
        for frame in range(first, last + 1):
            share = (frame - first) / max(last - first, 1)
            found[frame].append(np.array([*start, 1.2]) * (1 - share) + share * np.array([*stop, 1.2]))
    places = [np.array(one).reshape(-1, 3) for one in found]
    return list(range(end)), places, [one + [0, 0, 0.6] for one in places]


def test_people_who_pass_one_another_keep_their_numbers():
    frames, places, heads = places_of((0, 59, (-1, 0.3), (1, 0.3)), (0, 59, (1, -0.3), (-1, -0.3)))
    table = link_people(frames, [one[:: 1 if k % 2 else -1] for k, one in enumerate(places)], heads, 30)
    assert table.persons.tolist() == [0, 1] * 60
    for number in (0, 1):
        assert np.ptp(table.positions[table.persons == number, 1]) < 1e-9
    assert_allclose(table.heads[:, 2], 1.8)


def test_gaps_are_bridged_and_who_is_hardly_there_is_nobody():
    whole = places_of((0, 89, (-1, 0), (1, 0)))
    for k in range(30, 50):
        whole[1][k], whole[2][k] = np.zeros((0, 3)), np.zeros((0, 3))
    table = link_people(*whole, 30)
    assert_array_equal(table.frames, range(90))
    assert set(table.persons) == {0} and np.abs(np.diff(table.positions[:, 0])).max() < 0.03
    table = link_people(*places_of((0, 29, (0, 0), (0, 0)), (70, 99, (0, 0), (0, 0)), (10, 18, (2, 2), (2, 2))), 30)
    assert [(table.frames[table.persons == n].min(), table.frames[table.persons == n].max()) for n in (0, 1)] == [(0, 29), (70, 99)]
    assert set(table.persons) == {0, 1}
    nothing = link_people(range(3), [np.zeros((0, 3))] * 3, [np.zeros((0, 3))] * 3, 30)
    assert nothing.positions.shape == (0, 3) and nothing.heads.shape == (0, 3)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 4))
def test_however_people_are_listed_tracks_are_the_same(seed, n):
    """People who keep their distance, in any order in every frame: as many tracks, each of one of them."""
    rng = np.random.default_rng(seed)
    starts = np.array([[2.0 * k, 0.0] for k in range(n)])
    frames, places, heads = places_of(*[(0, 39, start, start + rng.uniform(-0.4, 0.4, 2)) for start in starts])
    orders = [rng.permutation(n) for _ in frames]
    table = link_people(
        frames, [one[k] for one, k in zip(places, orders, strict=True)], [one[k] for one, k in zip(heads, orders, strict=True)], 30
    )
    assert len(table.frames) == 40 * n and len(set(table.persons)) == n
    for a, b in combinations(range(n), 2):
        assert np.abs(table.positions[table.persons == a][:, 0] - table.positions[table.persons == b][:, 0]).min() > 1
