"""Whose a camera's detections are: by tracks, and by other cameras' lines where tracks leave it open."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_keypoint_cost import detected, places, pose

from hmc.body.keypoint_places import MIRRORED
from hmc.camera.model import Rig, look_at
from hmc.pose.views import whose as module
from hmc.pose.views.keypoints import lines_of
from hmc.pose.views.whose import whose


def rig_of(cameras):
    angles = 2 * np.pi * np.arange(cameras) / cameras
    return Rig(tuple(look_at(f"c{k}", (640, 480), [4 * np.cos(a), 4 * np.sin(a), 2.0], [0, 0, 0.9], 60) for k, a in enumerate(angles)))


def assigned(rig, images, people):
    directions = [
        np.array([lines_of(camera, one)[0] for one in image]).reshape(-1, 15, 3) for camera, image in zip(rig, images, strict=True)
    ]
    return whose(rig, images, directions, people)


def behind(rig, metres=0.45):
    """Two people one behind the other for the first camera, and tracks that are 15 cm beside them, each towards the other's side."""
    rng = np.random.default_rng(3)
    states = [pose(rng, (metres / 2, 0.0)), pose(rng, (-metres / 2, 0.0))]
    images = detected(rig, *(places(state) for state in states))
    aside = 0.15 * np.array([0.0, 1.0, 0.0])
    return images, {0: states[0][:3] + aside, 1: states[1][:3] - aside}


@pytest.mark.parametrize("cameras", [3, 5])
def test_who_stands_behind_is_told_by_the_other_cameras(cameras, monkeypatch):
    rig = rig_of(cameras)
    images, people = behind(rig)
    right = {0: [0] * cameras, 1: [1] * cameras}
    images[0][0, :, 0] -= 12  # detections are nearer to the other's track there
    images[0][1, :, 0] += 12
    swapped = [image[::-1] if c == 0 else image for c, image in enumerate(images)]
    expected = {person: [1 - k if c == 0 else k for c, k in enumerate(own)] for person, own in right.items()}
    assert assigned(rig, images, people) == right
    assert assigned(rig, swapped, people) == expected
    monkeypatch.setattr(module, "ROUNDS", 0)
    assert assigned(rig, images, people) != right


def test_a_camera_with_left_and_right_exchanged_keeps_its_people():
    rig = rig_of(4)
    images, people = behind(rig)
    images[0] = images[0][:, MIRRORED]
    assert assigned(rig, images, people) == {0: [0] * 4, 1: [1] * 4}


def test_of_two_detections_of_one_person_it_is_the_one_that_others_meet():
    rig = rig_of(4)
    state = pose(np.random.default_rng(4))
    images = detected(rig, places(state))
    beside = images[2].copy()
    beside[..., 0] += 20
    images[2] = np.concatenate([beside, images[2]])
    track = state[:3] + 0.15 * rig[2].rotation[0]  # nearer to the wrong one
    assert assigned(rig, images, {7: track}) == {7: [0, 0, 1, 0]}


def test_who_is_seen_by_no_other_camera_is_not_the_nearer_for_that():
    rig = rig_of(3)
    state = pose(np.random.default_rng(6))
    images = detected(rig, places(state))
    images[0][..., :2] += np.random.default_rng(7).normal(0, 4, images[0].shape[:-1] + (2,))  # lines do not meet to the millimetre
    trunk = places(state)[module._TRUNK].mean(axis=0)
    aside, away = 0.15 * rig[0].rotation[0], (trunk - rig.centres[0]) / np.linalg.norm(trunk - rig.centres[0])
    # In the first camera's image both are as far from the detection, to its right and left; the others see one of them.
    people = {0: trunk + aside, 1: trunk - 0.8 * aside + 0.8 * away}
    assert assigned(rig, images, people) == {0: [0, 0, 0], 1: [None, None, None]}


def test_what_fits_nobody_and_who_is_seen_by_none():
    rig = rig_of(3)
    rng = np.random.default_rng(5)
    near, far = pose(rng), pose(rng, (0.0, 2.0))
    images = detected(rig, places(far))
    assert assigned(rig, images, {0: near[:3]}) == {0: [None] * 3}
    assert assigned(rig, [image[:0] for image in images], {0: near[:3]}) == {0: [None] * 3}
    assert assigned(rig, images, {}) == {}


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 4), st.integers(2, 6))
def test_people_apart_are_who_they_are_in_any_order(seed, people, cameras):
    rng, rig = np.random.default_rng(seed), rig_of(cameras)
    states = {3 * k: pose(rng, (1.3 * k - 1.5, rng.uniform(-0.3, 0.3))) for k in range(people)}
    images, orders = detected(rig, *(places(state) for state in states.values())), [rng.permutation(people) for _ in rig]
    found = assigned(rig, [image[order] for image, order in zip(images, orders, strict=True)], {n: one[:3] for n, one in states.items()})
    for k, person in enumerate(states):
        assert found[person] == [int(np.flatnonzero(order == k)[0]) for order in orders]
