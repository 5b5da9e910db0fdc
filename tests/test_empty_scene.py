"""The empty scene out of images with people in them."""

import numpy as np

from hmc.camera.empty_scene import _masked_median, empty_scene, replace_people


def test_masked_median_against_a_loop():
    rng = np.random.default_rng(0)
    images = list(rng.integers(0, 256, (5, 70, 6, 3)).astype(np.uint8))
    hidden = list(rng.random((5, 70, 6)) < 0.5)
    got = _masked_median(images, hidden)
    for y in range(70):
        for x in range(6):
            seen = [image[y, x] for image, mask in zip(images, hidden, strict=True) if not mask[y, x]] or [image[y, x] for image in images]
            assert np.array_equal(got[y, x], np.sort(seen, axis=0)[(len(seen) - 1) // 2])


def scene_and_images():
    """Somebody sways about one place: the trunk's middle is in the way of the wall in most images, so a plain median holds it."""
    rng = np.random.default_rng(0)
    scene = np.full((180, 240, 3), (150, 160, 150), np.uint8)
    scene[120:] = (90, 80, 80)
    images = []
    for i in range(12):
        image = scene.copy()
        left = 70 + 5 * i
        image[40:150, left : left + 66] = (40, 50, 200)
        images.append((image + rng.normal(0, 2, image.shape)).clip(0, 255).astype(np.uint8))
    return scene, images


def test_somebody_who_sways_is_not_in_the_scene():
    scene, images = scene_and_images()
    plain = np.abs(np.median(images, axis=0) - scene).max(axis=2) > 25
    ours = np.abs(empty_scene(images).astype(int) - scene).max(axis=2) > 25
    assert plain.sum() > 1000
    assert ours.sum() < 0.1 * plain.sum()
    without = np.abs(replace_people(images[0], empty_scene(images)).astype(int) - scene).max(axis=2)
    assert (without > 40).mean() < 0.01


def test_an_empty_room_and_a_single_image_stay_what_they_are():
    scene, _ = scene_and_images()
    assert np.array_equal(empty_scene([scene] * 3), scene)
    assert np.array_equal(empty_scene([scene]), scene)
