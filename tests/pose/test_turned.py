"""Who was followed the wrong way round, told by evidence from frames of the whole run."""

from functools import partial
from itertools import product

import numpy as np
import pytest

from hmc.pose.turned import Stretch, TurnedSettings, followed_wrongly, stretches

SETTINGS = TurnedSettings()
FRAMES = list(range(100, 190))


def one_way(frames):
    """Somebody who was followed without a break and without turning about."""
    return stretches(np.array(frames, int), np.zeros(len(frames)), 25.0, SETTINGS)


def asked(evidence, frames=None, settings=SETTINGS, heads=None):
    """Who is found in which frames, and which were asked of each person, by evidence ``evidence(person, frame)``; with that of ``heads``,
    which were asked for it."""
    people = {person: one_way(of) for person, of in (frames or dict.fromkeys(range(3), FRAMES)).items()}
    seen, seen_heads = ({person: [] for person in people} for _ in range(2))

    def evidence_in(evidence, seen, asked):
        assert list(asked) == sorted(asked)
        for frame, persons in asked.items():
            told = {person: evidence(person, frame) for person in persons}
            for person in told:
                seen[person].append(frame)
            yield {person: value for person, value in told.items() if value is not None}

    if heads is None:
        return followed_wrongly(people, partial(evidence_in, evidence, seen), settings), seen
    found = followed_wrongly(people, partial(evidence_in, evidence, seen), settings, partial(evidence_in, heads, seen_heads))
    return found, seen_heads


def test_heads_are_asked_where_shapes_leave_it_open_and_tell_in_a_single_frame():
    frames = {0: FRAMES, 1: FRAMES, 2: FRAMES[:1], 3: FRAMES[:1], 4: []}
    mean = {0: -0.6, 1: -0.1, 2: -0.2, 3: -0.2}
    by_head = {1: 0.2, 2: 0.5, 3: 0.1}
    found, seen = asked(lambda person, frame: mean[person], frames, heads=lambda person, frame: by_head[person])
    assert found == {1: FRAMES, 2: FRAMES[:1]}
    assert {person: len(of) for person, of in seen.items()} == {0: 0, 1: SETTINGS.frames, 2: 1, 3: 1, 4: 0}
    found, _ = asked(lambda person, frame: 0.1, heads=lambda person, frame: None if person else -0.3)
    assert found == {1: FRAMES, 2: FRAMES}


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


def as_lists(some):
    return [(stretch.frames.tolist(), stretch.about) for stretch in some]


def test_where_a_heading_turns_about_from_one_frame_to_the_next_another_stretch_begins():
    found = stretches(*followed_about([30, 40]), 25.0, SETTINGS)
    assert as_lists(found) == [(list(range(30)), False), (list(range(30, 40)), True), (list(range(40, 90)), True)]


def test_who_turns_about_slowly_is_followed_the_same_way_round():
    found = stretches(np.arange(90), np.linspace(0, 3 * np.pi, 90), 25.0, SETTINGS)
    assert as_lists(found) == [(list(range(90)), False)]


def test_after_a_long_gap_nothing_is_known_of_the_way_round_before():
    found = stretches(*followed_about([30], gaps=range(25, 32)), 25.0, SETTINGS)
    assert as_lists(found) == [(list(range(25)), False), (list(range(32, 90)), False)]
    found = stretches(*followed_about([30], gaps=range(29, 32)), 25.0, SETTINGS)
    assert as_lists(found) == [(list(range(29)), False), (list(range(32, 90)), True)]
    assert stretches(np.zeros(0, int), np.zeros(0), 25.0, SETTINGS) == []


def found_by(turns, evidence, gaps=(), scatter=0.2):
    """The frames found of somebody who was followed about at `turns`, by ``evidence(frame)`` and chance."""
    rng = np.random.default_rng(5)
    parts = stretches(*followed_about(turns, gaps=gaps), 25.0, SETTINGS)
    told = followed_wrongly({7: parts}, lambda persons: ({7: evidence(frame) + rng.normal(0, scatter)} for frame in persons), SETTINGS)
    return set(told.get(7, ()))


@pytest.mark.parametrize("turns", [[70], [20], [30, 50], []])
@pytest.mark.parametrize("right", [1, -1])
def test_the_frames_of_the_wrong_side_are_turned_whichever_it_is(turns, right):
    """Evidence is for the body turned about where it was followed wrongly and against it elsewhere; both follow from the headings alone."""
    _, headings = followed_about(turns)
    wrong = set(np.flatnonzero(np.cos(headings - headings[0] - (0 if right == 1 else np.pi)) < 0).tolist())
    assert found_by(turns, lambda frame: 0.3 if frame in wrong else -0.3) == wrong


def test_a_little_evidence_of_each_side_adds_up():
    assert found_by([45], lambda frame: 0.02 if frame < 45 else -0.07, scatter=0) == set(range(45))
    assert found_by([45], lambda frame: -0.02 if frame < 45 else 0.01, scatter=0) == set(range(45, 90))


def test_much_evidence_against_it_overrules_that_nobody_turns_about_in_a_frame():
    """A pose that came round within some frames and jumped back is right on both sides of the jump."""
    assert found_by([60], lambda frame: -0.3) == set()
    assert found_by([60], lambda frame: 0.3) == set(range(90))


def test_a_stretch_too_short_to_tell_is_as_its_neighbors_have_it():
    assert found_by([50, 53], lambda frame: -0.3) == {50, 51, 52}
    assert found_by([50, 53], lambda frame: 0.3) == set(range(90)) - {50, 51, 52}


def test_a_short_stretch_that_is_surely_right_tells_so():
    """As who was followed round while they were lost, and turned about again in the last frames: what is wrong there is before it."""
    assert found_by([50, 56], lambda frame: -0.6) == set()
    assert found_by([87], lambda frame: -0.6) == set()
    assert found_by([87], lambda frame: -0.2) == {87, 88, 89}


def test_the_best_way_is_that_of_all_ways():
    """Against every combination, evidence drawn at random."""
    rng, settings = np.random.default_rng(2), TurnedSettings(sure=np.inf)
    for _ in range(50):
        n = int(rng.integers(1, 7))
        parts = [Stretch(np.arange(20 * k, 20 * k + 4), bool(k and rng.random() < 0.7)) for k in range(n)]
        told = rng.normal(0, 0.3, (n, 4))
        scores = {
            ways: np.dot(ways, told.sum(axis=1)) - sum(parts[k].about and ways[k] == ways[k - 1] for k in range(1, n)) * settings.about
            for ways in product((0, 1), repeat=n)
        }
        evidence = [{0: float(one)} for one in told.ravel()]
        frames = np.concatenate([part.frames for part in parts]).tolist()
        by_frame = dict(zip(frames, evidence, strict=True))
        found = followed_wrongly({0: parts}, partial(map, by_frame.get), settings).get(0, [])
        best = max(scores, key=scores.get)
        assert found == [frame for part, way in zip(parts, best, strict=True) if way for frame in part.frames]
