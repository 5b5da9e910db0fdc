"""The naive tracker on drawn rooms: ellipsoid people whose true centroids are known."""

from dataclasses import replace

import numpy as np
import pytest

from hmc.io.results import TrackTable
from hmc.tracking.association import assign_voxels
from hmc.tracking.blobs import observe
from hmc.tracking.columns import bodies_at, find_columns
from hmc.tracking.following import advance, finish, init
from hmc.tracking.naive import NaiveSettings
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.trackers import TRACKERS
from hmc.tracking.tracks import fill_gaps, from_rows, person_voxels, run, velocities
from hmc.tracking.update import FilterEstimate
from hmc.voxels.grid import VoxelGrid

GRID = VoxelGrid(np.array([-2.5, -2.0, 0.0]), 0.05, (100, 80, 48))
CENTRES = GRID.centres()
FPS = 20.0


def person(x, y, height=1.75, radius=0.24):
    """Voxels of an upright ellipsoid that stands on the floor at (x, y)."""
    xs, ys, zs = (CENTRES[:, 0, 0, 0], CENTRES[0, :, 0, 1], CENTRES[0, 0, :, 2])
    across = ((xs - x) / radius)[:, None] ** 2 + ((ys - y) / radius)[None] ** 2
    return across[..., None] + ((zs - height / 2) / (height / 2)) ** 2 <= 1


def box(lowest, highest):
    return np.all((CENTRES >= lowest) & (CENTRES <= highest), axis=-1)


def follow(volumes, settings=None):
    return run(
        ((frame, None if volume is None else observe(GRID, volume)) for frame, volume in enumerate(volumes)),
        FPS,
        TRACKERS["naive"].tracker(NaiveSettings(settings or FollowingSettings())),
    )


def step(state, frame, observation):
    return advance(state, frame, observation, FollowingSettings())


def nothing():
    return np.zeros(GRID.shape, bool)


def line(start, end, n):
    return [np.add(start, np.subtract(end, start) * t) for t in np.linspace(0, 1, n)]


def errors(table, number, truth):
    """Horizontal distance of one person's rows to the true path, a list over frames."""
    rows = table.persons == number
    return np.array(
        [np.hypot(*(position[:2] - truth[frame])) for frame, position in zip(table.frames[rows], table.positions[rows], strict=True)]
    )


def test_a_walker_is_one_person_from_the_first_frame():
    path = line((-1.5, -1), (1.5, 1), 60)
    table = follow([person(*p) for p in path])
    assert set(table.persons) == {0}
    assert list(table.frames) == list(range(60))
    assert errors(table, 0, path).max() < 0.03
    assert np.abs(table.positions[:, 2] - 0.875).max() < 0.03
    cap = 0.2 / 0.875  # the head is the ellipsoid's cap of 20 cm, whose centroid is known
    assert np.abs(table.heads[:, 2] - 0.875 * (1 + 3 * (2 - cap) ** 2 / (4 * (3 - cap)))).max() < 0.05


def test_empty_frames_and_rooms_are_ordinary():
    assert len(follow([nothing()] * 10).frames) == 0
    assert len(run([], FPS).frames) == 0
    state, info = step(init(FPS), 0, observe(GRID, nothing()))
    assert state.tracks == () and info.rows == () and len(info.owners) == 0


def test_two_who_cross_side_by_side_keep_their_numbers():
    a, b = line((-1.8, -0.22), (1.8, -0.22), 60), line((1.8, 0.22), (-1.8, 0.22), 60)
    table = follow([person(*p) | person(*q) for p, q in zip(a, b, strict=True)])
    assert set(table.persons) == {0, 1}
    first = errors(table, 0, a) if errors(table, 0, a).max() < errors(table, 0, b).max() else errors(table, 0, b)
    second = errors(table, 1, b) if errors(table, 1, b).max() < errors(table, 1, a).max() else errors(table, 1, a)
    assert first.max() < 0.12 and second.max() < 0.12
    assert len(first) == len(second) == 60


