"""Shadows on the floor leave the silhouettes, and legs do not: bodies and a shadow drawn exactly into a room with a patterned floor."""

import cv2
import numpy as np
import pytest
from drawn import floor_patch, silhouette

from hmc.camera.light import in_light_of, light_gains
from hmc.camera.segmentation import train_background
from hmc.voxels.carving import carve, pixels_at
from hmc.voxels.completion import make_completion_tables, shown
from hmc.voxels.floor_shadows import cut_filled_shadows, cut_floor_shadows, lit_views

ROOM = np.array([[-1.5, -1.5, 0.0], [1.5, 1.5, 2.2]])
DARK = 0.6


@pytest.fixture(scope="module")
def tables(ring):
    return make_completion_tables(ROOM, ring)


@pytest.fixture(scope="module")
def people(ring):
    return [silhouette(camera, 0.3, 0.1) for camera in ring]


def empty(camera, rng):
    """A room of mild color and texture, and what is learnt of it."""
    width, height = camera.size
    scene = np.array([120, 130, 140]) + 20 * cv2.GaussianBlur(rng.normal(size=(height, width)), (0, 0), 4)[..., None]
    frames = [np.clip(scene + rng.normal(0, 1, scene.shape), 0, 255).astype(np.uint8) for _ in range(12)]
    return scene, train_background(frames)


@pytest.fixture(scope="module")
def scenes(ring):
    rng = np.random.default_rng(0)
    return [empty(camera, rng) for camera in ring]


def filmed(scenes, people, shadows, trousers=(60, 65, 70), light=1.0):
    """Images of the people, in clothes of the floor's own chroma, with shadows; each with the darkness that a camera sees it in."""
    images = []
    for (scene, _), person, (shadow, dark) in zip(scenes, people, shadows, strict=True):
        image = np.where(shadow[..., None], dark * scene, scene)
        image = np.where(person[..., None], trousers, image)
        images.append(np.clip(light * image, 0, 255).astype(np.uint8))
    return images


def cut(tables, scenes, images, masks):
    return cut_by_views(tables, images, [model for _, model in scenes], masks)


def cut_by_views(tables, images, models, masks):
    each = zip(images, models, masks, strict=True)
    gains = [None if model is None or mask is None else light_gains(image, model.mean, mask) for image, model, mask in each]
    return cut_floor_shadows(tables, lit_views(images, models, gains), masks)


def test_a_shadow_that_all_cameras_see_as_dark_leaves_and_the_person_stays(tables, scenes, ring, people):
    shadows = [floor_patch(camera) for camera in ring]
    masks = [person | shadow for person, shadow in zip(people, shadows, strict=True)]
    for light in (1.0, 0.8):  # an exposure of its own is no shadow
        images = filmed(scenes, people, [(shadow, DARK) for shadow in shadows], light=light)
        for after, before, person, shadow in zip(cut(tables, scenes, images, masks), masks, people, shadows, strict=True):
            assert not (after & ~before).any()
            assert (after & person).sum() > 0.97 * person.sum()
            assert (after & shadow & ~person).sum() < 0.25 * (shadow & ~person).sum()


def test_a_person_without_a_shadow_keeps_the_whole_silhouette(tables, scenes, people):
    """In trousers that are the floor's own chroma, half as bright: to one camera a shadow."""
    images = filmed(scenes, people, [(np.zeros_like(person), 1.0) for person in people])
    for after, person in zip(cut(tables, scenes, images, people), people, strict=True):
        assert (after & person).sum() > 0.98 * person.sum()


def test_what_cameras_see_in_different_darkness_is_no_shadow(tables, scenes, ring, people):
    """A mirror image, or something that lies there."""
    patches = [floor_patch(camera) for camera in ring]
    images = filmed(scenes, people, [(patch, 0.4 * 1.22**k) for k, patch in enumerate(patches)])
    masks = [person | patch for person, patch in zip(people, patches, strict=True)]
    for after, patch, person in zip(cut(tables, scenes, images, masks), patches, people, strict=True):
        lost = (patch & ~person & ~after).sum() / (patch & ~person).sum()
        assert lost < 0.5
    alone = filmed(scenes, people, [(patch, DARK if k == 0 else 1.0) for k, patch in enumerate(patches)])
    np.testing.assert_array_equal(cut(tables, scenes, alone, masks)[0] & patches[0], masks[0] & patches[0])  # others see the bare floor


