"""Runs that repeat others, and presets with other values: what run.toml holds is what was used."""

from dataclasses import replace

import pytest
from methods import TINY, lean_method, lean_presets
from methods import pose_method as make_method

from hmc.cli import main
from hmc.cli import pose as command
from hmc.io.results import read_run


@pytest.fixture(scope="module", autouse=True)
def little_work():
    """The methods as they are, with less work; one with settings is made anew."""

    def lean(name, preset, models, init, skin, passes, settings):
        if not settings:
            return replace(lean_method(name, preset, tuple(models), init, skin), back=None)
        with pytest.MonkeyPatch.context() as patch:
            lean_presets(patch)
            made = make_method(name, preset, models, init, skin, passes, settings)
        usual = lean_method(name, preset, tuple(models), init, skin)
        return replace(made, start=usual.start, recover=usual.recover, legs=usual.legs, window_s=usual.window_s, back=None)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "pose_method", lean)
        yield


def pose(out, *more):
    return main(["pose", str(TINY), "--out", str(out), "--quiet", "--workers", "1", *more])


OPTIONS = ("--frames", "4", "--voxel", "0.05", "--track-voxel", "0.08", "--cameras", "cam_00,cam_02,cam_04,cam_06", "--seed", "3")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first")
    (folder / "my.toml").write_text("[annealed]\nlayers = 1\n[search]\ndraws = 11\n")
    assert pose(folder / "out", *OPTIONS, "--no-complete", "--smooth", "0.2", "--settings", str(folder / "my.toml")) == 0
    return folder / "out"


def test_settings_of_a_file_are_used_and_told(first):
    run = read_run(first / "run.toml")
    assert run["parameters"]["preset"]["annealed"]["layers"] == 1 and run["parameters"]["preset"]["search"]["draws"] == 11
    assert run["options"]["command"] == "pose" and run["options"]["smooth"] == 0.2 and run["options"]["complete"] is False
    assert not {"out", "recording", "workers", "quiet", "settings", "like"} & set(run["options"])


def test_a_run_is_repeated_byte_by_byte(first, tmp_path):
    assert pose(tmp_path / "out", "--like", str(first / "run.toml")) == 0
    for name in ("joints.csv", "tracks.csv", "pose.npz", "run.toml"):
        assert (tmp_path / "out" / name).read_bytes() == (first / name).read_bytes(), name


def test_a_repeated_run_is_found_where_it_was_made(first, capsys):
    assert pose(first, "--like", str(first / "run.toml")) == 0
    assert "was finished before" in capsys.readouterr().out


def test_what_is_said_goes_before_what_is_repeated(first, tmp_path):
    (tmp_path / "more.toml").write_text("[search]\ndraws = 12\n")
    like = ("--like", str(first / "run.toml"))
    assert (
        pose(tmp_path / "out", *like, "--frames", "3", "--settings", str(tmp_path / "more.toml"), "--cameras", "cam_00,cam_02,cam_04") == 0
    )
    parameters = read_run(tmp_path / "out" / "run.toml")["parameters"]
    assert parameters["frames"] == 3 and parameters["cameras"] == ["cam_00", "cam_02", "cam_04"] and parameters["smooth_s"] == 0.2
    assert parameters["preset"]["annealed"]["layers"] == 1 and parameters["preset"]["search"]["draws"] == 12
    assert pose(tmp_path / "other", *like, "--frames", "3", "--preset", "canton2009") == 0
    assert read_run(tmp_path / "other" / "run.toml")["parameters"]["preset"]["annealed"]["layers"] == 3  # the preset's own


def test_tracks_are_repeated(tmp_path):
    call = ["track", str(TINY), "--quiet", "--workers", "1", "--out"]
    options = ["--frames", "4", "--voxel", "0.08", "--tracker", "naive", "--no-cut-shadows", "--cameras", "cam_00,cam_02,cam_04"]
    assert main([*call, str(tmp_path / "a"), *options]) == 0
    assert main([*call, str(tmp_path / "b"), "--like", str(tmp_path / "a" / "run.toml")]) == 0
    assert (tmp_path / "a" / "tracks.csv").read_bytes() == (tmp_path / "b" / "tracks.csv").read_bytes()
    assert read_run(tmp_path / "a" / "run.toml")["parameters"] == read_run(tmp_path / "b" / "run.toml")["parameters"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "--like "),
        ("a = ", "not a TOML file"),
        ('method = "apf"\n', "does not say with which options it was made"),
        ('[options]\ncommand = "track"\n', "was made by `hmc track`, not by `hmc pose`"),
        ('[options]\ncommand = "pose"\nvoxel = -1\n', "[options]: `voxel`: must be a number above 0; got '-1'"),
        ('[options]\ncommand = "pose"\nspeed = 3\n', "[options]: unknown option `speed`; did you mean `seed`?"),
        ('[options]\ncommand = "pose"\npreset = "default"\nmodel = []\n[parameters.preset]\nnames = 3\n', "no setting `names`"),
    ],
)
def test_what_cannot_be_repeated_is_said(tmp_path, capsys, text, said):
    if text is not None:
        (tmp_path / "run.toml").write_text(text)
    assert pose(tmp_path / "out", "--like", str(tmp_path / "run.toml")) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1 and not (tmp_path / "out").exists()


@pytest.mark.parametrize(("text", "said"), [("[annealed]\nlayer = 3\n", "did you mean `annealed.layers`?"), ("a = ", "not a TOML file")])
def test_settings_that_are_wrong_are_said(tmp_path, capsys, text, said):
    (tmp_path / "my.toml").write_text(text)
    assert pose(tmp_path / "out", "--settings", str(tmp_path / "my.toml")) == 2
    assert said in capsys.readouterr().err and not (tmp_path / "out").exists()
