"""The particle filter and Sparse Sampling on drawn rooms: colored people whose true places are known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hmc.camera.model import Rig, look_at, project
from hmc.tracking.appearance import color_surface
from hmc.tracking.blobs import observe
from hmc.tracking.following import init
from hmc.tracking.sparse import propagate
from hmc.tracking.state import Candidate, DepartedTrack, PersonMemory, TrackerState, TrackRow
from hmc.tracking.stored import from_plain, to_plain
from hmc.tracking.trackers import make_tracker
from hmc.tracking.tracks import run
from hmc.tracking.views import FrameViews
from hmc.voxels.grid import VoxelGrid

FPS = 20.0
GRID = VoxelGrid(np.array([-2.5, -2.0, 0.0]), 0.06, (84, 67, 38))
CENTRES = GRID.centres()
SIZE = (200, 150)
RIG = Rig(
    tuple(
        look_at(f"cam_{i}", SIZE, [4.5 * np.cos(a), 4.0 * np.sin(a), 2.2], [0, 0, 0.8], 75)
        for i, a in enumerate(np.linspace(0.3, 2 * np.pi + 0.3, 4, endpoint=False))
    )
)
RED, GREEN, BLUE = (40, 40, 200), (50, 170, 60), (190, 60, 40)
FILTERS = [("particle", False), ("particle", True), ("sparse", False), ("sparse", True)]


def person(x, y, height=1.74, radius=0.24):
    across = ((CENTRES[..., 0] - x) / radius) ** 2 + ((CENTRES[..., 1] - y) / radius) ** 2
    return across + ((CENTRES[..., 2] - height / 2) / (height / 2)) ** 2 <= 1


def seen(people):
    """The observation of colored people [(x, y, color)], with images in which each voxel is a dot, the nearest in front."""
    volumes = [person(x, y) for x, y, _ in people]
    occupied = np.any([np.zeros(GRID.shape, bool), *volumes], axis=0)
    images, masks = [], []
    for camera in RIG:
        image, depth = np.full((SIZE[1], SIZE[0], 3), 120, np.uint8), np.full((SIZE[1], SIZE[0]), np.inf)
        for volume, (_, _, color) in zip(volumes, people, strict=True):
            points = CENTRES[volume]
            uv, valid = project(camera, points)
            far = (points @ camera.rotation.T + camera.translation)[:, 2]
            for dx in range(-2, 3):
                for dy in range(-2, 3):
                    column, row = (np.rint(uv) + (dx, dy)).astype(int).T
                    good = valid & (column >= 0) & (column < SIZE[0]) & (row >= 0) & (row < SIZE[1])
                    order = np.flatnonzero(good)[np.argsort(-far[good])]
                    order = order[far[order] < depth[row[order], column[order]]]
                    image[row[order], column[order]], depth[row[order], column[order]] = color, far[order]
        images.append(image)
        masks.append(np.isfinite(depth))
    return observe(GRID, occupied, None, FrameViews(RIG, masks, images))


def line(start, end, n):
    return [np.add(start, np.subtract(end, start) * t) for t in np.linspace(0, 1, n)]


def places(table, number, truth):
    rows = table.persons == number
    return np.hypot(*(table.positions[rows][:, :2] - np.array(truth)[table.frames[rows]]).T)


@pytest.fixture(scope="module")
def crossing():
    """Red and green walk towards each other, meet in the middle so that they are one, and turn back: nothing but color tells it."""
    out, back = line((-1.3, -0.3), (-0.16, 0), 14), line((-0.16, 0), (-1.3, 0.3), 14)
    a = [*out, *[np.array([-0.16, 0.0])] * 6, *back]
    b = [-place for place in a]
    return a, b, [seen([(*p, RED), (*q, GREEN)]) for p, q in zip(a, b, strict=True)]


def test_only_the_surface_that_is_asked_for_is_colored(crossing):
    observation = crossing[2][0]
    left = np.flatnonzero(observation.points[:, 0] < 0)
    rows, bins = color_surface(observation, left)
    assert set(rows) <= set(left) and len(rows) < 0.9 * len(left)
    known = bins[bins >= 0]
    assert len(known) > 0.4 * len(rows) and np.bincount(known).max() > 0.94 * len(known)  # nothing of who stands in front
    assert [len(part) for part in color_surface(replace(observation, views=None), left)] == [0, 0]
    assert [len(part) for part in color_surface(observation, left[:0])] == [0, 0]


@pytest.mark.parametrize(("name", "color"), FILTERS)
def test_two_who_meet_are_followed(crossing, name, color):
    a, b, observations = crossing
    table = run(enumerate(observations), FPS, make_tracker(name, color=color))
    assert set(table.persons) == {0, 1} and len(table.frames) == 2 * len(a)
    if color:
        errors = min(([places(table, k, t) for k, t in pair] for pair in (((0, a), (1, b)), ((1, a), (0, b)))), key=lambda e: np.mean(e))
        assert np.mean(errors) < 0.06 and np.max(errors) < 0.25


@pytest.mark.parametrize(("name", "color"), FILTERS)
def test_the_same_seed_gives_the_same_tracks_and_another_does_not(crossing, name, color):
    tracker = make_tracker(name, color=color, particles=50)
    first, again, other = (run(enumerate(crossing[2][:8]), FPS, tracker, seed) for seed in (3, 3, 4))
    assert np.array_equal(first.positions, again.positions)
    assert not np.array_equal(first.positions, other.positions)


def test_people_who_were_exchanged_get_their_numbers_back(crossing):
    tracker, observations = make_tracker("sparse", color=True), crossing[2][:14]
    state = init(FPS)
    for frame, observation in enumerate(observations[:10]):
        state, _ = tracker.step(np.random.default_rng(frame), state, frame, observation)
    one, two = state.tracks
    mixed = replace(
        state,
        tracks=(replace(two, person=one.person), replace(one, person=two.person)),
        memories=tuple(replace(mine, arrays=other.arrays) for mine, other in zip(state.memories, state.memories[::-1], strict=True)),
    )
    assert all(len(memory.arrays["samples"]) for memory in mixed.memories)
    after, _ = tracker.step(np.random.default_rng(10), mixed, 10, observations[10])
    assert [track.person for track in after.tracks] == [one.person, two.person]
    for track, before in zip(after.tracks, (one, two), strict=True):
        assert np.linalg.norm(track.position - before.position) < 0.2


@pytest.mark.parametrize("blank", [None, 19, 20, 21])
def test_people_who_come_back_are_recognised_by_their_colors(blank):
    """A frame that tells nothing, about when it is asked who they are, makes nobody a stranger."""
    nobody = [seen([])] * 26
    visit = {color: [seen([(*p, color)]) for p in line((-0.8, 0), (0.8, 0.2), 26)] for color in (RED, BLUE)}
    observations = [*visit[RED], *nobody, *visit[BLUE], *nobody, *visit[RED]]
    if blank is not None:
        observations[4 * 26 + blank] = None
    table = run(enumerate(observations), FPS, make_tracker("sparse", color=True))
    assert [set(table.persons[(table.frames // 52) == part]) for part in range(3)] == [{0}, {1}, {0}]
    assert len(set(run(enumerate(observations), FPS, make_tracker("sparse", color=False)).persons)) == 3


def test_samples_go_with_a_walker_by_less_than_a_voxel_a_frame(monkeypatch):
    """At 120 frames a second 1.2 m/s are a sixth of a voxel."""
    moved, path = [], line((-1.2, 0), (0.6, 0), 181)

    def noted(rng, memories, drift, *others):
        moved.append(drift.sum(axis=0))
        return propagate(rng, memories, drift, *others)

    monkeypatch.setattr("hmc.tracking.sparse.propagate", noted)
    run(enumerate(seen([(*p, RED)]) for p in path), 120.0, make_tracker("sparse", color=False))
    assert 1.3 < np.sum(moved, axis=0)[0] * GRID.voxel_size_m < 1.9


@pytest.mark.parametrize(("name", "color"), FILTERS)
def test_nobody_a_light_switch_and_everybody_leaving_are_ordinary(crossing, name, color):
    tracker, observations = make_tracker(name, color=color), crossing[2]
    empty, full = seen([]), observe(GRID, np.ones(GRID.shape, bool))
    assert len(run(enumerate([empty] * 5), FPS, tracker).frames) == 0
    cut = seen([(2.45, 0.0, RED)])  # half of the person is beyond the room's limit
    assert len(run(enumerate([cut] * 10), FPS, tracker).frames) in (0, 10)
    table = run(enumerate([*observations[:8], empty, None, full, *observations[8:12], *[empty] * 30]), FPS, tracker)
    assert set(table.persons) == {0, 1} and table.frames.max() == 14
    assert np.all(np.bincount(table.frames) == 2)


def test_a_state_comes_back_from_the_journal_as_it_was(crossing):
    tracker, state = make_tracker("sparse", color=True, particles=40), init(FPS)
    for frame, observation in enumerate(crossing[2][:9]):
        state, _ = tracker.step(np.random.default_rng(frame), state, frame, observation)
    candidate = Candidate((TrackRow(3, -1, np.ones(3), np.zeros(3)),), 1)
    look = state.memories[0].histogram
    state = replace(
        state,
        candidates=(candidate,),
        memories=(state.memories[0], PersonMemory(1)),
        departed=(DepartedTrack(7, look, 4),),
        reidentified=((8, 2),),
        arrays={"counts": np.arange(6, dtype=np.int32).reshape(2, 3), "empty": np.zeros((0, 3)), "flags": np.array([True, False])},
    )
    back: TrackerState = from_plain(TrackerState, json.loads(json.dumps(to_plain(state))))
    for one, other in ((back.memories[0], state.memories[0]), (back.memories[1], state.memories[1]), (back.departed[0], state.departed[0])):
        np.testing.assert_equal(vars(one), vars(other))
    for name, array in state.arrays.items():
        assert (
            np.array_equal(back.arrays[name], array) and back.arrays[name].dtype == array.dtype and back.arrays[name].shape == array.shape
        )
    assert back.reidentified == state.reidentified and back.fps == FPS and back.candidates[0].missed == 1
    on, resumed = (tracker.step(np.random.default_rng(9), s, 9, crossing[2][9])[0] for s in (state, back))
    assert np.array_equal(on.tracks[0].position, resumed.tracks[0].position)
    assert np.array_equal(on.memories[0].arrays["samples"], resumed.memories[0].arrays["samples"])
