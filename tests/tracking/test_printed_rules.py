"""The thesis's own life of tracks (Canton 2009, sections 4.2.3 and 4.3.1) on drawn rooms, against loops and closed forms."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from test_tracking_naive import FPS, GRID, box, errors, line, nothing, person

from hmc.errors import InputError
from hmc.tracking.blobs import observe
from hmc.tracking.following import advance, init
from hmc.tracking.region import least_radius
from hmc.tracking.rules import PRINTED, filtering, printed
from hmc.tracking.rules.printed import claim_regions
from hmc.tracking.settings import CANTON_2009, FollowingSettings, LifecycleSettings
from hmc.tracking.state import Track, TrackerState
from hmc.tracking.trackers import make_tracker
from hmc.tracking.tracks import run
from hmc.tracking.update import FilterEstimate, begin_update

NAIVE = make_tracker("naive", preset="canton2009")


def followed(volumes, tracker=NAIVE):
    return run(((frame, observe(GRID, volume)) for frame, volume in enumerate(volumes)), FPS, tracker)


def track(number, x, y, z=0.87):
    return Track(number, np.array([x, y, z]), np.zeros(3), np.zeros(3), 0.1, 0, 0)


def test_a_voxel_is_of_the_one_region_that_it_lies_in():
    """Eq. 4.4 and 4.7, against a loop."""
    observation = observe(GRID, person(-0.2, 0) | person(0.25, 0.1) | box((1.5, 1.0, 0.0), (2.0, 1.5, 1.0)))
    state = replace(init(FPS), tracks=(track(0, -0.2, 0), track(1, 0.25, 0.1)))
    owners = claim_regions(begin_update(state, 1, observation, None), CANTON_2009).owners
    for point, owner in zip(observation.points, owners, strict=True):
        inside = [k for k, one in enumerate(state.tracks) if (((point - one.position) / (0.45, 0.45, 1.2 * 0.87)) ** 2).sum() <= 1]
        assert owner == (inside[0] if len(inside) == 1 else -1)
    assert set(owners.tolist()) == {-1, 0, 1}


def test_the_naive_tracker_is_at_the_centroid_of_its_region():
    """Eq. 4.5: of a person who stands still, from the first frame on; of one who walks, less than a step behind."""
    volume = person(0.3, -0.2)
    table = followed([volume] * 3)
    assert table.persons.tolist() == [0, 0, 0]
    np.testing.assert_allclose(table.positions, np.tile(observe(GRID, volume).points.mean(axis=0), (3, 1)), atol=1e-9)
    path = line((-1.5, 0), (1.5, 0.8), 60)
    walk = followed([person(*place) for place in path])
    assert set(walk.persons) == {0} and len(walk.frames) == 60 and errors(walk, 0, path).max() < 0.03


@pytest.mark.parametrize(("name", "ticks"), [("naive", 2.0), ("particle", 1.0)])
def test_the_filters_time_is_that_of_what_finds_people(name, ticks, monkeypatch):
    """Eq. 4.33: of the naive tracker sharing out the voxels belongs to it, of the others only what they do themselves."""
    clock = count().__next__
    for module in (filtering, printed):
        monkeypatch.setattr(module, "thread_time", lambda: float(clock()))
    tracker = make_tracker(name, color=None if name == "naive" else False, preset="canton2009")
    state = replace(init(FPS), tracks=(track(0, 0, 0),), next_person=1)
    _, info = tracker.step(np.random.default_rng(0), state, 0, observe(GRID, person(0, 0)))
    assert info.filter_s == pytest.approx(ticks, abs=0.1)  # less what colors take


def test_a_region_keeps_who_is_no_faster_than_its_radius_allows():
    """Eq. 4.6, against a loop over the points of a person who is as wide as the region."""
    radius, disc = 0.3, [(x, y) for x in np.linspace(-0.3, 0.3, 61) for y in np.linspace(-0.3, 0.3, 61) if np.hypot(x, y) <= 0.3 + 1e-9]
    for fps in (10.0, 25.0):
        for speed in np.arange(0.5, 20.0, 0.5):
            touches = any((x + speed / fps) ** 2 + y**2 <= radius**2 + 1e-9 for x, y in disc)
            assert touches == (least_radius(speed, fps) <= radius + 1e-9)
    np.testing.assert_allclose(least_radius(np.array([1.0, 3.0]), 25), [0.02, 0.06])
    with pytest.raises(InputError, match="`fps` above 0"):
        least_radius(1.0, 0)


def test_furniture_begins_no_track_and_who_stands_too_close_to_another_neither():
    table = box((1.0, 0.5, 0.65), (2.2, 1.5, 0.72))
    assert len(followed([table] * 5).frames) == 0
    apart = followed([person(-1, 0) | person(1, 0)] * 3)
    assert set(apart.persons) == {0, 1}
    assert set(followed([person(-0.1, 0) | person(0.1, 0)] * 3).persons) == {0}
    state, _ = advance(init(FPS), 0, observe(GRID, person(0, 0)), CANTON_2009)
    # Two components, of which the second is nearer to the track than what is allowed.
    near = FollowingSettings(rules="canton2009", lifecycle=LifecycleSettings(least_distance_m=1.5))
    for settings, n in ((CANTON_2009, 2), (near, 1)):
        after, _ = advance(state, 1, observe(GRID, person(0, 0) | person(1.0, 0)), settings)
        assert len(after.tracks) == n


def test_of_two_tracks_in_one_place_the_older_stays():
    state = replace(init(FPS), tracks=(track(3, 0, 0), track(5, 0.1, 0)), next_person=6)
    after, _ = advance(state, 1, observe(GRID, person(0.05, 0)), CANTON_2009, filter=stay)
    assert [one.person for one in after.tracks] == [3]


def stay(state: TrackerState, predicted, observation, efficiency=1.0):
    k = len(state.tracks)
    return FilterEstimate(predicted, np.ones(k, bool), state.memories, efficiency=np.full(k, efficiency))


@pytest.mark.parametrize(("volume", "efficiency", "after_s"), [(nothing(), 1.0, 2.0), (person(0, 0), 0.01, 1.0), (person(0, 0), 0.5, None)])
def test_a_track_ends_that_is_no_person_or_whose_filter_finds_hardly_anything(volume, efficiency, after_s):
    lifecycle = LifecycleSettings(least_distance_m=9.0)  # so that no other begins in its place
    settings = replace(CANTON_2009, lifecycle=lifecycle)
    state = replace(init(FPS), tracks=(track(0, 0, 0),), next_person=1)
    alive = []
    for frame in range(60):
        state, _ = advance(state, frame, observe(GRID, volume), settings, lambda *given: stay(*given, efficiency=efficiency))
        alive.append(any(one.person == 0 for one in state.tracks))
    ended = alive.index(False) / FPS if False in alive else None
    assert ended == after_s


def test_tracks_have_no_motion_model_and_nothing_is_remembered_of_the_room():
    state = init(FPS)
    for frame, place in enumerate(line((-1, 0), (1, 0), 30)):
        state, _ = advance(state, frame, observe(GRID, person(*place) | box((1.5, 1.0, 0), (2.0, 1.5, 1.2))), CANTON_2009)
    assert all(not one.velocity.any() for one in state.tracks)
    assert not len(state.static.voxels) and not state.candidates and not state.departed and not state.false_tracks


@pytest.mark.parametrize("name", ["particle", "sparse"])
def test_filters_of_the_thesis_follow_who_walks(name):
    path = line((-1.5, 0), (1.5, 0.5), 90)  # 45 mm a frame: 1.1 m/s at the thesis's 25 frames a second
    tracker = make_tracker(name, color=False, preset="canton2009")
    table = followed([person(*place) for place in path], tracker)
    assert set(table.persons) == {0} and len(table.frames) == 90 and errors(table, 0, path).mean() < 0.2


def test_it_needs_a_tree_and_uses_no_rule_of_ours():
    with pytest.raises(InputError, match="needs a decision tree"):
        advance(
            init(FPS), 0, observe(GRID, person(0, 0)), FollowingSettings(rules="canton2009", lifecycle=LifecycleSettings(person="rules"))
        )
    assert {rule.__module__ for rule in PRINTED} == {"hmc.tracking.rules.printed"}
    with pytest.raises(ValueError, match="`rules` must be"):
        FollowingSettings(rules="none")
