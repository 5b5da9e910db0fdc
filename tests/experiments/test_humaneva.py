"""HumanEva-I: files laid out as they are released become a recording whose views and truth belong to the same moments."""

import numpy as np
import pytest
from c3d_files import write_c3d
from conftest import write_video

from hmc.camera.model import project
from hmc.errors import InputError
from hmc.experiments.__main__ import main
from hmc.experiments.five_actions import action_title
from hmc.experiments.humaneva import FIRST_FRAME, JOINTS, MARKERS, Sync, convert_take, find_takes, synchronise
from hmc.experiments.markerless_runs import chosen_cameras
from hmc.io.recording import background_frames, iterate_frames, open_recording
from hmc.io.results import read_joints
from hmc.landmarks import LANDMARKS

#: When each camera's first frame was taken: a frame of the motion capture, from 1. Two frames of it to one of the videos.
BEGAN = {"C1": 9.0, "BW1": 1.0, "C2": 5.0}
SCALE, N_FRAMES, N_MOCAP = 2.0, 30, 60


def point(label, moment):
    """Where a point of the motion capture is, millimetres."""
    k = sorted([*JOINTS.values(), "HEDO", "HEDP", *MARKERS]).index(label)
    return np.array([10.0 * moment + k, 20.0 * k + 1, 5.0 * k + 2.0 * moment]) if label != "HEDP" else point("HEDO", moment) + [0, 0, 120.0]


def write_release(root, ring, mocap=True):
    """Subject S1 with one sequence, three cameras; brightness of a frame says when it was taken."""
    subject = root / "S1"
    for camera, name in zip(ring, BEGAN, strict=False):
        numbers = [camera.matrix[0, 0], camera.matrix[1, 1], *camera.matrix[:2, 2], 0, *camera.distortions, *camera.rotation.ravel()]
        text = "\n".join(f"{value:.12g}" for value in [*numbers, *(1000 * camera.translation)])
        (subject / "Calibration_Data").mkdir(parents=True, exist_ok=True)
        (subject / "Calibration_Data" / f"{name}.cal").write_text(text)
        level = lambda index, name=name: int(BEGAN[name] + SCALE * index) + 40  # noqa: E731
        write_video(subject / "Image_Data" / f"Box_1_({name}).avi", N_FRAMES, camera.size, level, fps=60)
        (subject / "Sync_Data").mkdir(exist_ok=True)
        image = 4  # any frame will do
        (subject / "Sync_Data" / f"Box_1_({name}).ofs").write_text(f"{image}\n{BEGAN[name] + SCALE * (image - 1)}\n{SCALE}\n")
        for number, shade in ((1, 200), (2, 60), (3, 120)):
            write_video(root / "Background" / f"Background_{number}_({name}).avi", 3, camera.size, lambda index, shade=shade: shade)
    if mocap:
        labels = [*JOINTS.values(), "HEDO", "HEDP", *MARKERS]
        points = np.array([[point(label, moment) for label in labels] for moment in range(1, N_MOCAP + 1)])
        missing = np.zeros(points.shape[:2], bool)
        missing[35, labels.index("LKNE")] = True  # frame 36 of the motion capture
        write_c3d(subject / "Mocap_Data" / "Box_1.c3d", [f"S1:{label}" for label in labels], points, 120.0, missing=missing)
        (subject / "Mocap_Data" / "S1.mp").write_text("$LKneeWidth = 104.5\n$Height = 1723\n")
    return root


@pytest.fixture
def release(tmp_path, ring):
    return write_release(tmp_path / "HumanEva_I", ring)


def test_views_and_truth_belong_to_the_same_moments(release, tmp_path, ring):
    (take,) = find_takes(release)
    recording = open_recording(convert_take(take, tmp_path / "out"))
    assert recording.name == "S1_Box_1" and recording.fps == 60 and recording.subject_height_m == (1.723,)
    assert recording.rig.names == ("BW1", "C1", "C2")
    # the last camera to begin is at its frame 6; the others have seen more of what came before
    first = max(BEGAN.values()) + SCALE * (FIRST_FRAME - 1)
    assert recording.n_frames == N_FRAMES - (FIRST_FRAME - 1) - 2  # as long as two of the cameras last
    truth = read_joints(recording.path / "truth" / "joints.csv")
    assert (truth.persons == 0).all()
    for frame in iterate_frames(recording):
        moment = first + SCALE * frame.index
        for image in frame.images:
            assert image is None or abs(float(image[..., 1].mean()) - (moment + 40)) < 1.0
        if frame.index in truth.frames:
            pose = truth.positions[truth.frames == frame.index][0]
            for name, label in JOINTS.items():
                assert pose[LANDMARKS.index(name)] == pytest.approx(point(label, moment) / 1000, abs=2e-6)
            assert pose[0] == pytest.approx((point("LFEP", moment) + point("RFEP", moment)) / 2000, abs=2e-6)
            crown = point("TRXO", moment) / 1000 + [0, 0, 0.316103]
            assert pose[LANDMARKS.index("head_top")] == pytest.approx(crown, abs=2e-6)
    # moments are frames 19, 21, ..., of the motion capture, so the one with a lost marker, 36, is none of them
    assert truth.frames.tolist() == list(range(int((N_MOCAP - first) / SCALE) + 1))[: recording.n_frames]


def test_calibration_is_the_same_camera(release, tmp_path, ring):
    recording = open_recording(convert_take(find_takes(release / "S1")[0], tmp_path / "out"))
    points = np.random.default_rng(0).normal(0, 0.4, (20, 3)) + [0, 0, 1]
    for camera, name in zip(ring, BEGAN, strict=False):
        own = recording.rig[recording.rig.names.index(name)]
        assert np.allclose(project(own, points)[0], project(camera, points)[0], atol=1e-6)


