"""Who stands at a known place, cut out of one view."""

import numpy as np

from hmc.camera.standing import Standing
from hmc.camera.standing_cut import cut_body, figure, learn_body

PLACE = Standing(0.4, -0.3, 1.7)


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
