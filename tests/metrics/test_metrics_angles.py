"""Angular errors: poses built with SciPy's rotations give back their angles; other bodies and places in the room change nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hmc.errors import InputError
from hmc.landmarks import LANDMARKS
from hmc.metrics.angles import IMAGE_ANGLES, REFERENCE_ANGLES, angular_errors, reference_angles, score_angles

NAMES = list(REFERENCE_ANGLES)


def turn(axes, *angles):
    return Rotation.from_euler(axes.upper(), angles).as_matrix()


def posed(angles, lengths, root):
    """Landmarks of the reference body, link by link."""
    a = dict(zip(NAMES, angles, strict=True))
    trunk, head, wide, drop, hips, *links = lengths
    at = {"pelvis": np.zeros(3)}
    chest = turn("x", a["waist_bend"]) @ turn("z", a["waist_twist"])
    at["neck"] = chest @ [0, 0, trunk]
    at["head_top"] = at["neck"] + chest @ turn("xy", a["neck_bend"], a["neck_nod"]) @ [0, 0, head]
    for side, sign in (("l", 1), ("r", -1)):
        at[f"{side}_shoulder"] = chest @ [0, sign * wide, trunk - drop]
        at[f"{side}_hip"] = np.array([0, sign * hips, 0])
        for names, frame, bends, (upper, lower) in (
            (("shoulder", "elbow", "wrist"), chest, -1, links[:2]),
            (("hip", "knee", "ankle"), np.eye(3), 1, links[2:]),
        ):
            ball, hinge, end = (f"{side}_{name}" for name in names)
            link = frame @ turn(
                "yxz", -a[f"{ball}_flexion"], sign * a[f"{ball}_abduction"], sign * a[f"{ball}_rotation"]
            )  # intrinsic: upper case in SciPy
            at[hinge] = at[ball] + link @ [0, 0, -upper]
            at[end] = at[hinge] + link @ turn("y", bends * a[f"{hinge}_flexion"]) @ [0, 0, -lower]
    return np.array([at[name] for name in LANDMARKS]) @ Rotation.from_rotvec(root[:3]).as_matrix().T + root[3:]


def drawn(seed):
    rng = np.random.default_rng(seed)
    limits = {"flexion": (-2.5, 2.5), "abduction": (-1.2, 1.2), "rotation": (-2.5, 2.5), "bend": (-0.6, 0.6), "twist": (-0.6, 0.6)}
    angles = np.array([rng.uniform(*limits.get(name.split("_")[-1], (-0.8, 0.8))) for name in NAMES])
    for k, name in enumerate(NAMES):
        if name.split("_")[-2] in ("elbow", "knee"):
            angles[k] = rng.uniform(0.4, 2.6)
    lengths = np.array([0.5, 0.25, 0.18, 0.06, 0.1, 0.28, 0.26, 0.42, 0.43]) * rng.uniform(0.8, 1.2, 9)
    return angles, lengths, rng.normal(0, 2, 6)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**9))
def test_angles_come_back_from_the_points_of_any_body_anywhere(seed):
    angles, lengths, root = drawn(seed)
    np.testing.assert_allclose(reference_angles(posed(angles, lengths, root)), angles, atol=1e-9)


def test_left_and_right_are_mirror_images():
    angles, lengths, root = drawn(3)
    points = posed(angles, lengths, root)
    mirrored = points * [1, -1, 1]
    swap = [LANDMARKS.index({"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]) for name in LANDMARKS]
    back = dict(zip(NAMES, reference_angles(mirrored[swap]), strict=True))
    for name, value in zip(NAMES, angles, strict=True):
        if name[:2] == "l_":
            assert back["r_" + name[2:]] == pytest.approx(value)


def test_errors_wrap_and_do_not_depend_on_the_body():
    angles, lengths, root = drawn(5)
    other = angles.copy()
    place = NAMES.index("r_hip_flexion")
    angles[place], other[place] = np.pi - 0.1, -np.pi + 0.2
    taller = lengths * [1.1, 0.9, 1.2, 1, 1, 1.2, 0.8, 1.1, 1]
    truth, estimate = posed(angles, lengths, root)[None], posed(other, taller, -root)[None]
    errors = angular_errors(estimate, truth)[0]
    assert errors[place] == pytest.approx(0.3)
    np.testing.assert_allclose(np.delete(errors, place), 0, atol=1e-9)


def test_what_landmarks_do_not_show_is_nan():
    angles, lengths, root = drawn(7)
    angles[NAMES.index("l_elbow_flexion")] = 0.1
    angles[NAMES.index("r_shoulder_abduction")] = 1.5
    out = dict(zip(NAMES, reference_angles(posed(angles, lengths, root)), strict=True))
    hidden = {name for name, value in out.items() if np.isnan(value)}
    assert hidden == {"l_shoulder_rotation", "r_shoulder_flexion", "r_shoulder_rotation"}
    points = posed(*drawn(7))
    points[LANDMARKS.index("r_ankle")] = np.nan
    missing = {name for name, value in zip(NAMES, reference_angles(points), strict=True) if np.isnan(value)}
    assert missing == {"r_hip_rotation", "r_knee_flexion"}
    points = np.zeros((15, 3))
    assert np.isnan(reference_angles(points)[:4]).all()


def test_only_matched_landmarks_count():
    rng = np.random.default_rng(0)
    truth = np.array([posed(*drawn(seed)) for seed in range(20)])
    estimate = truth + rng.normal(0, 0.002, truth.shape)
    estimate[4:9, LANDMARKS.index("l_wrist")] += 0.4
    free, matched = angular_errors(estimate, truth), angular_errors(estimate, truth, 0.05)
    lost = [NAMES.index(name) for name in ("l_shoulder_rotation", "l_elbow_flexion")]
    assert np.isfinite(free[4:9][:, lost]).all() and np.isnan(matched[4:9][:, lost]).all()
    np.testing.assert_array_equal(np.delete(free, lost, axis=1), np.delete(matched, lost, axis=1))


def test_scores_are_the_equations():
    errors = np.random.default_rng(1).uniform(0, 1, (6, 20))
    scores = score_angles(errors)
    np.testing.assert_allclose([scores.mean, scores.deviation], [errors.mean(1).mean(), errors.mean(1).std()])
    np.testing.assert_allclose(score_angles(errors, "angle").mean, errors.mean(0))
    np.testing.assert_allclose(score_angles(errors, "frame").deviation, errors.std(1))
    errors[2] = np.nan
    assert score_angles(errors).counted == 100 and np.isnan(score_angles(errors, "frame").mean[2])
    assert np.isnan(score_angles(np.full((3, 20), np.nan)).mean)


def test_on_images_the_angles_of_a_flat_figure():
    rng = np.random.default_rng(4)
    truth = rng.uniform(0, 400, (30, 15, 2))
    at = {name: truth[:, place] for place, name in enumerate(LANDMARKS)}
    angles = reference_angles(truth)
    assert angles.shape == (30, len(IMAGE_ANGLES))
    first, second = at["l_elbow"] - at["l_shoulder"], at["l_wrist"] - at["l_elbow"]
    complex_angle = np.angle((second @ [1, 1j]) / (first @ [1, 1j]))
    np.testing.assert_allclose(angles[:, list(IMAGE_ANGLES).index("l_elbow")], complex_angle)
    # a turn, a zoom and a shift of the image change nothing
    turned = 1.3 * truth @ np.array([[0.6, -0.8], [0.8, 0.6]]) + 11
    np.testing.assert_allclose(angular_errors(turned, truth), 0, atol=1e-12)
    truth[0, LANDMARKS.index("l_wrist")] = np.nan
    assert np.isnan(reference_angles(truth)[0]).sum() == 1


def test_wrong_shapes():
    with pytest.raises(InputError, match=r"got \(14, 3\)"):
        reference_angles(np.zeros((14, 3)))
    with pytest.raises(InputError, match="n_angles"):
        score_angles(np.zeros(3))
