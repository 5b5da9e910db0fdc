"""People who stay where they are through a whole recording without frames of the empty scene; and furniture, which is none."""

from dataclasses import replace

import numpy as np
import pytest

from hmc.camera.model import Rig
from hmc.camera.standing import Standing
from hmc.camera.standing_cut import figure
from hmc.voxels import still_people
from hmc.voxels.carving import make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.still_people import cut_still_people, find_still_people

PLACE = Standing(0.3, -0.2, 1.7)
N = 10


def drawn(ring, sway_m):
    """Tables, and images of a person in checked clothes before a dull room, who sways by so many metres; nobody is known in them."""
    rig = Rig(tuple(camera.scaled(2.0) for camera in ring))
    tables = make_tables(VoxelGrid(np.array([-1.5, -1.5, 0.0]), 0.05, (60, 60, 42)), rig)
    rng = np.random.default_rng(0)
    samples = []
    empty = [rng.integers(100, 115, (*camera.size[::-1], 3)) for camera in rig]
    checks = (np.indices((240, 320)).sum(axis=0) // 5 % 2)[..., None] * np.array([10, 20, 60])
    for k in range(N):
        here = replace(PLACE, x=PLACE.x + sway_m * np.sin(2.1 * k), y=PLACE.y + sway_m * np.cos(1.3 * k))
        frame = []
        for camera, scene in zip(rig, empty, strict=True):
            moved = np.roll(checks, round(100 * sway_m * np.sin(2.1 * k)), axis=1)
            seen = np.where(figure(camera, here).body[..., None], np.array([40, 50, 140]) + moved, scene)
            frame.append((seen + rng.normal(0, 1.5, seen.shape)).clip(0, 255).astype(np.uint8))
        samples.append(frame)
    return tables, samples, [[np.zeros(image.shape[:2], bool) for image in frame] for frame in samples]


@pytest.fixture(scope="module")
def swaying(ring):
    tables, samples, nobody = drawn(ring, 0.03)
    return tables, samples, *find_still_people(tables, samples, nobody)


def test_who_sways_in_place_is_found_at_the_right_depth(swaying):
    _, _, found, doubted = swaying
    assert len(found) == 1 and not doubted
    place = found[0].place
    assert np.hypot(place.x - PLACE.x, place.y - PLACE.y) < 0.1 and abs(place.stature_m - PLACE.stature_m) < 0.12


def test_who_sways_in_place_is_cut_out_in_every_view_that_has_an_image(swaying):
    tables, samples, found, _ = swaying
    first, *others = (cut_still_people(found, c, image) for c, image in enumerate([None, *samples[4][1:]]))
    assert first is None
    for camera, mask in zip(tables.rig.cameras[1:], others, strict=True):
        truth = figure(camera, PLACE).body
        assert (mask & truth).sum() > 0.75 * (mask | truth).sum()


def test_what_does_not_sway_is_furniture(ring):
    assert find_still_people(*drawn(ring, 0.0)) == ((), ())


def test_who_is_known_already_is_not_found_once_more(ring):
    tables, samples, nobody = drawn(ring, 0.03)
    people = [[figure(camera, PLACE).body for camera in tables.rig] if k % 3 == 0 or k == 4 else masks for k, masks in enumerate(nobody)]
    assert find_still_people(tables, samples, people)[0] == ()


def test_who_was_found_in_some_samples_is_scene_in_the_others(ring):
    """Too still for what stirs to tell, but for two samples in which a scene without the person was known."""
    tables, samples, nobody = drawn(ring, 0.005)
    assert not find_still_people(tables, samples, nobody)[0]
    people = [[figure(camera, PLACE).body for camera in tables.rig] if k in (0, 9) else masks for k, masks in enumerate(nobody)]
    (found,), doubted = find_still_people(tables, samples, people)
    assert not doubted and np.hypot(found.place.x - PLACE.x, found.place.y - PLACE.y) < 0.1
    # Who passed by in one of them is not looked for where they were.
    assert not find_still_people(tables, samples, [*people[:1], *nobody[1:]])[0]


def test_too_few_samples_tell_nothing(ring):
    tables, samples, nobody = drawn(ring, 0.03)
    assert find_still_people(tables, samples[:4], nobody[:4]) == ((), ())


@pytest.mark.parametrize("off", [(0.12, 0.0), (0.0, -0.12), (-0.12, 0.08), (0.12, -0.12)])
def test_a_place_that_was_tried_beside_the_person_leads_to_the_person(ring, monkeypatch, off):
    tables, samples, nobody = drawn(ring, 0.03)
    beside = replace(PLACE, x=PLACE.x + off[0], y=PLACE.y + off[1], stature_m=1.4)
    monkeypatch.setattr(still_people, "stirring_places", lambda *_: [beside])
    (person,), _ = find_still_people(tables, samples, nobody)
    assert np.hypot(person.place.x - PLACE.x, person.place.y - PLACE.y) < np.hypot(*off) - 0.04


def test_who_stirs_may_wear_trousers_of_the_walls_color_who_was_seen_a_few_times_must_stand_on_the_floor(ring, monkeypatch):
    """Where nothing stirs, what was cut out without legs may be a wall."""
    tables, samples, nobody = drawn(ring, 0.03)

    def measure(lowest_m):
        monkeypatch.setattr(still_people, "_measure", lambda _, place, cuts, *__: [60, lowest_m, 1.7, place.x, place.y, *[0.7] * len(cuts)])
        return find_still_people(tables, samples, nobody)

    assert [len(some) for some in measure(0.7)] == [1, 0]
    assert [len(some) for some in measure(1.0)] == [0, 1]
    monkeypatch.setattr(still_people, "stirring_places", lambda *_: [])
    monkeypatch.setattr(still_people, "places_at_times", lambda *_: [PLACE])
    assert [len(some) for some in measure(0.3)] == [1, 0]
    assert [len(some) for some in measure(0.7)] == [0, 0]
