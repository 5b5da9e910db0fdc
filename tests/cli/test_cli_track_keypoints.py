"""The track command by keypoints alone: tracks, stopped runs, what is refused, and poses with these tracks."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import hmc
from hmc.cli import main
from hmc.io.keypoints import open_keypoints
from hmc.io.results import read_joints, read_run, read_tracks
from hmc.landmarks import landmark_index
from hmc.pose import keypoint_tracks
from hmc.synthetic.keypoints import write_keypoints

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
FRAMES = 12


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """The small clip with keypoints."""
    folder = Path(shutil.copytree(TINY, tmp_path_factory.mktemp("keypoints") / "clip"))
    write_keypoints(folder, np.random.default_rng(0))
    return folder


def track(folder, out, *more):
    return main(["track", str(folder), "--out", str(out), "--cues", "keypoints", "--frames", str(FRAMES), "--quiet", *more])


def trunks(folder, frames) -> np.ndarray:
    """Middles of the true person's shoulders and hips, metres."""
    truth = read_joints(folder / "truth" / "joints.csv")
    corners = [landmark_index(f"{side}_{joint}") for side in "lr" for joint in ("shoulder", "hip")]
    return truth.positions[frames][:, corners].mean(axis=1)


def test_tracks_are_the_middle_of_the_trunk(clip, tmp_path, capsys, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("hmc.tracking.resumable.stream_hulls", None)  # nothing is segmented
        assert track(clip, tmp_path / "out") == 0
    assert f"1 person in {FRAMES} frames" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["run.toml", "tracks.csv"]
    table, run = read_tracks(tmp_path / "out" / "tracks.csv"), read_run(tmp_path / "out" / "run.toml")
    assert table.frames.tolist() == list(range(FRAMES)) and set(table.persons) == {0}
    assert np.linalg.norm(table.positions - trunks(clip, table.frames), axis=1).max() < 0.06
    assert run["method"] == run["parameters"]["cues"] == "keypoints" and "voxel_size_m" not in run["parameters"]
    assert track(clip, tmp_path / "out") == 0
    assert "was finished before" in capsys.readouterr().out


def test_other_keypoints_are_another_run(clip, tmp_path, capsys):
    folder = Path(shutil.copytree(clip, tmp_path / "clip"))
    assert track(folder, tmp_path / "out") == 0
    write_keypoints(folder, np.random.default_rng(1))
    assert track(folder, tmp_path / "out") == 0
    assert "another recording; starting anew" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["track", "pose"])
def test_cameras_without_keypoints_are_named(clip, tmp_path, capsys, command):
    folder = Path(shutil.copytree(clip, tmp_path / "clip"))
    one = sorted((folder / "keypoints").iterdir())[1]
    one.rename(one.with_name(f"other_{one.name}"))
    assert main([command, str(folder), "--out", str(tmp_path / "out"), "--cues", "keypoints", "--frames", "4", "--quiet"]) == 0
    assert f"{folder / 'keypoints'}: no keypoints of cam_01; those of the other cameras are used" in capsys.readouterr().err
    assert any("no keypoints of cam_01" in problem for problem in read_run(tmp_path / "out" / "run.toml")["problems"])


@pytest.mark.parametrize("stop", [0, 7])
def test_a_stopped_run_goes_on_and_ends_as_if_it_had_not_been(clip, tmp_path, monkeypatch, stop):
    assert track(clip, tmp_path / "whole") == 0
    find, calls = keypoint_tracks.find_people, []

    def dying(*given):
        calls.append(len(calls))
        if len(calls) == stop + 1:
            raise KeyboardInterrupt
        return find(*given)

    monkeypatch.setattr(keypoint_tracks, "find_people", dying)
    assert track(clip, tmp_path / "cut") == 130
    assert not (tmp_path / "cut" / "tracks.csv").exists()
    assert track(clip, tmp_path / "cut") == 0
    assert (tmp_path / "cut" / "tracks.csv").read_bytes() == (tmp_path / "whole" / "tracks.csv").read_bytes()
    assert len(calls) == FRAMES + 1  # what was kept is not computed again


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--tracker", "naive"], "--cues keypoints: has no use for --tracker; leave it out"),
        (["--no-complete", "--voxel", "0.04"], "--cues keypoints: has no use for --no-complete, --voxel; leave them out"),
        (["--no-color", "--particles", "0"], "has no use for --no-color, --particles"),
        (["--track-preset", "alike", "--no-cut-shadows"], "has no use for --track-preset, --no-cut-shadows"),
        (["--full-images"], "has no use for --full-images; leave it out"),
        (["--cameras", "cam_77"], "no camera named"),
    ],
)
def test_what_does_not_go_together_is_one_line(clip, tmp_path, capsys, more, told):
    assert track(clip, tmp_path / "out", *more) == 2
    line = capsys.readouterr().err.strip()
    assert told in line and "\n" not in line and not (tmp_path / "out").exists()