def test_a_shadow_that_one_camera_does_not_see_leaves_the_others(tables, scenes, ring, people):
    """As where something stands before it, or the floor is glossy there."""
    patches = [floor_patch(camera) for camera in ring]
    images = filmed(scenes, people, [(patch, 1.0 if k == 0 else DARK) for k, patch in enumerate(patches)])
    masks = [person | patch for person, patch in zip(people, patches, strict=True)]
    done = cut(tables, scenes, images, masks)
    for after, patch, person in list(zip(done, patches, people, strict=True))[1:]:
        assert (after & patch & ~person).sum() < 0.25 * (patch & ~person).sum()
        assert (after & person).sum() > 0.97 * person.sum()


def test_a_colored_thing_on_the_floor_is_no_shadow(tables, scenes, ring, people):
    patches = [floor_patch(camera) for camera in ring]
    images = filmed(scenes, people, [(np.zeros_like(person), 1.0) for person in people])
    for image, patch, person in zip(images, patches, people, strict=True):
        image[patch & ~person] = (40, 60, 110)
    masks = [person | patch for person, patch in zip(people, patches, strict=True)]
    for after, mask in zip(cut(tables, scenes, images, masks), masks, strict=True):
        assert (after & mask).sum() > 0.98 * mask.sum()


def test_cameras_that_know_no_empty_scene_and_those_without_a_mask_are_left_as_they_are(tables, scenes, ring, people):
    shadows = [floor_patch(camera) for camera in ring]
    images = filmed(scenes, people, [(shadow, DARK) for shadow in shadows])
    masks = [person | shadow for person, shadow in zip(people, shadows, strict=True)]
    models = [model for _, model in scenes]
    given = cut_by_views(tables, images, [None, *models[1:]], [masks[0], None, *masks[2:]])
    assert given[0] is masks[0] and given[1] is None and given[2].sum() < masks[2].sum()
    assert cut_by_views(tables, images, [None] * 4 + models[4:], masks) == tuple(masks)


def bands(people):
    """Across each person, of four rows: cloth that was filled for its darkness."""
    middle = [round(float(np.flatnonzero(person.any(axis=1)).mean())) for person in people]
    return [person & (np.abs(np.arange(len(person)) - row) < 3)[:, None] for person, row in zip(people, middle, strict=True)]


def test_what_was_filled_for_its_darkness_leaves_on_a_shadow_and_stays_on_a_person(tables, ring, people):
    """The shadow lies between two people, whom the lines of sight to it meet in some views."""
    second = [silhouette(camera, -0.9, 0.3) for camera in ring]
    shadows = [floor_patch(camera) & ~one & ~other for camera, one, other in zip(ring, people, second, strict=True)]
    bodies = [one | other for one, other in zip(people, second, strict=True)]
    masks = [body | shadow for body, shadow in zip(bodies, shadows, strict=True)]
    filled = [shadow | band for shadow, band in zip(shadows, bands(people), strict=True)]
    done = cut_filled_shadows(tables, masks, filled, masks)
    for after, mask, body, shadow in zip(done, masks, bodies, shadows, strict=True):
        assert not (after & ~mask).any()
        assert (after & body).sum() > 0.98 * body.sum()
        assert (after & shadow).sum() < 0.15 * shadow.sum()


def test_what_only_one_camera_doubts_was_filled_rightly(tables, ring, people):
    patches = [floor_patch(camera) & ~person for camera, person in zip(ring, people, strict=True)]
    masks = [people[0] | patches[0], *people[1:]]
    done = cut_filled_shadows(tables, masks, [patches[0], *(np.zeros_like(person) for person in people[1:])], masks)
    np.testing.assert_array_equal(done[0], masks[0])


def test_nothing_filled_changes_nothing_and_cameras_without_doubts_are_left(tables, ring, people):
    none = [np.zeros_like(person) for person in people]
    assert cut_filled_shadows(tables, people, none, people) == tuple(people)
    patches = [floor_patch(camera) & ~person for camera, person in zip(ring, people, strict=True)]
    masks = [person | patch for person, patch in zip(people, patches, strict=True)]
    done = cut_filled_shadows(tables, [masks[0], None, *masks[2:]], [None, *patches[1:]], [None, *masks[1:]])
    assert done[0] is masks[0] and done[1] is None and done[2].sum() < masks[2].sum()


