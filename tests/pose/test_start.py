"""A person's first seconds on rendered people: heading, stature, poses; and windows that tell little or nothing."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose, assert_array_equal
from posed import COST, capture_of, mean_error, subject_of, true_state, view_of, views_of_act

from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel
from hmc.pose.method import Capture, StartPose, StepInfo, begin_tracking
from hmc.pose.methods.annealed import annealed_method
from hmc.pose.starts.candidates import StartSettings
from hmc.pose.starts.stature import estimate_height, possible_heights
from hmc.pose.starts.walk import walk
from hmc.pose.starts.window import WindowStart
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.presets import PRESETS
from hmc.search.filters import AnnealedSettings

FEW = AnnealedSettings(layers=2, particles=50, survival_rate=0.1, spread=0.5)
LEAN = replace(PRESETS["default"], symmetric=COST, annealed=FEW, search=SearchSettings(draws=80))
CANTON = replace(PRESETS["canton2009"], annealed=AnnealedSettings(layers=2, particles=60))
QUICK, LEAST = StartSettings(anchors=2, candidates=4), StartSettings(anchors=1, candidates=2)


@dataclass(frozen=True)
class Begun:
    """What came of a window: the start, the person's body, and the pose in every frame."""

    started: StartPose
    body: BodyModel
    states: np.ndarray
    infos: list[StepInfo]


def start_person(rng, preset, views, capture, height_m=None, settings=None) -> Begun | None:
    """A start, and the window followed from it with the preset's own step, as the driver does."""
    started = WindowStart(preset, settings or StartSettings())(rng, views, capture, height_m)
    if started is None:
        return None
    method = annealed_method(preset)
    subject = method.equip(started.subject.body, capture)
    path = walk(rng, method.step, begin_tracking(subject, started.state), started.anchor, views)
    return Begun(started, subject.body, np.array([tracked.state for tracked, _ in path]), [info for _, info in path])


def start_of(acted, seed=0, preset=None, settings=QUICK, **more) -> Begun:
    """The start of an actor."""
    return start_person(rng_of(seed), preset or LEAN, views_of_act(acted), capture_of(acted), settings=settings, **more)


def errors_of(acted, begun) -> np.ndarray:
    """Mean error of the landmarks, metres, frame by frame."""
    return np.array([mean_error(one, truth) for one, truth in zip(landmarks(begun.body, begun.states), acted.landmarks, strict=True)])


def rng_of(seed: int):
    return lambda frame: np.random.default_rng([seed, frame])


def turn(one: float, other: float) -> float:
    """Angle between two headings, degrees."""
    return float(np.degrees(np.abs(np.angle(np.exp(1j * (one - other))))))


@pytest.fixture(scope="module")
def walker():
    """A walker's first half second, started."""
    acted = act("walk", frames=8)
    return acted, start_of(acted)


def test_a_walker_is_found_facing_ahead(walker):
    acted, begun = walker
    assert max(turn(heading, acted.heading) for heading in begun.states[:, 3]) < 45
    assert errors_of(acted, begun).mean() < 0.10


def test_every_frame_of_the_window_has_a_state_within_the_limits(walker):
    acted, begun = walker
    assert len(begun.states) == len(begun.infos) == len(acted.targets)
    limits = begun.body.limits
    assert np.all((begun.states >= limits.low) & (begun.states <= limits.high))
    assert all(info.status == "fitted" and info.cost > 0 for info in begun.infos)
    costs = begun.started.costs
    assert np.all(np.diff(costs) >= 0) and 1 <= len(costs) <= QUICK.candidates


def test_candidates_that_fall_behind_are_given_up_and_the_winner_is_the_same():
    acted = act("walk", frames=12)
    views = views_of_act(acted)
    settings = replace(QUICK, trials_s=(0.07,), follow_s=0.2, same_m=0.0)
    few, all_of_them = (
        start_person(rng_of(1), LEAN, views, capture_of(acted), settings=replace(settings, behind=behind)).started for behind in (1.0, 1e6)
    )
    assert len(few.costs) == 1 < len(all_of_them.costs)
    assert_array_equal(few.state, all_of_them.state)
    assert few.costs[0] == all_of_them.costs[0]


