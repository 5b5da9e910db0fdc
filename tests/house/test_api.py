"""The public face: its examples run, its names are all there, and asking for hmc alone loads next to nothing."""

import doctest
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hmc
import hmc.api
from hmc.body.joints import dof_index
from hmc.body.kinematics import landmarks
from hmc.body.marker_places import with_skin_markers
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import project
from hmc.io.detections import DetectionTable
from hmc.io.results import TrackTable, read_centroids, read_joints, write_joints, write_tracks
from hmc.pose import registry
from hmc.tracking import trackers

ROOT = Path(__file__).resolve().parents[2]


def examples() -> list:
    finder, found = doctest.DocTestFinder(recurse=False), []
    for name in ("__init__", *hmc.api.__all__, "Session", "live", "open_recording", "pose_method", "register_method", "register_tracker"):
        found += finder.find(hmc if name == "__init__" else getattr(hmc.api, name, None) or getattr(hmc, name), f"hmc.{name}", globs={})
    return found + finder.find(registry, "hmc.pose.registry") + finder.find(trackers, "hmc.tracking.trackers")


@pytest.mark.parametrize("example", examples(), ids=lambda example: example.name)
def test_examples_run(example, monkeypatch):
    monkeypatch.chdir(ROOT)
    assert example.examples, f"{example.name} has no example"
    results = doctest.DocTestRunner().run(example)
    assert results.failed == 0


def test_every_name_is_there():
    for name in hmc.__all__:
        assert callable(getattr(hmc, name)) or isinstance(getattr(hmc, name), dict), name
    assert set(hmc.__all__) <= set(dir(hmc))
    with pytest.raises(AttributeError, match="no attribute 'poses'"):
        hmc.poses  # noqa: B018


def test_a_recording_and_a_result_are_as_good_as_their_folders(tmp_path):
    """`hmc.pose("folder")` worked, and `hmc.evaluate(people, "folder")` ended in an AttributeError."""
    tiny, few = ROOT / "data" / "synthetic" / "tiny", hmc.open_recording(ROOT / "data" / "synthetic" / "tiny", frames=2)
    truth = read_joints(tiny / "truth" / "joints.csv")
    write_joints(tmp_path / "poses" / "joints.csv", truth)
    write_tracks(tmp_path / "tracks" / "tracks.csv", read_centroids(tiny / "truth" / "centroids.csv"))
    assert hmc.evaluate(str(tmp_path / "poses"), str(tiny)).summary["mean_mm"] == 0
    scores = hmc.evaluate(tmp_path / "tracks", few)
    assert scores.mota == 1 and scores.objects == 2
    hmc.view(tmp_path / "tracks", str(tiny), tmp_path / "tracks.png")
    assert (tmp_path / "tracks.png").is_file()
    assert next(hmc.silhouettes(str(tiny))).index == next(hmc.hulls(tiny, 0.1)).index == 0
    assert set(next(hmc.views(str(tiny), read_centroids(tiny / "truth" / "centroids.csv"), voxel_size_m=0.1))) == {0}


@pytest.mark.parametrize("part", [{"start": 1.5}, {"frames": 2.5}, {"frames": "3"}])
def test_frames_are_counted_in_whole_numbers(part):
    with pytest.raises(hmc.InputError, match="must be a whole number of frames; got"):
        hmc.open_recording(ROOT / "data" / "synthetic" / "tiny", **part)


@pytest.mark.parametrize("seed", [None, -1, 1.5, "a"])
def test_a_seed_is_a_whole_number(seed):
    recording = hmc.open_recording(ROOT / "data" / "synthetic" / "tiny", frames=1)
    for command in (hmc.track, hmc.pose, lambda one, seed: hmc.Session(one.rig, one, seed=seed)):
        with pytest.raises(hmc.InputError, match="`seed` must be a whole number, 0 or more; got"):
            command(recording, seed=seed)


def test_what_is_left_out_or_a_text_is_told():
    recording = hmc.open_recording(ROOT / "data" / "synthetic" / "tiny", frames=1)
    with pytest.raises(hmc.InputError, match="a session needs a background: images of the empty scene for each of cam_00"):
        hmc.Session(recording.rig, None, fps=5)
    with pytest.raises(hmc.InputError, match="a height must be a number of metres"):
        default_body("1.76")


