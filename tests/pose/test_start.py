"""A person's first seconds on rendered people: heading, stature, poses; and windows that tell little or nothing."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose, assert_array_equal
from posed import COST, body_of, mean_error, true_state

from hmc.body.kinematics import landmarks
from hmc.pose.starts.window import StartSettings, estimate_height, follow, possible_heights, start_person
from hmc.pose.steps.annealed import make_filter
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.presets import PRESETS
from hmc.search.filters import AnnealedSettings

FEW = AnnealedSettings(layers=2, particles=50, survival_rate=0.1, spread=0.5)
LEAN = replace(PRESETS["default"], symmetric=COST, annealed=FEW, search=SearchSettings(draws=80))
CANTON = replace(PRESETS["canton2009"], annealed=AnnealedSettings(layers=2, particles=60))
ROOM = np.array([[-1.6, -1.6, 0.0], [1.6, 1.6, 2.3]])
QUICK, LEAST = StartSettings(anchors=2, candidates=4), StartSettings(anchors=1, candidates=2)


def rng_of(seed: int):
    return lambda frame: np.random.default_rng([seed, frame])


def turn(one: float, other: float) -> float:
    """Angle between two headings, degrees."""
    return float(np.degrees(np.abs(np.angle(np.exp(1j * (one - other))))))


@pytest.fixture(scope="module")
def walker():
    """A walker's first half second, started."""
    acted = act("walk", frames=8)
    return acted, start_person(rng_of(0), LEAN, acted.fps, acted.targets, None, acted.velocities, ROOM, QUICK)


def test_a_walker_is_found_facing_ahead(walker):
    acted, started = walker
    headings = [state.state[3] for state in started.states]
    assert max(turn(heading, acted.heading) for heading in headings) < 45
    errors = [
        mean_error(landmarks(started.filter.body, state.state), truth) for state, truth in zip(started.states, acted.landmarks, strict=True)
    ]
    assert np.mean(errors) < 0.10


def test_every_frame_of_the_window_has_a_state_within_the_limits(walker):
    acted, started = walker
    assert len(started.states) == len(started.infos) == len(acted.targets)
    limits = started.filter.body.limits
    for state, info in zip(started.states, started.infos, strict=True):
        assert np.all((state.state >= limits.low) & (state.state <= limits.high))
        assert info.status == "fitted" and info.cost > 0
    assert np.all(np.diff(started.candidates) >= 0) and 1 <= len(started.candidates) <= QUICK.candidates


def test_the_same_seed_gives_the_same_start():
    acted = act("walk")
    one, same, other = (
        start_person(rng_of(seed), LEAN, acted.fps, acted.targets[:2], None, acted.velocities[:2], ROOM, LEAST) for seed in (5, 5, 6)
    )
    for k in range(2):
        assert_array_equal(one.states[k].state, same.states[k].state)
    assert np.abs(one.states[1].state - other.states[1].state).max() > 1e-6


def test_a_fast_recording_is_decided_from_some_frames_and_followed_in_all():
    acted = act("walk", frames=9, fps=90)
    looked_at = []

    def rng(frame):
        looked_at.append(frame)
        return np.random.default_rng([2, frame])

    started = start_person(rng, LEAN, acted.fps, acted.targets, None, acted.velocities, ROOM, LEAST)
    assert len(started.states) == len(started.infos) == 9
    first_of_all = next(k for k, frame in enumerate(looked_at) if frame % 3)
    assert set(looked_at[: first_of_all - 1]) <= {0, 3, 6} and set(looked_at) == set(range(9))
    assert_allclose(started.filter.drift, make_filter(started.filter.body, LEAN, 90).drift)
    errors = [mean_error(landmarks(started.filter.body, s.state), truth) for s, truth in zip(started.states, acted.landmarks, strict=True)]
    assert np.mean(errors) < 0.12


def test_somebody_who_stands_still_is_found(heading_deg=-100):
    acted = act("gesture", frames=4, heading_deg=heading_deg)
    started = start_person(rng_of(1), LEAN, acted.fps, acted.targets, None, acted.velocities, ROOM, QUICK)
    assert turn(started.states[-1].state[3], acted.heading) < 45
    errors = [mean_error(landmarks(started.filter.body, s.state), truth) for s, truth in zip(started.states, acted.landmarks, strict=True)]
    assert np.mean(errors) < 0.10


