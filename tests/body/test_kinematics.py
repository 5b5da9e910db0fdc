"""Forward kinematics against the exponential maps of the thesis (appendix A), SciPy's rotations and finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.body.joints import DOF_NAMES, N_DOF, SEGMENTS, dof_index
from hmc.body.kinematics import SEGMENT_DOFS, dof_masks, joint_twists, landmarks, place_segments, segment_transforms
from hmc.body.proportions import canton_body, default_body, landmark_segments
from hmc.body.twists import chain_map
from hmc.landmarks import BONES, landmark_index

BODY = default_body(1.78)
# The trunk bends at the pelvis, so all bones are rigid.
RIGID = (*BONES, ("l_hip", "r_hip"), ("l_shoulder", "r_shoulder"))
#: What a spine that bends and shoulders that are raised move against one another.
IN_THE_TRUNK = {"pelvis", "neck", "l_shoulder", "r_shoulder"}


def random_states(seed: int, n: int, body=BODY) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low = np.where(np.isfinite(body.limits.low), body.limits.low, -3)
    high = np.where(np.isfinite(body.limits.high), body.limits.high, 3)
    return rng.uniform(low, high, (n, N_DOF))


def product_of_exponentials(body, state, index):
    """Segment's frame to world (Eq. A.10), ordered from the root outwards; twists are those of the neutral pose."""
    chain, at = [], index
    while at >= 0:
        chain.insert(0, at)
        at = SEGMENTS[at].parent
    home = np.cumsum(body.offsets[chain], axis=0)
    joints = [(name, centre, dof) for one, centre in zip(chain, home, strict=True) for name, dof in _turns(one)]
    axes = np.eye(3)[["xyz".index(name) for name, _, _ in joints]]
    matrix = chain_map(axes, np.array([centre for _, centre, _ in joints]), state[[dof for _, _, dof in joints]])
    at_rest = np.eye(4)
    at_rest[:3, 3] = home[-1]
    matrix = matrix @ at_rest
    matrix[:3, 3] += state[:3]
    return matrix


def _turns(segment):
    return zip(SEGMENTS[segment].axes, SEGMENT_DOFS[segment], strict=True)


@pytest.mark.parametrize("body", [BODY, canton_body(1.6)], ids=["default", "canton"])
def test_segments_are_products_of_exponential_maps(body):
    states = random_states(0, 4, body)
    rotations, positions = segment_transforms(body, states)
    for k, state in enumerate(states):
        for index in range(len(SEGMENTS)):
            expected = product_of_exponentials(body, state, index)
            assert_allclose(rotations[k, index], expected[:3, :3], atol=1e-12)
            assert_allclose(positions[k, index], expected[:3, 3], atol=1e-12)


def one_by_one(body, state):
    """Rotation and position of every segment, by products of matrices from the root outwards."""
    rotations, positions = [], []
    for segment, dofs, offset in zip(SEGMENTS, SEGMENT_DOFS, body.offsets, strict=True):
        frame, at = (np.eye(3), state[:3]) if segment.parent < 0 else (rotations[segment.parent], positions[segment.parent])
        positions.append(at + frame @ offset)
        for name, dof in zip(segment.axes, dofs, strict=True):
            frame = frame @ Rotation.from_euler(name.upper(), state[dof]).as_matrix()
        rotations.append(frame)
    return np.array(rotations), np.array(positions)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.sampled_from([1, 2, 7]))
def test_all_forms_are_the_loop_over_segments_and_axes(seed, n):
    rng = np.random.default_rng(seed)
    body = replace(BODY, offsets=np.r_[np.zeros((1, 3)), rng.normal(0, 0.3, (len(SEGMENTS) - 1, 3))])  # in all directions
    states, origin = random_states(seed, n, body), rng.normal(0, 2, 3)
    rotations, positions = segment_transforms(body, states)
    placed = place_segments(body, states, origin)
    assert placed.dtype == np.float32 and placed.shape == (len(SEGMENTS), 3, 4, n)
    for k, state in enumerate(states):
        expected = one_by_one(body, state)
        assert_allclose(rotations[k], expected[0], atol=1e-12)
        assert_allclose(positions[k], expected[1], atol=1e-12)
        for found, wanted in zip(joint_twists(body, state)[2:], expected, strict=True):
            assert_allclose(found, wanted, atol=1e-12)
        assert_allclose(placed[:, :, :3, k], expected[0], atol=2e-6)
        assert_allclose(placed[:, :, 3, k], expected[1] - origin, atol=1e-5)


def test_rotations_are_the_intrinsic_turns_of_scipy():
    states = random_states(1, 20)
    rotations, _ = segment_transforms(BODY, states)
    for index, segment in enumerate(SEGMENTS):
        local = Rotation.from_euler(segment.axes.upper(), states[:, SEGMENT_DOFS[index]]).as_matrix()
        parent = rotations[:, segment.parent] if segment.parent >= 0 else np.eye(3)
        assert_allclose(rotations[:, index], parent @ local, atol=1e-12)


def test_segments_are_in_the_order_of_the_state():
    assert sorted(dof for dofs in SEGMENT_DOFS for dof in dofs) == list(range(3, N_DOF))
    for segment, dofs in zip(SEGMENTS, SEGMENT_DOFS, strict=True):
        assert all(DOF_NAMES[dof].startswith(segment.joint) for dof in dofs)
        assert segment.parent < SEGMENTS.index(segment)


def test_one_state_or_many_give_the_same():
    states = random_states(2, 6).reshape(2, 3, N_DOF)
    rotations, positions = segment_transforms(BODY, states)
    points = landmarks(BODY, states)
    assert rotations.shape == (2, 3, len(SEGMENTS), 3, 3) and positions.shape == (2, 3, len(SEGMENTS), 3) and points.shape == (2, 3, 15, 3)
    for index in np.ndindex(2, 3):
        one = segment_transforms(BODY, states[index])
        assert_allclose(rotations[index], one[0], atol=1e-14)
        assert_allclose(positions[index], one[1], atol=1e-14)
        assert_allclose(points[index], landmarks(BODY, states[index]), atol=1e-14)


