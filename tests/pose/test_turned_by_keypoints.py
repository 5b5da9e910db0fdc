"""Cameras that have turned since they were calibrated: found by keypoints, turned back, told; and none where nothing has turned."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import hmc
from hmc.camera.model import Rig, project
from hmc.camera.turned_cameras import turn_back
from hmc.io.keypoints import open_keypoints
from hmc.io.results import read_joints
from hmc.pose.keypoint_cues import learn_scatter
from hmc.pose.keypoint_tracks import tracks_of_keypoints
from hmc.pose.turned_back import turned_back
from hmc.pose.turned_by_keypoints import turned_by_keypoints
from hmc.synthetic.keypoints import write_keypoints
from hmc.voxels.hulls import FrontendSettings
from hmc.voxels.run_options import RunOptions

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The small clip with keypoints that scatter and miss as a detector's."""
    folder = Path(shutil.copytree(TINY, tmp_path_factory.mktemp("keypoints") / "clip"))
    write_keypoints(folder, np.random.default_rng(0))
    return folder


def opened(folder, turn=(0.0, 0.0, 0.0), camera=2, cameras=()):
    """The recording with one camera calibrated as before it was turned, its tracks, and what its keypoints tell."""
    recording = hmc.open_recording(folder, cameras or None)
    tracks = tracks_of_keypoints(recording, open_keypoints(recording))
    back = Rotation.from_rotvec(turn).as_matrix()
    wrong = [replace(one, rotation=one.rotation @ back.T, translation=-one.rotation @ back.T @ one.centre) for one in recording.rig]
    rig = Rig(tuple(wrong[c] if c == camera else one for c, one in enumerate(recording.rig)))
    recording = replace(recording, rig=rig)
    return recording, tracks, learn_scatter(rig, tracks, open_keypoints(recording), recording.fps)


@pytest.mark.parametrize("degrees", [2.0, 4.0])
@pytest.mark.parametrize("cameras", [(), ("cam_00", "cam_02", "cam_04", "cam_05")])
def test_a_camera_that_has_turned_is_found_and_turned_back(folder, degrees, cameras):
    turn = np.radians(degrees) * np.array([0.6, -0.48, 0.64])
    recording, tracks, cues = opened(folder, turn, 1, cameras)
    (found,) = turned_by_keypoints(recording.rig, tracks, cues)
    assert found.name == recording.rig[1].name and found.after_m < 0.65 * found.before_m
    true = hmc.open_recording(folder, cameras or None).rig
    mended = turn_back(recording.rig, {found.name: found.turn})
    assert_allclose(mended.centres, true.centres, atol=1e-9)
    joints = read_joints(folder / "truth" / "joints.csv").positions[::5].reshape(-1, 3)
    off = [np.linalg.norm(project(rig[1], joints)[0] - project(true[1], joints)[0], axis=1).mean() for rig in (recording.rig, mended)]
    assert off[1] < 0.3 * off[0]
    assert all(
        np.array_equal(one.rotation, other.rotation) for c, (one, other) in enumerate(zip(mended, recording.rig, strict=True)) if c != 1
    )


def test_where_nothing_has_turned_nothing_is_turned(folder):
    for cameras in ((), ("cam_00", "cam_02", "cam_04", "cam_05")):
        recording, tracks, cues = opened(folder, cameras=cameras)
        assert turned_by_keypoints(recording.rig, tracks, cues) == []


def test_three_cameras_do_not_tell_which_of_them_has_turned(folder):
    recording, tracks, cues = opened(folder, (0.0, 0.05, 0.0), 1, ("cam_00", "cam_02", "cam_04"))
    assert turned_by_keypoints(recording.rig, tracks, cues) == []


def test_detections_that_are_off_anyhow_are_no_camera_that_has_turned(folder):
    recording, tracks, cues = opened(folder)
    rng = np.random.default_rng(1)

    def wild(index, people):
        return tuple(given + (40 if c == 3 else 0) * np.append(rng.normal(size=2), 0.0) for c, given in enumerate(people))

    spoilt = replace(cues, source=cues.source.changed(wild))
    assert turned_by_keypoints(recording.rig, tracks, spoilt) == []


def test_poses_are_found_with_the_camera_turned_back_or_kept_as_asked(folder):
    recording, tracks, cues = opened(folder, (0.0, 0.0, 0.03), 4)
    keypoints = open_keypoints(recording)
    mended = turned_back(recording, tracks, RunOptions(), keypoints)
    assert len(mended.notes) == 1 and "'cam_04' has turned by 1.7 deg" in mended.notes[0] and "calibrate it anew" in mended.notes[0]
    assert mended.cues.scatter_m[4].mean() < cues.scatter_m[4].mean() and list(mended.turns) == ["cam_04"]
    kept = turned_back(recording, tracks, RunOptions(FrontendSettings(exclude=False)), keypoints)
    assert kept.recording is recording and np.array_equal(kept.cues.scatter_m, cues.scatter_m) and "kept as it is" in kept.notes[0]
    assert turned_back(mended.recording, tracks, RunOptions(), keypoints).notes == ()


def test_a_detector_that_is_wrong_for_two_thirds_of_a_run_is_no_camera_that_has_turned(folder):
    recording, tracks, cues = opened(folder)
    first = recording.n_frames // 6

    def displaced(index, people):
        wrong = first <= index < first + 2 * recording.n_frames // 3
        return tuple(given + np.array([0.0, 25.0, 0.0]) * (wrong and c == 3) for c, given in enumerate(people))

    assert turned_by_keypoints(recording.rig, tracks, replace(cues, source=cues.source.changed(displaced))) == []
    always = replace(
        cues,
        source=cues.source.changed(lambda index, people: tuple(p + np.array([0.0, 25.0, 0.0]) * (c == 3) for c, p in enumerate(people))),
    )
    assert [one.name for one in turned_by_keypoints(recording.rig, tracks, always)] == [recording.rig[3].name]


@pytest.mark.slow
def test_a_turned_camera_costs_poses_little(folder):
    errors = {}
    for degrees in (0, 2):
        recording, tracks, _ = opened(folder, np.radians([0, 0, degrees]), 4)
        recording = replace(recording, n_frames=12)
        near = tracks.where(tracks.frames < 12)
        people = hmc.pose(recording, near, method="keypoints", keypoints=open_keypoints(recording))
        truth = read_joints(folder / "truth" / "joints.csv").positions[people.frames]
        errors[degrees] = 1000 * np.linalg.norm(people.positions - truth, axis=-1).mean()
        assert any("cam_04" in line for line in people.notes) == (degrees > 0)
    assert errors[2] < errors[0] + 4
