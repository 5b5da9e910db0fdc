"""Rooms in which something is wrong, for all trackers: nobody, people cut by the limits, lights that switch, furniture that is pushed.

People are drawn with trunk, head, arms and legs, so that the components look as hulls of people do.
"""

import numpy as np
import pytest
from test_tracking_sparse import RIG, line
from test_tracking_sparse import seen as drawn

from hmc.tracking.blobs import observe
from hmc.tracking.trackers import make_tracker
from hmc.tracking.tracks import run
from hmc.tracking.views import FrameViews
from hmc.voxels.grid import VoxelGrid

FPS = 10.0
GRID = VoxelGrid(np.array([-2.5, -2.0, 0.0]), 0.08, (63, 50, 28))
CENTRES = GRID.centres()
TRACKERS = [("naive", None), ("particle", True), ("sparse", False), ("sparse", True)]
every_tracker = pytest.mark.parametrize(("name", "color"), TRACKERS)
#: A frame of a scene in which nothing stands.
VIEWS = drawn([]).views


def capsule(a, b, radius):
    """Voxels within a radius of the line from a to b."""
    a, b = np.array(a, float), np.array(b, float)
    low, high = (
        np.floor((corner - GRID.origin) / GRID.voxel_size_m).astype(int)
        for corner in (np.minimum(a, b) - radius, np.maximum(a, b) + radius)
    )
    part = tuple(slice(max(first, 0), max(last + 2, 0)) for first, last in zip(low, high, strict=True))
    points = CENTRES[part]
    along = np.clip(((points - a) @ (b - a)) / max(float((b - a) @ (b - a)), 1e-9), 0, 1)
    volume = nothing()
    volume[part] = np.linalg.norm(points - a - along[..., None] * (b - a), axis=-1) <= radius
    return volume


def body(x, y, height=1.75, stride=0.0):
    """Somebody who stands or walks along x, as fat as a hull of four cameras."""
    hip, neck = 0.52 * height, 0.83 * height
    legs = [capsule((x, y + side * 0.1, hip), (x + side * stride, y + side * 0.12, 0), 0.1) for side in (-1, 1)]
    arms = [capsule((x, y + side * 0.24, neck - 0.05), (x - side * stride / 2, y + side * 0.28, 0.48 * height), 0.07) for side in (-1, 1)]
    trunk = capsule((x, y, hip), (x, y, neck), 0.19)
    return np.any([trunk, capsule((x, y, neck), (x, y, height - 0.12), 0.12), *legs, *arms], axis=0)


def seated(x, y):
    """Somebody who sits and looks along x, 1.3 m high."""
    thighs = [capsule((x, y + side, 0.5), (x + 0.45, y + side, 0.5), 0.1) for side in (-0.1, 0.1)]
    shins = [capsule((x + 0.45, y + side, 0.5), (x + 0.45, y + side, 0), 0.08) for side in (-0.1, 0.1)]
    return np.any([capsule((x, y, 0.5), (x, y, 1.0), 0.18), capsule((x, y, 1.0), (x, y, 1.18), 0.12), *thighs, *shins], axis=0)


def chair(x, y):
    """As a hull shows it: filled below the seat; 0.85 m high."""
    seat = (np.abs(CENTRES[..., 0] - x) <= 0.25) & (np.abs(CENTRES[..., 1] - y) <= 0.25)
    return seat & ((CENTRES[..., 2] <= 0.5) | ((CENTRES[..., 0] < x - 0.12) & (CENTRES[..., 2] <= 0.85)))


def nothing():
    return np.zeros(GRID.shape, bool)


def walk(start, end, n):
    return [body(*place, stride=0.25 * np.sin(k)) for k, place in enumerate(line(start, end, n))]


def follow(volumes, name, color):
    """The table of the tracks; images are grey, so that colors tell nothing, as where people are dressed alike."""
    tracker = make_tracker(name, color=color)
    views = FrameViews(RIG, [np.ones(image.shape[:2], bool) for image in VIEWS.images], VIEWS.images) if tracker.color else None
    seen = ((k, None if volume is None else observe(GRID, volume, None, views)) for k, volume in enumerate(volumes))
    return run(seen, FPS, tracker)


def numbers(table, first, last=None):
    """Who is told between two frames."""
    rows = (table.frames >= first) & (table.frames < (last or table.frames.max(initial=0) + 1))
    return set(table.persons[rows].tolist())


def far_from(table, number, truth):
    """Largest horizontal distance of one person from the true places, by frame."""
    rows = table.persons == number
    return np.hypot(*(table.positions[rows][:, :2] - np.array([truth[frame] for frame in table.frames[rows]])).T).max()


@every_tracker
def test_nobody_in_the_room(name, color):
    rng = np.random.default_rng(0)
    specks = [rng.random(GRID.shape) < 0.002 for _ in range(15)]
    for volumes in ([nothing()] * 15, specks, [chair(0.5, 0.5)] * 15, [None] * 15):
        assert len(follow(volumes, name, color).frames) == 0


@every_tracker
def test_everybody_leaves_and_no_ghost_lives_on(name, color):
    ways = [walk((0, -0.6), (3.2, -0.6), 35), walk((0.2, 0.7), (-3.2, 0.7), 35)]
    left = [a | b for a, b in zip(*ways, strict=True)]
    rest = capsule((2.4, -0.6, 0), (2.4, -0.6, 0.5), 0.12)  # what the hull keeps of who is out of the cameras' sight
    table = follow([*left, *[rest] * 30], name, color)
    assert numbers(table, 0) == {0, 1}
    assert 25 <= table.frames.max() < 35 + 0.6 * FPS


