"""A session by the command line: trials to their ends, faults told, runs repeated and killed, trials side by side and by a scheduler."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from methods import TINY, lean_method

from hmc.cli import main
from hmc.cli import pose as command
from hmc.cli.run import _tell
from hmc.io.results import read_run
from hmc.trials.session_file import read_session
from hmc.trials.state import BEGUN, DONE, FAILED, read_state, write_state

ROOT = Path(__file__).resolve().parents[2]
SESSION = """
name = "tiny"
calibration = "{tiny}/calibration.toml"
background = "{tiny}/background"
trials = "trials/*"
[recording]
fps = 15
room = [[-2.8, -2.6, 0.0], [2.8, 2.6, 3.0]]
[pose]
voxel = 0.05
track_voxel = 0.08
cameras = ["cam_00", "cam_02", "cam_04", "cam_06"]
passes = 1
[[person]]
name = "Ana"
height_m = 1.76
[[trial]]
name = "one"
frames = 4
[[trial]]
name = "two"
videos = "{tiny}/videos/{{camera}}.mp4"
start = 3
frames = 5
"""


@pytest.fixture(scope="module", autouse=True)
def little_work():
    """The methods as they are, with less work, people watched for three frames."""

    def lean(name, preset, models, init, skin, passes, settings):
        return replace(lean_method(name, preset, tuple(models), init, skin), back=None)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "pose_method", lean)
        yield


def make_lab(folder, more=""):
    (folder / "trials" / "one").mkdir(parents=True)
    (folder / "trials" / "one" / "videos").symlink_to(TINY / "videos")
    (folder / "session.toml").write_text(SESSION.format(tiny=TINY) + more)
    return folder


def run(lab, out, *more):
    return main(["run", str(lab), "--out", str(out), "--quiet", "--workers", "1", *more])


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    return make_lab(tmp_path_factory.mktemp("lab"))


@pytest.fixture(scope="module")
def finished(lab, tmp_path_factory):
    out = tmp_path_factory.mktemp("finished")
    assert run(lab, out) == 0
    return out


def files_of(out):
    """Bytes of all files but hidden ones, logs and what holds times."""
    found = (path for path in sorted(out.rglob("*")) if path.is_file() and path.name[0] != ".")
    return {str(path.relative_to(out)): path.read_bytes() for path in found if path.name not in ("log.txt", "trial.toml", "report.html")}


def test_every_trial_is_checked_posed_and_drawn(lab, finished):
    for name, frames in (("one", 4), ("two", 5)):
        state = read_state(finished / name)
        assert state.status == DONE and set(state.seconds) == {"check", "pose", "view"}
        run_toml = read_run(finished / name / "run.toml")
        assert run_toml["parameters"]["frames"] == frames and run_toml["parameters"]["voxel_size_m"] == 0.05
        assert run_toml["given"]["subject_height_m"] == [1.76] and len(list((finished / name / "moments").glob("*.jpg"))) == frames
        assert (finished / name / "check.png").is_file()
    page = (finished / "report.html").read_text()
    assert "2 trials: 2 done." in page and "With Ana (1.76 m)." in page


def test_what_is_finished_is_not_repeated(lab, finished, capsys):
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in finished.rglob("*") if path.suffix in (".csv", ".jpg", ".png")}
    page = (finished / "report.html").read_bytes()
    assert run(lab, finished) == 0
    assert before == {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in before}
    assert (finished / "report.html").read_bytes() == page
    said = capsys.readouterr().out
    assert "was finished before" in said and "one: done, 4 frames, 1 person, " in said and "2 of 2 trials done" in said


def test_what_another_run_is_at_work_on_is_not_done(lab, finished, capsys):
    state, session = read_state(finished / "one"), read_session(lab)
    write_state(finished / "one", replace(state, status=BEGUN))
    _tell(session, session.trials, finished)
    assert "one: not finished, 4 frames" in (said := capsys.readouterr().out) and "1 of 2 trials done" in said
    write_state(finished / "one", state)


def test_a_trials_result_is_that_of_hmc_pose_and_can_be_drawn(lab, finished, tmp_path, capsys):
    trial, session = str(lab / "trials" / "one"), ["--session", str(lab / "session.toml"), "--quiet"]
    options = ["--voxel", "0.05", "--track-voxel", "0.08", "--cameras", "cam_00,cam_02,cam_04,cam_06", "--passes", "1", "--frames", "4"]
    assert main(["pose", trial, "--out", str(tmp_path / "out"), *session, *options]) == 0
    assert (tmp_path / "out" / "joints.csv").read_bytes() == (finished / "one" / "joints.csv").read_bytes()
    assert main(["view", str(finished / "one"), trial, *session, "--no-voxels", "--out", str(tmp_path / "a.png")]) == 0
    assert main(["check", trial, "--session", str(lab / "session.toml"), "--out", str(tmp_path / "check.png")]) == 0
    assert f"\nnext: hmc pose {trial} --session {lab / 'session.toml'} --out one-result\n" in capsys.readouterr().out


def test_a_fault_of_one_trial_does_not_stop_the_others(tmp_path, capsys):
    lab = make_lab(tmp_path / "lab")
    (lab / "trials" / "empty").mkdir()
    assert run(lab, tmp_path / "out", "--trials", "empty,two") == 2
    told = capsys.readouterr()
    assert "hmc run: empty: " in told.err and "no videos/, images/ or silhouettes/ with the cameras' names" in told.err
    assert "Traceback" not in told.err
    assert "two: done" in told.out and "1 of 2 trials done; failed: empty" in told.out
    assert read_state(tmp_path / "out" / "empty").status == FAILED and not (tmp_path / "out" / "one").exists()
    page = (tmp_path / "out" / "report.html").read_text()
    assert "3 trials: 1 done, 1 failed, 1 not finished." in page
    (lab / "trials" / "empty" / "videos").symlink_to(TINY / "videos")
    assert run(lab, tmp_path / "out", "--trials", "empty") == 0
    assert "empty: done, 30 frames" in capsys.readouterr().out


def test_all_that_is_wrong_with_a_trial_is_told(tmp_path, capsys):
    lab = make_lab(tmp_path / "lab")
    videos = lab / "trials" / "two" / "videos"
    videos.mkdir(parents=True)
    for name in ("cam_00", "cam_04"):
        (videos / f"{name}.mp4").symlink_to(TINY / "videos" / f"{name}.mp4")
    (videos / "cam_02.mp4").write_bytes(b"no video")
    assert run(lab, tmp_path / "out", "--trials", "two") == 2
    told = capsys.readouterr().err
    assert "cam_02.mp4: is text, no video" in told and "camera 'cam_06' of the calibration has no video" in told and told.count("\n") == 1
    assert "1 failed" in (tmp_path / "out" / "report.html").read_text()


def test_what_breaks_by_itself_is_told_too(lab, tmp_path, capsys, monkeypatch):
    def breaks(args):
        raise RuntimeError("a bug")

    monkeypatch.setattr(command, "run", breaks)
    assert run(lab, tmp_path, "--trials", "one") == 1
    assert "RuntimeError: a bug" in capsys.readouterr().err and read_state(tmp_path / "one").fault == "RuntimeError: a bug"


def test_a_setting_that_changed_is_computed_again(lab, finished, tmp_path, capsys):
    import shutil

    out = tmp_path / "out"
    shutil.copytree(finished, out)
    other = make_lab(tmp_path / "lab")
    (other / "session.toml").write_text(SESSION.format(tiny=TINY).replace("frames = 4", "frames = 3"))
    assert run(other, out, "--trials", "one") == 0
    assert "its result has other parameters" in capsys.readouterr().out
    assert len(list((out / "one" / "moments").glob("*.jpg"))) == 3


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("voxel = 0.05", "voxle = 0.05", "unknown option `voxle`; did you mean `voxel`?"),
        ("voxel = 0.05", "voxel = -1", "`voxel`: must be a number above 0; got '-1'"),
        ("voxel = 0.05", "voxel = true", "`voxel`: must be a text or a number; got True"),
        ("voxel = 0.05", "workers = 3", "unknown option `workers`"),
        ("voxel = 0.05", "complete = 3", "`complete`: must be true or false; got 3"),
        ("passes = 1", "passes = 3", "`passes`: must be one of 1, 2; got 3"),
        ("frames = 4", 'frames = "many"', "`frames`: must be a whole number, 0 or more; got 'many'"),
        ("fps = 15", "fsp = 15", "unknown key `fsp`; did you mean `fps`?"),
    ],
)
def test_what_is_wrong_for_all_is_said_before_any_work(tmp_path, capsys, old, new, said):
    lab = make_lab(tmp_path / "lab")
    (lab / "session.toml").write_text(SESSION.format(tiny=TINY).replace(old, new, 1))
    assert run(lab, tmp_path / "out") == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1 and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--trials", "tow"], "no trial named `tow`; did you mean `two`?"),
        (["--parallel", "2", "--scheduler", "tcp://127.0.0.1:1"], "leave one of both out"),
        (["--scheduler", "tcp://127.0.0.1:1"], "no Dask scheduler answers"),
    ],
)
def test_wrong_options_are_said(lab, tmp_path, capsys, monkeypatch, more, said):
    monkeypatch.setattr("hmc.experiments.engine.cluster.CONNECT_S", 0.5)
    if more[0] == "--scheduler":
        pytest.importorskip("distributed")
    assert run(lab, tmp_path / "out", *more) == 2
    assert said in capsys.readouterr().err
    (tmp_path / "file").touch()
    assert run(lab, tmp_path / "file") == 2


def test_options_of_all_forms(lab, tmp_path):
    from hmc.cli import command_parser, make_parser
    from hmc.cli.option_tables import arguments_of

    parser = make_parser("pose")
    table = {
        "full-images": True, "color": False, "smooth": 0.2, "model": ["1", "auto"], "settings": "my.toml", "cues": "silhouettes",
        "cut_shadows": True, "height": "auto", "plugin": [],
    }  # fmt: skip
    words = arguments_of(command_parser(parser, "pose"), table, "here", tmp_path)
    args = parser.parse_args(["pose", "x", "--out", "y", *words])
    assert args.full_images and args.color is False and args.smooth == 0.2 and args.model == ["1", "auto"] and args.cut_shadows
    assert args.settings == tmp_path / "my.toml" and args.height == "auto" and args.plugin == []
    words = arguments_of(command_parser(parser, "pose"), {"smooth": True, "full_images": False}, "here", tmp_path)
    assert words == ["--smooth"]


def start(lab, out, *more):
    command = [sys.executable, "-m", "hmc", "run", str(lab), "--out", str(out), "--quiet", *more]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finished_code(process):
    """The exit code, when it has ended and its pipes are closed."""
    process.communicate(timeout=300)
    return process.returncode


@pytest.mark.slow
def test_a_killed_run_goes_on_and_leaves_the_same_bytes(tmp_path):
    lab = make_lab(tmp_path / "lab")
    whole, killed, beside = tmp_path / "whole", tmp_path / "killed", tmp_path / "beside"
    assert finished_code(start(lab, whole)) == 0
    for journal in (".track.journal", ".pose.journal"):
        process = start(lab, killed)
        deadline = time.monotonic() + 60
        while not list(killed.glob(f"two/{journal}")) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
    assert read_state(killed / "two").status != DONE
    for out, more in ((killed, ()), (beside, ("--parallel", "2"))):
        process = start(lab, out, *more)
        told = process.communicate(timeout=300)
        assert process.returncode == 0, told
        assert files_of(out) == files_of(whole)
    assert "hmc pose" not in (beside / "one" / "log.txt").read_text()


@pytest.mark.slow
def test_trials_side_by_side_end_with_a_parent_that_is_killed(tmp_path):
    lab, out = make_lab(tmp_path / "lab"), tmp_path / "out"
    process = start(lab, out, "--parallel", "2")
    deadline = time.monotonic() + 60
    while not list(out.glob("*/check.png")) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=40)
    again = start(lab, out)
    told = again.communicate(timeout=300)
    assert again.returncode == 0, told
    assert files_of(out).keys() >= {"one/joints.csv", "two/joints.csv"}


@pytest.mark.slow
def test_trials_by_the_workers_of_a_scheduler(tmp_path):
    distributed = pytest.importorskip("distributed")
    lab, whole, out = make_lab(tmp_path / "lab"), tmp_path / "whole", tmp_path / "out"
    (lab / "trials" / "empty").mkdir()
    assert finished_code(start(lab, whole)) == 2
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=tmp_path) as cluster:
        process = start(lab, out, "--scheduler", cluster.scheduler_address)
        told = process.communicate(timeout=300)
    assert process.returncode == 2 and "2 of 3 trials done; failed: empty" in told[0], told
    assert files_of(out) == files_of(whole)
