"""Silhouettes completed by the other cameras, against bodies whose silhouettes and shadows are drawn exactly."""

import cv2
import numpy as np
import pytest
from drawn import SHADOW, floor_patch, silhouette

from hmc.voxels.carving import carve
from hmc.voxels.completion import complete_masks, doubtful_hulls, floor_shadows, make_completion_tables

ROOM = np.array([[-1.5, -1.5, 0.0], [1.5, 1.5, 2.2]])


@pytest.fixture(scope="module")
def tables(ring):
    return make_completion_tables(ROOM, ring)


@pytest.fixture(scope="module")
def truth(ring):
    return [silhouette(camera, 0.3, 0.1) for camera in ring]


def lose(mask, where):
    """The mask without a band of rows: where in the mask it lies, from 0 (top) to 1."""
    rows = np.flatnonzero(mask.any(axis=1))
    first, last = (int(rows[0] + share * len(rows)) for share in where)
    out = mask.copy()
    out[first:last] = False
    return out


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()


def test_what_a_camera_doubts_is_decided_by_the_others(tables, truth):
    masks = [lose(truth[0], (0.2, 0.6)), lose(truth[1], (0.3, 0.7)), lose(truth[2], (0.72, 0.9)), *truth[3:]]
    done = complete_masks(tables, masks, truth).masks
    assert overlap(masks[0], truth[0]) < 0.65 and overlap(done[0], truth[0]) > 0.95
    for before, after in zip(masks, done, strict=True):
        assert after.dtype == bool and not (before & ~after).any()


def test_what_a_camera_surely_sees_empty_stays_empty(tables, truth):
    # A table before the legs; three others lost an arm's height, which comes back.
    masks = [lose(truth[0], (0.5, 1.0)), lose(truth[1], (0.1, 0.25)), lose(truth[2], (0.1, 0.25)), lose(truth[3], (0.3, 0.45)), truth[4]]
    done = complete_masks(tables, masks, [masks[0], *truth[1:]]).masks
    assert done[1].sum() > 1.1 * masks[1].sum() and done[2].sum() > 1.1 * masks[2].sum()
    np.testing.assert_array_equal(done[0], masks[0])


def test_a_camera_whose_light_changed_gains_the_person_and_no_wall(tables, truth):
    """It doubts all of the wall, so that a doubt tells nothing; the others say where somebody is lacking, and complete theirs as before."""
    masks = [*(lose(mask, where) for mask, where in zip(truth, ((0.2, 0.6), (0.3, 0.6), (0.72, 0.9), (0.05, 0.2)), strict=False)), truth[4]]
    done = complete_masks(tables, masks, [np.ones_like(truth[0]), *truth[1:]]).masks
    assert overlap(masks[0], truth[0]) < 0.6 and overlap(done[0], truth[0]) > 0.9
    assert overlap(done[1], truth[1]) > overlap(masks[1], truth[1]) + 0.2


def test_one_camera_s_loss_comes_back(tables, truth):
    done = complete_masks(tables, [lose(truth[0], (0.2, 0.6)), *truth[1:]], truth)
    assert overlap(done.masks[0], truth[0]) > 0.95 and not done.much
    assert all(after is before for after, before in zip(done.masks[1:], truth[1:], strict=True))


def test_limbs_come_back_and_rims_do_not(tables, truth):
    shins = [lose(mask, (0.8, 0.92)) for mask in truth[:2]]
    done = complete_masks(tables, [*shins, *truth[2:]], truth).masks
    for before, after, true in zip(shins, done, truth, strict=False):
        assert overlap(before, true) < 0.9 and overlap(after, true) > 0.98
    thin = [cv2.erode(mask.view(np.uint8), np.ones((3, 3), np.uint8)).view(bool) for mask in truth]
    done = complete_masks(tables, thin, truth)
    assert not done.much and all(after is before for after, before in zip(done.masks, thin, strict=True))


