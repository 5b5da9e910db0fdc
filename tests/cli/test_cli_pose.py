"""The pose command on the small rendered clip: results, resuming, repeated runs and wrong input."""

import csv
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn import draw_recording
from methods import TINY, lean_method
from numpy.testing import assert_array_equal

from hmc.body.dimensions import FITTED, FitBodySettings, prior_deviations, whole_deviations
from hmc.cli import main
from hmc.cli import pose as command
from hmc.io.recording import open_recording
from hmc.io.results import read_joints, read_pose, read_run, read_tracks
from hmc.landmarks import LANDMARKS
from hmc.pose import backward, follow, registry
from hmc.pose.clear_views import BorneOut
from hmc.pose.starts.fit_body import KNOWN_STATURE
from hmc.pose.trust import trust_features, trust_of
from hmc.voxels import hulls as frontend


@pytest.fixture(scope="module", autouse=True)
def little_work():
    """The methods as they are, with less work, people watched for three frames."""

    def lean(name, preset, models, init, skin, passes, settings):
        method = lean_method(name, preset, tuple(models), init, skin)
        return method if passes == 2 else replace(method, back=None)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "pose_method", lean)
        yield


def pose(out, *more, recording=TINY):
    return main(["pose", str(recording), "--out", str(out), "--quiet", *more])


def quick(out, *more, frames="4", recording=TINY):
    return pose(out, "--frames", frames, "--voxel", "0.05", "--preset", "canton2009", *more, recording=recording)


