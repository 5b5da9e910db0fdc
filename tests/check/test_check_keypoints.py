"""Do cameras' keypoints agree: nothing is said of a good rig, and a camera that is off in place or in time is named."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hmc
from hmc.camera.model import Rig
from hmc.check import inspect_recording
from hmc.check.keypoints import agreement_lines, keypoint_agreement, keypoint_findings
from hmc.cli import main
from hmc.io.calibration import write_calibration
from hmc.io.keypoints import open_keypoints
from hmc.synthetic.keypoints import KeypointNoise, write_keypoints

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"


@pytest.fixture
def clip(tmp_path):
    """The rendered clip with keypoints of a pretended detector, a false person now and then among them."""
    folder = Path(shutil.copytree(TINY, tmp_path / "tiny"))
    write_keypoints(folder, np.random.default_rng(0), KeypointNoise(noise_px=2, false_rate=0.1))
    return folder


def told(folder, cameras=None):
    recording = hmc.open_recording(folder, cameras=cameras)
    return keypoint_findings(keypoint_agreement(recording, open_keypoints(recording)), recording.path)


def turn(folder, name, degrees):
    def moved(camera):
        about = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
        return type(camera)(
            camera.name, camera.size, camera.matrix, camera.distortions, about @ camera.rotation, about @ camera.translation
        )

    rig = hmc.open_recording(folder).rig
    write_calibration(folder / "calibration.toml", Rig(tuple(moved(camera) if camera.name == name else camera for camera in rig)))


def shift(folder, name, frames):
    """Give what is seen in frame f the number f + frames."""
    own = folder / "keypoints" / name
    texts = {int(path.stem.split("_")[-2]): path.read_text() for path in own.iterdir()}
    shutil.rmtree(own)
    own.mkdir()
    for number, text in texts.items():
        if number + frames >= 0:
            (own / f"{number + frames}.json").write_text(text)


def test_of_a_good_rig_nothing_is_said(clip):
    assert told(clip) == []
    inspection = inspect_recording(clip)
    assert inspection.keypoints is not None and not [f for f in inspection.findings if "keypoints" in f.sentence]
    assert np.nanmax(inspection.keypoints.residual) < 6
    lines = agreement_lines(inspection.keypoints)
    assert len(lines) == 1 + len(inspection.recording.rig) and lines[1].startswith("cam_00") and "30/30" in lines[1]


@pytest.mark.parametrize(("camera", "degrees"), [("cam_01", 5), ("cam_03", -6)])
def test_a_camera_that_has_moved_is_named(clip, camera, degrees):
    turn(clip, camera, degrees)
    (sentence,) = told(clip)
    assert sentence.startswith(f"camera '{camera}': its keypoints are") and "has it moved" in sentence


@pytest.mark.parametrize(("camera", "frames"), [("cam_00", 5), ("cam_02", -4)])
def test_a_camera_that_is_early_or_late_is_named_with_its_frames(clip, camera, frames):
    shift(clip, camera, frames)
    (sentence,) = told(clip)
    found, way = re.search(r"if they are taken (\d+) frames? (later|earlier)", sentence).groups()
    assert sentence.startswith(f"camera '{camera}': ") and abs(int(found) - abs(frames)) <= 1
    assert way == ("later" if frames > 0 else "earlier") and "`first_frame`" in sentence
    assert sentence.endswith(f"hmc sync {clip}")


def test_of_two_cameras_none_is_named(clip):
    pair = ["cam_00", "cam_01"]
    assert told(clip, pair) == []
    shift(clip, "cam_01", 5)
    (sentence,) = told(clip, pair)
    assert "which of them is early or late cannot be told" in sentence and re.search("[456] frames later", sentence)
    assert sentence.endswith(f"hmc sync {clip}")
    turn(clip, "cam_00", 12)
    (sentence,) = told(clip, pair)
    assert "cannot be told" in sentence


def test_one_camera_nobody_and_a_broken_file(clip):
    for camera in sorted((clip / "keypoints").iterdir())[1:]:
        shutil.rmtree(camera)
    assert told(clip) == []
    for path in (clip / "keypoints" / "cam_00").iterdir():
        path.write_text('{"people": []}')
    assert told(clip) == []
    path.write_text("{")
    (warning,) = [f for f in inspect_recording(clip).findings if "keypoints" in f.sentence]
    assert warning.severity == "warning" and "not a JSON file" in warning.sentence


def test_the_command_prints_the_table(clip, tmp_path, capsys):
    shutil.rmtree(clip / "keypoints" / "cam_01")
    assert main(["check", str(clip), "--out", str(tmp_path / "rig.png")]) == 0
    printed = capsys.readouterr().out
    assert "px from others" in printed and re.search(r"^cam_01 +none$", printed, re.MULTILINE) and "wrists" in printed


@pytest.mark.parametrize("name", ["rendered/r1", "rendered/r4", "balancing"])
def test_a_real_detector(shared_data, name):
    """For images of 640 pixels: 3 px in rendered recordings, 6 to 9 in the real one."""
    recording = hmc.open_recording(shared_data / name)
    source = open_keypoints(recording)
    if source is None:
        pytest.skip("no keypoints beside these recordings")
    agreement = keypoint_agreement(recording, source)
    print("\n".join(agreement_lines(agreement)))
    known = np.isfinite(agreement.residual)
    assert known.sum() >= 3 and (agreement.residual[known] / agreement.scales[known] < 15).all()
    assert not [one for one in keypoint_findings(agreement, recording.path) if "taken" in one] and (name == "balancing") == bool(
        keypoint_findings(agreement, recording.path)
    )


@pytest.mark.parametrize("frames", [-7, 3])
def test_a_real_detector_out_of_time(shared_data, tmp_path, frames):
    folder = tmp_path / "r1"
    shutil.copytree(shared_data / "rendered" / "r1", folder, ignore=shutil.ignore_patterns("background", "truth"))
    if not (folder / "keypoints").is_dir():
        pytest.skip("no keypoints beside these recordings")
    shift(folder, "cam_04", frames)
    (sentence,) = told(folder)
    assert sentence.startswith("camera 'cam_04': ") and f"taken {abs(frames)} frames {'later' if frames > 0 else 'earlier'}" in sentence
