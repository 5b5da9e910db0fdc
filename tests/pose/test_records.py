"""Decided rows through a journal on disk and back, with and without a start, and the particles beside it."""

from pathlib import Path

import numpy as np
from numpy.testing import assert_array_equal

from hmc.body.joints import N_DOF
from hmc.body.proportions import default_body
from hmc.io.journal import append_journal, open_journal
from hmc.pose.person import Decided
from hmc.pose.records import from_record, keep_particles, kept_particles, to_record
from hmc.pose.steps.annealed import PoseState, pose_init
from hmc.pose.steps.presets import PRESETS
from hmc.search.filters import ParticleState


def test_rows_come_back_to_the_last_digit(tmp_path):
    rng = np.random.default_rng(0)
    states = rng.standard_normal((3, N_DOF))
    pose = pose_init(states[-1] + 0.01, rng.standard_normal(N_DOF) / 3)
    missing = rng.random((3, N_DOF)) < 0.3
    rows = Decided(4, (7, 8, 10), states, (1e-4, np.nan, 1 / 3e4), ("fitted", "no hull", "fitted"), pose, default_body(1.69), missing)
    journal = tmp_path / "journal"
    open_journal(journal, "run")
    append_journal(journal, to_record(rows))
    back = from_record(open_journal(journal, "run")[0], PRESETS["default"])
    assert (back.person, back.frames, back.status) == (rows.person, rows.frames, rows.status)
    assert_array_equal(back.states, rows.states)
    assert_array_equal(back.costs, rows.costs)
    assert_array_equal(back.pose.state, pose.state)
    assert_array_equal(back.pose.velocity, pose.velocity)
    assert_array_equal(back.missing, missing)
    assert back.body.dimensions == rows.body.dimensions
    assert_array_equal(back.body.offsets, rows.body.offsets)


def test_rows_without_a_start_come_back_as_nothing(tmp_path):
    rows = Decided(0, (1, 2), np.full((2, N_DOF), np.nan), (np.nan, np.nan), ("no hull", "no hull"))
    journal = tmp_path / "journal"
    open_journal(journal, "run")
    append_journal(journal, to_record(rows))
    back = from_record(open_journal(journal, "run")[0], PRESETS["default"])
    assert back.frames == (1, 2) and back.states.shape == (2, N_DOF) and np.isnan(back.states).all()
    assert back.pose is None and back.body is None


def particles(value: float) -> PoseState:
    of = ParticleState(np.full((5, N_DOF), value), np.zeros(5))
    return pose_init(np.zeros(N_DOF), particles=of, memory={"active": np.array([value > 0, False])})


def kept(journal: Path, person: int, frame: int) -> np.ndarray:
    """Numbers of the particles that are kept; their memory must be the same frame's."""
    of, memory = kept_particles(journal, person, frame)
    assert_array_equal(memory["active"], [of.particles[0, 0] > 0, False])
    return of.particles


def test_particles_of_the_last_record_outlive_the_next_ones_until_those_are_recorded(tmp_path):
    journal = tmp_path / "journal"
    before = -1
    for frame in (3, 4, 6, 7):
        keep_particles(journal, 2, frame, before, particles(frame))
        for number in (frame, before):
            if number >= 0:
                assert_array_equal(kept(journal, 2, number), number)
        before = frame
    # The run died after the particles of frame 9, before its record, and goes on after frame 7.
    keep_particles(journal, 2, 9, 7, particles(9))
    assert_array_equal(kept(journal, 2, 7), 7)
    keep_particles(journal, 2, 9, 7, particles(9.5))
    assert_array_equal(kept(journal, 2, 9), 9.5)
    assert kept_particles(journal, 2, 3) is None and kept_particles(journal, 1, 9) is None
    assert len(list(tmp_path.iterdir())) == 2


def test_particles_of_an_earlier_run_are_not_taken_for_this_one_s(tmp_path):
    journal = tmp_path / "journal"
    keep_particles(journal, 0, 3, -1, particles(-3))
    keep_particles(journal, 0, 4, 3, particles(-4))
    before = -1
    for frame in (3, 4, 5):  # begun anew
        keep_particles(journal, 0, frame, before, particles(frame))
        assert_array_equal(kept(journal, 0, frame), frame)
        before = frame