def test_a_gap_too_short_to_be_asked_for_stays_a_doubt(tables, truth):
    """A hand's breadth of the shins, which the hull's image, closed, covers."""
    shins = [lose(mask, (0.85, 0.91)) for mask in truth[:2]]
    done = complete_masks(tables, [*shins, *truth[2:]], truth)
    for before, after, left, true in zip(shins, done.masks, done.left, truth, strict=False):
        assert after is before and not (left & (before | ~true)).any()
        assert left.sum() > 0.8 * (true & ~before).sum()


@pytest.mark.parametrize("seed", range(8))
def test_nobody_is_added_where_each_camera_sees_another_person(tables, ring, seed):
    """Four people whose silhouettes are whole, and doubts all about them: in the places where they cross nobody is asked for."""
    places = np.random.default_rng(seed).uniform(-1.0, 1.0, (4, 2))
    masks = [np.logical_or.reduce([silhouette(camera, x, y) for x, y in places]) for camera in ring]
    doubts = [cv2.dilate(mask.view(np.uint8), np.ones((13, 13), np.uint8)).view(bool) for mask in masks]
    done = complete_masks(tables, masks, doubts)
    assert all(after is before for after, before in zip(done.masks, masks, strict=True)) and not done.much
    assert all(left is None or not (left & (mask | ~doubt)).any() for left, mask, doubt in zip(done.left, masks, doubts, strict=True))
    assert any(left is not None for left in done.left)


def test_who_is_lost_to_a_camera_among_others_is_asked_for(tables, ring):
    people = [[silhouette(camera, x, y) for camera in ring] for x, y in ((0.9, 0.0), (-0.5, 0.7), (-0.4, -0.8))]
    whole = [np.logical_or.reduce(masks) for masks in zip(*people, strict=True)]
    doubts = [cv2.dilate(mask.view(np.uint8), np.ones((5, 5), np.uint8)).view(bool) for mask in whole]
    for person in people:
        lost = person[0] & ~lose(person[0], (0.1, 0.6))
        lacking = whole[0] & ~lost
        done = complete_masks(tables, [lacking, *whole[1:]], doubts).masks
        assert (done[0] & lost).sum() > 0.8 * lost.sum() and overlap(done[0], whole[0]) > overlap(lacking, whole[0]) + 0.05


def test_much_was_lost_where_two_cameras_lost_a_band(tables, truth):
    assert complete_masks(tables, [*(lose(mask, (0.2, 0.6)) for mask in truth[:2]), *truth[2:]], truth).much


def test_doubts_that_nobody_shares_are_dropped(tables, truth):
    rng = np.random.default_rng(0)
    blot = np.zeros_like(truth[0])
    blot[5:30, 5:40] = True
    doubtful = [truth[0] | blot, *(mask | (rng.random(mask.shape) < 0.02) for mask in truth[1:])]
    for mask, after in zip(truth, complete_masks(tables, truth, doubtful).masks, strict=True):
        assert overlap(mask, after) > 0.97 and not (after & ~mask & blot).any()


def test_shadows_on_the_floor_are_told_from_legs(tables, truth, ring):
    shadows = [floor_patch(camera) for camera in ring]
    masks = [lose(truth[0], (0.6, 1.0)), lose(truth[1], (0.1, 0.4)), lose(truth[2], (0.1, 0.3)), *truth[3:]]
    doubtful = [shadow | mask for shadow, mask in zip(shadows, truth, strict=True)]
    cells = floor_shadows(tables, masks, doubtful)
    x, y = (ROOM[0, i] - 0.5 + (np.arange(n) + 0.5) * 0.03 for i, n in enumerate(cells.shape))
    (x0, y0), (x1, y1) = SHADOW
    inside = ((x > x0) & (x < x1))[:, None] & ((y > y0) & (y < y1))
    far = ~(((x > x0 - 0.1) & (x < x1 + 0.1))[:, None] & ((y > y0 - 0.1) & (y < y1 + 0.1)))
    assert cells[inside].mean() > 0.9 and not cells[far].any()
    done = complete_masks(tables, masks, doubtful).masks
    for mask, shadow, after in zip(truth, shadows, done, strict=True):
        assert (after & shadow & ~mask).sum() < 0.03 * mask.sum()
    # The lost legs come back where they are not before the shadow.
    lost = truth[0] & ~masks[0] & ~shadows[0]
    assert lost.sum() > 100 and (done[0] & lost).sum() > 0.8 * lost.sum()


