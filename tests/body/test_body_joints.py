"""Degrees of freedom, joint limits and proportions against Table 6.1 of the thesis as printed, and mirrored and scaled bodies."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hmc.body.flesh import flesh_points
from hmc.body.joints import DOF_NAMES, N_CANTON, N_DOF, SEGMENTS, canton_limits, default_limits, dof_index, mirror_state
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.model import PARTS, BodyModel, neutral_state
from hmc.body.proportions import DEFAULT_LENGTHS, SOLE, canton_body, default_body, make_body
from hmc.errors import InputError
from hmc.landmarks import LANDMARKS, landmark_index

PI = np.pi
# As printed: joint, axis, least and greatest angle.
TABLE_6_1 = [
    ("neck", "x", -PI / 2, PI / 2), ("neck", "y", -PI / 2, PI / 2),
    ("r_shoulder", "x", -PI, PI), ("r_shoulder", "y", -3 * PI / 4, PI / 2), ("r_shoulder", "z", -PI / 2, PI), ("r_elbow", "z", 0, PI),
    ("l_shoulder", "x", -PI, PI), ("l_shoulder", "y", -PI / 2, 3 * PI / 4), ("l_shoulder", "z", -PI, PI / 2), ("l_elbow", "z", -PI, 0),
    ("r_hip", "x", -PI / 2, PI / 3), ("r_hip", "y", -PI, PI / 2), ("r_hip", "z", -PI / 4, PI / 4), ("r_knee", "y", 0, PI),
    ("l_hip", "x", -PI / 3, PI / 2), ("l_hip", "y", -PI, PI / 2), ("l_hip", "z", -PI / 4, PI / 4), ("l_knee", "y", 0, PI),
    ("torso", "x", -PI / 4, PI / 4), ("torso", "y", -PI / 4, PI / 2), ("torso", "z", -PI / 8, PI / 8),
]  # fmt: skip
SIDES = [name for name in LANDMARKS if name[:2] in ("l_", "r_")]


def swapped(name: str) -> str:
    return {"l": "r", "r": "l"}[name[0]] + name[1:]


def unequal(arms: float, legs: float) -> BodyModel:
    """A body of 1.7 m with a longer left arm and leg."""
    return make_body(default_body(1.7).dimensions | {"arms_longer_left": arms, "legs_longer_left": legs})


def test_limits_are_the_printed_ones():
    limits = canton_limits()
    assert len(TABLE_6_1) == 21 == N_CANTON - 6
    assert not limits.low[N_CANTON:].any() and not limits.high[N_CANTON:].any()
    for joint, axis, low, high in TABLE_6_1:
        k = DOF_NAMES.index(f"{joint}_{axis}")
        assert limits.low[k] == pytest.approx(low) and limits.high[k] == pytest.approx(high)
    assert np.all(np.isinf(limits.low[:6])) and np.all(np.isinf(limits.high[:6]))


def test_lengths_are_the_printed_ones_and_sum_to_the_height():
    height = 1.8
    body = canton_body(height)
    points = dict(zip(LANDMARKS, landmarks(body, neutral_state("sideways", body.limits)), strict=True))
    for start, end, share in [
        ("pelvis", "neck", 0.33), ("neck", "head_top", 0.16), ("l_shoulder", "l_elbow", 0.20), ("r_elbow", "r_wrist", 0.20),
        ("l_hip", "l_knee", 0.26), ("r_hip", "r_knee", 0.26), ("l_knee", "l_ankle", 0.25), ("r_knee", "r_ankle", 0.25),
    ]:  # fmt: skip
        assert np.linalg.norm(points[start] - points[end]) == pytest.approx(share * height)
    assert points["head_top"][2] - points["l_ankle"][2] == pytest.approx(height)


def test_the_default_body_stands_as_tall_as_it_says():
    body = default_body(1.75)
    points = landmarks(body, neutral_state("down", body.limits))
    legs = points[landmark_index("head_top"), 2] - points[landmark_index("l_ankle"), 2]
    assert legs + body.dimensions["ankle_height"] == pytest.approx(1.75, rel=0.03)


@pytest.mark.parametrize("limits", [default_limits(), canton_limits()], ids=["default", "canton"])
def test_left_and_right_have_mirrored_limits(limits):
    bounds = mirror_state(np.where(np.isfinite([limits.low, limits.high]), [limits.low, limits.high], 0))
    for k, name in enumerate(DOF_NAMES):
        if name[:2] in ("l_", "r_") and not name.endswith("shoulder_y"):  # the printed table has the twist of the arms the other way
            assert_allclose(np.sort(bounds[:, k]), [limits.low[k], limits.high[k]])


@given(seed=st.integers(0, 2**31), arms=st.floats(-0.1, 0.1), legs=st.floats(-0.1, 0.1))
def test_a_mirrored_state_of_a_mirrored_body_gives_mirrored_landmarks(seed, arms, legs):
    body, mirrored = (unequal(sign * arms, sign * legs) for sign in (1, -1))
    low, high = np.where(np.isfinite(body.limits.low), body.limits.low, 0), np.where(np.isfinite(body.limits.high), body.limits.high, 0)
    state = np.random.default_rng(seed).uniform(low, high)
    state[:6] = 0
    state[dof_index("torso_x", "torso_z", "spine_x", "neck_x")] = 0  # what the mirror does not touch has to be symmetric
    there = landmarks(body, state) * [1, -1, 1]
    expected = np.array([there[landmark_index(swapped(name) if name in SIDES else name)] for name in LANDMARKS])
    assert_allclose(landmarks(mirrored, mirror_state(state)), expected, atol=1e-12)
    assert_allclose(mirror_state(mirror_state(state)), state)


def test_mirroring_many_equals_mirroring_one_by_one():
    states = np.random.default_rng(1).normal(size=(4, 2, N_DOF))
    many = mirror_state(states)
    for index in np.ndindex(4, 2):
        assert_allclose(many[index], mirror_state(states[index]))
    assert_allclose(many[..., :6], states[..., :6])


def test_a_body_of_twice_the_dimensions_is_twice_as_large():
    small = default_body(0.9)
    large = make_body({name: value * (1 if name.startswith("girth") else 2) for name, value in small.dimensions.items()})
    state = neutral_state("down", small.limits)
    state[3:] += np.random.default_rng(0).normal(0, 0.2, N_DOF - 3)
    assert_allclose(landmarks(large, state), 2 * landmarks(small, state))
    for name in ("start", "end", "radii"):
        assert_allclose(getattr(large.cones, name), 2 * getattr(small.cones, name))


def test_another_sole_moves_the_feet_alone():
    usual = default_body(1.8)
    low = make_body(usual.dimensions, sole=SOLE - 0.01)
    ends = [np.stack([body.cones.start, body.cones.end]) for body in (usual, low)]
    moved = np.array([1.8 * 0.01 if abs(down) > 1e-9 else 0.0 for down in (ends[0] - ends[1])[0, :, 2]])
    assert np.count_nonzero(moved) == 2 and low.dimensions == usual.dimensions
    assert_allclose(ends[0] - ends[1], moved[:, None] * np.array([0, 0, 1.0]) + np.zeros((2, 1, 1)), atol=1e-12)
    assert_allclose(low.cones.radii, usual.cones.radii)


def test_dimensions_are_what_landmarks_show():
    d = {name: 0.1 + 0.01 * k for k, name in enumerate(DEFAULT_LENGTHS)}
    body = make_body({"height": 1.7} | d | {name: 1.0 for name in default_body(1.7).dimensions if name.startswith("girth")})
    points = dict(zip(LANDMARKS, landmarks(body, neutral_state("sideways", body.limits)), strict=True))
    assert np.linalg.norm(points["neck"] - points["pelvis"]) == pytest.approx(d["trunk"])
    assert np.linalg.norm(points["l_shoulder"] - points["r_shoulder"]) == pytest.approx(2 * d["shoulder_half_width"])
    assert points["neck"][2] - points["l_shoulder"][2] == pytest.approx(d["shoulder_drop"])
    assert np.linalg.norm(points["l_hip"] - points["r_hip"]) == pytest.approx(2 * d["hip_half_width"])
    assert_allclose(points["pelvis"], (points["l_hip"] + points["r_hip"]) / 2)
    assert points["l_wrist"][1] > points["l_shoulder"][1] > 0 > points["r_shoulder"][1]  # Y to the person's left


@pytest.mark.parametrize(("kind", "bones"), [("arms", ("shoulder", "elbow", "wrist")), ("legs", ("hip", "knee", "ankle"))])
def test_unequal_limbs_differ_by_their_share_and_their_flesh_with_them(kind, bones):
    usual, body = default_body(1.7), unequal(**{"arms": 0.0, "legs": 0.0} | {kind: 0.06})
    points, before = (dict(zip(LANDMARKS, landmarks(one, neutral_state("down", one.limits)), strict=True)) for one in (body, usual))
    for above, below in pairwise(bones):
        left, right = (np.linalg.norm(points[f"{side}_{above}"] - points[f"{side}_{below}"]) for side in "lr")
        mean = np.linalg.norm(before[f"l_{above}"] - before[f"l_{below}"])
        assert (left, right) == pytest.approx((1.03 * mean, 0.97 * mean))
    ratio = body.cones.lengths / usual.cones.lengths
    parts = np.array([PARTS[part] for part in usual.cones.part])
    longer = {part for part, by in zip(parts, ratio, strict=True) if by > 1.01}
    shorter = {part for part, by in zip(parts, ratio, strict=True) if by < 0.99}
    assert longer == {swapped(part) for part in shorter} and len(longer) == 2
    assert {part.split("_")[0] for part in longer} == {"l"}
    assert_allclose(ratio[[part[:2] not in ("l_", "r_") for part in parts]], 1)


def test_hips_that_lie_farther_back_in_the_flesh_leave_joints_and_the_neck_where_they_are():
    usual = default_body(1.7)
    moved = make_body(usual.dimensions | {"pelvis_flesh_forward": 0.02})
    state = neutral_state("down", usual.limits)
    assert_allclose(landmarks(moved, state), landmarks(usual, state))
    rotations, positions = segment_transforms(usual, state[None])
    carrier = usual.cones.segment

    def ends(body: BodyModel) -> np.ndarray:
        return np.concatenate(
            [(rotations[0, carrier] @ at[..., None])[..., 0] + positions[0, carrier] for at in (body.cones.start, body.cones.end)]
        )

    before, by = ends(usual), ends(moved) - ends(usual)
    assert_allclose(by[:, 1:], 0, atol=1e-12)
    # Sheared: all at the hips' height, nothing at the neck, in between as much as that is from the neck.
    hip, neck = landmarks(usual, state)[[landmark_index("pelvis"), landmark_index("neck")], 2]
    names = np.tile([SEGMENTS[k].name for k in carrier], 2)
    trunk = np.isin(names, ["pelvis", "torso", "chest"]) & (before[:, 2] > hip)
    assert np.count_nonzero(trunk) == 7
    assert_allclose(by[trunk, 0], 0.02 * (neck - before[trunk, 2]) / (neck - hip), atol=1e-9)
    tops = (np.abs(before[:, 2] - hip) < 1e-9) | (np.isin(names, ["pelvis"]) & ~trunk)
    assert np.count_nonzero(tops) == 3
    assert_allclose(by[tops, 0], 0.02)
    assert_allclose(by[~trunk & ~tops, 0], 0, atol=1e-12)


@pytest.mark.parametrize("group", ["torso", "depth", "head", "arms", "thighs", "shanks"])
def test_girths_change_radii_and_nothing_else(group):
    body = default_body(1.75)
    wide = make_body(body.dimensions | {f"girth_{group}": 1.3})
    ratio = wide.cones.radii / body.cones.radii
    assert np.all(np.isclose(ratio, 1) | np.isclose(ratio, 1.3)) and np.isclose(ratio, 1.3).any()
    assert_allclose(wide.offsets, body.offsets)
    assert_allclose(wide.cones.start, body.cones.start)
    wanted = {"depth": "torso", "arms": "arm", "thighs": "thigh", "shanks": "shank"}.get(group, group)
    assert all(wanted in PARTS[part] for part in body.cones.part[np.isclose(ratio, 1.3).any((1, 2))])


@pytest.mark.parametrize("make", [default_body, canton_body])
def test_flesh_is_well_formed(make):
    cones = make(1.75).cones
    assert set(cones.part) == set(range(len(PARTS)))
    assert np.all(cones.radii > 0) and np.all(cones.lengths > 0)
    assert_allclose(np.linalg.norm(cones.across, axis=1), 1)
    assert np.all((cones.segment >= 0) & (cones.segment < len(SEGMENTS)))
    assert_allclose(cones.bases @ cones.bases.transpose(0, 2, 1), np.tile(np.eye(3), (len(cones.part), 1, 1)), atol=1e-9)


@pytest.mark.parametrize("height", [0.2, 3.5, -1.0, np.nan])
def test_nobody_has_such_a_height(height):
    with pytest.raises(InputError, match="metres"):
        default_body(height)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("trunk", None),
        ("trunk", np.nan),
        ("girth_head", -0.1),
        ("height", np.inf),
        ("legs_longer_left", np.nan),
        ("arms_longer_left", -0.6),
        ("hip_flesh_forward", -0.01),
    ],
)
def test_wrong_dimensions_are_named(name, value):
    dimensions = dict(default_body(1.7).dimensions)
    dimensions.pop(name)
    if value is not None:
        dimensions[name] = value
    with pytest.raises(InputError, match=name):
        make_body(dimensions)


def test_names_are_looked_up():
    assert dof_index("root_tx", "l_knee_y").tolist() == [0, DOF_NAMES.index("l_knee_y")]
    with pytest.raises(ValueError, match="l_knee_q"):
        dof_index("l_knee_y", "l_knee_q")


def test_neutral_states():
    body = default_body(1.8)
    sideways, down = neutral_state("sideways"), neutral_state("down")
    assert not sideways.any()
    assert np.all((down >= body.limits.low) & (down <= body.limits.high))
    for side in ("l", "r"):
        wrist, shoulder = landmark_index(f"{side}_wrist"), landmark_index(f"{side}_shoulder")
        assert landmarks(body, sideways)[wrist, 2] == pytest.approx(landmarks(body, sideways)[shoulder, 2])
        assert landmarks(body, down)[wrist, 2] < landmarks(body, down)[shoulder, 2] - 0.4
    with pytest.raises(ValueError, match="sideways"):
        neutral_state("up")


def test_the_body_stands_on_its_soles_with_the_spine_behind():
    """Flesh ends 2 cm over the floor that the ankle's height tells, and 2 cm over the crown; chest and crown lie before hips and neck."""
    body = default_body(1.8)
    points = flesh_points(body, 0.01)
    rotations, positions = segment_transforms(body, neutral_state("down")[None])
    placed = np.einsum("nij,nj->ni", rotations[0, points.segment], points.points) + positions[0, points.segment]
    legs = body.dimensions["thigh"] + body.dimensions["shank"] + body.dimensions["ankle_height"]
    assert placed[:, 2].min() == pytest.approx(0.012 * 1.8 - legs, abs=0.012)
    marks = landmarks(body, neutral_state("down"))
    crown, neck = marks[LANDMARKS.index("head_top")], marks[LANDMARKS.index("neck")]
    assert crown[0] - neck[0] == pytest.approx(0.027 * 1.8) and neck[0] == pytest.approx(0.0)
    assert placed[:, 2].max() == pytest.approx(crown[2] + 0.010 * 1.8, abs=0.006)
    skull = placed[placed[:, 2] > crown[2] - 0.06]
    assert skull[:, 0].mean() == pytest.approx(crown[0] - 0.007 * 1.8, abs=0.006)  # the skull's middle is behind the crown
    chest = placed[(points.part == PARTS.index("torso")) & (np.abs(placed[:, 2] - 0.6 * neck[2]) < 0.03)]
    assert chest[:, 0].mean() == pytest.approx(0.010 * 1.8, abs=0.006)
