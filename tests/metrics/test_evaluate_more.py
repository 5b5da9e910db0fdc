"""`hmc evaluate` with angles, with thresholds from the errors, and in images: against errors that we made and against OpenCV."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest

from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import Rig, look_at
from hmc.cli import main
from hmc.errors import InputError
from hmc.io.calibration.toml import write_calibration
from hmc.io.results import PoseTable, write_joints
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.metrics.landmarks import landmark_errors
from hmc.metrics.scores import evaluate_images, evaluate_pose, image_landmarks, read_image_landmarks
from hmc.metrics.threshold import choose_threshold


@pytest.fixture(scope="module")
def truth() -> PoseTable:
    """One person in 40 frames, arms bent, who walks along x."""
    body = default_body(1.75)
    states = np.tile(neutral_state("down", body.limits), (40, 1))
    states[:, 0], states[:, 2] = np.linspace(-0.5, 0.5, 40), 0.95
    return PoseTable(np.arange(40), np.zeros(40, int), landmarks(body, states))


def turned_about(points: np.ndarray, hinge: str, end: str, axis: np.ndarray, degrees: float) -> np.ndarray:
    """One landmark turned about another, by OpenCV's rotation."""
    rotation, _ = cv2.Rodrigues(np.radians(degrees) * axis / np.linalg.norm(axis))
    out, k, m = points.copy(), landmark_index(hinge), landmark_index(end)
    out[:, m] = out[:, k] + (points[:, m] - points[:, k]) @ rotation.T
    return out


def table(path) -> list[dict]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def made(tmp_path, truth: PoseTable, positions: np.ndarray):
    write_joints(tmp_path / "recording" / "truth" / "joints.csv", truth)
    write_joints(tmp_path / "result" / "joints.csv", PoseTable(truth.frames, truth.persons, positions))
    return tmp_path / "result", tmp_path / "recording"


def test_a_turned_shank_is_an_angle(tmp_path, truth, capsys):
    """The left shank 10 degrees back, which its landmarks show as 10 degrees of the knee and of nothing else."""
    across = truth.positions[0, landmark_index("l_hip")] - truth.positions[0, landmark_index("r_hip")]
    result, recording = made(tmp_path, truth, turned_about(truth.positions, "l_knee", "l_ankle", across, 10.0))
    assert main(["evaluate", str(result), str(recording), "--angles"]) == 0
    rows = {row["angle"]: row for row in table(result / "angles.csv") if row["person"] == "all"}
    change = float(rows["l_knee_flexion"]["mean_deg"])
    assert change == pytest.approx(10, abs=0.6) and int(rows["l_knee_flexion"]["compared"]) == 40
    assert all(
        float(row["mean_deg"]) < 1e-3
        for name, row in rows.items()
        if row["mean_deg"] and not name.startswith(("l_knee", "l_hip", "overall"))
    )
    assert "l_knee_flexion" in capsys.readouterr().out
    report = tomllib.loads((result / "metrics.toml").read_text())
    assert report["angles"]["mean_deg"] == pytest.approx(float(rows["overall"]["mean_deg"]), abs=1e-3)


def test_an_angle_of_unmatched_landmarks_does_not_count(tmp_path, truth):
    positions = truth.positions.copy()
    positions[:, landmark_index("l_ankle")] += [0, 0, 0.5]
    result, recording = made(tmp_path, truth, positions)
    assert main(["evaluate", str(result), str(recording), "--angles", "--quiet"]) == 0
    rows = {row["angle"]: row for row in table(result / "angles.csv") if row["person"] == "all"}
    assert rows["l_knee_flexion"]["compared"] == "0" and rows["l_knee_flexion"]["mean_deg"] == ""
    assert rows["r_knee_flexion"]["compared"] == "40"


def test_thresholds_come_from_the_errors(tmp_path, truth, capsys):
    """Most errors are about 30 mm, a tenth are lost by half a metre: both tests part them, and the scores use what they say."""
    rng = np.random.default_rng(1)
    off = np.clip(rng.normal(0.03, 0.006, truth.positions.shape[:2]), 0.001, None)
    off[rng.random(off.shape) < 0.1] += 0.5
    direction = rng.standard_normal(truth.positions.shape)
    positions = truth.positions + off[..., None] * direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    result, recording = made(tmp_path, truth, positions)
    assert main(["evaluate", str(result), str(recording), "--threshold", "auto", "--quiet"]) == 0
    said = tomllib.loads((result / "metrics.toml").read_text())["pose"]
    errors = landmark_errors(np.round(positions, 6), np.round(truth.positions, 6))
    for test in ("lilliefors", "r2"):
        threshold = said[f"threshold_{test}_mm"]
        assert threshold == pytest.approx(1000 * choose_threshold(errors, test).threshold, abs=0.01) and 35 < threshold < 100
    assert "by Lilliefors" in capsys.readouterr().out
    names = [name for name in table(result / "metrics.csv")[0] if name.startswith("mmta")]
    share = float((errors < 0.1).mean())
    assert names and "mmta_at_100mm" not in names and all(abs(said[name] - share) < 0.02 for name in names)


def test_thresholds_are_checked(tmp_path, truth, capsys):
    with pytest.raises(InputError, match="cannot be chosen from 15 errors"):
        evaluate_pose(truth.where(truth.frames == 0), truth.where(truth.frames == 0), ["auto"])
    result, recording = made(tmp_path, truth, truth.positions)
    for wrong in ("-3", "much", "nan"):
        with pytest.raises(SystemExit) as stopped:
            main(["evaluate", str(result), str(recording), f"--threshold={wrong}"])
        assert stopped.value.code == 2 and "neither auto nor a number above 0" in capsys.readouterr().err