def test_two_who_meet_talk_and_part():
    n = 30
    a = line((-1.5, 0), (-0.2, 0), n) + [np.array([-0.2, 0.0])] * n + line((-0.2, 0), (-1.5, 0.5), n)
    b = line((1.5, 0), (0.2, 0), n) + [np.array([0.2, 0.0])] * n + line((0.2, 0), (1.5, 0.5), n)
    table = follow([person(*p) | person(*q) for p, q in zip(a, b, strict=True)])
    assert set(table.persons) == {0, 1}
    near_a = 0 if table.positions[0][0] < 0 else 1
    assert errors(table, near_a, a).max() < 0.15 and errors(table, 1 - near_a, b).max() < 0.15


def test_two_who_come_in_as_one_blob_become_two_persons():
    a, b = line((0, 0), (-1.5, 0), 50), line((0.35, 0), (1.8, 0), 50)
    table = follow([person(*p) | person(*q) for p, q in zip(a, b, strict=True)])
    assert set(table.persons) == {0, 1}
    assert (np.bincount(table.persons) > 25).all()


@pytest.mark.parametrize("fps", [15, 30, 60])
@pytest.mark.parametrize("blank", [False, True], ids=["not in the hull", "no hull"])
def test_who_walks_on_unseen_for_a_moment_is_the_same_at_any_rate(fps, blank):
    path = [(-1.9 + 1.5 * k / fps, 0.0) for k in range(round(2.5 * fps))]
    gone = slice(round(1.2 * fps), round(1.8 * fps))
    seen = [observe(GRID, person(*p)) for p in path]
    seen[gone] = [None if blank else observe(GRID, nothing())] * (gone.stop - gone.start)
    table = run(enumerate(seen), float(fps), TRACKERS["naive"].tracker(NaiveSettings()))
    assert set(table.persons) == {0} and table.frames.max() == len(path) - 1


def test_a_person_in_pieces_is_one_person():
    path = line((-1, 0), (1, 0), 40)
    cut = (CENTRES[..., 2] > 0.75) & (CENTRES[..., 2] < 0.9) | (CENTRES[..., 2] > 1.3) & (CENTRES[..., 2] < 1.4)
    table = follow([person(*p) & ~cut for p in path])
    assert set(table.persons) == {0}
    assert len(table.frames) == 40
    assert errors(table, 0, path).max() < 0.04


def test_a_person_who_loses_a_piece_for_some_frames_is_kept():
    path = line((-1, 0), (1, 0), 60)
    low = CENTRES[..., 2] < 0.9
    table = follow([person(*p) & ~low if 20 < i < 40 else person(*p) for i, p in enumerate(path)])
    assert set(table.persons) == {0} and len(table.frames) == 60


def test_noise_ghosts_and_furniture_are_nobody():
    rng = np.random.default_rng(0)
    chair = box((1, 1, 0), (1.45, 1.45, 0.85))
    shadow = box((-1, -1, 0), (0, 1, 0.12))
    hanging = box((-2, 1, 1.5), (-1.7, 1.3, 2.2))
    volumes = [chair | shadow | hanging | (rng.random(GRID.shape) < 0.002) for _ in range(30)]
    assert len(follow(volumes).frames) == 0


def test_a_ghost_of_two_frames_is_nobody():
    path = line((-1, 0), (1, 0), 40)
    table = follow([person(*p) | person(1.5, 1.2) if 10 <= i < 12 else person(*p) for i, p in enumerate(path)])
    assert set(table.persons) == {0}


def test_leaving_ends_the_track_and_coming_back_starts_one():
    there = [person(0, 0)] * 20
    table = follow(there + [nothing()] * 40 + there)
    assert list(table.frames) == [*range(20), *range(60, 80)]
    assert set(table.persons) == {0, 1}


