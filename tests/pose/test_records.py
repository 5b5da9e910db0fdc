"""Decided rows through a journal on disk and back, with and without a start, and what a method remembers beside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from hmc.body.joints import N_DOF
from hmc.body.proportions import default_body
from hmc.io.journal import append_journal, open_journal
from hmc.pose.method import Capture, StepInfo, Tracked, begin_tracking, make_subject
from hmc.pose.person import DecidedFrames, PoseTask
from hmc.pose.records import from_record, keep_decided, kept_decided, to_record, with_angles
from hmc.pose.registry import pose_method

TASK = PoseTask(pose_method("apf"), Capture())
SUBJECT = make_subject(default_body(1.69), TASK.capture)


def through(tmp_path, rows: DecidedFrames) -> DecidedFrames:
    """Rows that were written and read."""
    journal = tmp_path / "journal"
    open_journal(journal, "run")
    append_journal(journal, to_record(rows))
    return from_record(open_journal(journal, "run")[0], TASK)


def test_rows_come_back_to_the_last_digit(tmp_path):
    rng = np.random.default_rng(0)
    states = rng.standard_normal((3, N_DOF))
    missing = rng.random(N_DOF) < 0.3
    told = {"error_m": 1 / 7, "started": True, "doubts": "a leg is missing; legs touch"}
    infos = (StepInfo(cost=1e-4, missing=missing), StepInfo("no hull"), StepInfo(cost=1 / 3e4, details=told))
    tracked = begin_tracking(SUBJECT, states[-1] + 0.01, rng.standard_normal(N_DOF) / 3)
    rows = DecidedFrames(4, (7, 8, 10), states, infos, tracked, SUBJECT.body)
    back = through(tmp_path, rows)
    assert (back.person, back.frames) == (rows.person, rows.frames)
    assert [info.status for info in back.infos] == ["fitted", "no hull", "fitted"]
    assert_array_equal([info.cost for info in back.infos], [1e-4, np.nan, 1 / 3e4])
    assert_array_equal(back.infos[0].missing, missing)
    assert back.infos[1].missing is None and back.infos[2].missing is None
    assert [dict(info.details) for info in back.infos] == [{}, {}, told]
    assert_array_equal(back.states, rows.states)
    assert back.body.dimensions == rows.body.dimensions
    assert_array_equal(back.body.offsets, rows.body.offsets)


def test_rows_without_a_start_come_back_as_nothing(tmp_path):
    back = through(tmp_path, DecidedFrames(0, (1, 2), np.full((2, N_DOF), np.nan), (StepInfo("no hull"),) * 2))
    assert back.frames == (1, 2) and back.states.shape == (2, N_DOF) and np.isnan(back.states).all()
    assert back.tracked is None and back.body is None


def tracked(value: float) -> Tracked:
    """A pose and what is remembered beside it: arrays of any kind and shape."""
    memory = {"particles": np.full((5, N_DOF), value), "active": np.array([value > 0, False]), "count": np.array(int(value))}
    return begin_tracking(SUBJECT, np.full(N_DOF, value), np.full(N_DOF, value / 3), memory)


def rows_of(frame: int, value: float, person: int = 2) -> DecidedFrames:
    return DecidedFrames(person, (frame,), np.full((1, N_DOF), value), (StepInfo(cost=1.0),), tracked(value), SUBJECT.body)


def kept(journal: Path, person: int = 2) -> Tracked:
    """What a person goes on from."""
    return [one for one in kept_decided(journal, "run", TASK) if one.person == person][-1].tracked


def check(found: Tracked, value: float) -> None:
    expected = tracked(value)
    assert_array_equal(found.state, expected.state)
    assert_array_equal(found.velocity, expected.velocity)
    assert set(found.memory) == set(expected.memory)
    for name, values in expected.memory.items():
        assert_array_equal(found.memory[name], values)
        assert found.memory[name].dtype == values.dtype


def test_a_run_goes_on_from_the_last_row_of_each_person(tmp_path):
    journal = tmp_path / "journal"
    open_journal(journal, with_angles("run"))
    before = -1
    for frame in (3, 4, 6, 7):
        keep_decided(journal, rows_of(frame, frame), before)
        keep_decided(journal, rows_of(frame, -frame, person=5), before)
        check(kept(journal), frame)
        check(kept(journal, 5), -frame)
        before = frame
    again = list(kept_decided(journal, "run", TASK))
    assert [(one.person, one.frames) for one in again] == [(person, (frame,)) for frame in (3, 4, 6, 7) for person in (2, 5)]
    assert [one.tracked is None for one in again] == [True] * 6 + [False] * 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["journal", *(f"journal.{p}.{k}.npz" for p in (2, 5) for k in (0, 1))]


def test_memory_of_the_last_record_outlives_the_next_one_until_that_is_recorded(tmp_path, monkeypatch):
    """The run dies after the memory was written, before its record: it goes on from the record before."""
    journal = tmp_path / "journal"
    open_journal(journal, with_angles("run"))
    keep_decided(journal, rows_of(6, 6), -1)
    keep_decided(journal, rows_of(7, 7), 6)

    def dies(*given):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("hmc.pose.records.append_journal", dies)
        for value in (9, 9.5):  # and once more, as it is taken up and dies again
            with pytest.raises(KeyboardInterrupt):
                keep_decided(journal, rows_of(9, value), 7)
            check(kept(journal), 7)
    keep_decided(journal, rows_of(9, 9.5), 7)
    check(kept(journal), 9.5)
    assert len(list(tmp_path.iterdir())) == 3


def test_states_of_other_angles_are_not_taken_up(tmp_path):
    journal = tmp_path / "journal"
    open_journal(journal, with_angles("run").replace(" spine_x", ""))
    keep_decided(journal, replace(rows_of(3, 3), states=np.zeros((1, N_DOF - 1))), -1)
    assert list(kept_decided(journal, "run", TASK)) == []


def test_memory_of_an_earlier_run_is_not_taken_for_this_one_s(tmp_path):
    journal = tmp_path / "journal"
    open_journal(journal, "another run")
    keep_decided(journal, rows_of(3, -3), -1)
    keep_decided(journal, rows_of(4, -4), 3)
    assert list(kept_decided(journal, "run", TASK)) == []
    before = -1
    for frame in (3, 4, 5):  # begun anew
        keep_decided(journal, rows_of(frame, frame), before)
        check(kept(journal), frame)
        before = frame


def test_without_a_memory_there_is_no_file_beside_the_journal_and_without_a_journal_none_at_all(tmp_path):
    journal = tmp_path / "journal"
    open_journal(journal, with_angles("run"))
    rows = rows_of(1, 1)
    rows = replace(rows, tracked=replace(rows.tracked, memory={}))
    keep_decided(journal, rows, -1)
    assert not kept(journal).memory
    keep_decided(None, rows, -1)
    assert list(kept_decided(None, "run", TASK)) == []
    assert [path.name for path in tmp_path.iterdir()] == ["journal"]