def ring() -> Rig:
    cameras = []
    for k, angle in enumerate((0.3, 2.4, 4.5)):
        camera = look_at(f"cam_{k}", (640, 480), (4 * np.cos(angle), 4 * np.sin(angle), 1.6), (0, 0, 1.0), 65.0)
        cameras.append(replace(camera, distortions=np.array([-0.1, 0.02, 0, 0, 0])))
    return Rig(tuple(cameras))


def marked(path, truth: PoseTable, rig: Rig, shift: tuple[float, float]) -> None:
    """A table of marked landmarks: OpenCV's images of the true ones, moved."""
    lines = ["frame,camera,person,joint,u,v"]
    for camera in rig:
        for frame, points in zip(truth.frames, truth.positions, strict=True):
            uv = cv2.projectPoints(points.copy(), cv2.Rodrigues(camera.rotation)[0], camera.translation, camera.matrix, camera.distortions)[
                0
            ]
            lines += [
                f"{frame},{camera.name},5,{name},{u + shift[0]},{v + shift[1]}" for name, (u, v) in zip(LANDMARKS, uv[:, 0], strict=True)
            ]
    path.write_text("\n".join(lines) + "\n")


def test_marked_landmarks_are_scored_in_pixels(tmp_path, truth, capsys):
    rig = ring()
    result, recording = made(tmp_path, truth, truth.positions)
    write_calibration(recording / "calibration.toml", rig)
    marked(tmp_path / "marked.csv", truth, rig, (3.0, 4.0))
    command = ["evaluate", str(result), str(recording), "--truth", str(tmp_path / "marked.csv")]
    assert main([*command, "--threshold", "4", "6", "--angles"]) == 0
    overall = {row["camera"]: row for row in table(result / "images.csv") if row["landmark"] == "overall"}
    assert set(overall) == {"all", "cam_0", "cam_1", "cam_2"}
    for row in overall.values():
        assert float(row["mean_px"]) == pytest.approx(5, abs=0.02)
        assert (row["mmta_at_4px"], float(row["mmta_at_6px"])) == ("0.0000", 1)
    angles = {row["angle"]: row for row in table(result / "angles.csv") if row["camera"] == "all"}
    assert angles["overall"]["compared"] == "0" and "l_knee" in angles  # none is matched at the first threshold
    assert "in images" in capsys.readouterr().out
    assert main([*command, "--threshold", "6", "--angles"]) == 0
    angles = {row["angle"]: row for row in table(result / "angles.csv") if row["camera"] == "all"}
    assert float(angles["overall"]["mean_deg"]) < 0.01 and int(angles["overall"]["compared"]) == 40 * 3 * 9


def test_true_joints_are_scored_in_images(tmp_path, truth):
    rig = ring()
    positions = truth.positions + np.array([0, 0, 0.02])
    result, recording = made(tmp_path, truth, positions)
    write_calibration(recording / "calibration.toml", rig)
    assert main(["evaluate", str(result), str(recording), "--images", "--quiet"]) == 0
    expected = []
    for camera in rig:
        pose = cv2.Rodrigues(camera.rotation)[0], camera.translation, camera.matrix, camera.distortions
        both = [cv2.projectPoints(points.reshape(-1, 3), *pose)[0] for points in (positions, truth.positions)]
        expected.append(np.linalg.norm(both[0] - both[1], axis=-1).mean())
    found = [row for row in table(result / "images.csv") if row["landmark"] == "overall"]
    assert [float(row["mean_px"]) for row in found[1:]] == pytest.approx(expected, abs=1e-3)
    assert (result / "metrics.csv").is_file()


def test_two_people_in_images_are_told_apart(truth):
    rig = ring()
    other = PoseTable(truth.frames, np.ones(40, int), truth.positions + np.array([0, 1.0, 0]))
    both = PoseTable(*(np.concatenate([getattr(truth, name), getattr(other, name)]) for name in ("frames", "persons", "positions")))
    swapped = PoseTable(both.frames, 1 - both.persons, both.positions)
    assert evaluate_images(image_landmarks(swapped, rig), image_landmarks(both, rig, inside=True), rig).summary["mean_px"] < 1e-9


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0,cam_9,0,neck,1,2", "no camera named 'cam_9'"),
        ("0,cam_0,0,nose,1,2", "no landmark named 'nose'"),
        ("0,cam_0,0,neck,one,2", "must be numbers of pixels"),
        ("0,cam_0,0,neck,1,2\n0,cam_0,0,neck,1,3", "line 3: .*twice"),
    ],
)
def test_marked_landmarks_are_checked(tmp_path, line, message):
    path = tmp_path / "marked.csv"
    path.write_text(f"frame,camera,person,joint,u,v\n{line}\n")
    with pytest.raises(InputError, match=message):
        read_image_landmarks(path, ["cam_0"])


def test_images_need_a_calibration_and_joints(tmp_path, truth, capsys):
    result, recording = made(tmp_path, truth, truth.positions)
    marked(tmp_path / "marked.csv", truth.where(truth.frames < 2), ring(), (0.0, 0.0))
    assert main(["evaluate", str(result), "--truth", str(tmp_path / "marked.csv")]) == 2
    assert "need the RECORDING" in capsys.readouterr().err
    (result / "joints.csv").unlink()
    assert main(["evaluate", str(result), str(recording), "--images"]) == 2
    assert "need joints.csv" in capsys.readouterr().err
