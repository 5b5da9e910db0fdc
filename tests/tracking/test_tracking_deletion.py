"""When tracks end: furniture that somebody left behind, and filters that find hardly anything (Canton 2009, section 4.2.3)."""

from dataclasses import replace

import numpy as np
import pytest
from test_tracking_naive import FPS, GRID, box, follow, line, nothing, person

from hmc.tracking.blobs import observe
from hmc.tracking.following import advance, init
from hmc.tracking.rules.gating import associate_voxels
from hmc.tracking.rules.pushed_objects import release_pushed_objects
from hmc.tracking.rules.static_objects import learn_static, without_static
from hmc.tracking.settings import FollowingSettings, LifecycleSettings
from hmc.tracking.state import PersonMemory, StaticObjects, Track, TrackerState, TrackRow
from hmc.tracking.trackers import make_tracker
from hmc.tracking.tracks import run
from hmc.tracking.update import FilterEstimate, begin_update

#: As large as a person, and seat and back alone, which are as large as a third of one.
CHAIR = box((-0.3, -0.25, 0), (0.25, 0.25, 0.8))
SEAT = box((-0.3, -0.25, 0.3), (0.25, 0.25, 0.5)) | box((-0.3, -0.25, 0), (-0.2, 0.25, 0.8))


def states(tracker, volumes):
    """The state after each frame."""
    state, rng = init(FPS), np.random.default_rng(0)
    for frame, volume in enumerate(volumes):
        state, _ = tracker.step(rng, state, frame, observe(GRID, volume))
        yield state


@pytest.mark.parametrize("name", ["naive", "particle", "sparse"])
def test_a_chair_that_somebody_left_behind_is_nobody_after_a_while(name):
    """What is as large as the person who left it may be the person, until it has not moved for long."""
    tracker = make_tracker(name, color=False if name != "naive" else None)
    lifecycle = tracker.following.lifecycle
    for chair, seconds in ((SEAT, lifecycle.unlike_s), (CHAIR, lifecycle.still_s)):
        limit = round(seconds * FPS)
        alive = [len(state.tracks) for state in states(tracker, [person(0, 0)] * 20 + [chair] * (limit + 40))]
        assert set(alive[10:20]) == {1}
        assert set(alive[20 + limit + 2 :]) == {0}


def test_a_person_who_sits_down_or_bends_stays():
    seated = box((-0.2, -0.2, 0), (0.2, 0.2, 1.25)) | box((-0.2, -0.2, 0), (0.5, 0.2, 0.55))
    bent = box((-0.2, -0.2, 0), (0.2, 0.2, 0.9)) | box((-0.2, -0.2, 0.7), (0.6, 0.2, 0.95))
    for shape in (seated, bent):
        table = follow([person(0, 0)] * 20 + [shape] * 100)
        assert set(table.persons) == {0} and len(table.frames) == 120


def followed_with(efficiency, n=40):
    """Numbers of the tracks after n frames in which a filter that sees the person works so well."""
    settings = FollowingSettings(lifecycle=LifecycleSettings(efficiency_s=0.5))
    state = init(FPS)

    def filter(state, predicted, observation):
        k = len(state.tracks)
        memories = tuple(PersonMemory(track.person, {"points": np.zeros((1, 3))}) for track in state.tracks)
        return FilterEstimate(predicted, np.ones(k, bool), memories, efficiency=np.full(k, efficiency))

    for frame in range(n):
        state, _ = advance(state, frame, observe(GRID, person(0, 0)), settings, filter)
    return [track.person for track in state.tracks]


def test_a_track_whose_filter_hardly_finds_anything_ends():
    assert followed_with(0.5) == [0]
    assert 0 not in followed_with(0.01)


@pytest.mark.parametrize("name", ["particle", "sparse"])
@pytest.mark.parametrize("size", [20, 1000])
def test_filters_work_well_on_people_and_not_at_all_on_nothing(name, size):
    tracker = make_tracker(name, color=False, particles=size)
    # Nothing else may end the track: not the missing voxels, and not the verdict.
    lifecycle = replace(tracker.following.lifecycle, patience_s=100.0, unlike_s=100.0)
    following = replace(tracker.following, lifecycle=lifecycle)
    tracker = tracker.method.tracker(replace(tracker.settings, following=following))
    path = [person(*place) for place in line((-0.8, 0), (0.8, 0), 30)]
    alive = [len(state.tracks) for state in states(tracker, path + [nothing()] * 40)]
    assert set(alive[10:30]) == {1}
    assert alive[-1] == 0