def test_walking_out_of_the_room():
    path = line((0, 0), (3.2, 0), 60)
    table = follow([person(*p) for p in path] + [nothing()] * 30)
    assert set(table.persons) == {0}
    assert 45 <= table.frames.max() < 60


def test_a_gap_is_filled_on_a_straight_line():
    path = line((-1, 0), (1, 0), 60)
    table = follow([nothing() if 25 <= i < 33 else person(*p) for i, p in enumerate(path)])
    assert set(table.persons) == {0}
    assert list(table.frames) == list(range(60))
    assert errors(table, 0, path).max() < 0.05


def test_a_frame_that_tells_nothing_waits():
    path = line((-1, 0), (1, 0), 60)
    table = follow([None if 25 <= i < 29 else person(*p) for i, p in enumerate(path)])
    assert set(table.persons) == {0} and list(table.frames) == list(range(60))


def test_everything_foreground_does_not_end_or_start_anybody():
    path = line((-1, 0), (1, 0), 60)
    table = follow([np.ones(GRID.shape, bool) if 25 <= i < 28 else person(*p) for i, p in enumerate(path)])
    assert set(table.persons) == {0} and list(table.frames) == list(range(60))


def test_a_light_switch_that_fills_a_third_of_the_room_tells_nothing():
    path = line((-1, 0), (1, 0), 60)
    third = CENTRES[..., 0] > 2.5 - 5 * 0.35
    table = follow([person(*p) | third if 25 <= i < 33 else person(*p) for i, p in enumerate(path)])
    assert set(table.persons) == {0} and list(table.frames) == list(range(60))
    assert errors(table, 0, path).max() < 0.6


def test_standing_still_for_long():
    table = follow([person(0.3, 0.4)] * 200)
    assert list(table.frames) == list(range(200)) and set(table.persons) == {0}
    assert np.ptp(table.positions, axis=0).max() < 1e-9


def test_a_recording_of_two_frames_has_its_person():
    assert list(follow([person(0, 0), person(0.03, 0)]).frames) == [0, 1]


def test_bending_and_kneeling_people_are_found():
    bent = box((-0.25, -0.2, 0), (0.25, 0.2, 0.9)) | box((-0.25, -0.2, 0.65), (0.7, 0.2, 1.0))
    kneeling = box((-0.2, -0.2, 0), (0.2, 0.2, 1.15)) | box((-0.6, -0.2, 0), (0.2, 0.2, 0.3))  # the shins behind
    fat = box((-0.25, -0.2, 0), (0.4, 0.2, 1.15))  # the same as a hull of few cameras fills it
    for shape in (bent, kneeling, fat):
        assert set(follow([shape] * 20).persons) == {0}


def test_step_is_a_function_of_its_arguments():
    observation = observe(GRID, person(0, 0) | person(1, 1))
    state = init(FPS)
    for frame in range(12):
        before = state
        state, info = step(state, frame, observation)
        again, info_again = step(before, frame, observation)
        assert [t.person for t in again.tracks] == [t.person for t in state.tracks]
        assert np.array_equal(info.owners, info_again.owners) and len(info.rows) == len(info_again.rows)


def test_owners_match_a_loop_over_voxels():
    volume = person(-0.2, 0) | person(0.25, 0.1) | person(1.5, 1)
    observation = observe(GRID, volume)
    positions = np.array([[-0.2, 0, 0.87], [0.25, 0.1, 0.87], [1.5, 1, 0.87]])
    owners, shared = assign_voxels(observation, positions)
    assert list(shared) == [True, True, False]
    radii = np.array([0.45, 0.45, 1.2 * 0.87])
    labels_of = [observation.labels[np.argmin(np.linalg.norm(observation.points - p, axis=1))] for p in positions]
    for point, label, owner in zip(observation.points, observation.labels, owners, strict=True):
        distances = [np.sum(((point - p) / radii) ** 2) if own == label else np.inf for p, own in zip(positions, labels_of, strict=True)]
        assert owner == int(np.argmin(distances))


