"""Where people stand who hardly move, as told by what stirs in the views."""

import cv2
import numpy as np

from hmc.camera.standing import Standing, find_standing
from hmc.camera.standing_cut import cut_body, figure, learn_body

ROOM = np.array([[-2.0, -2.0, 0.0], [2.0, 2.0, 2.2]])
PLACE = Standing(0.4, -0.3, 1.7, 1.0)


def stirring_views(rig, place):
    return [figure(camera, place).body.astype(np.float32) for camera in rig], [np.ones(camera.size[::-1], bool) for camera in rig]


def test_a_body_that_stirs_in_all_views_is_found_where_it_stands(ring):
    best, *others = find_standing(ring, ROOM, *stirring_views(ring, PLACE))
    assert np.hypot(best.x - PLACE.x, best.y - PLACE.y) < 0.12 and abs(best.stature_m - PLACE.stature_m) <= 0.15
    assert all(one.score < best.score for one in others)


def test_what_stirs_in_one_view_or_far_around_is_no_person(ring):
    amounts, known = stirring_views(ring, PLACE)
    one = [amount if c == 1 else np.zeros_like(amount) for c, amount in enumerate(amounts)]
    wide = [cv2.dilate(amount, np.ones((61, 61), np.uint8)) for amount in amounts]
    assert find_standing(ring, ROOM, one, known) == [] and find_standing(ring, ROOM, wide, known) == []


def test_two_views_are_not_enough(ring):
    amounts, known = stirring_views(ring, PLACE)
    assert find_standing(ring, ROOM, amounts, [mask & (c < 2) for c, mask in enumerate(known)]) == []


def test_dark_trousers_before_a_dark_floor_are_cut_out_and_nothing_is_where_the_person_left(ring):
    """The trousers are no darker than the hair and the wall: one model of the whole person takes them for surroundings."""
    rng = np.random.default_rng(0)
    camera = ring[0].scaled(2.0)
    shape = figure(camera, PLACE)
    height, width = shape.body.shape
    empty = np.full((height, width, 3), 170.0)
    empty[height // 2 :] = (50, 52, 50)
    person = np.where((shape.parts <= 1)[..., None], (78, 58, 50), (40, 50, 190))

    def image(there):
        seen = np.where((shape.body & there)[..., None], person, empty)
        return (seen + rng.normal(0, 3, seen.shape)).clip(0, 255).astype(np.uint8)

    images, nobody = [image(True) for _ in range(7)], [np.zeros((height, width), bool)] * 7
    colors = learn_body(images, nobody, shape)
    cut = cut_body(images[0], None, shape, colors)
    assert (cut & shape.body).sum() > 0.93 * (cut | shape.body).sum()
    assert not cut_body(image(False), None, shape, colors).any()
