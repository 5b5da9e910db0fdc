"""Keypoints of a detector: lines of sight, whose they are, what they cost, and what a recording tells of the detector."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from methods import tiny_clip
from numpy.testing import assert_allclose
from scipy.optimize import approx_fprime, least_squares

from hmc.body.joints import N_DOF
from hmc.body.keypoint_places import BODY_KEYPOINTS, KEYPOINT_SEGMENTS, MIRRORED, keypoint_places
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import project
from hmc.io.keypoints.layouts import KEYPOINTS
from hmc.io.results import TrackTable
from hmc.landmarks import LANDMARKS
from hmc.pose.keypoint_cues import beside_body, learn_beside, learn_scatter, with_keypoints
from hmc.pose.objectives.keypoints import BESIDE_M, Beside, KeypointCost, KeypointSettings
from hmc.pose.objectives.objective import Sum
from hmc.pose.views.keypoint_pose import keypoint_pose, landmarks_seen
from hmc.pose.views.keypoints import SeenKeypoints, see_keypoints, sight_lines
from hmc.pose.views.line_meeting import meeting_points
from hmc.pose.views.person_view import PersonView

BODY = default_body(1.75)
OF_BODY = [KEYPOINTS.index(name) for name in BODY_KEYPOINTS]


def pose(rng, at=(0.0, 0.0)):
    state = neutral_state("down", BODY.limits)
    state[:3] = (*at, 0.95)
    state[3:] += rng.normal(0, 0.2, N_DOF - 3)
    return np.clip(state, BODY.limits.low, BODY.limits.high)


def places(state, beside=0.0):
    rotations, positions = segment_transforms(BODY, state)
    return positions[KEYPOINT_SEGMENTS] + np.einsum("kij,kj->ki", rotations[KEYPOINT_SEGMENTS], keypoint_places(BODY) + beside)


def detected(rig, *people, rng=None, noise_px=0.0):
    """What an ideal detector, or one of so much noise, makes of people's keypoints (15, 3)."""
    rng = rng or np.random.default_rng(0)
    images = [[project(camera, one)[0] + noise_px * rng.standard_normal((15, 2)) for one in people] for camera in rig]
    return [np.array([np.column_stack([uv, np.ones(15)]) for uv in image]).reshape(-1, 15, 3) for image in images]


def seen_by(rig, state, **noise):
    return see_keypoints(rig, detected(rig, places(state), **noise), {0: state[:3]})[0]


class Stored:
    """A source of keypoints that were made before: one list of arrays a frame."""

    def __init__(self, frames):
        self.frames = frames

    def frame(self, index):
        out = []
        for people in self.frames[index]:
            whole = np.full((len(people), len(KEYPOINTS), 3), np.nan)
            whole[..., 2] = 0
            whole[:, OF_BODY] = people
            out.append(whole)
        return tuple(out)


def test_joints_of_the_body_are_its_landmarks():
    state = pose(np.random.default_rng(1))
    expected = landmarks(BODY, state)[[LANDMARKS.index(name) for name in BODY_KEYPOINTS[:12]]]
    assert_allclose(places(state)[:12], expected, atol=1e-12)
    assert [BODY_KEYPOINTS[k][2:] for k in MIRRORED[:12]] == [name[2:] for name in BODY_KEYPOINTS[:12]]


def test_lines_of_sight_are_those_of_opencv(ring):
    camera = replace(ring.cameras[0], distortions=np.array([-0.2, 0.05, 0.001, -0.002]))
    points = np.random.default_rng(2).uniform([-0.6, -0.6, 0.2], [0.6, 0.6, 1.8], (40, 3))
    rotation, _ = cv2.Rodrigues(camera.rotation)
    uv = cv2.projectPoints(points, rotation, camera.translation, camera.matrix, camera.distortions)[0][:, 0]
    lines = sight_lines(camera, uv)
    ways = points - camera.centre
    assert_allclose(np.linalg.norm(np.cross(ways, lines), axis=1), 0, atol=1e-5)
    assert (np.einsum("ni,ni->n", ways, lines) > 0).all()


def test_lines_meet_where_the_least_squares_of_scipy_do(ring):
    rng = np.random.default_rng(3)
    state = pose(rng)
    seen = seen_by(ring, state, rng=rng, noise_px=1.0)
    for k in (2, 5, 12):
        own = seen.keypoint == k

        def misses(x, own=own):
            return (np.einsum("nij,nj->ni", seen.across[own], x - seen.centre[own]) / seen.deviation_m[own][:, None]).ravel()

        assert_allclose(seen.points[k], least_squares(misses, state[:3]).x, atol=1e-5)


