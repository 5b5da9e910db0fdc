"""Whole bodies among the people found in samples, and who is found in some of them only."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from hmc.camera.empty_scene import SamplePeople, cut_again, scenes_behind
from hmc.camera.model import Rig
from hmc.camera.standing import Standing
from hmc.camera.standing_cut import around, figure
from hmc.voxels.agreement import agreed_views
from hmc.voxels.carving import make_tables
from hmc.voxels.grid import VoxelGrid, voxels_of
from hmc.voxels.known_bodies import is_known, known_hulls, places_at_times

PLACE = Standing(0.3, -0.2, 1.7)
N = 12


@pytest.fixture(scope="module")
def tables(ring):
    rig = Rig(tuple(camera.scaled(2.0) for camera in ring))
    return make_tables(VoxelGrid(np.array([-1.5, -1.5, 0.0]), 0.05, (60, 60, 42)), rig)


def bodies(tables, place):
    return [np.zeros(camera.size[::-1], bool) if place is None else figure(camera, place).body for camera in tables.rig]


def close(place, truth=PLACE):
    return np.hypot(place.x - truth.x, place.y - truth.y) < 0.1 and abs(place.stature_m - truth.stature_m) < 0.1


def test_who_is_in_some_samples_has_a_place_who_is_in_most_or_in_one_has_none(tables):
    def found(*there):
        people = [bodies(tables, PLACE if k in there else None) for k in range(N)]
        return places_at_times(tables.grid, known_hulls(tables, people))

    (place,) = found(0, 6, 11)
    assert close(place)
    assert found(*range(N)) == found(0) == []


def test_who_steps_from_side_to_side_and_is_known_beside_a_place_is_not_still(tables):
    beside = [replace(PLACE, x=PLACE.x + side) for side in (-0.22, 0.22)]
    hulls = known_hulls(tables, [bodies(tables, beside[k % 2]) for k in range(N)])
    points = [tables.grid.centres(voxels_of(hull)) for hull in hulls]
    assert is_known(points, PLACE, 0.05)
    assert not is_known(points, replace(PLACE, x=PLACE.x + 1.0), 0.05)
    trunks = [hull[hull[:, 2] > 0.9] for hull in points]
    assert not is_known(trunks, PLACE, 0.05)


def crouching(tables, deep_m):
    """Images of somebody who stands in every third and crouches by so much in the others, never in quite the same way; where they are."""
    rng = np.random.default_rng(0)
    scenes = [rng.integers(100, 115, (*camera.size[::-1], 3)) for camera in tables.rig]
    images, masks = [], []
    for k in range(N):
        sway = deep_m * np.array([np.sin(2.1 * k), np.cos(1.3 * k)]) / 4
        place = (
            PLACE
            if k % 3 == 0
            else Standing(*(np.array([PLACE.x, PLACE.y]) + sway).tolist(), PLACE.stature_m - deep_m * (0.8 + 0.2 * np.sin(k)))
        )
        there = bodies(tables, place)
        seen = [np.where(mask[..., None], (40, 50, 140), scene) for mask, scene in zip(there, scenes, strict=True)]
        images.append([(one + rng.normal(0, 2, one.shape)).clip(0, 255).astype(np.uint8) for one in seen])
        masks.append(there)
    return images, masks


def known_when_standing(tables, images, masks):
    """What is known of them: the standing body, and a scene with the crouching one in it."""
    people = [frame if k % 3 == 0 else bodies(tables, None) for k, frame in enumerate(masks)]
    return SamplePeople(
        people,
        [None] * len(tables.rig),
        [
            (np.median([frame[c] for frame in images], axis=0).astype(np.uint8), np.zeros(images[0][c].shape[:2], bool))
            for c in range(len(tables.rig))
        ],
        [None] * len(tables.rig),
    )


def overlap(found, truth):
    pairs = [pair for frames in zip(found, truth, strict=True) for pair in zip(*frames, strict=True)]
    return sum((a & b).sum() for a, b in pairs) / sum((a | b).sum() for a, b in pairs)


def test_who_moves_on_the_spot_and_was_found_in_some_samples_is_found_in_all(tables):
    images, masks = crouching(tables, 0.5)
    before = known_when_standing(tables, images, masks)
    regions = [around(camera, PLACE, 0.6) for camera in tables.rig]
    after = cut_again(images, before, regions, partial(agreed_views, tables))
    assert overlap(before.masks, masks) < 0.6
    assert overlap(after.masks, masks) > 0.9
    for c, scene in enumerate(scenes_behind(images, after)):
        inside = np.logical_or.reduce([frame[c] for frame in masks])
        wrong = np.abs(scene.image.astype(int) - 107).max(axis=2) > 25
        assert (wrong & inside & ~scene.unseen).sum() < 0.1 * inside.sum()


def test_nobody_is_sought_where_nothing_changes_or_nobody_was_found(tables):
    views, regions = partial(agreed_views, tables), [around(camera, PLACE, 0.6) for camera in tables.rig]
    images, masks = crouching(tables, 0.5)
    before = known_when_standing(tables, images, masks)
    elsewhere = [around(camera, replace(PLACE, x=-1.0, y=1.0), 0.2) for camera in tables.rig]
    assert cut_again(images, before, elsewhere, views) is before
    still = [images[1] if k % 3 else frame for k, frame in enumerate(images)]
    before = known_when_standing(tables, still, masks)
    assert cut_again(still, before, regions, views) is before