def test_person_voxels_on_a_finer_grid():
    fine = VoxelGrid(GRID.origin, 0.04, (125, 100, 60))
    centres = fine.centres()
    bodies = [(((centres - (x, 0, 0.9)) / (0.24, 0.24, 0.9)) ** 2).sum(axis=-1) <= 1 for x in (-0.6, 0.6)]
    voxels = person_voxels(observe(fine, bodies[0] | bodies[1]), np.array([[-0.6, 0, 0.9], [0.6, 0, 0.9]]))
    for body, own in zip(bodies, voxels, strict=True):
        assert np.array_equal(own, np.argwhere(body))


def test_velocities_are_the_slope():
    path = line((-1, 0), (1, 0.5), 41)
    table = follow([person(*p) for p in path])
    slope = velocities(table, FPS)
    assert np.abs(slope[5:-5, :2] - (1.0, 0.25)).max() < 0.12
    assert np.abs(slope[:, 2]).max() < 0.05


def test_velocities_are_polyfit_s_over_the_window_whatever_the_order_and_gaps():
    rng = np.random.default_rng(3)
    frames = np.concatenate([rng.permutation(60)[:45], rng.permutation(60)[:30], [7]])
    persons = np.repeat([4, 1, 2], [45, 30, 1])
    table = TrackTable(frames, persons, rng.standard_normal((76, 3)))
    slope = velocities(table, FPS, window_s=0.5)
    for row in range(76):
        near = (persons == persons[row]) & (np.abs(frames - frames[row]) <= 5)
        expected = np.polyfit(frames[near], table.positions[near], 1)[0] * FPS if near.sum() > 1 else np.zeros(3)
        assert np.allclose(slope[row], expected, atol=1e-9)


def test_velocities_are_of_the_positions_that_are_known():
    places = np.arange(12.0)[:, None] * [0.1, -0.2, 0.0]
    table = TrackTable(np.arange(12), np.zeros(12, int), places)
    holes = replace(table, positions=np.where(np.isin(np.arange(12), [0, 4, 5])[:, None], np.nan, places))
    known = np.isfinite(holes.positions).all(axis=1)
    slope = velocities(holes, FPS)
    assert np.allclose(slope[known], velocities(table, FPS)[known]) and not slope[~known].any()
    assert not velocities(replace(table, positions=np.full((12, 3), np.nan)), FPS).any()


def test_gaps_longer_than_asked_stay():
    state = init(FPS)
    rows: list = []
    for frame in range(10):
        state, info = step(state, frame, observe(GRID, person(0, 0)))
        rows += info.rows
    rows = [row for row in rows if row.frame not in (3, 4, 5)]
    assert len(fill_gaps(from_rows(rows), 2).frames) == 7
    assert len(fill_gaps(from_rows(rows), 3).frames) == 10
    assert finish(state, 10) == ()


def test_bad_frame_rate_is_refused():
    with pytest.raises(ValueError, match="`fps` must be a positive"):
        init(0.0)


@pytest.mark.parametrize("gap", [0.36, 0.42])
def test_two_who_hold_each_other_from_the_first_frame_are_two(gap):
    n = 30
    a = [np.array([-gap / 2, 0.0])] * n + line((-gap / 2, 0), (-1.5, 0), n)
    b = [np.array([gap / 2, 0.0])] * n + line((gap / 2, 0), (1.6, 0), n)
    table = follow([person(*p) | person(*q, height=1.65) for p, q in zip(a, b, strict=True)])
    assert set(table.persons) == {0, 1} and len(table.frames) == 4 * n
    left = 0 if table.positions[0, 0] < 0 else 1
    assert errors(table, left, a).max() < 0.15 and errors(table, 1 - left, b).max() < 0.15


