"""Where people are who stay on one spot, as told by what stirs in the views."""

import cv2
import numpy as np
import pytest

from hmc.camera.model import Rig, project
from hmc.camera.standing import Standing
from hmc.camera.standing_cut import figure
from hmc.voxels.carving import make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.stirring_places import stirring_places

PLACE = Standing(0.4, -0.3, 1.7)


@pytest.fixture(scope="module")
def tables(ring):
    rig = Rig(tuple(camera.scaled(2.0) for camera in ring))
    return make_tables(VoxelGrid(np.array([-2.0, -2.0, 0.0]), 0.05, (80, 80, 44)), rig)


def views(tables, place=PLACE):
    amounts = [figure(camera, place).body.astype(np.float32) for camera in tables.rig]
    return amounts, [np.ones(amount.shape, bool) for amount in amounts]


def outlines(amounts):
    return [cv2.morphologyEx(amount, cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) for amount in amounts]


def close(place, truth=PLACE):
    return np.hypot(place.x - truth.x, place.y - truth.y) < 0.1 and abs(place.stature_m - truth.stature_m) < 0.1


@pytest.mark.parametrize("seen", [lambda amounts: amounts, outlines])
def test_a_body_that_stirs_in_all_views_is_found_where_it_stands(tables, seen):
    amounts, known = views(tables)
    (place,) = stirring_places(tables, seen(amounts), known)
    assert close(place)


def test_arms_that_swing_wide_and_above_the_head_are_no_part_of_the_stature(tables):
    """Beside the person as much stirs as within: only a hull of all views has a middle."""
    amounts, known = views(tables)
    turn = np.linspace(-0.4, 1.4, 40) * np.pi / 2
    for camera, amount in zip(tables.rig, amounts, strict=True):
        for side in (-1, 1):
            hands = np.column_stack([np.full(40, PLACE.x), PLACE.y + side * (0.2 + 0.6 * np.cos(turn)), 1.4 + 0.6 * np.sin(turn)])
            shoulder = [PLACE.x, PLACE.y + side * 0.2, 1.4]
            swept = project(camera, np.vstack([hands[:30], [shoulder]]))[0]
            cv2.fillPoly(amount, [swept.round().astype(np.int32)], 1.0)
    (place,) = stirring_places(tables, amounts, known)
    assert close(place)


def test_two_who_stay_beside_each_other_are_two_places_those_first_that_stir_more(tables):
    other = Standing(-0.4, -0.1, 1.3)
    amounts, known = views(tables)
    both = [np.maximum(*pair) for pair in zip(amounts, views(tables, other)[0], strict=True)]
    first, second = stirring_places(tables, both, known)
    assert close(first) and close(second, other)
    assert stirring_places(tables, both, known, most=1) == [first]


def test_what_stirs_in_one_view_or_little_or_to_the_ceiling_is_no_person(tables):
    amounts, known = views(tables)
    one = [amount if c == 1 else np.zeros_like(amount) for c, amount in enumerate(amounts)]
    assert stirring_places(tables, one, known) == []
    small = views(tables, Standing(PLACE.x, PLACE.y, 0.6))[0]
    assert stirring_places(tables, small, known) == []
    tall = views(tables, Standing(PLACE.x, PLACE.y, 2.6))[0]
    assert stirring_places(tables, tall, known) == []
    assert stirring_places(tables, [0.8 * amount for amount in amounts], known) == []


def test_most_views_must_tell(tables):
    amounts, known = views(tables)
    few = len(known) // 2
    hidden = [mask & (c < few) for c, mask in enumerate(known)]
    assert stirring_places(tables, [np.where(mask, amount, 1) for amount, mask in zip(amounts, hidden, strict=True)], hidden) == []
