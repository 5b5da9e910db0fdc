"""Who was followed the wrong way round, told by evidence from frames of the whole run."""

import numpy as np
import pytest

from hmc.pose.turned import TurnedSettings, followed_wrongly

SETTINGS = TurnedSettings()
FRAMES = list(range(100, 190))


def asked(evidence, frames=None, settings=SETTINGS):
    """Who is found, and which frames were asked of each person, by evidence ``evidence(person, frame)``."""
    people = frames or dict.fromkeys(range(3), FRAMES)
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
    mean = {0: -0.5, 1: 0.25, 2: 0.0}
    found, seen = asked(lambda person, frame: mean[person] + rng.normal(0, 0.15))
    assert found == {1}
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
    assert found == {1}


def test_frames_that_show_too_little_say_nothing():
    found, _ = asked(lambda person, frame: None if person == 0 or frame % 2 else 0.3)
    assert 0 not in found and found <= {1, 2}
    assert asked(lambda person, frame: None)[0] == frozenset() == asked(lambda person, frame: 1.0, {0: []})[0]


@pytest.mark.parametrize("mean", [-0.3, 0.0])
def test_chance_turns_nobody(mean):
    """Of people of whom nothing tells, by frames that scatter as real ones do, hardly anybody is turned: the drift is against it."""
    rng = np.random.default_rng(1)
    turned = [len(asked(lambda person, frame: mean + rng.normal(0, 0.2))[0]) for _ in range(100)]
    assert np.sum(turned) <= 0.07 * 300