def test_without_keypoints_it_says_so(tmp_path, capsys):
    assert track(TINY, tmp_path / "out") == 2
    line = capsys.readouterr().err.strip()
    assert f"--cues keypoints: {TINY} has no keypoints; put a detector's into" in line and "\n" not in line


def test_from_python_and_on_to_poses(clip, tmp_path):
    recording = hmc.open_recording(clip, frames=FRAMES)
    source = open_keypoints(recording)
    tracks = hmc.track(recording, keypoints=source)
    assert track(clip, tmp_path) == 0
    np.testing.assert_allclose(read_tracks(tmp_path / "tracks.csv").positions, tracks.positions, atol=1e-5)
    people = hmc.pose(recording, tracks, "keypoints", keypoints=source)
    assert_array_equal(people.positions, hmc.pose(recording, method="keypoints", keypoints=source).positions)
    with pytest.raises(hmc.InputError, match="no use for a tracker"):
        hmc.track(recording, "naive", keypoints=source)


def pose(folder, tracks, out, *more):
    return main(["pose", str(folder), "--tracks", str(tracks), "--out", str(out), "--frames", str(FRAMES), "--quiet", *more])


def test_poses_of_given_tracks(clip, tmp_path, capsys, monkeypatch):
    """They are those of a run that makes the same tracks; and another file is another run."""
    file, ways = tmp_path / "tracks" / "tracks.csv", ["--cues", "keypoints"]
    assert track(clip, file.parent) == 0
    assert main(["pose", str(clip), "--out", str(tmp_path / "own"), "--frames", str(FRAMES), "--quiet", *ways]) == 0
    with monkeypatch.context() as patch:
        patch.setattr(keypoint_tracks, "find_people", None)  # nobody is looked for
        assert pose(clip, file, tmp_path / "out", *ways) == 0
        expected, found = (read_joints(tmp_path / name / "joints.csv") for name in ("own", "out"))
        np.testing.assert_allclose(found.positions, expected.positions, atol=1e-4)
        assert read_run(tmp_path / "out" / "run.toml")["tracks"] == str(file.resolve())
        capsys.readouterr()
        assert pose(clip, file, tmp_path / "out", *ways) == 0
        assert "was finished before" in capsys.readouterr().out
        file.write_text(file.read_text().replace(",0,", ",4,"))
        assert pose(clip, file, tmp_path / "out", *ways) == 0
    assert "starting anew" in capsys.readouterr().out
    assert set(read_joints(tmp_path / "out" / "joints.csv").persons) == {4}


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--method", "marker-apf"], "needs no tracks; leave one of both out"),
        (["--tracker", "naive"], "--tracker naive would have nothing to do; leave one of both out"),
        (["--start", "20"], "has nobody in these frames; choose others with --start and --frames"),
    ],
)
def test_tracks_that_do_not_go_with_the_rest_are_one_line(clip, tmp_path, capsys, more, told):
    assert track(clip, tmp_path / "tracks") == 0
    capsys.readouterr()
    file = tmp_path / "tracks" / "tracks.csv"
    assert pose(clip, file, tmp_path / "out", *more) == 2
    line = capsys.readouterr().err.strip()
    assert told in line and "\n" not in line
    assert pose(clip, file, file.parent) == 2 and "would overwrite" in capsys.readouterr().err
    assert pose(clip, tmp_path / "none.csv", tmp_path / "out") == 2 and "none.csv" in capsys.readouterr().err


@pytest.mark.slow
def test_hulls_are_given_to_people_who_were_tracked_by_keypoints(clip, tmp_path):
    assert track(clip, tmp_path / "tracks") == 0
    file, ways = tmp_path / "tracks" / "tracks.csv", ["--cues", "silhouettes", "--frames", "6"]
    assert pose(clip, file, tmp_path / "out", *ways) == 0
    found, run = read_joints(tmp_path / "out" / "joints.csv"), read_run(tmp_path / "out" / "run.toml")
    truth = read_joints(clip / "truth" / "joints.csv").positions[found.frames]
    assert found.frames.tolist() == list(range(6)) and np.linalg.norm(found.positions - truth, axis=-1).mean() < 0.06
    assert "tracker" not in run["parameters"] and run["parameters"]["back"]  # both passes