def test_the_empty_scene_that_fits_is_taken(release, tmp_path):
    recording = open_recording(convert_take(find_takes(release)[0], tmp_path / "out"))
    assert all(abs(float(next(background_frames(recording, k))[..., 1].mean()) - 60) <= 1 for k in range(3))


def test_a_lost_marker_and_moments_between_frames(ring, tmp_path, monkeypatch):
    root = write_release(tmp_path / "HumanEva_I", ring)
    for name in BEGAN:  # half a frame of the motion capture later
        path = root / "S1" / "Sync_Data" / f"Box_1_({name}).ofs"
        image, mocap, scale = map(float, path.read_text().split())
        path.write_text(f"{image:g}\n{mocap + 0.5}\n{scale}\n")
    folder = convert_take(find_takes(root)[0], tmp_path / "out")
    truth = read_joints(folder / "truth" / "joints.csv")
    first = max(BEGAN.values()) + 0.5 + SCALE * (FIRST_FRAME - 1)
    moments = first + SCALE * truth.frames
    assert 35.5 not in moments and 33.5 in moments and 37.5 in moments
    shoulder = truth.positions[:, LANDMARKS.index("l_shoulder")]
    assert np.allclose(shoulder, [point("LCLO", moment) / 1000 for moment in moments], atol=2e-6)


@pytest.mark.parametrize("began", [(1, 1, 1), (40, 7, 12.4), (-20, -3.3, -9)])
def test_moments_against_the_equation_of_the_release(began):
    """MocapIndex = MOCAP_ST + (ImageIndex - IM_ST) * MOCAP_SC, for every camera at the start that is found."""
    syncs = {f"C{k}": Sync(10.0, start + 2.01 * 9, 2.01) for k, start in enumerate(began)}
    starts, moment, scale = synchronise(syncs)
    assert scale == pytest.approx(2.01) and moment == pytest.approx(max(1, *began)) and min(starts.values()) >= 0
    for camera, sync in syncs.items():
        assert abs(sync.mocap + (starts[camera] + 1 - sync.image) * sync.scale - moment) <= scale / 2 + 1e-9


def test_command(release, tmp_path, capsys):
    (release / "S1" / "Sync_Data" / "Box_1_(C2).ofs").unlink()
    assert main(["humaneva", str(release), "--out", str(tmp_path / "out"), "--frames", "7"]) == 0
    told = capsys.readouterr()
    assert "camera C2 is left out" in told.err and "wrote" in told.out
    recording = open_recording(tmp_path / "out" / "S1_Box_1")
    assert recording.n_frames == 7 and len(recording.rig) == 2
    assert main(["humaneva", str(release), "--out", str(tmp_path / "out")]) == 0  # again, over the former


def test_without_truth_and_background(ring, tmp_path, capsys):
    root = write_release(tmp_path / "HumanEva_I", ring, mocap=False)
    for path in (root / "Background").iterdir():
        path.unlink()
    assert main(["humaneva", str(root), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().err
    assert "has no motion capture" in told and "cut from the sequence itself" in told
    assert not (tmp_path / "out" / "S1_Box_1" / "truth").exists()


def test_actions_are_called_as_in_the_thesis():
    names = ("Walking", "Jog", "ThrowCatch", "Gestures", "Box")
    titles = [action_title(f"S{k}_{name}_1@12345678") for k, name in enumerate(names, 1)]
    assert titles == ["Walking", "Jog", "Throw/Catch", "Gesture", "Box"]
    assert action_title("S1_Combo_2@12345678") == "S1_Combo_2" and action_title("mine@12345678") == "mine"


def test_wrong_input_is_told(release, tmp_path, capsys):
    out = ["--out", str(tmp_path / "out")]
    assert main(["humaneva", str(tmp_path), *out]) == 2
    assert "no HumanEva-I here" in capsys.readouterr().err
    assert main(["humaneva", str(release), "--only", "S1_Jog_1", *out]) == 2
    assert "has S1_Box_1" in capsys.readouterr().err
    (release / "S1" / "Sync_Data" / "Box_1_(C1).ofs").write_text("1\n2\n")
    with pytest.raises(InputError, match="holds 2 numbers"):
        convert_take(find_takes(release)[0], tmp_path / "out")
    (release / "S1" / "Sync_Data" / "Box_1_(C1).ofs").write_text("1\n2\n2.0\n")
    write_c3d(release / "S1" / "Mocap_Data" / "Box_1.c3d", ["LFEP"], np.ones((60, 1, 3)), 120.0)
    with pytest.raises(InputError, match=r"Box_1\.c3d: the motion capture has no point TRXO"):
        convert_take(find_takes(release)[0], tmp_path / "out")


def test_three_cameras_are_those_in_color():
    """As in the thesis's reconstructions from three cameras; of other recordings they are evenly spread."""
    names = ("BW1", "BW2", "BW3", "BW4", "C1", "C2", "C3")
    assert chosen_cameras(names, 3) == ["C1", "C2", "C3"]
    assert chosen_cameras(names, 2) == ["C1", "C2"] and chosen_cameras(names, 5) == ["C1", "C2", "C3", "BW1", "BW3"]
    other = tuple(f"cam_0{k}" for k in range(7))
    assert chosen_cameras(other, 3) == ["cam_00", "cam_02", "cam_04"]
    assert chosen_cameras(("C1", "C2", "C3", "C4"), 2) == ["C1", "C3"]  # no grey ones: not that dataset