def test_missing_cameras_and_cameras_without_doubts(tables, truth):
    masks = [lose(truth[0], (0.2, 0.6)), truth[1], None, lose(truth[3], (0.62, 0.9)), *truth[4:]]
    doubtful = [truth[0], None, truth[2], *truth[3:]]
    done = complete_masks(tables, masks, doubtful).masks
    assert done[2] is None and overlap(done[0], truth[0]) > 0.95
    np.testing.assert_array_equal(done[1], truth[1])


@pytest.mark.parametrize("left", [0, 3])
def test_too_few_masks_are_left_as_they_are(tables, truth, left):
    masks = [mask if c < left else None for c, mask in enumerate(truth)]
    done = complete_masks(tables, masks, truth).masks
    assert all(after is before for after, before in zip(done, masks, strict=True))


def test_nobody_and_no_doubts_change_nothing(tables, truth):
    empty = [np.zeros_like(mask) for mask in truth]
    assert not any(mask.any() for mask in complete_masks(tables, empty, empty).masks)
    done = complete_masks(tables, truth, [None] * len(truth)).masks
    assert all(after is before for after, before in zip(done, truth, strict=True))


def test_a_hall_is_looked_at_more_coarsely(ring):
    tables = make_completion_tables(np.array([[-15.0, -15.0, 0.0], [15.0, 15.0, 5.0]]), ring)
    assert tables.carving.grid.n_voxels < 5e6 and tables.carving.grid.voxel_size_m > 0.1


def test_each_pixel_looks_at_the_cell_that_falls_on_it(tables, ring):
    for camera, pixels, cells in zip(ring, tables.cell_pixels, tables.pixel_cells, strict=True):
        width, height = camera.size
        seen = np.flatnonzero(pixels < width * height)
        assert len(seen) > 1000
        back = cells.ravel()[pixels[seen]]
        on_floor = back < tables.cells[0] * tables.cells[1]
        assert on_floor.mean() > 0.95  # at the floor's border the pixel's centre may lie beyond it
        there, here = (np.unravel_index(places[on_floor], tables.cells) for places in (back, seen))
        # There and back again ends within half a pixel, which is some cells far away.
        off = np.hypot(there[0] - here[0], there[1] - here[1])
        assert np.median(off) <= 1 and np.quantile(off, 0.99) <= 3


def test_doubtful_hulls_have_what_cameras_see_and_none_denies(tables, truth):
    masks = [np.zeros_like(mask) if c >= 2 else mask for c, mask in enumerate(truth)]
    hull, of_three = doubtful_hulls(tables.carving, masks, truth)
    np.testing.assert_array_equal(hull, carve(tables.carving, truth) & carve(tables.carving, masks, tolerance=3, outside="carve"))
    assert hull.sum() > 1000 and not of_three.any()
    assert not any(one.any() for one in doubtful_hulls(tables.carving, masks, [*truth[:-1], masks[-1]]))
    without = [*masks[:-1], None]
    assert (hull & ~doubtful_hulls(tables.carving, without, truth)[0]).sum() == 0
    three = [np.zeros_like(mask) if c >= 3 else mask for c, mask in enumerate(truth)]
    np.testing.assert_array_equal(doubtful_hulls(tables.carving, three, truth)[1], carve(tables.carving, truth))
