"""The time that a run says is left, against that which it then takes, by a clock of the test's own."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.cli.run_bar import FIRST_POSE, FITTING, FOLLOWING, LEARNING, SECOND_PASS, TRACKING, VIEWS, RunBar

STAGES = [TRACKING, FIRST_POSE, FOLLOWING, FITTING, SECOND_PASS, VIEWS]


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def run(costs, frames=100, people=1, learning=20.0, quiet=True, before=1.0, megapixels=1.5):
    """A run whose stages take so many seconds a frame, or a person's halt: what it said after every frame, and when it ended."""
    clock, said = Clock(), []
    bar = RunBar(STAGES, frames, people, quiet, clock, megapixels=megapixels)

    def look(name):
        said.append((name, clock.now - 100, bar.left_s()))

    def learnt():
        clock.now += learning
        yield from range(frames)

    for _ in bar.stage(TRACKING, LEARNING)(learnt(), frames):
        clock.now += costs[TRACKING]
        look(TRACKING)
    for frame in bar.stage(FOLLOWING)(range(frames), frames):
        if frame == 30:
            for _ in range(people):
                bar.phase(FIRST_POSE)
                look(FIRST_POSE)
                clock.now += costs[FIRST_POSE]
                bar.phase(FOLLOWING)
        clock.now += costs[FOLLOWING] * people * (before if frame < 30 else 1.0)
        look(FOLLOWING)
    bar.phase(FITTING)
    look(FITTING)
    clock.now += costs[FITTING] * people
    for name in (SECOND_PASS, VIEWS):
        for _ in bar.stage(name)(range(frames), frames):
            clock.now += costs[name] * people
            look(name)
    return said, clock.now - 100


USUAL = {TRACKING: 1.0, FIRST_POSE: 42.0, FOLLOWING: 0.5, FITTING: 30.0, SECOND_PASS: 0.75, VIEWS: 0.05}


@settings(max_examples=30, deadline=None)
@given(speed=st.floats(0.01, 20), people=st.integers(1, 4), frames=st.integers(40, 300))
def test_of_a_run_like_others_the_time_left_is_right_at_any_speed(speed, people, frames):
    said, total = run({name: speed * cost for name, cost in USUAL.items()}, frames, people, 5 * speed)
    told = [(gone, left) for _, gone, left in said if left is not None]
    assert len(told) > 3 * frames
    for gone, left in told:
        assert gone + left == pytest.approx(total, rel=0.03, abs=3 * speed)


@settings(max_examples=30, deadline=None)
@given(unlike=st.lists(st.floats(0.5, 2), min_size=6, max_size=6))
def test_of_an_unusual_one_it_is_within_a_factor_and_right_at_last(unlike):
    costs = {name: cost * factor for (name, cost), factor in zip(USUAL.items(), unlike, strict=True)}
    said, total = run(costs)
    for name, gone, left in said:
        if left is not None and name not in (SECOND_PASS, VIEWS):
            assert (total - gone) / 4.01 - 3 <= left <= 4.01 * (total - gone) + 3
    middle = [(gone, left) for name, gone, left in said if name == SECOND_PASS][50:]
    rest = np.array([total - gone for gone, _ in middle])
    assert np.abs(np.array([left for _, left in middle]) - rest).max() < 0.1 * 100 * 4  # the views are yet to come


def test_frames_before_the_first_pose_tell_nothing_of_the_speed_after_it():
    """.07 s a frame before, .3 after it."""
    unlike = {FOLLOWING: 0.3, SECOND_PASS: 0.45}
    said, total = run({name: 0.4 * cost for name, cost in USUAL.items()} | unlike, frames=120, before=0.25)
    after = [(gone, left) for name, gone, left in said if name == FOLLOWING][40:]
    assert max(abs(gone + left - total) / (total - gone) for gone, left in after) < 0.3


def test_people_who_are_slow_to_follow_are_slow_in_the_second_pass():
    """Two who stand close together: both passes take twice as long as usual."""
    said, total = run(USUAL | {FOLLOWING: 1.0, SECOND_PASS: 1.5}, people=2)
    after = [(gone, left) for name, gone, left in said if name == FOLLOWING][50:]
    assert max(abs(gone + left - total) / (total - gone) for gone, left in after) < 0.2


def test_large_images_are_slow_to_track_and_no_slower_to_fit():
    """Four of 1088 x 1920, of which a frame takes 2.8 times as long."""
    said, total = run(USUAL | {TRACKING: 2.8}, megapixels=8.36)
    after = [(gone, left) for name, gone, left in said if name == TRACKING][20:]
    assert max(abs(gone + left - total) / (total - gone) for gone, left in after) < 0.2


def test_a_terminal_without_columns_is_shown_the_bar(monkeypatch, capsys):
    monkeypatch.setattr("hmc.cli.run_bar._columns", lambda: 0)
    run({name: cost / 100 for name, cost in USUAL.items()}, quiet=False)
    assert "left of all" in capsys.readouterr().err


def test_nothing_is_said_before_anything_is_measured_and_nothing_is_left_at_the_end():
    said, total = run(USUAL)
    assert said[0][2] is None and said[-1][1] == total
    assert said[-1][2] < 1


def test_the_bar_names_what_is_done(capsys):
    run({name: cost / 100 for name, cost in USUAL.items()}, quiet=False)
    shown = capsys.readouterr().err
    for name in (LEARNING, TRACKING, FIRST_POSE, FOLLOWING, SECOND_PASS, VIEWS):
        assert re.search(rf"{name}: +\d+%\|.*\| \d+/100 frames, \d+:\d\d gone", shown), name
    assert re.search(r"fitting bodies, \d+:\d\d gone, about \d+:\d\d left of all", shown)