def cut_by_whole_images(tables, images, models, masks):
    """The rule pixel by pixel and cell by cell, with nothing left out: whole images, all cells of the floor, all cameras."""
    seen, cut = [], []
    for image, model, mask in zip(images, models, masks, strict=True):
        lit = in_light_of(image, model.mean, mask)
        color = cv2.GaussianBlur(cv2.cvtColor(lit, cv2.COLOR_BGR2YCrCb), (3, 3), 0).astype(np.float32)
        share = np.maximum(color[..., 0], 1) / model.mean[..., 0]
        tint = np.abs(color[..., 1:] - 128 - np.minimum(share, 1)[..., None] * (model.mean[..., 1:] - 128)).max(axis=-1)
        seen.append(np.where(tint < 6, np.log(share), np.float32(9)))
    floor = np.stack([np.append(dark, np.float32(np.nan)).take(cells) for dark, cells in zip(seen, tables.cell_pixels, strict=True)])
    bare = ((floor > np.log(0.93)) & (floor < 9)).sum(axis=0)
    dark = (floor <= np.log(0.93)) & (floor >= np.log(0.5))
    hull = carve(tables.carving, masks)
    hull[..., : int(np.ceil(0.25 / tables.carving.grid.voxel_size_m))] = False
    voxels = np.argwhere(hull)
    points, at = tables.carving.grid.centres(voxels), pixels_at(tables.carving, voxels).astype(np.int64)
    three = np.ones((3, 3), np.uint8)
    for c, mask in enumerate(masks):
        others = dark & (np.arange(len(masks)) != c)[:, None]
        agree = (others & (np.abs(floor - floor[c]) < 0.18)).sum(axis=0)
        found = (dark.sum(axis=0) > bare) & dark[c] & (agree >= np.maximum(1, 0.34 * others.sum(axis=0)))
        found = cv2.morphologyEx(found.astype(np.uint8).reshape(tables.cells), cv2.MORPH_OPEN, three)
        spots = np.append(cv2.morphologyEx(found, cv2.MORPH_CLOSE, three), 0)[tables.pixel_cells[c]] > 0
        image, scale = shown(tables.carving.rig[c], points, at[c])
        side = max(1, int(np.ceil(tables.carving.grid.voxel_size_m * scale)))
        standing = cv2.dilate(image, np.ones((side, side), np.uint8)) > 0
        gone = mask & spots & (seen[c] > np.log(0.5)) & (seen[c] < 0) & ~standing
        opened = cv2.morphologyEx((mask & ~gone).astype(np.uint8), cv2.MORPH_OPEN, three) > 0
        around = cv2.dilate(gone.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        cut.append(np.where(around, opened, mask & ~gone))
    return cut


@pytest.mark.parametrize("seed", range(4))
def test_parts_of_images_and_of_the_floor_give_what_the_whole_gives(tables, scenes, ring, people, seed):
    rng = np.random.default_rng(seed)
    images, masks = (
        filmed(scenes, people, [(floor_patch(camera), rng.uniform(0.45, 0.97)) for camera in ring], light=rng.uniform(0.8, 1)),
        [],
    )
    for image, camera, person in zip(images, ring, people, strict=True):
        spots = cv2.GaussianBlur(rng.normal(size=person.shape), (0, 0), 6)
        image[spots > 0.09] = 0.7 * image[spots > 0.09]
        if seed % 2:  # at the very rim of the image too
            spots[: 1 + seed], spots[:, -1 - seed :] = 1, 1
        masks.append((person | floor_patch(camera) | (spots > 0.08)) & (spots > -0.12))
    found = cut(tables, scenes, images, masks)
    expected = cut_by_whole_images(tables, images, [model for _, model in scenes], masks)
    assert any((after != mask).any() for after, mask in zip(expected, masks, strict=True))
    for after, whole in zip(found, expected, strict=True):
        np.testing.assert_array_equal(after, whole)