def test_who_came_in_behind_another_is_let_go_when_seen():
    """The two are one, half hidden, when the track begins; later both are seen, still touching."""
    n = 20
    single, pair = person(0, 0), person(0, 0) | person(0.4, 0, height=1.65)
    table = follow([single] * n + [pair] * n + [person(*p) | person(*q, height=1.65) for p, q in
                                                zip(line((0, 0), (-1, 0), n), line((0.4, 0), (1.4, 0), n), strict=True)])  # fmt: skip
    assert set(table.persons) == {0, 1}
    assert table.frames[table.persons == 1].min() == n


def test_one_person_has_one_column():
    arms = box((-0.9, -0.06, 1.3), (0.9, 0.06, 1.42))
    hands = box((-0.4, -0.06, 1.4), (-0.3, 0.06, 2.0)) | box((0.3, -0.06, 1.4), (0.4, 0.06, 2.0))
    for volume in (person(0, 0, radius=0.3), person(0, 0) | arms, person(0, 0) | arms | hands):
        observation = observe(GRID, volume)
        assert len(observation.points) * 0.05**3 > 0.2  # as much as two people's
        assert len(find_columns(observation)) == 1


def held_back(state, predicted, observation):
    """A filter that sees everybody, a quarter of a metre behind where they should be."""
    return FilterEstimate(predicted - [0.25, 0, 0], np.ones(len(predicted), bool), state.memories)


def sees_all(state, predicted, observation):
    """A filter that sees everybody where they should be."""
    return FilterEstimate(predicted, np.ones(len(predicted), bool), state.memories)


def test_two_who_walk_arm_in_arm_are_at_their_columns_where_the_filter_is_behind():
    a, b = line((-1.8, -0.22), (1.8, -0.22), 60), line((-1.8, 0.22), (1.8, 0.22), 60)
    state, worst = init(FPS), 0.0
    for frame, (p, q) in enumerate(zip(a, b, strict=True)):
        state, _ = advance(state, frame, observe(GRID, person(*p) | person(*q)), FollowingSettings(), held_back)
        for place in (p, q) if frame > 20 else ():
            worst = max(worst, min(np.hypot(*(track.position[:2] - place)) for track in state.tracks))
    assert len(state.tracks) == 2 and worst < 0.06


def test_two_who_come_together_in_one_column_are_not_both_at_its_middle():
    """Of the two there is one column; what lies around it is the body of neither, and the filter still knows both."""
    state, apart = init(FPS), [*np.linspace(0.93, 0.13, 30), 0.13, 0.13]
    for frame, x in enumerate(apart):
        observation = observe(GRID, person(-x, 0, radius=0.22) | person(x, 0, radius=0.22))
        state, _ = advance(state, frame, observation, FollowingSettings(), sees_all)
    assert len(find_columns(observation)) == 1
    assert sorted(round(float(track.position[0]), 1) for track in state.tracks) == [-0.1, 0.1]


def test_who_crouches_is_not_taken_for_a_column_that_comes_up_beside_them():
    """The column is free for a moment, 60 cm away, as of somebody who was hidden, or of a ghost; she is seen all the time."""
    n, low = 20, CENTRES[..., 2] < 0.85
    crouching, beside = person(0, 0, radius=0.35) & low, person(0.6, 0)
    volumes = [person(0, 0)] * n + [crouching] * n + [crouching | beside if i < 3 else crouching for i in range(n)]
    table = follow(volumes)
    assert set(table.persons) == {0} and len(table.frames) == len(volumes)
    assert np.hypot(*table.positions[:, :2].T).max() < 0.1


def test_a_body_s_middle_is_that_of_all_its_voxels():
    bodies = [person(-0.3, 0.01), person(0.3, 0.01, height=1.6)]
    observation = observe(GRID, bodies[0] | bodies[1])
    measured = bodies_at(observation, np.array([[-0.25, 0.05], [0.3, 0.0], [2.4, 1.9]]))
    for body, place in zip(bodies, measured[:2], strict=True):
        assert np.abs(place - CENTRES[body].mean(axis=0)).max() < 0.02
    assert np.isnan(measured[2]).all()
    assert bodies_at(observation, np.zeros((0, 2))).shape == (0, 3)
