"""Poses by keypoints alone: the posture's cost, the body by lengths, the small clip from end to end, stopped runs, and what is refused."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from posed import body_of, crossed_arms
from stopped import Stopped, noting, stopping

import hmc
from hmc.body.joints import N_DOF, dof_index
from hmc.body.keypoint_places import BODY_KEYPOINTS, KEYPOINT_SEGMENTS, keypoint_places
from hmc.body.kinematics import segment_transforms
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body, stature
from hmc.cli import main
from hmc.io.keypoints import open_keypoints
from hmc.io.recording import reduced
from hmc.io.results import read_run, read_tracks, write_tracks
from hmc.landmarks import LANDMARKS
from hmc.pose.follow import FollowOptions, follow, for_method
from hmc.pose.keypoint_cues import learn_scatter
from hmc.pose.keypoint_tracks import tracks_of_keypoints
from hmc.pose.keypoint_views import with_keypoint_views
from hmc.pose.objectives.posture import PostureCost
from hmc.pose.objectives.residuals import residual_rows
from hmc.pose.starts.keypoint_body import body_of_keypoints, measured_lengths
from hmc.synthetic.keypoints import write_keypoints
from hmc.voxels.run_options import RunOptions

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
FRAMES = 12


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """The small clip with keypoints, as nobody could segment it: without frames of the empty scene."""
    folder = Path(shutil.copytree(TINY, tmp_path_factory.mktemp("keypoints") / "clip"))
    shutil.rmtree(folder / "background")
    write_keypoints(folder, np.random.default_rng(0))
    return folder


@pytest.fixture(autouse=True)
def nothing_is_segmented(monkeypatch):
    def refuse(*given, **named):
        raise AssertionError("silhouettes were asked for")

    for module in ("hmc.pose.follow", "hmc.tracking.resumable"):
        monkeypatch.setattr(f"{module}.stream_hulls", refuse)


def errors(people, folder) -> np.ndarray:
    """Distances from the true joints, metres."""
    truth = hmc.io.results.read_joints(folder / "truth" / "joints.csv")
    return np.linalg.norm(people.positions - truth.positions[people.frames], axis=-1)


# --- the parts


def test_the_posture_s_residuals_are_its_cost_and_change_as_they_say():
    body, points = body_of()
    objective = PostureCost(body, points.axes)
    rng, arms = np.random.default_rng(0), crossed_arms()
    arms[dof_index("r_hip_x", "l_hip_x")] = -0.05, 0.05  # legs that cross cost more, and no derivative is just between
    for state in (arms, arms + rng.normal(0, 0.02, N_DOF)):
        residuals, jacobian = residual_rows(objective.linearise(state))
        assert_allclose(residuals @ residuals, objective.cost(state[None])[0], rtol=1e-4)
        assert_allclose(objective.by_part(state[None]).sum(), objective.cost(state[None])[0])
        step = 1e-6 * np.eye(N_DOF)
        posture = slice(len(residuals) - N_DOF, None)
        slopes = np.array([(objective.linearise(state + d).residuals - objective.linearise(state - d).residuals) / 2e-6 for d in step]).T
        assert_allclose(jacobian[posture], slopes[posture], atol=1e-6)
        # Flesh is taken as round and straight near each point.
        deep = np.flatnonzero(residuals[:-N_DOF])
        assert len(deep) and np.abs(jacobian[deep] - slopes[deep]).max() < 0.25 * np.abs(slopes[deep]).max()
    other, axes = body_of(1.6)
    assert objective.of_body(other, axes).body is other and objective.coarser(rng, 5) is objective


def keypoints_of(body, states) -> np.ndarray:
    rotations, positions = segment_transforms(body, states)
    turned = (rotations[:, KEYPOINT_SEGMENTS] @ keypoint_places(body)[..., None])[..., 0]
    return positions[:, KEYPOINT_SEGMENTS] + turned


@pytest.mark.parametrize("height_m", [1.5, 1.65, 1.9])
def test_lengths_tell_the_stature(height_m):
    """Exact keypoints of a body of average proportions: its stature, drawn a little to the middle; a stature that is given is kept."""
    states = np.tile(neutral_state("down"), (9, 1))
    states[:, 3] = np.linspace(0, 3, 9)
    points = keypoints_of(default_body(height_m), states)
    assert abs(stature(body_of_keypoints(points).dimensions) / height_m - 1) < 0.03
    given = body_of_keypoints(points, 1.7).dimensions
    assert abs(given["height"] / 1.7 - 1) < 0.02
    # Lengths go with what was measured also where the stature is given.
    assert (given["thigh"] - 1.7 * 0.245) * (height_m - 1.7) > 0
    assert body_of_keypoints(np.full((2, len(BODY_KEYPOINTS), 3), np.nan)).dimensions["height"] == pytest.approx(1.70)


def test_a_length_that_few_frames_show_is_that_of_people():
    points = keypoints_of(default_body(1.8), np.tile(neutral_state("down"), (6, 1)))
    points[2:, BODY_KEYPOINTS.index("l_wrist")] = points[:, BODY_KEYPOINTS.index("r_wrist")] = np.nan
    points[0, BODY_KEYPOINTS.index("l_wrist")] += 0.5
    assert len(measured_lengths(points)["forearm"]) == 2
    body = body_of_keypoints(points)
    assert body.dimensions["forearm"] / body.dimensions["height"] == pytest.approx(0.150)


def test_lines_of_sight_are_the_same_through_smaller_images(clip):
    recording = hmc.open_recording(clip, frames=FRAMES)
    small = reduced(recording, (2,) * len(recording.rig))
    tracks, again = (tracks_of_keypoints(one, open_keypoints(one)) for one in (recording, small))
    assert_allclose(again.positions, tracks.positions, atol=1e-6)
    full, less = (learn_scatter(one.rig, tracks, open_keypoints(one), one.fps) for one in (recording, small))
    assert_allclose(less.scatter_m, full.scatter_m, atol=1e-6)


def test_keypoints_go_with_images_that_are_made_smaller(clip, tmp_path, monkeypatch, halved_images):
    given = []

    def learn(rig, tracks, source, fps, workers=1):
        given.append((rig[0].size, source.factors))
        raise hmc.InputError("enough")

    monkeypatch.setattr("hmc.pose.turned_back.learn_scatter", learn)
    recording = hmc.open_recording(clip, frames=2)
    source = open_keypoints(recording)
    tracks = tracks_of_keypoints(recording, source)
    write_tracks(tmp_path / "tracks.csv", tracks)
    for full in (False, True):
        with pytest.raises(hmc.InputError, match="enough"):
            hmc.pose(recording, tracks, keypoints=source, full_images=full)
        words = ["--tracks", str(tmp_path / "tracks.csv"), "--frames", "2", "--quiet", *["--full-images"] * full]
        assert main(["pose", str(clip), "--out", str(tmp_path / "out"), *words]) == 2
    assert given == [((160, 120), (2,) * 7)] * 2 + [((320, 240), (1,) * 7)] * 2


def test_images_of_which_no_voxels_are_made_stay_as_they_are(clip, halved_images):
    recording = hmc.open_recording(clip, frames=2)
    for name in ("keypoints", "marker-apf"):
        assert for_method(recording, hmc.pose_method(name), 0.03) is recording
    assert for_method(recording, hmc.pose_method("smd"), 0.03).factors == (2,) * 7


def test_cameras_agree_with_a_pose_until_it_is_moved(clip):
    recording = hmc.open_recording(clip, frames=3)
    source = open_keypoints(recording)
    people = hmc.pose(recording, method="keypoints", keypoints=source)
    tracks = tracks_of_keypoints(recording, source)
    cues = learn_scatter(recording.rig, tracks, source, recording.fps)
    arm = people.states.states.copy()
    arm[:, dof_index("l_elbow_z")] -= 1.5
    moved = with_keypoint_views(replace(people, states=replace(people.states, states=arm)), recording, tracks, cues)
    wrist = LANDMARKS.index("l_wrist")
    assert (people.poses.views[:, wrist] >= 2).all() and (moved.poses.views[:, wrist] < 2).all()
    others = np.arange(15) != wrist
    assert_array_equal(moved.poses.views[:, others], people.poses.views[:, others])


# --- from end to end


def test_the_clip_s_person_by_keypoints_alone(clip):
    recording = hmc.open_recording(clip, frames=FRAMES)
    people = hmc.pose(recording, method="keypoints", keypoints=open_keypoints(recording))
    assert people.frames.tolist() == list(range(FRAMES)) and set(people.status) == {"fitted"} and people.notes == ()
    off = errors(people, clip)
    assert off.mean() < 0.045 and off.max() < 0.2
    views = people.poses.views
    assert views.shape == (FRAMES, 15) and (views >= 2).mean() > 0.9 and views.max() <= len(recording.rig)
    again = hmc.pose(recording, method="keypoints", keypoints=open_keypoints(recording), seed=5)
    assert_array_equal(again.positions, people.positions)


def test_keypoints_of_other_cameras_lead_nowhere(clip, tmp_path):
    folder = Path(shutil.copytree(clip, tmp_path / "clip"))
    names = sorted(path.name for path in (folder / "keypoints").iterdir())
    for one, other in zip(names, names[1:] + names[:1], strict=True):
        shutil.rmtree(folder / "keypoints" / one)
        shutil.copytree(clip / "keypoints" / other, folder / "keypoints" / one)
    recording = hmc.open_recording(folder, frames=FRAMES)
    people = hmc.pose(recording, method="keypoints", keypoints=open_keypoints(recording))
    assert not len(people.frames) or np.nanmean(errors(people, folder)) > 0.2


def test_frames_without_keypoints_are_nan_and_noted(clip, tmp_path):
    folder = Path(shutil.copytree(clip, tmp_path / "clip"))
    for camera in (folder / "keypoints").iterdir():
        for frame in (4, 5):
            (file,) = camera.glob(f"*{frame:06d}_*")
            file.unlink()
    recording = hmc.open_recording(folder, frames=FRAMES)
    people = hmc.pose(recording, method="keypoints", keypoints=open_keypoints(recording))
    assert [frame for frame, why in zip(people.frames, people.status, strict=True) if why != "fitted"] == [4, 5]
    assert np.isnan(people.positions[4:6]).all() and np.nanmean(errors(people, folder)) < 0.045
    assert people.notes == ("person 0: 2 frames without a pose: no keypoints of this person in this frame",)


@pytest.mark.parametrize("stop", [2, 8])
def test_a_stopped_run_goes_on_and_ends_as_if_it_had_not_been(clip, tmp_path, stop):
    """Tracks and poses alike; people are watched for half of the clip."""
    recording = hmc.open_recording(clip, frames=FRAMES)
    source, method = open_keypoints(recording), replace(hmc.pose_method("keypoints"), window_s=0.4)

    def work(run, track_run):
        tracks = tracks_of_keypoints(recording, source, track_run)
        options = FollowOptions(keypoints=learn_scatter(recording.rig, tracks, source, recording.fps))
        return tracks, follow(recording, tracks, method, options, run)

    tracks, whole = work(RunOptions(), RunOptions())
    kept = {"journal": tmp_path / "poses", "key": "run"}
    kept_tracks = {"journal": tmp_path / "tracks", "key": "run"}
    with pytest.raises(Stopped):
        work(RunOptions(), RunOptions(**kept_tracks, progress=stopping(stop)))
    seen: list[int] = []
    assert_array_equal(tracks_of_keypoints(recording, source, RunOptions(**kept_tracks, progress=noting(seen))).positions, tracks.positions)
    assert seen == list(range(stop, FRAMES))
    with pytest.raises(Stopped):
        work(RunOptions(**kept, progress=stopping(stop)), RunOptions(**kept_tracks))
    seen.clear()
    _, people = work(RunOptions(**kept, progress=noting(seen)), RunOptions(**kept_tracks))
    assert seen[0] == (0 if stop == 2 else stop)
    assert_array_equal(people.positions, whole.positions)
    assert_array_equal(people.costs, whole.costs)


def test_the_command(clip, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["pose", str(clip), "--cues", "keypoints", "--frames", "8", "--height", "1.76", "--out", str(out), "--quiet"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["feet.csv", "joints.csv", "pose.npz", "run.toml", "tracks.csv"]
    run = read_run(out / "run.toml")
    assert run["method"] == "keypoints" and run["parameters"]["cues"] == "keypoints" and "voxel_size_m" not in run["parameters"]
    assert read_tracks(out / "tracks.csv").frames.tolist() == list(range(8))
    capsys.readouterr()
    assert main(["pose", str(clip), "--cues", "keypoints", "--frames", "8", "--height", "1.76", "--out", str(out), "--quiet"]) == 0
    assert "was finished before" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--cues", "keypoints", "--method", "smd"], "--cues keypoints: method smd needs more than keypoints; leave --method out"),
        (["--cues", "keypoints", "--method", "marker-apf"], "--cues keypoints: method marker-apf needs more than keypoints"),
        (["--cues", "silhouettes", "--method", "keypoints"], "--cues silhouettes: method keypoints has no use for silhouettes"),
        (["--cues", "keypoints", "--preset", "canton2009"], "no preset named 'canton2009' of method keypoints"),
    ],
)
def test_what_does_not_go_together_is_one_line(clip, tmp_path, capsys, more, told):
    assert main(["pose", str(clip), "--out", str(tmp_path / "out"), *more]) != 0
    line = capsys.readouterr().err.strip()
    assert told in line and "\n" not in line


def test_without_keypoints_it_says_so(tmp_path, capsys):
    for more in (["--cues", "keypoints"], ["--method", "keypoints"]):
        assert main(["pose", str(TINY), "--out", str(tmp_path / "out"), *more]) != 0
        assert f"{' '.join(more)}: {TINY} has no keypoints; put a detector's into" in capsys.readouterr().err
    with pytest.raises(hmc.InputError, match="method keypoints needs keypoints of a 2-D detector"):
        hmc.pose(hmc.open_recording(TINY, frames=2), method="keypoints")