def test_the_thesis_start_faces_where_the_walk_goes():
    """Canton (2009), section 6.3.3: root at the tracked place, heading of the walk."""
    acted = act("walk")
    velocities = np.tile([0.6, -0.8, 0.0], (len(acted.targets), 1))
    still = replace(CANTON, drift_scale=1e-6)
    started = start_person(rng_of(0), still, acted.fps, acted.targets, 1.78, velocities, ROOM)
    state = started.states[0].state
    assert turn(state[3], np.arctan2(-0.8, 0.6)) < 1
    assert_allclose(state[:2], acted.targets[0].surface.mean(0)[:2], atol=0.02)
    assert abs(landmarks(started.filter.body, state)[[11, 14], 2].min()) < 0.05
    assert started.filter.body.height_m == pytest.approx(1.78) and started.fit is None


def test_a_given_stature_wins():
    acted = act("walk")
    plain = replace(LEAN, fit_body=None, start="neutral")
    started = start_person(rng_of(0), plain, acted.fps, acted.targets[:2], 1.5, room=ROOM)
    assert started.filter.body.height_m == 1.5


@pytest.mark.parametrize("height", [1.6, 1.78, 1.9])
def test_stature_from_the_volume(height):
    acted = act("stand", frames=4, height_m=height)
    assert estimate_height(acted.targets) == pytest.approx(height, rel=0.06)
    shifted = [replace(t, surface=t.surface + [0, 0, 0.4]) for t in acted.targets]
    assert estimate_height(shifted, 0.4) == pytest.approx(estimate_height(acted.targets))


def test_stature_where_there_is_little_to_see():
    acted = act("stand", frames=4)
    target = acted.targets[0]
    low = replace(target, surface=target.surface[target.surface[:, 2] < 0.9])
    for targets in ([], [None], [None, replace(target, surface=target.surface[:5])], [low, low]):
        assert 1.5 < estimate_height(targets) < 1.9
    # A frame without hull and one with the arms up change little.
    arms_up = replace(target, surface=target.surface * [1, 1, 1.25])
    assert estimate_height([*acted.targets, None, arms_up]) == pytest.approx(estimate_height(acted.targets), abs=0.03)


@pytest.mark.parametrize("height", [1.22, 1.38])
def test_a_child_who_stands_is_no_adult_who_bends(height):
    acted = act("gesture", frames=4, height_m=height)
    started = start_person(rng_of(1), LEAN, acted.fps, acted.targets, None, acted.velocities, ROOM, QUICK)
    assert started.filter.body.height_m == pytest.approx(height, rel=0.1)
    errors = [mean_error(landmarks(started.filter.body, s.state), truth) for s, truth in zip(started.states, acted.landmarks, strict=True)]
    assert np.mean(errors) < 0.10


def test_an_adult_who_sits_is_no_child():
    acted = act("seated", frames=4)
    assert len(possible_heights(acted.targets)) == 2
    started = start_person(rng_of(1), LEAN, acted.fps, acted.targets, None, acted.velocities, ROOM, QUICK)
    assert started.filter.body.height_m == pytest.approx(1.7, rel=0.1)


def test_without_any_hull_there_is_no_start():
    acted = act("walk")
    noise = replace(acted.targets[0], surface=acted.targets[0].surface[:10])
    for targets in ([], [None] * 5, [noise, None, noise]):
        assert start_person(rng_of(0), LEAN, 25.0, targets) is None


@pytest.mark.parametrize(("preset", "fps"), [(LEAN, 5.0), (CANTON, 5.0), (CANTON, 120.0)])
def test_short_windows_with_gaps(preset, fps):
    """One frame with a hull among some without: the others keep its pose."""
    acted = act("walk")
    started = start_person(rng_of(0), preset, fps, [None, acted.targets[1], None], room=ROOM, settings=LEAST)
    assert [info.status == "fitted" for info in started.infos] == [False, True, False]
    for k in (0, 2):
        assert_array_equal(started.states[k].state, started.states[1].state)
    alone = start_person(rng_of(0), preset, fps, [acted.targets[1]], room=ROOM, settings=LEAST)
    assert len(alone.states) == 1 and np.isfinite(alone.states[0].state).all()


def test_following_visits_every_frame_once_from_the_anchor_outwards():
    acted = act("walk")
    body, _ = body_of(acted.height_m)
    filt = make_filter(body, LEAN, acted.fps)
    visited = []

    def step(rng, given, state, target):
        visited.append(next(k for k, t in enumerate(acted.targets) if t is target))
        moved = replace(state, state=state.state + 0.1, velocity=np.full(27, 0.1))
        return moved, visited[-1]

    states, infos = follow(rng_of(0), filt, true_state(body, acted, 3), 3, acted.targets, step)
    assert visited == [3, 4, 5, 6, 7, 2, 1, 0] and infos == list(range(8))
    distance = [round((state.state - true_state(body, acted, 3))[5] / 0.1) for state in states]
    assert distance == [4, 3, 2, 1, 2, 3, 4, 5]
