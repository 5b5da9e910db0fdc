"""What a step keeps of a person between frames: the same whoever shares the work, and no more views than are needed."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from hmc.body.joints import N_DOF
from hmc.body.proportions import default_body
from hmc.pose.legs import LegSettings
from hmc.pose.method import Alternatives, Capture, PoseMethod, StartPose, StepInfo, Tracked, make_subject
from hmc.pose.person import TOGETHER, PersonState, PersonTrack, PoseTask, person_step
from hmc.pose.views.person_view import PersonView
from hmc.processes import may_fork

N_FRAMES, FPS = 80, 20.0
TRACK = PersonTrack(3, np.arange(10, 10 + N_FRAMES), np.zeros((N_FRAMES, 3)))
SUBJECT = make_subject(default_body(1.8), Capture())


def step(rng, tracked, view):
    """A pose that goes its own way."""
    state = np.clip(tracked.state + rng.normal(0, 0.02, N_DOF), SUBJECT.body.limits.low, SUBJECT.body.limits.high)
    return Tracked(tracked.subject, state, state - tracked.state), StepInfo("fitted", cost=float(rng.random()))


def alternatives(rng, stepped, view):
    """A pose beside it, by the numbers that come after those of the step."""
    tracked, info = stepped
    other = tracked.state + rng.normal(0, 0.5, N_DOF)
    return Alternatives(np.stack([tracked.state, other]), np.array([info.cost, rng.random()]))


METHOD = PoseMethod(
    "made up",
    "tests",
    start=lambda frame_rng, views, capture, height_m: StartPose(SUBJECT, 2, np.zeros(N_DOF)),
    step=step,
    alternatives=alternatives,
    legs=LegSettings(lag_s=1.0, jump_weight=1e-9),
)


def followed(method: PoseMethod, workers: int):
    """All that is decided, and how many views are held after each frame."""
    task, state, decided, held = PoseTask(method, Capture(FPS, workers=workers), seed=1), PersonState(), [], []
    for frame in TRACK.frames.tolist():
        state, rows = person_step(task, TRACK, state, PersonView(frame))
        decided += rows
        held.append(len(state.watched) + sum(row.find_from is not None for row in state.followed))
    return decided, held, task


@pytest.mark.skipif(not may_fork(), reason="processes are forked on Linux alone")
def test_alternatives_that_are_found_together_are_those_found_one_by_one():
    alone, _, _ = followed(METHOD, 1)
    shared, _, _ = followed(METHOD, 3)
    assert [one.frames for one in alone] == [one.frames for one in shared]
    assert_array_equal(np.concatenate([one.frames for one in alone]), TRACK.frames)
    for one, other in zip(alone, shared, strict=True):
        assert_array_equal(one.states, other.states)
        assert [info.cost for info in one.infos] == [info.cost for info in other.infos]


def test_the_alternative_that_costs_less_is_decided_with_the_numbers_after_the_step():
    """Jumps cost next to nothing here: each frame's cheaper pose is the answer."""
    decided, _, task = followed(METHOD, 2)
    states = dict(zip(TRACK.frames.tolist(), np.concatenate([one.states for one in decided]), strict=True))
    bare = dict(zip(TRACK.frames.tolist(), np.concatenate([one.states for one in followed(replace(METHOD, legs=None), 2)[0]]), strict=True))
    others = 0
    for frame in TRACK.frames[task.window :].tolist():
        rng = task.rng(TRACK.number, frame)
        rng.normal(0, 0.02, N_DOF)
        own = rng.random()
        other = bare[frame] + rng.normal(0, 0.5, N_DOF)
        cheaper = (1 + METHOD.legs.doubt) * rng.random() < own
        assert_array_equal(states[frame], other if cheaper else bare[frame])
        others += cheaper
    assert 0 < others < N_FRAMES - task.window


def test_views_are_held_until_alternatives_are_found_and_none_where_there_are_none():
    window = PoseTask(METHOD, Capture(FPS)).window
    for workers, most in ((1, 0), (2, TOGETHER - 1)):
        held = followed(METHOD, workers)[1]
        assert held[: window - 1] == list(range(1, window))  # who is watched
        assert max(held[window - 1 :]) == most and held[-1] == 0
    for without in (replace(METHOD, alternatives=None), replace(METHOD, alternatives=None, legs=None)):
        assert max(followed(without, 2)[1][window - 1 :]) == 0