def pictures(out):
    """The bytes of the silhouettes in a result, by file."""
    return {path.relative_to(out): path.read_bytes() for path in (out / "silhouettes").rglob("*.png")}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Five frames with the default preset."""
    out = tmp_path_factory.mktemp("finished") / "out"
    assert pose(out, "--frames", "5", "--voxel", "0.05") == 0
    return out


def test_a_run_leaves_its_files_and_its_silhouettes_and_nothing_else(finished):
    assert sorted(path.name for path in finished.iterdir()) == [
        "doubtful",
        "evidence.csv",
        "feet.csv",
        "joints.csv",
        "pose.npz",
        "run.toml",
        "silhouettes",
        "tracks.csv",
    ]
    assert len(list((finished / "silhouettes").rglob("*.png"))) == 5 * 7
    joints, tracks, states, run = (
        read_joints(finished / "joints.csv"),
        read_tracks(finished / "tracks.csv"),
        read_pose(finished / "pose.npz"),
        read_run(finished / "run.toml"),
    )
    assert joints.frames.tolist() == list(range(5)) and np.isfinite(joints.positions).all()
    for table in (tracks, states):
        assert_array_equal(table.frames, joints.frames)
        assert_array_equal(table.persons, joints.persons)
    assert run["method"] == "apf" and run["seed"] == 0
    known = run["bodies"]["known_to_percent"]["0"]
    assert list(known) == list(FITTED)
    # The stature is given, and five frames tell too little.
    assert known["height"] == round(100 * KNOWN_STATURE, 1) and known["girth_arms"] == 10.0
    # Of five coarse frames, with little work, the one or the other landmark is not trusted; nothing else is odd.
    assert len(run["problems"]) <= 1 and all("by their trust" in line for line in run["problems"])
    assert run["parameters"]["voxel_size_m"] == 0.05 and run["parameters"]["preset"]["name"] == "default"
    truth = read_joints(TINY / "truth" / "joints.csv")
    error = np.linalg.norm(joints.positions - truth.where(truth.frames < 5).positions, axis=-1)
    assert np.median(error) < 0.12


@pytest.mark.slow
def test_of_a_good_run_nothing_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "pose_method", registry.pose_method)
    assert pose(tmp_path, "--frames", "8") == 0
    run, joints, truth = read_run(tmp_path / "run.toml"), read_joints(tmp_path / "joints.csv"), read_joints(TINY / "truth" / "joints.csv")
    assert run["problems"] == []
    by_the_prior = 100 * whole_deviations(np.diag(prior_deviations(FitBodySettings()) ** 2))
    told = run["bodies"]["known_to_percent"]["0"]
    assert all(0 < own <= round(prior, 1) for own, prior in zip(told.values(), by_the_prior, strict=True))
    assert all(told[name] < 0.8 * by_the_prior[FITTED.index(name)] for name in ("height", "thigh", "trunk", "girth_torso"))
    assert np.median(np.linalg.norm(joints.positions - truth.where(truth.frames < 8).positions, axis=-1)) < 0.03


def test_large_images_are_made_smaller_unless_they_are_asked_for(finished, tmp_path, halved_images):
    smaller, larger = tmp_path / "smaller", tmp_path / "larger"
    assert pose(smaller, "--frames", "5", "--voxel", "0.05") == 0
    assert pose(larger, "--frames", "5", "--voxel", "0.05", "--full-images") == 0
    assert read_run(smaller / "run.toml")["parameters"]["image_factors"] == [2] * 7
    assert (larger / "joints.csv").read_bytes() == (finished / "joints.csv").read_bytes()
    assert "image_factors" not in read_run(larger / "run.toml")["parameters"]
    apart = np.linalg.norm(read_joints(smaller / "joints.csv").positions - read_joints(larger / "joints.csv").positions, axis=-1)
    assert 0 < np.median(apart) < 0.04


@pytest.mark.parametrize("workers", ["1", "3"])
def test_poses_are_the_same_bytes_whatever_the_number_of_processes(finished, tmp_path, workers):
    assert pose(tmp_path / "out", "--frames", "5", "--voxel", "0.05", "--workers", workers) == 0
    for name in ("joints.csv", "tracks.csv"):
        assert (tmp_path / "out" / name).read_bytes() == (finished / name).read_bytes()


def test_a_finished_run_is_not_repeated(finished, capsys, monkeypatch):
    before = {path.name: path.stat().st_mtime_ns for path in finished.iterdir()}
    monkeypatch.setattr(follow, "stream_hulls", None)
    assert pose(finished, "--frames", "5", "--voxel", "0.05") == 0
    assert "finished before" in capsys.readouterr().out
    assert {path.name: path.stat().st_mtime_ns for path in finished.iterdir()} == before


def test_trust_follows_from_the_evidence_that_a_run_leaves(finished):
    with open(finished / "evidence.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    joints = read_joints(finished / "joints.csv")
    assert [row["joint"] for row in rows] == list(LANDMARKS) * len(joints.frames)
    columns = ("views", "shown", "denied", "bare_m", "passes_apart_m", "cost_m2")
    views, shown, denied, bare_m, apart, cost = (
        np.array([float(row[name] or "nan") for row in rows]).reshape(-1, len(LANDMARKS)) for name in columns
    )
    assert_array_equal(views, joints.views)
    assert all(row["views"].isdigit() for row in rows)
    assert (cost == cost[:, :1]).all() and (cost > 0).all()
    features = trust_features(joints, BorneOut(views, shown, denied, bare_m, np.zeros(7)), apart, open_recording(TINY).fps)
    np.testing.assert_allclose(trust_of(features), joints.trust, atol=0.003)
    assert np.ptp(joints.trust) > 0.01


def test_another_run_takes_kept_silhouettes_and_comes_to_the_same_bytes(finished, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(frontend, "stream_masks", None)  # nothing is segmented
    more = "--frames", "5", "--voxel", "0.05", "--silhouettes-from", str(finished), "--out", str(tmp_path / "again")
    assert pose(tmp_path, *more, "--no-silhouettes") == 0
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == [
        "evidence.csv", "feet.csv", "joints.csv", "pose.npz", "run.toml", "tracks.csv",
    ]  # fmt: skip
    for name in ("joints.csv", "evidence.csv", "tracks.csv"):
        assert (tmp_path / "again" / name).read_bytes() == (finished / name).read_bytes()
    assert pose(tmp_path, *more, "--no-silhouettes") == 0
    assert "finished before" in capsys.readouterr().out
    told = read_run(tmp_path / "again" / "run.toml")
    assert told["silhouettes"] == str(finished.resolve()) and told["options"]["silhouettes"] is False


def test_a_picture_of_the_result_shows_the_silhouettes_of_the_run(finished, tmp_path, monkeypatch):
    """Nothing is segmented; where the run kept none, something is."""
    view = ["view", str(finished), str(TINY), "--frame", "2", "--quiet", "--out"]
    shutil.copytree(finished, tmp_path / "other")
    monkeypatch.setattr(frontend, "stream_masks", None)
    assert main([*view, str(tmp_path / "kept.png")]) == 0
    assert cv2.imread(str(tmp_path / "kept.png")).shape[2] == 3
    shutil.rmtree(tmp_path / "other" / "silhouettes")
    view[1] = str(tmp_path / "other")
    with pytest.raises(TypeError):
        main([*view, str(tmp_path / "none.png")])


def test_kept_silhouettes_that_will_not_do_are_refused(finished, tmp_path, capsys):
    for words, said in (
        (("--frames", "6", "--silhouettes-from", str(finished)), "has frames 0 to 4 only"),
        (("--silhouettes-from", str(tmp_path)), "holds no silhouettes"),
        (("--frames", "5", "--silhouettes-from", str(tmp_path / "out")), "is what --out"),
    ):
        assert pose(tmp_path / "out", *words) == 2
        assert said in capsys.readouterr().err


def test_silhouettes_of_the_recording_itself_stay_as_they_are(tmp_path):
    """A result that is put into its recording's folder keeps none: they would be taken for ready-made ones the next time."""
    shutil.copytree(TINY, tmp_path / "tiny")
    assert quick(tmp_path / "tiny", recording=tmp_path / "tiny") == 0
    assert not (tmp_path / "tiny" / "silhouettes").exists()
    assert any("silhouettes are not kept" in line for line in read_run(tmp_path / "tiny" / "run.toml")["problems"])


