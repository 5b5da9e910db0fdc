"""`hmc pose --method marker-apf`: from a table of detections, from colored markers in images, and what it says of wrong input."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from hmc.body.joints import dof_index
from hmc.body.kinematics import landmarks
from hmc.body.marker_places import with_skin_markers
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import Rig, look_at, project
from hmc.cli import main
from hmc.io.calibration import write_calibration
from hmc.io.detections import DetectionTable, write_detections
from hmc.io.recording import open_recording
from hmc.io.results import read_joints, read_pose, read_run
from hmc.pose.steps import marker_filter
from hmc.search import AnnealedSettings

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
GREEN = (30, 230, 40)


@pytest.fixture(autouse=True)
def little_work(monkeypatch):
    lean = replace(marker_filter.MARKER_PRESETS["default"], annealed=AnnealedSettings(2, 120, 0.1, 0.5))
    monkeypatch.setitem(marker_filter.MARKER_PRESETS, "default", lean)


def pose(recording, out, *more):
    return main(["pose", str(recording), "--method", "marker-apf", "--out", str(out), "--quiet", *map(str, more)])


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Images of the true joints of the shipped clip, with the lens's distortion."""
    truth, rig = read_joints(TINY / "truth" / "joints.csv").positions[:5], open_recording(TINY).rig
    uv, _ = project(rig, truth)
    rows = [(frame, rig.names[view], uv[view, frame, m]) for frame in range(5) for view in range(len(rig)) for m in range(15)]
    path = tmp_path_factory.mktemp("table") / "d.csv"
    write_detections(path, DetectionTable(np.array([r[0] for r in rows]), np.array([r[1] for r in rows]), np.array([r[2] for r in rows])))
    return path


def test_from_a_table_of_detections(table, tmp_path, capsys):
    arguments = ("--detections", table, "--markers", "joints", "--frames", 5)
    assert pose(TINY, tmp_path / "out", *arguments) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["feet.csv", "joints.csv", "pose.npz", "run.toml", "tracks.csv"]
    joints, truth = read_joints(tmp_path / "out" / "joints.csv"), read_joints(TINY / "truth" / "joints.csv")
    assert np.linalg.norm(joints.positions - truth.positions[:5], axis=-1).mean() < 0.03
    assert len(read_pose(tmp_path / "out" / "pose.npz").states) == 5
    run = read_run(tmp_path / "out" / "run.toml")
    assert run["method"] == "marker-apf" and run["parameters"]["markers"] == "joints"
    assert "person 0: 5 frames, from 0 to 4, stature about" in capsys.readouterr().out
    assert pose(TINY, tmp_path / "out", *arguments) == 0
    assert "finished before" in capsys.readouterr().out
    assert pose(TINY, tmp_path / "out", *arguments, "--seed", 3) == 0
    assert "starting anew" in capsys.readouterr().out


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """A recording of green discs on a grey room, where a body's markers would be seen."""
    folder = tmp_path_factory.mktemp("worn")
    rig = Rig(
        tuple(
            look_at(f"c{k}", (400, 300), (2.9 * np.cos(a), 2.9 * np.sin(a), 1.8), (0, 0, 0.9), 62)
            for k, a in enumerate((0, 1.3, 2.6, 4, 5.3))
        )
    )
    write_calibration(folder / "calibration.toml", rig)
    (folder / "recording.toml").write_text("fps = 30.0\nsubject_height_m = [1.75]\n")
    body = default_body(1.75)
    states = np.tile(neutral_state("down", body.limits), (4, 1))
    states[:, 2] = 0.95
    states[:, dof_index("l_shoulder_x")] += np.radians([[-40], [-38], [-36], [-34]])
    uv, _ = project(rig, landmarks(with_skin_markers(body), states))
    for camera, view in zip(rig, uv, strict=True):
        (folder / "images" / camera.name).mkdir(parents=True)
        for frame, points in enumerate(view):
            image = np.full((300, 400, 3), 120, np.uint8)
            for point in np.rint(16 * points).astype(int):
                cv2.circle(image, tuple(point.tolist()), 3 * 16, GREEN, -1, shift=4)
            cv2.imwrite(str(folder / "images" / camera.name / f"{frame:06d}.png"), image)
    (folder / "markers").mkdir()
    lines = "".join(f"0,c0,{u:.1f},{v:.1f}\n" for u, v in uv[0, 0, :4])
    (folder / "markers" / "labels.csv").write_text("frame,camera,u,v\n" + lines)
    return folder, landmarks(body, states)


def test_from_colored_markers_in_images(worn, tmp_path):
    folder, truth = worn
    assert pose(folder, tmp_path / "out") == 0
    joints = read_joints(tmp_path / "out" / "joints.csv")
    assert np.linalg.norm(joints.positions - truth, axis=-1).mean() < 0.05
    again = shutil.copy(tmp_path / "out" / "detections.csv", tmp_path / "d.csv")
    assert pose(folder, tmp_path / "again", "--detections", again) == 0
    assert (tmp_path / "again" / "joints.csv").read_bytes() == (tmp_path / "out" / "joints.csv").read_bytes()


def test_what_it_says_of_wrong_input(worn, table, tmp_path, capsys):
    folder, _ = worn

    def fails(*arguments):
        assert pose(*arguments) == 2
        return capsys.readouterr().err

    assert "give --detections FILE" in fails(TINY, tmp_path / "out")
    assert "no such file" in fails(TINY, tmp_path / "out", "--detections", tmp_path / "none.csv")
    assert "give one of them" in fails(TINY, tmp_path / "out", "--detections", table, "--labels", table)
    assert "no preset named 'best' of method marker-apf" in fails(TINY, tmp_path / "out", "--detections", table, "--preset", "best")
    assert "no marker in these frames" in fails(TINY, tmp_path / "out", "--detections", table, "--start", 10)
    (tmp_path / "labels.csv").write_text("frame,camera,u,v\n90,c0,1,1\n")
    assert "frame 90 is not in the recording" in fails(folder, tmp_path / "out", "--labels", tmp_path / "labels.csv")
