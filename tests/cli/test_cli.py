"""The frame of the command line: exit codes, one line for a user's mistake, help without heavy imports."""

import argparse
import errno
import os
import re
import shlex
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

import hmc
from hmc.cli import COMMANDS, common, main
from hmc.errors import InputError


def run(*args, **kwargs):
    return subprocess.run([sys.executable, "-m", "hmc", *args], capture_output=True, text=True, timeout=120, **kwargs)


def test_without_arguments_help_is_printed(capsys):
    assert main([]) == 0
    shown = capsys.readouterr().out
    assert "usage: hmc" in shown and "check" in shown


def test_version(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0 and capsys.readouterr().out.strip() == f"hmc {hmc.__version__}"


@pytest.mark.parametrize("argv", [["fly"], ["check"], ["check", "x", "--cameras", ","], ["check", "x", "--no-such-option"]])
def test_wrong_options_end_with_2_and_usage(argv, capsys):
    with pytest.raises(SystemExit) as stop:
        main(argv)
    assert stop.value.code == 2
    assert "usage: hmc" in capsys.readouterr().err


def test_check_good_recording(recording_folder, tmp_path, capsys):
    out = tmp_path / "rig.png"
    assert main(["check", str(recording_folder), "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert out.is_file() and f"picture: {out}" in lines
    assert lines[-1] == "take_1: can be used: 5 cameras, 12 frames, 25 a second"


@pytest.mark.skipif(os.name == "nt", reason="a shell of Unix closes them")
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_process_that_was_begun_without_streams_does_its_work(recording_folder, tmp_path, closed):
    """It ended in a traceback when all was done, or did not begin."""
    words = [sys.executable, "-m", "hmc", "check", str(recording_folder), "--out", str(tmp_path / "rig.png")]
    done = subprocess.run(f"{shlex.join(words)} {closed}", shell=True, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and "Traceback" not in done.stderr and (tmp_path / "rig.png").is_file()


@pytest.mark.parametrize("out", ["videos/cam_00.avi", "videos/new.png", "calibration.toml", "truth/a.png"])
def test_no_picture_takes_the_place_of_a_recording_s_file(recording_folder, capsys, out):
    """`hmc view RESULT RECORDING --out RECORDING/videos/cam_00.mp4` wrote over what was filmed."""
    (recording_folder / "truth").mkdir()
    (recording_folder / "truth" / "joints.csv").write_text("frame,person,joint,x,y,z\n")
    before = {file: file.read_bytes() for file in recording_folder.rglob("*") if file.is_file()}
    for words in (["check"], ["sync", "--dry-run"], ["world", "--dry-run"]):
        assert main([*words, str(recording_folder), "--out", str(recording_folder / out)]) == 2
        assert "the recording's own files; choose another place" in capsys.readouterr().err
    assert {file: file.read_bytes() for file in recording_folder.rglob("*") if file.is_file()} == before
    assert main(["check", str(recording_folder), "--out", str(recording_folder / "check.png")]) == 0


@pytest.mark.parametrize("words", [["export", "--to", "csv"], ["angles"]])
def test_no_export_takes_the_place_of_a_result_s_file(tmp_path, capsys, words):
    (tmp_path / "joints.csv").write_text("frame,person,joint,x,y,z\n0,0,pelvis,0,0,1\n")
    assert main([*words, str(tmp_path), "--out", str(tmp_path / "joints.csv")]) == 2
    assert "is the result's own file; choose another name" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["export", "rec", "--to", "csv", "--cutoff", "3"], "--cutoff is of --smooth butterworth"),
        (["export", "rec", "--to", "csv", "--smooth", "butterworth", "--window", "1"], "--window is of --smooth polynomial"),
        (["angles", "rec", "--window", "1"], "--window is of --smooth polynomial"),
        (["export", "rec", "--to", "csv", "--max-gap", "1"], "(--max-gap) is of fill (--fill) linear or spline"),
        (["world", "rec", "--square", "0.05"], "give --board too"),
        (["world", "rec", "--board", "2x9"], "'2x9' is not the inner corners of a chessboard, 3 or more each way"),
        (["world", "rec", "--distance", "cam_00,cam_01"], "'cam_00,cam_01' is not two cameras and how many metres they are apart"),
        (["pose", "rec", "--out", "res", "--detections", "points.csv"], "--detections is of --method marker-apf"),
        (["pose", "rec", "--out", "res", "--labels", "points.csv"], "--labels is of --method marker-apf"),
        (["pose", "rec", "--out", "res", "--cues", "all"], "choose from 'silhouettes', 'silhouettes,keypoints', 'keypoints'"),
    ],
)
def test_options_without_anything_to_act_on_are_refused(recording_folder, tmp_path, monkeypatch, capsys, words, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rec").symlink_to(recording_folder)
    with suppress(SystemExit):
        assert main(words) == 2
    assert says in capsys.readouterr().err and not (tmp_path / "res").exists()


def test_check_default_picture_and_all_frames(recording_folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["check", str(recording_folder), "--all", "--cameras", "cam_00,cam_01,cam_02"]) == 0
    assert (tmp_path / "take_1_check.png").is_file()
    assert "3 cameras, 12 frames" in capsys.readouterr().out


def test_check_bad_recording(recording_folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (recording_folder / "videos" / "cam_01.avi").unlink()
    assert main(["check", str(recording_folder)]) == 2
    captured = capsys.readouterr()
    assert "error: " in captured.out and captured.out.splitlines()[-1] == "take_1: cannot be used (1 error)"
    assert main(["check", str(tmp_path / "nowhere")]) == 2
    assert "no such folder" in capsys.readouterr().out


def test_picture_that_cannot_be_written(recording_folder, tmp_path, capsys):
    for name, words in (("no/such/folder.png", "No such file"), ("rig.docx", "ends in .png"), ("rig", "ends in .png")):
        assert main(["check", str(recording_folder), "--out", str(tmp_path / name)]) == 2
        assert re.search(rf"the picture cannot be written \(.*{words}", capsys.readouterr().err)


def test_in_a_process_of_its_own(tmp_path):
    result = run("check", str(tmp_path), cwd=tmp_path)
    assert result.returncode == 2 and "no calibration found" in result.stdout and "Traceback" not in result.stderr


def test_help_needs_no_heavy_imports():
    code = (
        "import sys, hmc.cli\ntry:\n hmc.cli.main(['--help'])\nexcept SystemExit: pass\n"
        "print([m for m in ('matplotlib', 'pandas', 'tqdm', 'sklearn') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0 and result.stdout.splitlines()[-1] == "[]", result.stderr


def fake_command(monkeypatch, action):
    """Replace what `check` does."""
    import hmc.cli.check

    monkeypatch.setattr(hmc.cli.check, "run", action)


def raising(error):
    def action(args):
        raise error

    return action


def test_input_error_is_one_line(monkeypatch, capsys):
    fake_command(monkeypatch, raising(InputError("here.toml: this is wrong; do that")))
    assert main(["check", "x"]) == 2
    assert capsys.readouterr().err == "hmc check: here.toml: this is wrong; do that\n"


def test_interrupt(monkeypatch, capsys):
    fake_command(monkeypatch, raising(KeyboardInterrupt()))
    assert main(["check", "x"]) == 130
    assert capsys.readouterr().err.strip() == "hmc check: interrupted"


@pytest.mark.parametrize("words", [["check", "x"], ["experiments", "list"]])
def test_an_interrupt_while_a_command_is_imported(words, monkeypatch, capsys):
    """Its module takes a second: Ctrl-C in it ended in a traceback."""
    for loads in ("hmc.cli.make_parser", "hmc.cli.experiments.hand_over"):
        monkeypatch.setattr(loads, raising(KeyboardInterrupt()))
    assert main(words) == 130
    assert capsys.readouterr().err == f"hmc {words[0]}: interrupted\n"


def test_an_interrupt_that_a_library_takes_for_an_error_of_its_own_is_an_interrupt(monkeypatch, capsys):
    """A figure that was being drawn ended in a traceback: "Invalid affine transformation matrix"."""

    def action(args):
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise ValueError("Invalid affine transformation matrix")

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        fake_command(monkeypatch, action)
        assert main(["check", "x"]) == 130 and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert capsys.readouterr().err.strip() == "hmc check: interrupted"
        fake_command(monkeypatch, raising(ValueError("of its own")))
        with pytest.raises(ValueError, match="of its own"):
            main(["check", "x"])
    finally:
        signal.signal(signal.SIGINT, before)


def test_files_that_cannot_be_had_are_one_line(monkeypatch, capsys):
    fake_command(monkeypatch, raising(PermissionError(13, "Permission denied", "/out/tracks.csv")))
    assert main(["check", "x"]) == 2
    assert capsys.readouterr().err == "hmc check: /out/tracks.csv: Permission denied\n"


def test_a_full_disk_is_one_line_where_no_file_is_named(monkeypatch, capsys):
    fake_command(monkeypatch, raising(OSError(errno.ENOSPC, "No space left on device")))
    assert main(["check", "x"]) == 2
    assert capsys.readouterr().err == "hmc check: No space left on device; make room, and start it again\n"


def test_faults_of_our_own_are_not_hidden(monkeypatch):
    for fault in (RuntimeError("a bug"), OSError("raised by hand")):
        fake_command(monkeypatch, raising(fault))
        with pytest.raises(type(fault)):
            main(["check", "x"])


def test_reader_of_the_pipe_went_away(tmp_path):
    """`hmc check x | true`: no traceback, whatever is printed after the reader has gone."""
    code = (
        "import sys, time, hmc.cli.check as c\n"
        "def run(args):\n time.sleep(0.3)\n print('x' * 100000)\n return 0\n"
        "c.run = run\nfrom hmc.cli import main\nsys.exit(main(['check', 'x']))"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    error = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=60) == 0 and error == ""


def test_every_command_that_is_there_has_help(capsys):
    import importlib.util

    there = [name for name in COMMANDS if importlib.util.find_spec(f"hmc.cli.{name}")]
    assert "check" in there
    for name in there:
        with pytest.raises(SystemExit) as stop:
            main([name, "--help"])
        assert stop.value.code == 0
        assert f"usage: hmc {name}" in capsys.readouterr().out


def test_selection_options(recording_folder):
    parser = argparse.ArgumentParser()
    common.add_selection_options(parser)
    args = parser.parse_args([str(recording_folder), "--start", "3", "--frames", "4", "--cameras", "cam_02, cam_00", "--quiet"])
    recording = common.open_selected(args)
    assert recording.start == 3 and recording.n_frames == 4 and recording.rig.names == ("cam_02", "cam_00") and args.quiet


@pytest.mark.parametrize(
    "kind, good, bad",
    [
        ("whole_number", "7", ["-1", "1.5", "x", ""]),
        ("positive_float", "0.5", ["0", "-1", "nan", "inf", "x"]),
        ("float_from_zero", "0", ["-1", "nan", "inf", "x", ""]),
    ],
)
def test_number_types(kind, good, bad):
    convert = getattr(common, kind)
    assert convert(good) == float(good)
    for text in bad:
        with pytest.raises(argparse.ArgumentTypeError, match="must be a"):
            convert(text)


def test_progress_passes_everything_on(capsys):
    assert list(common.progress(range(5), quiet=True)) == list(range(5))
    assert capsys.readouterr().err == ""
    assert list(common.progress(iter(range(5)), total=5, desc="reading")) == list(range(5))
    shown = capsys.readouterr().err
    assert "reading" in shown and "5/5" in shown and "frame/s" in shown


def test_problems_are_listed_once(capsys):
    common.print_problems(["a", "b", "a"])
    assert capsys.readouterr().err.splitlines() == ["note: a", "note: b"]


def test_what_several_cameras_have_in_common_is_one_line():
    lost = [f"cam_{c}: frames 98 to 99 cannot be read; left out" for c in (1, 2, 1, 3)]
    assert common.gather_problems([*lost, "cam_4: frame 7 cannot be read; left out", "one remark: of its own", "and another"]) == [
        "cam_1, cam_2, cam_3: frames 98 to 99 cannot be read; left out",
        "cam_4: frame 7 cannot be read; left out",
        "one remark: of its own",
        "and another",
    ]


def test_names_that_are_no_text_are_told(tmp_path, monkeypatch, capsys):
    """Neither what decodes videos nor run.toml takes them."""
    assert main(["check", "r\udcff"]) == 2
    assert capsys.readouterr().err == r"hmc: 'r\udcff' is no text in UTF-8; rename that file or folder" + "\n"
    folder = Path(os.fsdecode(bytes(tmp_path) + b"/\xff"))
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert main(["check", "r"]) == 2
    assert "is no text in UTF-8" in capsys.readouterr().err


def test_signs_that_the_terminal_has_not_are_written_otherwise(tmp_path):
    folder = tmp_path / "Läufer"
    folder.mkdir()
    done = run("check", str(folder), "--out", str(tmp_path / "a.png"), env={**os.environ, "PYTHONIOENCODING": "ascii:strict"})
    assert done.returncode == 2 and r"L\xe4ufer" in done.stdout and "Traceback" not in done.stderr