def test_a_camera_that_is_wrong_does_not_move_the_point(ring):
    state = pose(np.random.default_rng(4))
    given = detected(ring, places(state))
    given[1][0, 2, :2] += 60
    seen = see_keypoints(ring, given, {0: state[:3]})[0]
    assert_allclose(seen.points, places(state), atol=2e-3)


def test_a_keypoint_of_one_camera_is_a_line_and_no_point(ring):
    state = pose(np.random.default_rng(5))
    given = detected(ring, places(state))
    for one in given[1:]:
        one[0, 2] = np.nan
    seen = see_keypoints(ring, given, {0: state[:3]})[0]
    assert np.isnan(seen.points[2]).all() and (seen.keypoint == 2).sum() == 1
    assert np.isfinite(np.delete(seen.points, 2, axis=0)).all()


def test_people_get_their_own_detections_and_nobody_what_is_nobodys(ring):
    rng = np.random.default_rng(6)
    states = {3: pose(rng, (-0.8, 0.0)), 7: pose(rng, (0.7, 0.4))}
    stranger = places(pose(rng, (0.0, 2.2)))
    given = detected(ring, *(places(state) for state in states.values()), stranger)
    order = [rng.permutation(3) for _ in ring]
    seen = see_keypoints(ring, [one[k] for one, k in zip(given, order, strict=True)], {n: one[:3] for n, one in states.items()})
    for person, state in states.items():
        assert_allclose(seen[person].points, places(state), atol=2e-3)


def test_somebody_a_metre_beside_is_somebody_else(ring):
    state = pose(np.random.default_rng(11))
    given = detected(ring, places(state))
    camera = ring.cameras[1]
    across = camera.rotation[0]  # a metre to the right in this camera's image
    given[1] = detected(ring, places(state) + across)[1]
    seen = see_keypoints(ring, given, {0: state[:3]})[0]
    assert 1 not in seen.camera
    given[1] = detected(ring, places(state) + 0.4 * across)[1]
    assert 1 in see_keypoints(ring, given, {0: state[:3]})[0].camera


def test_a_camera_that_exchanges_left_and_right_is_turned(ring):
    state = pose(np.random.default_rng(7))
    given = detected(ring, places(state))
    given[2] = given[2][:, MIRRORED]
    seen = see_keypoints(ring, given, {0: state[:3]})[0]
    off = np.einsum("nij,nj->ni", seen.across, places(state)[seen.keypoint] - seen.centre)
    assert_allclose(off, 0, atol=2e-3)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_the_cost_is_that_of_its_residuals_and_its_gradient_is_right(seed):
    rng = np.random.default_rng(seed)
    n = 30
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    one = np.cross(directions, np.eye(3)[np.abs(directions).argmin(axis=1)])
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    across = np.stack([one, np.cross(directions, one)], axis=1)
    seen = SeenKeypoints(
        rng.integers(15, size=n),
        rng.integers(4, size=n),
        rng.normal(0, 0.1, (n, 3)) + [0, 0, 1],
        across,
        np.full(n, 0.03),
        np.zeros((15, 3)),
    )
    cost = KeypointCost(BODY, seen, Beside(rng.normal(0, 0.02, (15, 3))), KeypointSettings(wide=2.0))
    state = pose(rng)
    found = cost.linearise(state)
    whole = cost.cost(state[None])[0]
    assert_allclose(found.residuals @ found.residuals, whole, rtol=1e-9)
    assert_allclose(cost.by_part(state[None]).sum(), whole, rtol=1e-9)
    rows, jacobian = found.pulls()
    gradient = approx_fprime(state, lambda x: cost.cost(x[None])[0], 1e-7)
    assert_allclose(2 * jacobian.T @ found.residuals[rows], gradient, atol=1e-4 * np.abs(gradient).max())
    assert_allclose(Sum([cost, cost]).cost(state[None]), 2 * whole)


def test_a_detection_that_is_altogether_wrong_pulls_little(ring):
    state = pose(np.random.default_rng(8))
    given = detected(ring, places(state))
    right = KeypointCost(BODY, see_keypoints(ring, given, {0: state[:3]})[0])
    costs = []
    for px in (20, 80, 160):
        wrong = [one.copy() for one in given]
        wrong[0][0, 8, 0] += px
        costs.append(replace(right, seen=see_keypoints(ring, wrong, {0: state[:3]})[0]).cost(state[None])[0])
    near, far, farther = np.array(costs) - right.cost(state[None])[0]
    assert 0 < near < far < farther < 2 * far < 16 * near


