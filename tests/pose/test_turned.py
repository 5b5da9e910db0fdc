"""Who was followed the wrong way round, told by evidence from frames of the whole run."""

import numpy as np
import pytest

from hmc.pose.turned import Stretch, TurnedSettings, followed_wrongly, stretches

SETTINGS = TurnedSettings()
FRAMES = list(range(100, 190))


def one_way(frames):
    """Somebody who was followed without a break and without turning about."""
    return stretches(np.array(frames, int), np.zeros(len(frames)), 25.0, SETTINGS)


def asked(evidence, frames=None, settings=SETTINGS):
    """Who is found in which frames, and which were asked of each person, by evidence ``evidence(person, frame)``."""
    people = {person: one_way(of) for person, of in (frames or dict.fromkeys(range(3), FRAMES)).items()}
    seen = {person: [] for person in people}

    def evidence_in(asked):
        assert list(asked) == sorted(asked)
        for frame, persons in asked.items():
            told = {person: evidence(person, frame) for person in persons}
            for person in told:
                seen[person].append(frame)
            yield {person: value for person, value in told.items() if value is not None}

    return followed_wrongly(people, evidence_in, settings), seen


def test_the_mean_over_the_run_decides_and_who_is_surely_right_is_asked_less():
    rng = np.random.default_rng(0)
    mean = {0: -0.6, 1: 0.15, 2: -0.1}
    found, seen = asked(lambda person, frame: mean[person] + rng.normal(0, 0.15))
    assert found == {1: FRAMES}
    assert len(seen[0]) == SETTINGS.first and len(seen[1]) == len(seen[2]) == SETTINGS.frames
    assert min(seen[1]) == FRAMES[0] and max(seen[1]) == FRAMES[-1] and len(set(seen[1])) == SETTINGS.frames


def test_each_is_asked_of_its_own_frames_alone():
    people = {0: list(range(50)), 1: list(range(30, 90))}
    _, seen = asked(lambda person, frame: 0.0, people)
    assert all(len(seen[person]) == SETTINGS.frames and set(seen[person]) <= set(frames) for person, frames in people.items())


def test_a_single_frame_decides_nothing_however_sure_it_is():
    found, _ = asked(lambda person, frame: 3.0 if frame == FRAMES[0] else -0.4)
    assert not found
    found, _ = asked(lambda person, frame: 0.9, {0: FRAMES[:3], 1: FRAMES[:4]})
    assert found == {1: FRAMES[:4]}


def test_frames_that_show_too_little_say_nothing():
    found, _ = asked(lambda person, frame: None if person == 0 or frame % 2 else 0.2)
    assert found == {1: FRAMES, 2: FRAMES}
    assert asked(lambda person, frame: None)[0] == {} == asked(lambda person, frame: 1.0, {0: []})[0]


@pytest.mark.parametrize("mean", [-0.4, -0.1])
def test_chance_turns_nobody(mean):
    """Of people of whom nothing tells, by frames that scatter as real ones do, hardly anybody is turned: the drift is against it."""
    rng = np.random.default_rng(1)
    turned = [len(asked(lambda person, frame: mean + rng.normal(0, 0.2))[0]) for _ in range(100)]
    assert np.sum(turned) <= 0.07 * 300


def followed_about(turns, n=90, gaps=(), seed=0):
    """Frames (without `gaps`) and headings of somebody who walks in a curve, followed the other way round from each of `turns` on."""
    rng = np.random.default_rng(seed)
    frames = np.setdiff1d(np.arange(n), gaps)
    headings = np.cumsum(rng.normal(0, 0.05, n)) + np.pi * np.isin(np.arange(n), turns).cumsum()
    return frames, headings[frames]


def test_where_a_heading_turns_about_from_one_frame_to_the_next_the_side_changes():
    (one,) = stretches(*followed_about([30, 40]), 25.0, SETTINGS)
    assert one.frames.tolist() == list(range(90))
    assert np.flatnonzero(one.sides == -1).tolist() == list(range(30, 40))


def test_who_turns_about_slowly_is_followed_the_same_way_round():
    (one,) = stretches(np.arange(90), np.linspace(0, 3 * np.pi, 90), 25.0, SETTINGS)
    assert (one.sides == 1).all()


def test_after_a_long_gap_nothing_is_known_of_the_side_before():
    first, second = stretches(*followed_about([30], gaps=range(25, 32)), 25.0, SETTINGS)
    assert first.frames[-1] == 24 and second.frames[0] == 32
    assert (first.sides == 1).all() and (second.sides == 1).all()
    (one,) = stretches(*followed_about([30], gaps=range(29, 32)), 25.0, SETTINGS)
    assert np.flatnonzero(one.sides == -1)[0] == 29 and one.frames[29] == 32


@pytest.mark.parametrize("turns", [[70], [20], [30, 50], []])
@pytest.mark.parametrize("right", [1, -1])
def test_the_frames_of_the_wrong_side_are_turned_whichever_it_is(turns, right):
    """Evidence is for the body turned about where it was followed wrongly and against it elsewhere; both follow from the headings alone."""
    rng = np.random.default_rng(5)
    frames, headings = followed_about(turns)
    wrong = set(np.flatnonzero(np.cos(headings - headings[0] - (0 if right == 1 else np.pi)) < 0).tolist())

    def evidence_in(persons):
        for frame in persons:
            yield {7: (0.3 if frame in wrong else -0.3) + rng.normal(0, 0.2)}

    found = followed_wrongly({7: stretches(frames, headings, 25.0, SETTINGS)}, evidence_in, SETTINGS)
    assert set(found.get(7, ())) == wrong


def test_evidence_of_both_sides_adds_up():
    """A little for one side and a little against the other decide, where the mean over the run says nothing."""
    sides = np.where(np.arange(90) < 45, 1, -1)
    found = followed_wrongly(
        {0: [Stretch(np.arange(90), sides)]}, lambda persons: ({0: 0.1 if frame < 45 else -0.15} for frame in persons), SETTINGS
    )
    assert found == {0: list(range(45))}
