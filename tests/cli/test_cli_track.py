"""The track command: results, resuming, repeated runs and wrong input."""

import os
import signal
from dataclasses import replace

import numpy as np
import pytest
from drawn import draw_recording, walk

from hmc.cli import main
from hmc.io.results import read_run, read_tracks
from hmc.processes import may_fork
from hmc.tracking import resumable
from hmc.tracking.trackers import TRACKERS
from hmc.voxels import looks


@pytest.fixture(scope="module")
def folder(tmp_path_factory, ring):
    n = 24
    other = [(0.9, -0.9 + 0.02 * i) for i in range(n)]
    return draw_recording(tmp_path_factory.mktemp("drawn") / "two", ring, [[*one, two] for one, two in zip(walk(n), other, strict=True)])


def track(folder, out, *more):
    return main(["track", str(folder), "--out", str(out), "--quiet", *more])


def test_tracks_are_where_people_were_drawn(folder, tmp_path, capsys):
    assert track(folder, tmp_path / "out") == 0
    assert "2 persons in 24 frames" in capsys.readouterr().out
    table = read_tracks(tmp_path / "out" / "tracks.csv")
    assert set(table.persons) == {0, 1} and len(table.frames) == 48
    truth = np.array([place for (place,) in walk(24)])
    distance = np.linalg.norm(table.positions[:, :2] - truth[table.frames], axis=1)
    nearest = np.array([distance[table.frames == frame].min() for frame in range(24)])
    assert nearest.max() < 0.07  # the hull joins the two at the end
    run = read_run(tmp_path / "out" / "run.toml")
    assert run["method"] == "sparse" and run["parameters"]["voxel_size_m"] == 0.04
    assert run["speed"]["frames"] == 24 and 0 < run["speed"]["filter_s"] < run["speed"]["input_s"]
    assert run["speed"]["filter_real_time_factor"] > run["speed"]["real_time_factor"] > 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["doubtful", "run.toml", "silhouettes", "tracks.csv"]


def test_tracks_are_the_same_bytes_whatever_the_number_of_processes(folder, tmp_path):
    for workers in ("1", "2", "3"):
        assert track(folder, tmp_path / workers, "--workers", workers) == 0
        assert (tmp_path / workers / "tracks.csv").read_bytes() == (tmp_path / "1" / "tracks.csv").read_bytes()


def test_large_images_are_made_smaller_unless_they_are_asked_for(folder, tmp_path, capsys, halved_images, monkeypatch):
    monkeypatch.setattr("hmc.camera.noise.LEAST_LEFT", 1.0)  # drawn images have no noise that averaging could lower
    for workers in ("1", "2"):
        assert track(folder, tmp_path / workers, "--workers", workers) == 0
        assert read_run(tmp_path / workers / "run.toml")["parameters"]["image_factors"] == [2] * 5
    assert (tmp_path / "1" / "tracks.csv").read_bytes() == (tmp_path / "2" / "tracks.csv").read_bytes()
    assert "2 persons in 24 frames" in capsys.readouterr().out

    def places():
        """By frame, from one side of the room to the other, whoever is person 0."""
        table = read_tracks(tmp_path / "1" / "tracks.csv")
        return table.positions[np.lexsort([table.positions[:, 1], table.frames])]

    smaller = places()
    assert track(folder, tmp_path / "1", "--full-images") == 0
    assert "starting anew" in capsys.readouterr().out
    assert "image_factors" not in read_run(tmp_path / "1" / "run.toml")["parameters"]
    assert 0 < np.abs(smaller - places()).max() < 0.07


