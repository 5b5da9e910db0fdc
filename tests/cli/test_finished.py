"""What tells a finished result from a damaged one, and where results may go."""

import argparse

import pytest

from hmc.cli.common import output_path, unlike_its_run, was_finished, written_digests
from hmc.errors import InputError
from hmc.io.results import write_run

RUN = {"method": "m", "seed": 0, "parameters": {"start": 0}}


@pytest.fixture
def result(tmp_path):
    (tmp_path / "tracks.csv").write_text("frame,person,x,y,z\n0,0,1,2,3\n")
    write_run(tmp_path / "run.toml", "m", {"start": 0}, 0, written=written_digests([tmp_path / "tracks.csv"]))
    return tmp_path


def test_a_result_that_is_as_it_was_written_is_finished(result, capsys):
    assert was_finished([result / "tracks.csv"], result / "run.toml", RUN)
    assert not was_finished([result / "tracks.csv"], result / "run.toml", RUN | {"seed": 1})
    assert not was_finished([result / "tracks.csv", result / "joints.csv"], result / "run.toml", RUN)
    assert "finished before" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "frame,person,x,y,z\n", "frame,person,x,y,z\n0,0,1,2,4\n"])
def test_a_changed_one_is_told_and_left(result, text):
    path = result / "tracks.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"tracks\.csv: is not as its run wrote it"):
        was_finished([path], result / "run.toml", RUN)
    assert path.read_text() == text


@pytest.mark.parametrize("name", ["tracks.csv", "joints.csv"])
def test_what_no_run_wrote_is_not_written_over(result, name):
    other = result / name
    if name == "tracks.csv":
        (result / "run.toml").unlink()
    other.write_text("somebody's own")
    written = [result / "tracks.csv", result / "joints.csv"]
    with pytest.raises(InputError, match=rf"{name}: no run wrote it.* move it away, or give another --out"):
        was_finished(written, result / "run.toml", RUN)
    (result / ".pose.journal").touch()  # a run was stopped while it wrote
    assert not was_finished(written, result / "run.toml", RUN | {"seed": 1})
    assert other.read_text() == "somebody's own"


@pytest.mark.parametrize("written", [None, 3, "tracks.csv"])
def test_a_run_that_does_not_tell_what_it_wrote_counts_as_its_writer(result, written):
    write_run(result / "run.toml", "m", {"start": 0}, 0, **({} if written is None else {"written": written}))
    assert was_finished([result / "tracks.csv"], result / "run.toml", RUN)


def test_whoever_reads_a_changed_one_is_told(result):
    other = result / "other.csv"
    other.write_text("of no run")
    assert unlike_its_run(result) == unlike_its_run(result, ["tracks.csv", "other.csv"]) == []
    (result / "tracks.csv").write_text("frame,person,x,y,z\n")
    assert unlike_its_run(result) == [f"{result / 'tracks.csv'}: is not as its run wrote it (changed, or damaged)"]
    assert unlike_its_run(result, ["other.csv"]) == []
    (result / "run.toml").unlink()
    assert unlike_its_run(result) == []


@pytest.mark.parametrize("text", ["cam_00 ", "-inf", " a", "out/ /b", "a\nb", ""])
def test_odd_names_are_no_place_for_results(text):
    with pytest.raises(argparse.ArgumentTypeError, match="may not begin with - or have blanks around them"):
        output_path(text)


@pytest.mark.parametrize("text", ["out", "../out", "/tmp/a b/c", "a-b.png"])
def test_others_are_taken_as_they_are(text):
    assert str(output_path(text)) == text