def test_where_a_thing_was_taken_for_a_person_nothing_begins_while_it_stands_there():
    """The whole of the thing does not look like a person, but its strict hull does, so that it would begin a track again and again."""
    settings = FollowingSettings()
    thing, sure = box((-0.75, -0.7, 0), (0.75, 0.7, 1.05)), box((-0.2, -0.2, 0), (0.2, 0.2, 1.05))
    seen = [observe(GRID, person(0, 0))] * 20 + [observe(GRID, thing, sure)] * 150
    seen += [observe(GRID, nothing())] * 5 + [observe(GRID, person(0, 0))] * 20
    state, persons = init(FPS), []
    for frame, observation in enumerate(seen):
        state, info = advance(state, frame, observation, settings)
        persons.append([row.person for row in info.rows if row.frame == frame])
    assert persons[10:20] == [[0]] * 10
    assert persons[20:170] == [[]] * 150
    assert [person for [person] in persons[180:]] == [1] * 15


LYING = box((-0.9, -0.25, 0), (0.9, 0.25, 0.35))


@pytest.mark.parametrize("name", ["naive", "particle", "sparse"])
def test_a_person_who_lies_down_and_gets_up_again_keeps_the_number(name):
    tracker = make_tracker(name, color=False if name != "naive" else None)
    path = [person(*place) for place in line((-0.8, 0), (0, 0), 80)]
    down = round(10 * FPS)
    volumes = path + [LYING] * down + [person(*place) for place in line((0, 0), (0.8, 0), 60)]
    table = run(((frame, observe(GRID, volume)) for frame, volume in enumerate(volumes)), FPS, tracker)
    assert set(table.persons) == {0}
    assert list(table.frames) == list(range(len(volumes)))


@pytest.mark.parametrize("name", ["naive", "particle", "sparse"])
def test_who_goes_down_as_soon_as_they_are_seen_is_the_same_body(name):
    """As large as before, though unlike a person; what is left of a third of it is not."""
    tracker = make_tracker(name, color=False if name != "naive" else None)
    crouching, third = box((-0.35, -0.35, 0), (0.35, 0.35, 0.5)), box((-0.35, -0.35, 0), (0.35, 0.35, 0.2))
    seen = [person(0, 0)] * round(1.5 * FPS)
    for low, stays in ((crouching, True), (third, False)):
        volumes = seen + [low] * round(5 * FPS)
        table = run(((frame, observe(GRID, volume)) for frame, volume in enumerate(volumes)), FPS, tracker)
        assert list(table.frames) == list(range(len(volumes) if stays else len(seen)))


@pytest.mark.parametrize("name", ["naive", "particle", "sparse"])
def test_who_lies_from_the_first_frame_on_is_found_and_a_table_is_not(name):
    tracker = make_tracker(name, color=False if name != "naive" else None)
    lying, on_a_table = (box((-0.85, -0.25, low), (0.85, 0.25, low + 0.3)) for low in (0.0, 0.6))
    table_top = box((-0.75, -0.4, 0.65), (0.75, 0.4, 0.75))
    for volume, persons in ((lying, {0}), (on_a_table, {0}), (table_top, set())):
        table = run(((frame, observe(GRID, volume)) for frame in range(round(4 * FPS))), FPS, tracker)
        assert set(table.persons) == persons


def test_where_an_established_person_lies_is_told_before_they_get_up():
    tracker = make_tracker("naive")
    volumes = [person(0, 0)] * 80 + [LYING] * 100
    state, last = init(FPS), []
    for frame, volume in enumerate(volumes):
        state, info = tracker.step(np.random.default_rng(0), state, frame, observe(GRID, volume))
        last += [row.frame for row in info.rows]
    assert max(last) >= 180 - round(tracker.following.lifecycle.unlike_s * FPS) - 1


@pytest.mark.parametrize("name", ["naive", "particle", "sparse"])
def test_who_gets_up_from_a_chair_that_stays_keeps_the_number_and_the_chair_is_nobody(name):
    tracker = make_tracker(name, color=False if name != "naive" else None)
    chair = box((-0.35, -0.25, 0), (0.15, 0.25, 0.8))
    walk_in = [person(*place) for place in line((1.8, 0), (0.25, 0), 80)]
    seated = [box((-0.2, -0.2, 0.4), (0.2, 0.2, 1.3)) | box((0.1, -0.2, 0), (0.5, 0.2, 0.55)) | chair] * 80
    up = [person(*place) | chair for place in line((0.3, 0), (1.8, 0.5), 60)] + [person(1.8, 0.5) | chair] * 60
    volumes = [*walk_in, *seated, *up]
    table = run(((frame, observe(GRID, volume)) for frame, volume in enumerate(volumes)), FPS, tracker)
    assert set(table.persons) == {0}
    late = table.frames >= len(volumes) - 80
    assert late.sum() == 80
    assert np.abs(table.positions[late, :2] - (1.8, 0.5)).max() < 0.7