def test_of_candidates_on_the_same_way_the_cheapest_alone_goes_on():
    acted = act("walk", frames=12)
    views = views_of_act(acted)
    settings = replace(QUICK, trials_s=(0.07,), follow_s=0.2, behind=1e6)
    each, one = (
        start_person(rng_of(1), LEAN, views, capture_of(acted), settings=replace(settings, same_m=same)).started for same in (0.0, 10.0)
    )
    assert len(one.costs) == 1 < len(each.costs)
    assert one.costs[0] in each.costs


def test_the_same_seed_gives_the_same_start():
    acted = act("walk")
    views = views_of_act(acted)[:2]
    one, same, other = (start_person(rng_of(seed), LEAN, views, capture_of(acted), settings=LEAST) for seed in (5, 5, 6))
    assert_array_equal(one.states, same.states)
    assert np.abs(one.states[1] - other.states[1]).max() > 1e-6


def test_a_fast_recording_is_decided_from_some_frames_and_followed_in_all():
    acted = act("walk", frames=9, fps=90)
    looked_at = []

    def rng(frame):
        looked_at.append(frame)
        return np.random.default_rng([2, frame])

    begun = start_person(rng, LEAN, views_of_act(acted), capture_of(acted), settings=LEAST)
    assert len(begun.states) == len(begun.infos) == 9
    first_of_all = next(k for k, frame in enumerate(looked_at) if frame % 3)
    assert set(looked_at[: first_of_all - 1]) <= {0, 3, 6} and set(looked_at) == set(range(9))
    # Whoever goes on from it does so at the recording's own frame rate.
    assert begun.started.subject.capture.fps == 90
    assert errors_of(acted, begun).mean() < 0.12


def test_somebody_who_stands_still_is_found(heading_deg=-100):
    acted = act("gesture", frames=4, heading_deg=heading_deg)
    begun = start_of(acted, 1)
    assert turn(begun.states[-1, 3], acted.heading) < 45
    assert errors_of(acted, begun).mean() < 0.10


def test_the_thesis_start_faces_where_the_walk_goes():
    """Canton (2009), section 6.3.3: root at the tracked place, heading of the walk."""
    acted = act("walk")
    velocities = np.tile([0.6, -0.8, 0.0], (len(acted.targets), 1))
    still = replace(CANTON, drift_scale=1e-6)
    begun = start_person(rng_of(0), still, views_of_act(acted, velocities), capture_of(acted), 1.78)
    state = begun.states[0]
    assert turn(state[3], np.arctan2(-0.8, 0.6)) < 1
    assert_allclose(state[:2], acted.targets[0].surface.mean(0)[:2], atol=0.02)
    assert abs(landmarks(begun.body, state)[[11, 14], 2].min()) < 0.05
    assert begun.body.height_m == pytest.approx(1.78)


def test_a_given_stature_wins():
    acted = act("walk")
    plain = replace(LEAN, fit_body=None, start="neutral")
    begun = start_person(rng_of(0), plain, views_of_act(acted)[:2], capture_of(acted), 1.5)
    assert begun.body.height_m == 1.5


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
@pytest.mark.slow
def test_a_child_who_stands_is_no_adult_who_bends(height):
    acted = act("gesture", frames=4, height_m=height)
    begun = start_of(acted, 1)
    assert begun.body.height_m == pytest.approx(height, rel=0.1)
    assert errors_of(acted, begun).mean() < 0.10


@pytest.mark.slow
def test_an_adult_who_sits_is_no_child():
    acted = act("seated", frames=4)
    assert len(possible_heights(acted.targets)) == 2
    assert start_of(acted, 1).body.height_m == pytest.approx(1.7, rel=0.1)


