"""People cut out by colors where the scene was never seen."""

from dataclasses import replace

import numpy as np
import pytest

from hmc.camera.people_cut import View, cut_people, learn_colors

FLOOR, SHIRT, TROUSERS = (66, 70, 68), (60, 60, 190), (150, 60, 50)
#: Rows and columns of two people, who stand still from the hips down, and of where the cameras say that people may be.
PEOPLE = (np.s_[60:200, 90:115], np.s_[70:210, 170:195])
MAYBE = np.s_[50:215, 80:205]
BETWEEN = np.s_[100:210, 125:160]


@pytest.fixture
def view():
    """Two people on a floor; their shirts move, and the outer rim of their trousers."""
    image = np.empty((320, 240, 3), float)
    image[:] = FLOOR
    differs, maybe, surely = (np.zeros(image.shape[:2], bool) for _ in range(3))
    for rows, columns in PEOPLE:
        image[rows, columns] = TROUSERS
        surely[rows, columns] = True
        top = slice(rows.start, rows.start + 70)
        image[top, columns] = SHIRT
        differs[top, columns] = True
        differs[top.stop : rows.stop, columns.start : columns.start + 6] = True
    maybe[MAYBE] = True
    image = np.clip(image + np.random.default_rng(0).normal(0, 3, image.shape), 0, 255).astype(np.uint8)
    return View(image, differs, surely, maybe, np.zeros_like(differs))


def test_people_are_cut_out_with_the_limbs_that_never_move(view):
    people = cut_people(view, learn_colors([view]))
    assert not people[BETWEEN].any()
    for part in PEOPLE:
        assert people[part].mean() > 0.95


def test_the_floor_between_people_is_not_theirs_though_the_mixtures_say_so(view):
    colors = learn_colors([view])
    people = cut_people(view, replace(colors, people=colors.scene, scene=colors.people))
    assert people[BETWEEN].mean() < 0.05
