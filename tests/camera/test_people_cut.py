"""People cut out by colors where the scene was never seen."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from hmc.camera.local_color import looks_unlike_surroundings
from hmc.camera.people_cut import View, color_mixture, cut_people, learn_colors

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
    nowhere = np.zeros_like(differs)
    return View(image, differs, surely, maybe, nowhere, nowhere)


def test_people_are_cut_out_with_the_limbs_that_never_move(view):
    people = cut_people(view, learn_colors([view]))
    assert not people[BETWEEN].any()
    for part in PEOPLE:
        assert people[part].mean() > 0.95


def test_legs_in_a_color_of_their_own_are_what_the_floor_around_is_not(view):
    """Nothing of the trousers has moved; they hold up what has."""
    differs, below = view.differs.copy(), np.zeros_like(view.differs)
    for rows, columns in PEOPLE:
        legs = slice(rows.start + 70, rows.stop)
        differs[legs, columns] = False
        below[legs, columns.start - 10 : columns.stop + 10] = True
    lost = replace(view, differs=differs)
    held = replace(lost, below=below)
    for rows, columns in PEOPLE:
        legs = np.s_[rows.start + 74 : rows.stop, columns]
        assert cut_people(lost, learn_colors([lost]))[legs].mean() < 0.1
        people = cut_people(held, learn_colors([held]))
        assert people[legs].mean() > 0.95 and not people[BETWEEN].any()


def test_a_limb_that_changed_is_not_its_own_surroundings(view):
    """A stretched arm of the shirt's color, before a floor that was never surely seen; walls have that color too."""
    arm = np.s_[70:90, 115:165]
    image, unseen = view.image.copy(), np.zeros_like(view.differs)
    image[:, :70], image[arm] = SHIRT, SHIRT
    unseen[50:215, 115:170] = True
    changed = np.zeros_like(unseen)
    changed[arm] = True
    lost = replace(view, image=image, unseen=unseen)
    colors = learn_colors([lost])
    people = cut_people(replace(lost, changed=changed), colors)
    assert cut_people(lost, colors)[arm].mean() < 0.6
    assert people[arm].mean() > 0.9 and not people[BETWEEN].any()


def test_the_floor_between_people_is_not_theirs_though_the_mixtures_say_so(view):
    colors = learn_colors([view])
    people = cut_people(view, replace(colors, people=colors.scene, scene=colors.people))
    assert people[BETWEEN].mean() < 0.05


@pytest.mark.parametrize("asked", [np.s_[150:200, 90:115], np.s_[190:210, 165:200]])
def test_of_a_part_of_the_image_as_of_all_of_it(view, asked):
    where = np.zeros(view.possibly.shape, bool)
    where[asked] = True
    colors = learn_colors([view])
    assert np.array_equal(cut_people(view, colors, where), cut_people(view, colors) & where)
    assert not cut_people(view, colors, where & ~view.possibly).any()


def test_mixtures_are_written_as_opencv_writes_its_own(view):
    truth = np.zeros(view.possibly.shape, bool)
    for part in PEOPLE:
        truth[part] = True
    mixtures = np.zeros((2, 1, 65))
    labels = np.where(truth, cv2.GC_FGD, cv2.GC_BGD).astype(np.uint8)
    cv2.grabCut(view.image, labels, None, *mixtures, 0, cv2.GC_INIT_WITH_MASK)
    for kind, theirs in zip((~truth, truth), mixtures, strict=True):
        # Clusters may be others; the moments of the mixture are not.
        for one, other in zip(_moments(color_mixture(view.image[kind])), _moments(theirs), strict=True):
            assert one == pytest.approx(other, abs=0.03 * np.abs(other).max())


def test_mixtures_do_not_hang_on_where_clusters_begin():
    rng = np.random.default_rng(0)
    shades = rng.integers(0, 255, (9, 3))
    pixels = np.clip(shades[rng.integers(0, 9, 6000)] + rng.normal(0, 5, (6000, 3)), 0, 255).astype(np.uint8)
    found = []
    for seed in range(6):
        cv2.setRNGSeed(seed)
        found.append(np.sort(color_mixture(pixels)[0, :5]))
    assert np.allclose(found, found[0], atol=0.01)


def test_where_people_hide_all_around_nothing_is_unlike_it(view):
    people = np.zeros(view.possibly.shape, bool)
    for part in PEOPLE:
        people[part] = True
    assert looks_unlike_surroundings(view.image, people, people)[people].mean() > 0.95
    assert not looks_unlike_surroundings(view.image, np.ones_like(people), people).any()


def _moments(mixture):
    """Mean (3,) and covariance (3, 3) of all of a mixture."""
    weights, means, spreads = mixture[0, :5], mixture[0, 5:20].reshape(5, 3), mixture[0, 20:].reshape(5, 3, 3)
    mean = weights @ means
    apart = means - mean
    return mean, np.einsum("k,kij->ij", weights, spreads) + np.einsum("k,ki,kj->ij", weights, apart, apart)