@pytest.mark.slow
def test_who_is_small_and_sits_is_no_mean_adult():
    acted = act("seated", frames=4, height_m=1.46)
    begun = start_of(acted, 1)
    assert begun.body.height_m == pytest.approx(1.46, rel=0.06)
    assert errors_of(acted, begun).mean() < 0.04


@pytest.mark.slow
def test_who_stood_before_sitting_down_was_as_tall_as_that():
    stood, sat = act("stand", frames=2, height_m=1.35), act("seated", frames=8, height_m=1.35)
    both = replace(
        sat,
        targets=[*stood.targets, *sat.targets],
        landmarks=np.concatenate([stood.landmarks, sat.landmarks]),
        velocities=np.concatenate([stood.velocities, sat.velocities]),
    )
    begun = start_of(both)
    assert begun.body.height_m == pytest.approx(1.35, rel=0.05)
    assert errors_of(both, begun).mean() < 0.025


def test_without_any_hull_there_is_no_start():
    acted = act("walk")
    noise = replace(acted.targets[0], surface=acted.targets[0].surface[:10])
    for targets in ([], [None] * 5, [noise, None, noise]):
        assert WindowStart(LEAN)(rng_of(0), [view_of(target) for target in targets], Capture(25.0)) is None


@pytest.mark.parametrize(("preset", "fps"), [(LEAN, 5.0), (CANTON, 5.0), (CANTON, 120.0)])
def test_short_windows_with_gaps(preset, fps):
    """One frame with a hull among some without: the others keep its pose."""
    acted = act("walk")
    capture = replace(capture_of(acted), fps=fps)
    views = [view_of(None), view_of(acted.targets[1]), view_of(None)]
    begun = start_person(rng_of(0), preset, views, capture, settings=LEAST)
    assert [info.status == "fitted" for info in begun.infos] == [False, True, False]
    for k in (0, 2):
        assert_array_equal(begun.states[k], begun.states[1])
    alone = start_person(rng_of(0), preset, views[1:2], capture, settings=LEAST)
    assert len(alone.states) == 1 and np.isfinite(alone.states).all()


def test_following_visits_every_frame_once_from_the_anchor_outwards():
    acted = act("walk")
    subject, views, visited = subject_of(acted, LEAN), views_of_act(acted), []

    def step(rng, tracked, view):
        visited.append(view.frame)
        return replace(tracked, state=tracked.state + 0.1, velocity=np.full(N_DOF, 0.1)), StepInfo(cost=view.frame)

    start = true_state(subject.body, acted, 3)
    path = walk(rng_of(0), step, begin_tracking(subject, start), 3, views)
    assert visited == [3, 4, 5, 6, 7, 2, 1, 0] and [info.cost for _, info in path] == list(range(8))
    distance = [round((tracked.state - start)[5] / 0.1) for tracked, _ in path]
    assert distance == [4, 3, 2, 1, 2, 3, 4, 5]


def test_both_ways_from_the_anchor_begin_at_rest_and_with_what_it_remembers():
    subject, given = subject_of(act("walk"), LEAN), {}

    def step(rng, tracked, view):
        given[view.frame] = tracked
        memory = {"visited": np.append(tracked.memory["visited"], view.frame)}
        return replace(tracked, velocity=np.ones(N_DOF), memory=memory), StepInfo()

    start = begin_tracking(subject, np.zeros(N_DOF), np.ones(N_DOF), {"visited": np.array([-1])})
    walk(rng_of(0), step, start, 1, [view_of(None, frame=k) for k in range(4)])
    assert given[1].velocity.all() and given[3].velocity.all()
    assert not given[0].velocity.any() and not given[2].velocity.any()
    assert [given[k].memory["visited"].tolist() for k in range(4)] == [[-1, 1], [-1], [-1, 1], [-1, 1, 2]]