def test_the_pose_that_keypoints_show(ring):
    rng = np.random.default_rng(9)
    state = pose(rng)
    seen = seen_by(ring, state)
    start = neutral_state("down", BODY.limits)
    start[:3] = state[:3]
    (found,) = keypoint_pose(BODY, seen, start)
    named = np.isfinite(landmarks_seen(seen)).all(axis=1)
    assert named.sum() == 12
    assert np.linalg.norm(landmarks(BODY, found) - landmarks(BODY, state), axis=1)[named].max() < 0.02
    assert keypoint_pose(BODY, seen.of(seen.keypoint < 0), start)  # points are there still
    assert not keypoint_pose(BODY, replace(seen, points=np.full((15, 3), np.nan)), start)
    assert not keypoint_pose(BODY, None, start)


def test_the_scatter_of_a_detector_is_learnt(ring):
    rng = np.random.default_rng(10)
    noise, states = np.array([1.0, 1.0, 4.0, 1.0, 1.0]), [pose(rng) for _ in range(60)]
    frames = []
    for state in states:
        frames.append([detected([camera], places(state), rng=rng, noise_px=px)[0] for camera, px in zip(ring, noise, strict=False)])
    rig = ring.select(ring.names[: len(noise)])
    frames = [one[: len(rig)] for one in frames]
    tracks = TrackTable(np.arange(60), np.zeros(60, int), np.array([state[:3] for state in states]))
    cues = learn_scatter(rig, tracks, Stored(frames), 30)
    metres = [px * np.linalg.norm(camera.centre - [0, 0, 1]) / camera.matrix[0, 0] for camera, px in zip(rig, noise, strict=False)]
    found = np.median(cues.scatter_m, axis=1)
    expected = np.maximum(metres, 0.008)
    assert np.all((found > 0.6 * expected) & (found < 1.6 * expected))
    view = with_keypoints({0: PersonView(3)}, rig, tracks, cues)[0]
    assert len(view.keypoints.keypoint) == 15 * len(rig)
    assert with_keypoints({0: PersonView(3)}, rig, tracks, None)[0].keypoints is None


def test_what_lies_beside_is_learnt_and_what_is_never_seen_is_not(ring):
    rng = np.random.default_rng(11)
    beside = rng.normal(0, 0.02, (15, 3))
    found = []
    for _ in range(40):
        state = pose(rng)
        given = detected(ring, places(state, beside), rng=rng, noise_px=0.3)
        for one in given:
            one[:, 4] = np.nan
        found.append(beside_body(BODY, state, see_keypoints(ring, given, {0: state[:3]})[0]))
    learnt = learn_beside(found, [2e-4] * 40)
    told = np.arange(15) != 4
    assert np.abs(learnt.offset_m - beside)[told].max() < 0.006
    assert not learnt.offset_m[4].any() and learnt.deviation_m[4] == BESIDE_M[4]
    assert (learnt.deviation_m[told] < BESIDE_M[told]).all()
    assert learnt.worth == 1 and learn_beside(found, [1e-4]).worth == 0.5 and learn_beside(found, [1.0]).worth == 4
    assert not learn_beside([], []).offset_m.any()


def test_lines_that_are_hardly_apart_do_not_meet():
    centres = np.array([[0.0, 0, 0], [0.001, 0, 0]])
    directions = np.tile([0.0, 0, 1], (2, 15, 1))
    assert np.isnan(meeting_points(centres, directions, np.full((2, 15), 0.03))).all()


@pytest.mark.slow
def test_a_pose_with_keypoints_is_nearer_to_them_and_no_farther_from_the_truth(tmp_path):
    import hmc
    from hmc.experiments.truth import all_truth

    clip = tiny_clip(10)
    truth = all_truth(clip)
    index = [LANDMARKS.index(name) for name in BODY_KEYPOINTS[:12]]
    frames = {}
    for frame in range(clip.start, clip.start + clip.n_frames):
        points = truth.positions[truth.frames == frame][0][index]
        whole = np.concatenate([points, np.full((3, 3), np.nan)])
        frames[frame] = detected(clip.rig, whole)
        for one in frames[frame]:
            one[:, 12:] = np.nan
    alone = hmc.pose(clip)
    both = hmc.pose(clip, keypoints=Stored(frames))

    def off(people):
        own = truth.where(np.isin(truth.frames, people.frames))
        return np.linalg.norm(people.positions - own.positions, axis=2)[:, index].mean()

    assert off(both) < off(alone) < 0.05
