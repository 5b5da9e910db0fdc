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


def test_a_damaged_journal_is_not_thrown_away(tmp_path):
    path = tmp_path / "journal"
    path.write_text('{"key":"a"}\n{"frame"\n{"frame":1}\n')
    with pytest.raises(InputError, match="line 2: damaged"):
        open_journal(path, "a")
    assert path.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_is_told(tmp_path):
    with pytest.raises(InputError, match=r"/dev/full: cannot be written .*; choose another folder, or make room"):
        append_journal("/dev/full", {"key": "a"})
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="journal: cannot be written"):
        open_journal(tmp_path / "file" / "journal", "a")