def test_one_state_alone_is_the_same_to_the_last_digit():
    for state in random_states(5, 20):
        rotations, positions = segment_transforms(BODY, state)
        _, _, turned, placed = joint_twists(BODY, state)
        assert np.array_equal(turned, rotations) and np.array_equal(placed, positions)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
@pytest.mark.parametrize("body", [BODY, canton_body(1.6)], ids=["default", "canton"])
def test_bones_keep_their_lengths_in_any_state(body, seed):
    points = landmarks(body, random_states(seed, 5, body))
    rest = landmarks(body, np.zeros(N_DOF))
    for a, b in RIGID if body is not BODY else [pair for pair in RIGID if not IN_THE_TRUNK.issuperset(pair)]:
        a, b = landmark_index(a), landmark_index(b)
        lengths = np.linalg.norm(points[:, a] - points[:, b], axis=1)
        assert_allclose(lengths, np.linalg.norm(rest[a] - rest[b]))


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_the_root_moves_the_whole_body_rigidly(seed):
    one, other = random_states(seed, 2)
    other[6:] = one[6:]
    points, moved = landmarks(BODY, one), landmarks(BODY, other)

    def root(state):
        return Rotation.from_euler("ZYX", state[3:6]).as_matrix()

    turn = root(other) @ root(one).T
    assert_allclose(moved, (points - one[:3]) @ turn.T + other[:3], atol=1e-11)


def test_angles_turn_the_way_people_bend():
    def shift(name, degrees, landmark):
        state = np.zeros(N_DOF)
        state[dof_index(name)] = np.radians(degrees)
        return (landmarks(BODY, state) - landmarks(BODY, np.zeros(N_DOF)))[landmark_index(landmark)]

    assert shift("torso_y", 30, "head_top")[0] > 0.1  # a bow goes forward
    assert shift("l_knee_y", 60, "l_ankle")[0] < -0.1 and shift("r_knee_y", 60, "r_ankle")[0] < -0.1  # heels go backward
    assert shift("l_hip_y", -60, "l_knee")[0] > 0.1 and shift("r_hip_y", -60, "r_knee")[0] > 0.1  # knees go up in front
    assert shift("r_elbow_z", 60, "r_wrist")[0] > 0.1 and shift("l_elbow_z", -60, "l_wrist")[0] > 0.1
    assert shift("r_shoulder_x", 60, "r_wrist")[2] < -0.1 and shift("l_shoulder_x", -60, "l_wrist")[2] < -0.1  # arms drop
    assert shift("root_rz", 30, "l_wrist")[0] < -0.1  # anticlockwise from above
    assert shift("spine_y", 30, "head_top")[0] > 0.1 and not shift("spine_y", 30, "l_hip").any()
    for side, sign in (("r", 1), ("l", -1)):
        assert shift(f"{side}_girdle_x", -sign * 20, f"{side}_shoulder")[2] > 0.04  # shoulders are raised
        assert shift(f"{side}_girdle_z", sign * 20, f"{side}_shoulder")[0] > 0.04  # and brought forward


def test_twists_are_derivatives_of_points():
    """dp/dtheta = axis x (p - centre) (Eq. A.1), where the degree of freedom moves the segment, else zero."""
    step = 1e-6
    masks = dof_masks()
    for state in random_states(3, 3):
        axes, centres, rotations, positions = joint_twists(BODY, state)
        assert_allclose(np.linalg.norm(axes, axis=1), 1)
        reference = segment_transforms(BODY, state)
        assert_allclose(rotations, reference[0], atol=1e-12)
        assert_allclose(positions, reference[1], atol=1e-12)
        local = np.random.default_rng(0).normal(0, 0.3, (len(SEGMENTS), 3))

        def place(s, local=local):
            r, p = segment_transforms(BODY, s)
            return p + (r @ local[..., None])[..., 0]

        points = place(state)
        for dof in range(N_DOF):
            unit = step * np.eye(N_DOF)[dof]
            measured = (place(state + unit) - place(state - unit)) / (2 * step)
            expected = np.tile(axes[dof], (len(SEGMENTS), 1)) if dof < 3 else np.cross(axes[dof], points - centres[dof])
            assert_allclose(measured, expected * masks[:, dof, None], atol=1e-8)


def test_every_degree_of_freedom_moves_something():
    masks = dof_masks()
    assert masks.shape == (len(SEGMENTS), N_DOF) and masks.any(0).all() and masks[:, :6].all()
    assert not masks[[s.name for s in SEGMENTS].index("pelvis"), 6:].any()


def test_landmarks_lie_on_their_segments():
    states = random_states(4, 3)
    rotations, positions = segment_transforms(BODY, states)
    points = landmarks(BODY, states)
    carriers = landmark_segments()
    for name, segment in (("l_elbow", "l_forearm"), ("r_knee", "r_shank"), ("pelvis", "pelvis"), ("neck", "head"), ("l_hip", "l_thigh")):
        index = [s.name for s in SEGMENTS].index(segment)
        assert carriers[landmark_index(name)] == index
        assert_allclose(points[:, landmark_index(name)], positions[:, index])
    head = [s.name for s in SEGMENTS].index("head")
    up, ahead = rotations[:, head, :, 2], rotations[:, head, :, 0]
    tip = positions[:, head] + up * BODY.dimensions["head"] + ahead * BODY.dimensions["head_forward"]
    assert_allclose(points[:, landmark_index("head_top")], tip)
