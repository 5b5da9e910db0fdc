"""Constant offsets of landmarks: what we put into a walking, turning person comes out, against a plain loop and SciPy's rotations."""

from __future__ import annotations

import csv
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import hmc
from hmc.body.joints import dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.cli import main
from hmc.errors import InputError
from hmc.io.results import PoseTable, TrackTable, write_joints, write_tracks
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.metrics.offsets import LEAST_FRAMES, TRUNK, constant_offsets, trunk_frames
from hmc.metrics.scores import evaluate_offsets, evaluate_pose

LEFT, RIGHT = ([landmark_index(f"{side}_{name}") for name in ("hip", "shoulder")] for side in "lr")
SEEDS = st.integers(0, 10**9)


def walker(n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Landmarks of a person who walks a curve, leaning, arms and legs swinging; and the trunk's rotation, as the body has it."""
    body = default_body(1.75)
    time = np.linspace(0, 2 * np.pi, n)
    states = np.tile(neutral_state("down", body.limits), (n, 1))
    states[:, 0], states[:, 1], states[:, 2] = np.cos(time), np.sin(time), 0.95
    states[:, 3], states[:, 4], states[:, 5] = 1.3 * time, 0.2 * np.sin(time), 0.1 * np.cos(2 * time)
    for name, swing in (("l_hip_y", 0.5), ("r_hip_y", -0.5), ("l_shoulder_y", -0.4), ("r_shoulder_y", 0.4)):
        states[:, dof_index(name)] += swing * np.sin(3 * time)[:, None]
    return landmarks(body, states), Rotation.from_euler("ZYX", states[:, 3:6]).as_matrix()


TRUTH, TURNS = walker()


def moved(offsets: np.ndarray, truth: np.ndarray = TRUTH) -> np.ndarray:
    """Landmarks with offsets, shape (15, 3) or (n, 15, 3), that go with the trunk."""
    return truth + np.einsum("fij,fkj->fki", trunk_frames(truth), np.broadcast_to(offsets, truth.shape))


def test_the_trunk_s_frame_is_the_body_s():
    """The spine of the drawn body is straight, its hips and shoulders lie across: the frame is the root's turn."""
    np.testing.assert_allclose(trunk_frames(TRUTH), TURNS, atol=1e-6)


@settings(deadline=None, max_examples=30)
@given(SEEDS)
def test_the_trunk_s_frame_is_a_rotation_that_looks_forward(seed):
    rng = np.random.default_rng(seed)
    frames = trunk_frames(TRUTH + rng.normal(0, 0.02, TRUTH.shape))
    np.testing.assert_allclose(np.swapaxes(frames, -1, -2) @ frames, np.broadcast_to(np.eye(3), frames.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1)
    assert (np.einsum("fij,fij->fj", frames, TURNS) > 0.8).all()


@settings(deadline=None, max_examples=30)
@given(SEEDS)
def test_a_constant_offset_is_found_and_leaves_nothing(seed):
    offsets = np.random.default_rng(seed).normal(0, 0.05, (15, 3))
    found = constant_offsets(moved(offsets), TRUTH)
    np.testing.assert_allclose(found.offsets, offsets, atol=1e-12)
    np.testing.assert_allclose(found.errors, np.broadcast_to(np.linalg.norm(offsets, axis=1), (40, 15)))
    np.testing.assert_allclose(found.remaining, 0, atol=1e-12)
    assert (found.compared == 40).all() and not found.missing.any() and not found.flat.any()


@settings(deadline=None, max_examples=30)
@given(SEEDS)
def test_where_both_stand_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    estimate = TRUTH + rng.normal(0, 0.05, TRUTH.shape)
    turns, shifts = Rotation.random(40, random_state=seed % 2**32).as_matrix(), rng.normal(0, 5, (40, 1, 3))
    here = constant_offsets(estimate, TRUTH)
    there = constant_offsets(*(np.einsum("fij,fkj->fki", turns, points) + shifts for points in (estimate, TRUTH)))
    for name in ("offsets", "errors", "remaining"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=1e-10)


@settings(deadline=None, max_examples=30)
@given(SEEDS, st.integers(1, 19))
def test_a_limb_that_is_lost_for_a_while_does_not_shift_it(seed, lost):
    """Lost in fewer than half of the frames: the rest agree, and the errors of the stretch stay what they are."""
    rng = np.random.default_rng(seed)
    offsets = rng.normal(0, 0.05, (15, 3))
    estimate = moved(offsets)
    begin, wrist = rng.integers(0, 40 - lost), landmark_index("l_wrist")
    away = rng.normal(0, 1, (lost, 3))
    estimate[begin : begin + lost, wrist] += away
    found = constant_offsets(estimate, TRUTH)
    np.testing.assert_allclose(found.offsets, offsets, atol=1e-12)
    np.testing.assert_allclose(found.remaining[begin : begin + lost, wrist], np.linalg.norm(away, axis=1))


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_against_a_plain_loop(seed):
    rng = np.random.default_rng(seed)
    truth, estimate = TRUTH.copy(), TRUTH + rng.normal(0, 0.05, TRUTH.shape)
    truth[rng.random(truth.shape[:2]) < 0.03] = np.nan
    estimate[rng.random(truth.shape[:2]) < rng.uniform(0, 0.9)] = np.nan
    found = constant_offsets(estimate, truth)
    for k in range(15):
        errors = {}
        for f in range(40):
            at = dict(zip(LANDMARKS, truth[f], strict=True))
            if any(np.isnan(at[name]).any() for name in TRUNK) or np.isnan(truth[f, k] + estimate[f, k]).any():
                continue
            up = at["neck"] - at["pelvis"]
            side = at["l_hip"] + at["l_shoulder"] - at["r_hip"] - at["r_shoulder"]
            forward = np.cross(side, up)
            left = np.cross(up, forward)
            error = estimate[f, k] - truth[f, k]
            errors[f] = [error @ axis / np.linalg.norm(axis) for axis in (forward, left, up)]
        assert found.compared[k] == len(errors)
        if len(errors) < LEAST_FRAMES:
            assert np.isnan(found.offsets[k]).all() and np.isnan(found.errors[:, k]).all() and np.isnan(found.remaining[:, k]).all()
            continue
        offset = [sorted(one[axis] for one in errors.values()) for axis in range(3)]
        offset = [(one[(len(one) - 1) // 2] + one[len(one) // 2]) / 2 for one in offset]
        np.testing.assert_allclose(found.offsets[k], offset, atol=1e-12)
        assert np.flatnonzero(np.isfinite(found.remaining[:, k])).tolist() == list(errors)
        for f, error in errors.items():
            assert found.errors[f, k] == pytest.approx(np.sqrt(sum(one**2 for one in error)))
            assert found.remaining[f, k] == pytest.approx(np.sqrt(sum((a - b) ** 2 for a, b in zip(error, offset, strict=True))))


def test_frames_without_a_trunk_do_not_count():
    offsets = np.full((15, 3), 0.03)
    truth, estimate = TRUTH.copy(), moved(offsets)
    truth[:3, landmark_index("neck")] = np.nan
    truth[5, LEFT] = truth[5, RIGHT]
    truth[6, landmark_index("pelvis")] = truth[6, landmark_index("neck")]
    estimate[20:22] = np.nan  # no estimate: not for the truth's sake
    truth[30, landmark_index("l_ankle")] = np.nan
    estimate[[0, 5]] += 1.0
    found = constant_offsets(estimate, truth)
    assert np.flatnonzero(found.missing).tolist() == [0, 1, 2] and np.flatnonzero(found.flat).tolist() == [5, 6]
    assert found.compared.tolist() == [35 - 2 - (name == "l_ankle") for name in LANDMARKS]
    np.testing.assert_allclose(found.offsets, offsets, atol=1e-12)
    assert np.isnan(found.errors[[0, 1, 2, 5, 6, 20, 21]]).all()


def test_noise_alone_looks_constant_the_more_so_the_fewer_frames():
    """Why few frames have no offset: what is taken off is in-sample. Errors without a constant part seem to have one."""
    rng = np.random.default_rng(4)
    share = {}
    for n in (LEAST_FRAMES, 40):
        found = constant_offsets(TRUTH[:n] + rng.normal(0, 0.02, (n, 15, 3)), TRUTH[:n])
        share[n] = 1 - found.remaining.mean() / found.errors.mean()
    assert share[LEAST_FRAMES] > share[40] > 0
    one = constant_offsets(TRUTH[:1] + 0.02, TRUTH[:1], least_frames=1)
    np.testing.assert_allclose(one.remaining, 0, atol=1e-12)


@pytest.mark.parametrize("n", [50, 200, 800])
def test_of_noise_alone_hardly_anything_is_constant(n):
    """A part of an offset scatters as a median of n: by sqrt(pi / 2) sigma / sqrt(n). The mean error stays what it was."""
    truth, _ = walker(n)
    found = constant_offsets(truth + np.random.default_rng(n).normal(0, 0.02, truth.shape), truth)
    scatter = np.sqrt(np.pi / 2) * 0.02 / np.sqrt(n)
    # The root mean square of 45 parts scatters by a tenth itself.
    assert 0.7 < np.sqrt(np.mean(found.offsets**2)) / scatter < 1.3
    assert 0.95 < found.remaining.mean() / found.errors.mean() < 1.001


def test_landmarks_that_are_not_estimated_have_no_offset_and_the_others_have():
    offsets = np.full((15, 3), 0.02)
    estimate = moved(offsets)
    missing = [landmark_index(name) for name in ("pelvis", "neck", "l_hip")]  # the trunk is the truth's
    estimate[:, missing] = np.nan
    found = constant_offsets(estimate, TRUTH)
    assert np.isnan(found.offsets[missing]).all() and (found.compared[missing] == 0).all()
    others = np.setdiff1d(np.arange(15), missing)
    np.testing.assert_allclose(found.offsets[others], offsets[others], atol=1e-12)
    np.testing.assert_allclose(found.remaining[:, others], 0, atol=1e-12)
    assert not found.missing.any()


def test_the_median_may_cost_a_little():
    """The component-wise median of three vectors is farther from them than nothing is."""
    errors = np.array([[0.01, 0.01, -0.01], [0.01, -0.01, 0.01], [-0.01, 0.01, 0.01]])
    truth, _ = walker(39)
    found = constant_offsets(moved(np.tile(errors[:, None], (13, 15, 1)), truth), truth)
    np.testing.assert_allclose(found.offsets, 0.01, atol=1e-12)
    assert found.remaining.mean() > found.errors.mean()


def test_shapes_are_checked():
    with pytest.raises(InputError, match="must both be"):
        constant_offsets(TRUTH[:3], TRUTH)
    for points in (TRUTH[..., :2], TRUTH[:, :14], TRUTH[0, 0]):
        with pytest.raises(InputError, match=r"must be \(\.\.\., 15, 3\)"):
            trunk_frames(points)
    with pytest.raises(InputError, match="15, 3"):
        constant_offsets(TRUTH[..., :2], TRUTH[..., :2])


# The tables and the command.


def two_persons(offsets: np.ndarray) -> tuple[PoseTable, PoseTable]:
    """Truth of two walkers, 3 m apart, and an estimate that is off by an offset, shape (2, 15, 3), in each."""
    frames = np.tile(np.arange(40), 2)
    persons = np.repeat([0, 1], 40)
    aside = np.array([0, 3.0, 0])
    truth = PoseTable(frames, persons, np.concatenate([TRUTH, TRUTH + aside]))
    return truth, PoseTable(frames, persons, np.concatenate([moved(offsets[0]), moved(offsets[1]) + aside]))


def made(folder, truth: PoseTable, estimate: PoseTable):
    write_joints(folder / "recording" / "truth" / "joints.csv", truth)
    write_joints(folder / "result" / "joints.csv", estimate)
    return str(folder / "result"), str(folder / "recording")


def table(path) -> dict[tuple[str, str], dict]:
    with open(path, newline="") as file:
        return {(row["person"], row["landmark"]): row for row in csv.DictReader(file)}


@pytest.fixture
def offsets() -> np.ndarray:
    """Hips 40 mm up in one person and 20 mm in the other, to opposite sides by 30 mm; all else is right."""
    offsets = np.zeros((2, 15, 3))
    for name, side in (("l_hip", 1), ("r_hip", -1)):
        offsets[0, landmark_index(name)] = [0, 0.03 * side, 0.04]
        offsets[1, landmark_index(name)] = [0, -0.03 * side, 0.02]
    return offsets


def test_the_command_prints_and_writes(tmp_path, offsets, capsys):
    truth, estimate = two_persons(offsets)
    wrist = landmark_index("r_wrist")
    estimate.positions[10:20, wrist] += [0.2, 0, 0]  # lost in a quarter of one person's frames
    result, recording = made(tmp_path, truth, estimate)
    assert main(["evaluate", result, recording, "--offsets"]) == 0
    out = capsys.readouterr().out
    rows = table(tmp_path / "result" / "offsets.csv")
    assert len(rows) == 3 * 16
    assert list(rows["all", "neck"]) == [
        "person", "landmark", "mean_mm", "mean_without_mm", "offset_mm", "forward_mm", "outward_mm", "up_mm", "frames"
    ]  # fmt: skip

    def figures(person, landmark):
        return [float(value) for value in list(rows[person, landmark].values())[2:]]

    lengths = [50, np.hypot(30, 20)]
    # Outward on both sides in one person, inward in the other.
    for name in ("l_hip", "r_hip"):
        assert figures("0", name) == pytest.approx([50, 0, 50, 0, 30, 40, 40], abs=2e-3)
        assert figures("1", name) == pytest.approx([lengths[1], 0, lengths[1], 0, -30, 20, 40], abs=2e-3)
    assert figures("0", "overall")[4:6] == pytest.approx([2 * 30 / 12, 2 * 40 / 15], abs=2e-3)
    # Over persons: plain means, the sides cancel, the length does not.
    assert figures("all", "l_hip") == pytest.approx([np.mean(lengths), 0, np.mean(lengths), 0, 0, 30, 80], abs=2e-3)
    assert figures("0", "r_wrist") == pytest.approx([50, 50, 0, 0, 0, 0, 40], abs=2e-3)
    mean, without = (2 * sum(lengths) + 50) / 30, 50 / 30
    assert figures("all", "overall") == pytest.approx([mean, without, 2 * np.mean(lengths) / 15, 0, 0, 60 / 15, 80], abs=2e-3)
    metrics = table(tmp_path / "result" / "metrics.csv")
    assert all(float(row["mean_mm"]) == pytest.approx(float(metrics[key]["mean_mm"]), abs=2e-3) for key, row in rows.items())
    report = tomllib.loads((tmp_path / "result" / "metrics.toml").read_text())
    assert report["offsets"] == pytest.approx(
        {"mean_mm": mean, "mean_without_mm": without, "offset_mm": 2 * np.mean(lengths) / 15, "frames": 80,
         "constant_share": 1 - without / mean}, abs=2e-3,
    )  # fmt: skip
    assert report["notes"] == []
    assert out.index("first frame of each person") < out.index("constant offsets along the true trunk") < out.index("\nwithout them:")
    assert f"without them: mean {without:.1f} mm for {mean:.1f}, {1 - without / mean:.0%} of the error is constant (in-sample)" in out
    assert out.count("\nl_hip ") == 2 and out.count("\nperson 1 ") == 2
    assert main(["evaluate", result, recording, "--offsets", "--quiet"]) == 0
    out = capsys.readouterr().out
    assert "l_hip" not in out and out.count("\noverall ") == 2


def test_without_the_option_there_is_no_table(tmp_path, offsets, capsys):
    result, recording = made(tmp_path, *two_persons(offsets))
    assert main(["evaluate", result, recording]) == 0
    assert "constant" not in capsys.readouterr().out and not (tmp_path / "result" / "offsets.csv").exists()


def test_what_is_left_out_is_told(tmp_path, offsets, capsys):
    truth, estimate = two_persons(offsets)
    truth.positions[2:4, landmark_index("pelvis")] = np.nan
    truth.positions[8, LEFT] = np.nan
    truth.positions[50, LEFT] = truth.positions[50, RIGHT]
    estimate.positions[:31, landmark_index("l_wrist")] = np.nan
    result, recording = made(tmp_path, truth, estimate)
    assert main(["evaluate", result, recording, "--offsets"]) == 0
    out = capsys.readouterr().out
    assert "note: person 0: no offsets from frames 2-3, 8 (3 frames): the truth lacks a landmark of the trunk" in out
    assert "note: person 1: no offsets from frame 10: the true trunk is flat there" in out
    assert "note: person 0: l_wrist has no offset, compared in fewer than 10 frames" in out
    rows = table(tmp_path / "result" / "offsets.csv")
    assert list(rows["0", "l_wrist"].values())[2:] == ["", "", "", "", "", "", "0"]
    assert rows["all", "l_wrist"]["frames"] == rows["1", "l_wrist"]["frames"] == "39" and rows["0", "overall"]["frames"] == "37"


def test_a_short_clip_has_a_note_and_no_offsets(tmp_path, offsets, capsys):
    result, recording = made(tmp_path, *two_persons(offsets))
    assert main(["evaluate", result, recording, "--offsets", "--frames", "9"]) == 0
    out = capsys.readouterr().out
    assert "note: person 1: no landmark has an offset, compared in fewer than 10 frames" in out and "along the true trunk" not in out
    report = tomllib.loads((tmp_path / "result" / "metrics.toml").read_text())
    assert report["offsets"]["frames"] == 0 and np.isnan(report["offsets"]["constant_share"])


def test_a_truth_without_trunks_is_one_line_and_exit_code_2(tmp_path, offsets, capsys):
    """Whether hips and shoulders are missing or lie along the spine; nothing is printed or written."""
    for name, lacking in (("missing", np.nan), ("flat", TRUTH[0, LEFT])):
        truth, estimate = two_persons(offsets)
        for side in (LEFT, RIGHT):
            truth.positions[:, side] = lacking
        result, recording = made(tmp_path / name, truth, estimate)
        assert main(["evaluate", result, recording, "--offsets"]) == 2
        captured = capsys.readouterr()
        assert "in no frame with an estimate does the truth have a trunk (pelvis, neck, l_hip, r_hip" in captured.err
        assert captured.err.count("\n") == 1 and captured.out == ""
        assert not (tmp_path / name / "result" / "metrics.csv").exists()
        with pytest.raises(InputError, match="have a trunk"):
            evaluate_offsets(evaluate_pose(estimate, truth).persons)


def test_one_person_without_a_trunk_is_a_note(offsets):
    truth, estimate = two_persons(offsets)
    truth.positions[:40, LEFT] = np.nan
    found = evaluate_offsets(evaluate_pose(estimate, truth).persons)
    rows = {(row["person"], row["landmark"]): row for row in found.rows}
    assert rows["0", "neck"]["frames"] == 0 and rows["all", "l_hip"]["up_mm"] == pytest.approx(20)
    assert len(found.notes) == 1 and found.notes[0].startswith("person 0: no offsets from frames 0-39 (40 frames)")


def test_a_person_who_was_never_estimated_has_no_offsets(offsets):
    truth, estimate = two_persons(offsets)
    found = evaluate_offsets(evaluate_pose(estimate.of(0), truth).persons)
    rows = {(row["person"], row["landmark"]): row for row in found.rows}
    assert rows["1", "overall"]["frames"] == 0 and np.isnan(rows["1", "l_hip"]["offset_mm"])
    assert rows["all", "l_hip"]["up_mm"] == pytest.approx(40) and found.notes == ()


def test_a_perfect_result_has_no_share(tmp_path, offsets, capsys):
    truth, _ = two_persons(offsets)
    result, recording = made(tmp_path, truth, truth)
    assert main(["evaluate", result, recording, "--offsets"]) == 0
    assert "without them" not in capsys.readouterr().out
    report = tomllib.loads((tmp_path / "result" / "metrics.toml").read_text())
    assert report["offsets"]["mean_without_mm"] == 0 and np.isnan(report["offsets"]["constant_share"])


def test_from_python(tmp_path, offsets):
    """As the docstring of `hmc.evaluate` says it."""
    truth, estimate = two_persons(offsets)
    found = evaluate_offsets(evaluate_pose(estimate, truth).persons)
    assert found.summary["constant_share"] == pytest.approx(1) and found.summary["mean_without_mm"] < 1e-9
    assert "evaluate_offsets" in hmc.evaluate.__doc__


def test_wrong_use_is_one_line_and_exit_code_2(tmp_path, offsets, capsys):
    truth, estimate = two_persons(offsets)
    result, recording = made(tmp_path, truth, estimate)
    tracks = TrackTable(truth.frames, truth.persons, truth.positions[:, 0], truth.positions[:, 2])
    for place in ("where.csv", "result/tracks.csv", "tracks_only/tracks.csv"):
        write_tracks(tmp_path / place, tracks)
    for arguments in ([result, "--truth", str(tmp_path / "where.csv")], [str(tmp_path / "tracks_only"), recording]):
        assert main(["evaluate", *arguments, "--offsets"]) == 2
        captured = capsys.readouterr()
        assert "--offsets needs joints.csv there, and true joints in metres" in captured.err
        assert captured.err.count("\n") == 1 and captured.out == ""