@every_tracker
def test_who_is_cut_by_the_room_s_limit_keeps_the_number(name, color):
    out, back = line((0.5, 0.3), (2.45, 0.3), 25), line((2.45, 0.3), (0.5, 0.6), 25)
    path = [*out, *[np.array([2.45, 0.3])] * 20, *back]
    table = follow([body(*place) for place in path], name, color)
    assert numbers(table, 0) == {0} and list(table.frames) == list(range(70))
    assert far_from(table, 0, path) < 0.35


@every_tracker
@pytest.mark.parametrize("share", [0.3, 0.5, 0.9])
def test_a_light_switch_that_comes_and_goes_ends_and_begins_nobody(name, color, share):
    path = line((-1.2, -0.5), (1.0, -0.5), 45)
    light = CENTRES[..., 1] > 2.0 - 4.0 * share
    on = [k in range(10, 13) or k in range(20, 25) or k == 35 for k in range(45)]
    volumes = [body(*place) | body(-0.9, 1.2) | (light & switched) for place, switched in zip(path, on, strict=True)]
    table = follow(volumes, name, color)
    assert numbers(table, 0) == {0, 1} and np.all(np.bincount(table.frames) == 2)
    walker = int(table.persons[np.argmin(table.positions[:2, 1])])
    assert far_from(table, walker, path) < 0.5


@every_tracker
def test_frames_without_voxels_leave_everybody_their_number(name, color):
    path = line((-1.2, -0.4), (1.0, -0.4), 40)
    empty = [10, 11, *range(20, 26)]
    volumes = [nothing() if k in empty else body(*place) | seated(0.2, 1.1) for k, place in enumerate(path)]
    table = follow(volumes, name, color)
    assert numbers(table, 0) == {0, 1} and np.all(np.bincount(table.frames) == 2)


@every_tracker
def test_a_chair_that_somebody_pushes_is_nobody(name, color):
    """In front of the one who pushes it, then left behind: where it stood before is foreground, too."""
    n = 30
    pushing = line((-0.2, 0), (1.0, 0), n)
    path = [*line((-1.6, 0), (-0.2, 0), n), *pushing, *line((1.0, 0), (-1.6, 1.0), n)]
    before = [nothing()] * n
    pushed = [chair(place[0] + 0.5, 0) | (chair(0.3, 0) if place[0] > 0.1 else nothing()) for place in pushing]
    after = [chair(1.5, 0) | chair(0.3, 0)] * n
    volumes = [body(*place) | things for place, things in zip(path, [*before, *pushed, *after], strict=True)]
    table = follow(volumes, name, color)
    assert numbers(table, 0) == {0} and len(table.frames) == 3 * n
    assert far_from(table, 0, path) < 0.35


@every_tracker
def test_a_newcomer_does_not_take_the_number_of_somebody_who_sits_low(name, color):
    n = 35
    low = capsule((0, 0.2, 0), (0, 0.2, 0.6), 0.24) | capsule((0, 0.2, 0.6), (0, 0.2, 0.85), 0.12)  # on the floor, the legs crossed
    alone = [*walk((-1.6, 0.2), (0, 0.2), n), *[low] * n]
    coming = line((2.4, -0.5), (0.7, 0.0), n)
    volumes = [*alone, *[low | body(*place) for place in coming], *[low | body(0.7, 0)] * 10]
    table = follow(volumes, name, color)
    assert numbers(table, 0, 2 * n) == {0} and numbers(table, 2 * n + 15) == {0, 1}
    last = table.frames == table.frames.max()
    places = dict(zip(table.persons[last].tolist(), table.positions[last, 0], strict=True))
    assert abs(places[0]) < 0.25 and abs(places[1] - 0.7) < 0.25


@every_tracker
def test_what_an_established_person_left_behind_ends_and_who_sits_still_does_not(name, color):
    n, long = 40, round(10 * FPS)
    volumes = [*walk((-1.2, 0), (0, 0), n), *[chair(0, 0) | seated(-1.2, 1.0)] * long]
    table = follow([v | seated(-1.2, 1.0) for v in volumes], name, color)
    sits = table.persons[(table.frames == 0)][np.argmax(table.positions[table.frames == 0, 1])]
    assert numbers(table, n + long - 10) == {int(sits)}
    assert np.count_nonzero(table.persons == sits) == n + long
    moving = [chair(0, 0) if k < 0 else capsule((0.1 * np.sin(k / 4), 0, 0), (0.1 * np.sin(k / 4), 0, 0.8), 0.24) for k in range(long)]
    assert numbers(follow([*walk((-1.2, 0), (0, 0), n), *moving], name, color), n + long - 10) == {0}  # crouches and moves


@pytest.mark.parametrize(("gap", "persons"), [(1.2, {0}), (2.2, {0, 1})])
def test_what_one_camera_does_not_see_is_no_newcomer_beside_somebody_whom_all_see(gap, persons):
    solid, unseen = body(-1.2, 0), body(-1.2 + gap, 0)
    seen = [(k, observe(GRID, solid | unseen if k > 12 else solid, solid)) for k in range(30)]
    assert numbers(run(seen, FPS, make_tracker("naive")), 0) == persons
