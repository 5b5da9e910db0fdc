"""Taking up a journal: of the same run, of another one, and none."""

from pathlib import Path

import pytest

from hmc.errors import InputError
from hmc.io.journal import append_journal, open_journal, read_journal


def test_a_run_goes_on_from_its_records(tmp_path):
    path = tmp_path / "run" / "journal"
    assert open_journal(path, "a") == []
    append_journal(path, {"frame": 0})
    append_journal(path, {"frame": 1})
    assert open_journal(path, "a") == [{"frame": 0}, {"frame": 1}]
    append_journal(path, {"frame": 2})
    assert [record["frame"] for record in open_journal(path, "a")] == [0, 1, 2]


def test_another_run_s_records_are_let_go(tmp_path):
    path = tmp_path / "journal"
    open_journal(path, "a")
    append_journal(path, {"frame": 0})
    assert open_journal(path, "b") == []
    assert read_journal(path) == [{"key": "b"}]


def test_no_journal_keeps_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert open_journal(None, "a") == []
    assert list(tmp_path.iterdir()) == []


def lines_of(path):
    return path.read_bytes().splitlines(keepends=True)


def cut_line(lines):
    lines[2] = lines[2][:-12] + b"\n"


def altered_digit(lines):
    lines[2] = lines[2].replace(b"1", b"2", 1)


def exchanged(lines):
    lines[2], lines[3] = lines[3], lines[2]


def dropped(lines):
    del lines[2]


def doubled(lines):
    lines.insert(2, lines[1])


def other_text(lines):
    lines[2] = b"\xff\xfe\0\n"


@pytest.mark.parametrize("spoil", [cut_line, altered_digit, exchanged, dropped, doubled, other_text])
def test_a_line_that_is_not_as_it_was_ends_the_journal(tmp_path, spoil):
    path, told = tmp_path / "journal", []
    open_journal(path, "a")
    for frame in range(4):
        append_journal(path, {"frame": frame})
    lines = lines_of(path)
    spoil(lines)
    path.write_bytes(b"".join(lines))
    assert open_journal(path, "a", told.append) == [{"frame": 0}]
    assert len(told) == 1 and "damaged in line 3" in told[0]
    append_journal(path, {"frame": 1})
    assert open_journal(path, "a", told.append) == [{"frame": 0}, {"frame": 1}]
    assert len(told) == 1


def test_no_line_that_is_whole_begins_anew(tmp_path):
    path, told = tmp_path / "journal", []
    path.write_text('{"key":"a"}\n{"frame"\n{"frame":1}\n')
    assert open_journal(path, "a", told.append) == []
    assert len(told) == 1 and read_journal(path) == [{"key": "a"}]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_is_told(tmp_path):
    with pytest.raises(InputError, match=r"/dev/full: cannot be written .*; choose another folder, or make room"):
        append_journal("/dev/full", {"key": "a"})
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="journal: cannot be written"):
        open_journal(tmp_path / "file" / "journal", "a")
