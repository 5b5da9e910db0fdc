"""Shadows on the floor leave the silhouettes, and legs do not: bodies and a shadow drawn exactly into a room with a patterned floor."""

import cv2
import numpy as np
import pytest
from drawn import floor_patch, silhouette

from hmc.camera.segmentation import train_background
from hmc.voxels.completion import make_completion_tables
from hmc.voxels.floor_shadows import cut_filled_shadows, cut_floor_shadows

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
    return cut_floor_shadows(tables, images, [model for _, model in scenes], masks)


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
    given = cut_floor_shadows(tables, images, [None, *models[1:]], [masks[0], None, *masks[2:]])
    assert given[0] is masks[0] and given[1] is None and given[2].sum() < masks[2].sum()
    assert cut_floor_shadows(tables, images, [None] * 4 + models[4:], masks) == tuple(masks)


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