def test_a_package_that_is_called_stays_a_package():
    import hmc.pose.person
    from hmc.pose.registry import METHODS

    assert callable(hmc.pose) and hmc.pose.person is sys.modules["hmc.pose.person"]
    assert hmc.METHODS is METHODS


def test_importing_hmc_loads_nothing_heavy():
    program = "import sys, hmc; print(*sorted({'numpy', 'scipy', 'cv2', 'sklearn', 'pandas', 'matplotlib'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.split() == []


def test_what_cannot_be_done_is_said(tmp_path):
    recording = hmc.open_recording(ROOT / "data" / "synthetic" / "tiny", frames=2)
    with pytest.raises(hmc.InputError, match="no pose method named 'magic'; there are apf"):
        hmc.pose(recording, method="magic")
    with pytest.raises(hmc.InputError, match="needs detections"):
        hmc.pose(recording, method="marker-apf")
    tracks = hmc.track(recording)
    with pytest.raises(hmc.InputError, match=r"must end in \.png"):
        hmc.view(tracks, recording, tmp_path / "picture.txt")


@pytest.mark.parametrize("out", ["videos/cam_00.avi", "videos/new.png", "calibration.toml"])
def test_no_view_takes_the_place_of_a_recording_s_file(recording_folder, out):
    """`hmc.view(tracks, recording, "RECORDING/videos/cam_00.mp4")` wrote over what was filmed; the command refused."""
    before = {file: file.read_bytes() for file in recording_folder.rglob("*") if file.is_file()}
    recording = hmc.open_recording(recording_folder, frames=2)
    tracks = TrackTable(np.zeros(1, int), np.zeros(1, int), np.array([[0.0, 0.0, 1.0]]))
    with pytest.raises(ValueError, match="the recording's own files; choose another place"):
        hmc.view(tracks, recording, str(recording_folder / out))
    assert {file: file.read_bytes() for file in recording_folder.rglob("*") if file.is_file()} == before
    hmc.view(tracks, recording, recording_folder / "tracks.png")
    assert (recording_folder / "tracks.png").is_file()


def test_no_export_takes_the_place_of_a_result_s_file(tmp_path, monkeypatch):
    text = "frame,person,joint,x,y,z\n0,0,pelvis,0,0,1\n"
    (tmp_path / "two").mkdir()
    (tmp_path / "two" / "joints.csv").write_text(text)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="is the result's own file; choose another name"):
        hmc.export("two", tmp_path / "two" / "joints.csv", fps=15)
    assert (tmp_path / "two" / "joints.csv").read_text() == text
    assert hmc.export("two", "two/table.csv", fps=15) == [Path("two/table.csv")]


@pytest.mark.parametrize("smooth_s", [-0.1, float("nan"), float("inf")])
def test_a_time_to_smooth_over_is_looked_at_before_any_work(smooth_s):
    with pytest.raises(ValueError, match="`smooth_s` must be a number of seconds, 0 or more"):
        hmc.pose("nowhere", smooth_s=smooth_s)


@pytest.mark.slow
def test_poses_from_detections():
    """A person who wears the markers, seen by the shipped clip's cameras: no image is read, and no tracks are needed."""
    recording = hmc.open_recording(ROOT / "data" / "synthetic" / "tiny", frames=3)
    body = default_body(1.76)
    states = np.tile(neutral_state("down", body.limits), (3, 1))
    states[:, 2] = 0.95
    states[:, dof_index("l_shoulder_x")] += np.radians([[-40], [-36], [-32]])
    uv, _ = project(recording.rig, landmarks(with_skin_markers(body), states))
    view, frame, _ = (index.ravel() for index in np.indices(uv.shape[:3]))
    detections = DetectionTable(frame, np.array(recording.rig.names)[view], uv.reshape(-1, 2))
    errors = []
    for seed in range(3):  # one draw may leave an arm astray
        people = hmc.pose(recording, method="marker-apf", detections=detections, seed=seed)
        assert people.frames.tolist() == [0, 1, 2] and set(people.persons) == {0}
        errors.append(np.linalg.norm(people.positions - landmarks(body, states), axis=-1).mean())
    assert sorted(errors)[1] < 0.002