@pytest.mark.parametrize("full", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_what_a_method_tells_of_each_frame_stands_beside_the_poses(tmp_path, monkeypatch, full):
    """With little work the swarm's own fits are far off; as the preset has it they are near."""
    if full:
        monkeypatch.setattr(command, "pose_method", registry.pose_method)
    assert pose(tmp_path, "--method", "pso", "--frames", "5", "--voxel", "0.04", "--height", "recording") == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        "doubtful",
        "evidence.csv",
        "feet.csv",
        "fits.csv",
        "joints.csv",
        "pose.npz",
        "run.toml",
        "silhouettes",
        "tracks.csv",
    }
    with open(tmp_path / "fits.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["frame", "person", "status", "error_m", "doubts"]
    joints = read_joints(tmp_path / "joints.csv")
    fitted = [int(row["frame"]) for row in rows if row["status"] == "fitted"]
    assert [int(row["frame"]) for row in rows] == list(range(5)) and fitted == sorted(set(joints.frames.tolist()))
    errors = [float(row["error_m"]) for row in rows if row["status"] == "fitted"]
    assert 0 < min(errors) and max(errors) < 1
    if full:  # the first frame's swarm begins anywhere, and may end elsewhere; those after it follow
        assert max(errors[1:]) < 0.3 and np.median(errors) < 0.15
    told = read_run(tmp_path / "run.toml")
    assert told["method"] == "pso" and told["parameters"]["preset"]["swarm"]["swarm"]["voxels"] is True


def test_a_changed_parameter_starts_anew(tmp_path, capsys):
    assert quick(tmp_path) == 0
    first = read_joints(tmp_path / "joints.csv")
    (tmp_path / "fits.csv").write_text("what another method told\n")
    assert quick(tmp_path, "--seed", "5") == 0
    assert "starting anew" in capsys.readouterr().out
    second = read_joints(tmp_path / "joints.csv")
    assert np.abs(first.positions - second.positions).max() > 1e-4
    assert read_run(tmp_path / "run.toml")["seed"] == 5 and not (tmp_path / "fits.csv").exists()
    assert quick(tmp_path, frames="3") == 0
    assert "starting anew" in capsys.readouterr().out
    assert read_joints(tmp_path / "joints.csv").frames.max() == 2


@pytest.mark.parametrize("stop", [1, 4])
@pytest.mark.slow
def test_a_stopped_run_goes_on_and_ends_as_if_it_had_not_been(tmp_path, monkeypatch, stop):
    assert quick(tmp_path / "whole", frames="6") == 0
    stream = follow.stream_hulls

    def dying(*args, **options):
        for hull in stream(*args, **options):
            if hull.index == stop:
                raise KeyboardInterrupt
            yield hull

    with monkeypatch.context() as patch:
        patch.setattr(follow, "stream_hulls", dying)
        assert quick(tmp_path / "cut", frames="6") == 130
    assert not (tmp_path / "cut" / "joints.csv").exists()
    assert quick(tmp_path / "cut", frames="6") == 0
    for name in ("joints.csv", "evidence.csv", "tracks.csv"):
        assert (tmp_path / "cut" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    one, other = (read_pose(tmp_path / folder / "pose.npz") for folder in ("cut", "whole"))
    assert_array_equal(one.states, other.states)
    assert sorted(path.name for path in (tmp_path / "cut").iterdir()) == [
        "doubtful",
        "evidence.csv",
        "joints.csv",
        "pose.npz",
        "run.toml",
        "silhouettes",
        "tracks.csv",
    ]
    assert pictures(tmp_path / "cut") == pictures(tmp_path / "whole")


@pytest.mark.slow
def test_a_run_killed_in_the_second_pass_goes_on_there(finished, tmp_path, monkeypatch):
    back, seen = backward._back, []

    def dying(rng, subject, own, after, view, settings):
        seen.append(view.frame)
        if len(seen) == dies_after:
            raise KeyboardInterrupt
        return back(rng, subject, own, after, view, settings)

    default = ("--frames", "5", "--voxel", "0.05")
    monkeypatch.setattr(backward, "_back", dying)
    dies_after = 3
    assert pose(tmp_path, *default) == 130 and not (tmp_path / "joints.csv").exists()
    dies_after, before = 0, len(seen)
    assert pose(tmp_path, *default) == 0
    assert seen[before:] == list(range(seen[before], -1, -1)) and len(seen) - before < 5  # what was done is not done again
    for name in ("joints.csv", "tracks.csv"):
        assert (tmp_path / name).read_bytes() == (finished / name).read_bytes()
    assert pictures(tmp_path) == pictures(finished)


def test_one_pass_is_another_run(finished, tmp_path):
    assert pose(tmp_path, "--frames", "5", "--voxel", "0.05", "--passes", "1") == 0
    one, two = (read_run(folder / "run.toml")["parameters"] for folder in (tmp_path, finished))
    assert "back" not in one and two["back"]["body_frames"] == 20
    assert (tmp_path / "joints.csv").read_bytes() != (finished / "joints.csv").read_bytes()


@pytest.mark.slow
def test_the_recording_is_segmented_once(tmp_path, monkeypatch):
    calls = []
    stream = frontend.stream_masks
    monkeypatch.setattr(frontend, "stream_masks", lambda *args, **options: calls.append(args) or stream(*args, **options))
    assert quick(tmp_path / "kept") == 0 and len(calls) == 1
    monkeypatch.setattr(follow, "kept_silhouettes", lambda *args: None)
    assert quick(tmp_path / "again") == 0 and len(calls) == 3
    assert (tmp_path / "kept" / "joints.csv").read_bytes() == (tmp_path / "again" / "joints.csv").read_bytes()


def test_a_given_height_is_the_body_s(tmp_path, capsys):
    assert quick(tmp_path, "--height", "1.62", frames="3") == 0
    assert "stature about 1.62 m" in capsys.readouterr().out
    assert float(read_pose(tmp_path / "pose.npz").bodies[0]["height"]) == pytest.approx(1.62)


@pytest.mark.slow
def test_the_height_of_the_recording_is_used_unless_auto(tmp_path):
    assert quick(tmp_path / "told", frames="3") == 0
    assert float(read_pose(tmp_path / "told" / "pose.npz").bodies[0]["height"]) == pytest.approx(1.76)  # recording.toml
    assert quick(tmp_path / "auto", "--height", "auto", frames="3") == 0
    height = float(read_pose(tmp_path / "auto" / "pose.npz").bodies[0]["height"])
    assert height == pytest.approx(1.76, rel=0.08) and height != pytest.approx(1.76, abs=1e-6)


def test_an_empty_room(tmp_path, ring, capsys):
    folder = draw_recording(tmp_path / "empty", ring, [[]] * 4)
    assert pose(tmp_path / "out", "--voxel", "0.08", recording=folder) == 0
    assert "no person in 4 frames" in capsys.readouterr().out
    assert len(read_joints(tmp_path / "out" / "joints.csv").frames) == 0
    assert len(read_pose(tmp_path / "out" / "pose.npz").frames) == 0


def test_part_of_a_recording_with_some_of_its_cameras(tmp_path):
    assert quick(tmp_path, "--start", "2", "--cameras", "cam_00,cam_02,cam_03,cam_05", frames="3") == 0
    assert read_joints(tmp_path / "joints.csv").frames.tolist() == [2, 3, 4]
    assert read_run(tmp_path / "run.toml")["parameters"]["cameras"] == ["cam_00", "cam_02", "cam_03", "cam_05"]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--height", "175"], "stature in metres"),
        (["--height", "tall"], "stature in metres"),
        (["--height", "nan"], "stature in metres"),
        (["--method", "pso", "--preset", "canton2009"], "no preset named 'canton2009' of method pso; there are default, hsiao2008"),
        (["--method", "smd", "--model", "1"], "has no use for a scalable model"),
        (["--method", "guess"], "no pose method named 'guess'; there are apf"),
        (["--preset", "defualt"], "no preset named 'defualt' of method apf; there are default, canton2009"),
        (["--frames", "2", "--voxel", "0.0005"], "would fit"),
        (["--frames", "2", "--track-voxel", "0.0005"], "would fit"),
        (["--track-voxel", "0.5"], "do not show people"),
        (["--start", "99"], "nothing to read"),
        (["--cameras", "cam_77"], "no camera named"),
    ],
)
def test_wrong_input_is_one_line(tmp_path, capsys, more, message):
    assert pose(tmp_path / "out", *more) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


WRONG = (("--voxel", "0"), ("--voxel", "much"), ("--frames", "-1"), ("--seed", "x"), ("--seed", "-1"))


@pytest.mark.parametrize("more", WRONG)
def test_arguments_that_are_none(tmp_path, capsys, more):
    with pytest.raises(SystemExit) as stop:
        pose(tmp_path / "out", *more)
    assert stop.value.code == 2 and more[0] in capsys.readouterr().err


def test_a_file_is_no_folder(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert quick(tmp_path / "file") == 2
    assert "is a file" in capsys.readouterr().err
    assert pose(tmp_path / "out", recording=tmp_path / "nowhere") == 2
    assert capsys.readouterr().err.count("\n") == 1