@pytest.mark.skipif(not may_fork(), reason="there is one process only")
def test_a_process_that_is_gone_is_one_line(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(looks, "segment_views", lambda *given: os.kill(os.getpid(), signal.SIGKILL))
    assert track(folder, tmp_path / "out", "--workers", "2") == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and "exit code -9" in lines[0] and "--workers 1" in lines[0]


@pytest.mark.parametrize("stop", [3, 14, 23])
@pytest.mark.slow
def test_a_stopped_run_goes_on_and_ends_as_if_it_had_not_been(folder, tmp_path, monkeypatch, stop):
    monkeypatch.setattr(resumable, "CHECKPOINT_FRAMES", 5)
    assert track(folder, tmp_path / "whole") == 0
    method, calls = TRACKERS["sparse"], []

    def dying(rng, state, frame, *rest):
        calls.append(frame)
        if frame == stop and calls.count(frame) == 1:
            raise KeyboardInterrupt
        return method.step(rng, state, frame, *rest)

    monkeypatch.setitem(TRACKERS, "sparse", replace(method, step=dying))
    assert track(folder, tmp_path / "cut") == 130
    assert not (tmp_path / "cut" / "tracks.csv").exists()
    with open(tmp_path / "cut" / ".track.journal", "a") as journal:
        journal.write('{"next_frame": 9, "rows": [{"fra')  # the power went while a line was written
    assert track(folder, tmp_path / "cut") == 0
    assert (tmp_path / "cut" / "tracks.csv").read_bytes() == (tmp_path / "whole" / "tracks.csv").read_bytes()
    assert calls.count(0) == (2 if stop < 5 else 1)  # what was kept is not computed again


def test_a_finished_run_is_not_repeated_and_a_changed_one_is(folder, tmp_path, capsys, monkeypatch):
    assert track(folder, tmp_path, "--frames", "8") == 0
    before = (tmp_path / "tracks.csv").stat().st_mtime_ns
    with monkeypatch.context() as patch:
        patch.setitem(TRACKERS, "sparse", replace(TRACKERS["sparse"], step=None))
        assert track(folder, tmp_path, "--frames", "8") == 0
    assert "finished before" in capsys.readouterr().out
    assert (tmp_path / "tracks.csv").stat().st_mtime_ns == before
    assert track(folder, tmp_path, "--frames", "10") == 0
    assert "starting anew" in capsys.readouterr().out
    assert read_tracks(tmp_path / "tracks.csv").frames.max() == 9


def test_a_journal_of_other_parameters_is_begun_anew(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(resumable, "CHECKPOINT_FRAMES", 5)
    method = TRACKERS["sparse"]

    def dying(rng, state, frame, *rest):
        if frame == 12:
            raise KeyboardInterrupt
        return method.step(rng, state, frame, *rest)

    with monkeypatch.context() as patch:
        patch.setitem(TRACKERS, "sparse", replace(method, step=dying))
        assert track(folder, tmp_path / "cut", "--voxel", "0.1") == 130
    assert track(folder, tmp_path / "cut") == 0
    assert track(folder, tmp_path / "whole") == 0
    assert (tmp_path / "cut" / "tracks.csv").read_bytes() == (tmp_path / "whole" / "tracks.csv").read_bytes()


def test_an_empty_room_and_a_selection(tmp_path, ring, capsys):
    path = draw_recording(tmp_path / "empty", ring, [[]] * 6)
    assert track(path, tmp_path / "out", "--start", "2", "--frames", "3", "--cameras", "cam_00,cam_01,cam_02") == 0
    assert "no person in 3 frames" in capsys.readouterr().out
    assert len(read_tracks(tmp_path / "out" / "tracks.csv").frames) == 0


def test_one_camera_finds_nobody_and_says_why(folder, tmp_path, capsys):
    assert track(folder, tmp_path, "--frames", "3", "--cameras", "cam_00") == 0
    captured = capsys.readouterr()
    assert "3 frames" in captured.out and "one camera does not tell" in captured.err


def test_what_was_survived_is_listed_at_the_end(tmp_path, ring, capsys):
    path = draw_recording(tmp_path / "take", ring, walk(10))
    (path / "images" / "cam_02" / "000004.png").write_bytes(b"no image")
    assert track(path, tmp_path / "out") == 0
    noted = capsys.readouterr().err.strip().splitlines()
    assert len(noted) == 1 and noted[0].startswith("note: cam_02: frame 4")
    assert len(read_run(tmp_path / "out" / "run.toml")["problems"]) == 1


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--voxel", "0.5"], "do not show people"),
        (["--voxel", "0.0005"], "would fit"),
        (["--start", "99"], "nothing to read"),
        (["--cameras", "cam_77"], "no camera named"),
    ],
)
def test_wrong_input_is_one_line(folder, tmp_path, capsys, more, message):
    assert track(folder, tmp_path / "out", *more) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


def test_poses_and_files_are_not_overwritten(folder, tmp_path, capsys):
    (tmp_path / "joints.csv").write_text("")
    assert track(folder, tmp_path) == 2
    assert "holds poses" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    assert track(folder, tmp_path / "file") == 2
    assert "is a file" in capsys.readouterr().err


@pytest.mark.parametrize("inside", ["videos", "pose", "keypoints/cam_00", "truth"])
def test_no_result_lies_where_parts_of_its_recording_are_looked_for(folder, capsys, inside):
    """It was written there, and its files were a camera's the next time."""
    before = sorted(folder.rglob("*"))
    for command in (["track"], ["pose", "--height", "auto"]):
        assert main([command[0], str(folder), "--out", str(folder / inside), "--quiet", *command[1:]]) == 2
        error = capsys.readouterr().err
        assert "parts are looked for there; choose another folder" in error and error.count("\n") == 1
    assert sorted(folder.rglob("*")) == before


def test_a_result_may_lie_beside_the_parts(folder):
    from hmc.io.places import RecordingPlaces

    assert not any(RecordingPlaces(folder).looked_through(folder / name) for name in ("", "result", "result/videos", "..", "videos2"))