def test_a_chair_that_was_pushed_and_left_takes_nobody_over():
    """It stands where nobody is, and then somebody who was there before walks past it, touching it."""
    chair = box((0.3, -0.5, 0), (1.1, 0.3, 1.05))
    path = line((-1.8, 0.6), (1.8, 0.6), 60) + line((1.8, 0.6), (-1.8, 0.6), 60)
    volumes = [person(-1.8, 0.6)] * 40 + [person(-1.8, 0.6) | chair] * 40 + [person(*place) | chair for place in path]
    table = follow(volumes)
    assert set(table.persons) == {0}
    truth = [np.array([-1.8, 0.6])] * 80 + path
    assert max(np.hypot(*(position[:2] - truth[frame])) for frame, position in zip(table.frames, table.positions, strict=True)) < 0.1


def learnt(observation, people, n, static=None, fps=10.0):
    """What is known after n frames with people [(x, y, height of the head)]."""
    static = StaticObjects() if static is None else static
    rows = [TrackRow(0, -1, np.array([x, y, 0.6 * z]), np.array([x, y, z])) for x, y, z in people]
    for _ in range(n):
        static = learn_static(static, observation, rows, fps)
    return static


def test_standing_furniture_is_nobody_s_and_is_forgotten_when_it_goes():
    chair, fps = observe(GRID, CHAIR), 10.0
    static = learnt(chair, [(1.5, 0, 1.6)], 6)
    both = observe(GRID, CHAIR | person(1.5, 0))
    rest, kept = without_static(both, static, fps)
    assert np.array_equal(rest.points, both.points[kept]) and np.array_equal(kept, both.points[:, 0] > 0.5)
    static = learnt(observe(GRID, nothing()), [], 3, static)
    assert without_static(both, static, fps)[1].all()
    assert len(learnt(chair, [(0, 0, 0.7)], 20).voxels) == 0


def test_a_chair_beside_somebody_who_stands_is_known_though_their_centroid_is_near():
    chair = observe(GRID, box((0.4, -0.2, 0), (0.8, 0.2, 0.8)))
    static = learnt(chair, [(0, 0, 1.6)], 8)
    assert len(static.voxels) == len(chair.points)
    legs = observe(GRID, box((-0.3, -0.15, 0), (0.3, 0.15, 0.9)) | box((-0.9, -0.1, 1.2), (0.9, 0.1, 1.4)))
    assert len(learnt(legs, [(0, 0, 1.6)], 20).voxels) == np.count_nonzero(np.abs(legs.points[:, 0]) > 0.5)  # arms held out for 2 s
    assert len(learnt(chair, [(0.1, 0, 0.9)], 20).voxels) < len(chair.points)  # the feet of somebody who sits


def test_what_somebody_who_stands_pushes_is_released_and_their_own_voxels_are_not():
    pushed = box((0.25, -0.3, 0), (1.1, 0.3, 0.8))
    observation = observe(GRID, person(0, 0) | pushed)
    track = Track(0, np.array([0, 0, 0.87]), np.array([0, 0, 1.65]), np.zeros(3), 0.1, 0, 0)
    update = begin_update(TrackerState(FPS, (track,)), 1, observation, None)
    for rule in (associate_voxels, release_pushed_objects):
        update = rule(update, FollowingSettings())
    far = observation.points[:, 0] > 0.6
    assert (update.owners[far] == -1).all() and (update.owners[observation.points[:, 0] < 0.25] == 0).all()
    assert (update.claimed[update.pushed >= 0] == 0).all() and (update.pushed >= 0).sum() > 100
    low = replace(update, observation=observe(GRID, box((-0.3, -0.25, 0), (1.1, 0.25, 0.8))))  # nobody stands here: nothing is released
    low = release_pushed_objects(replace(low, owners=np.zeros(len(low.observation.points), int)), FollowingSettings())
    assert (low.owners == 0).all()


def test_what_not_all_cameras_see_is_no_furniture():
    """The tolerant hull of four cameras fills a part of the room for long; whoever walks into it is there."""
    fat = box((0.4, -0.7, 0), (1.8, 0.7, 1.6))
    path = [np.array([-1.0, 0.0])] * 30 + line((-1.0, 0), (1.2, 0), 40) + [np.array([1.2, 0.0])] * 20
    state, seen = init(FPS), []
    for frame, place in enumerate(path):
        state, info = advance(state, frame, observe(GRID, person(*place) | fat, person(*place)), FollowingSettings())
        seen += [(row.frame, row.person) for row in info.rows]
    assert sorted(seen) == [(frame, 0) for frame in range(len(path))]
    kept = without_static(observe(GRID, person(1.2, 0) | fat, person(1.2, 0)), state.static, FPS)[0]
    assert kept.certain.sum() == person(1.2, 0).sum()
