"""Silhouettes of noisy, compressed, small and grey images; what is known of noise."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from test_segmentation import SIZE, Scene, overlap

from hmc.camera.noise import blur_for, blurred, is_grey, left_of_noise, noise_floor
from hmc.camera.reduction import reduce_image
from hmc.camera.segmentation import segment, train_background


def jpeg(image, quality):
    return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)


def grey(image):
    return cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)


def small(image):
    return cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


@pytest.mark.parametrize(("sigma", "side"), [(1, 0), (2, 0), (4, 3), (7, 3), (10, 5)])
def test_the_blur_follows_the_noise(sigma, side):
    rng = np.random.default_rng(0)
    frames = [np.clip(128 + rng.normal(0, sigma, (90, 120, 3)), 0, 255).astype(np.uint8) for _ in range(4)]
    assert blur_for(frames) == side
    assert blur_for(frames[:1]) == 0
    assert blur_for([frames[0], frames[1][:50]]) == 0


def test_no_blur_is_the_very_image():
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    assert blurred(image, 0) is image
    np.testing.assert_array_equal(blurred(image, 3), cv2.GaussianBlur(image, (3, 3), 0))


def test_the_floor_is_that_of_the_camera():
    """Even noise leaves the mixture alone; noise in a tenth of the blocks, and none elsewhere, is expected everywhere."""
    even = noise_floor(np.full((80, 80, 2), (2.0, 0.5), np.float32))
    assert even.variance == 4
    np.testing.assert_allclose(even.deviation, [1.6, 0.4], rtol=1e-5)
    blocks = np.zeros((80, 80, 2), np.float32)
    blocks[:8] = 5.0, 2.0
    rare = noise_floor(blocks)
    assert rare.variance == pytest.approx(3 * 25 + 5.7 * 4, rel=1e-5)
    np.testing.assert_allclose(rare.deviation, [4.0, 1.6], rtol=1e-5)
    assert noise_floor(np.zeros((8, 8, 2), np.float32)).variance > even.variance


def test_averaging_hides_no_noise_that_was_recorded():
    """Images of a sensor's noise made smaller keep the mixture's floor; as recorded, so little noise would be a codec's doing."""
    recorded = np.full((80, 80, 2), (2.0, 0.6), np.float32)
    averaged = (recorded * left_of_noise(2)).astype(np.float32)
    assert noise_floor(averaged, 2).variance == pytest.approx(noise_floor(recorded).variance)
    assert noise_floor(averaged).variance > 2 * noise_floor(recorded).variance
    assert left_of_noise(1) == 1 and left_of_noise(2) == pytest.approx(2**-0.5) and left_of_noise(3) == left_of_noise(6)


def test_an_averaged_camera_is_as_sensitive_as_it_was():
    """A person of little contrast before a noisy wall, as recorded and of half the size: both have a silhouette."""
    rng = np.random.default_rng(3)

    def taken(person):
        image = np.full((480, 640, 3), 120.0)
        image[160:320, 280:360] += 9 * person
        return np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)

    for factor in (1, 2):
        model = train_background([reduce_image(taken(False), factor) for _ in range(30)], factor=factor)
        mask, _ = segment(model, reduce_image(taken(True), factor))
        truth = np.zeros(mask.shape, bool)
        truth[160 // factor : 320 // factor, 280 // factor : 360 // factor] = True
        assert (mask & truth).sum() / (mask | truth).sum() > 0.9


def test_grey_is_told_from_color():
    scene = Scene(1)
    image, _ = scene.person()
    assert is_grey(grey(image)) and is_grey(jpeg(grey(image), 50))
    assert not is_grey(image)
    room = grey(scene.empty())
    room[100:140, 100:130] = (60, 40, 150)  # a grey room, but somebody in red
    assert not is_grey(room)


@pytest.mark.parametrize(
    ("name", "noise", "change", "least"),
    [
        ("noisy", 6, None, 0.9),
        ("very noisy", 11, None, 0.9),
        ("compressed", 2, lambda image: jpeg(image, 30), 0.68),
        ("heavily compressed", 2, lambda image: jpeg(image, 10), 0.58),
        ("small", 2, small, 0.97),
    ],
)
def test_people_are_found_in_bad_images_and_nobody_in_empty_ones(name, noise, change, least):
    scene = Scene(3, noise=noise)
    change = change or (lambda image: image)
    model = train_background(change(scene.empty()) for _ in range(30))
    for x in (100, 160, 200):
        image, truth = scene.person(x=x)
        mask, model = segment(model, change(image))
        true = truth if mask.shape == truth.shape else cv2.resize(truth.view(np.uint8), mask.shape[::-1], interpolation=cv2.INTER_AREA) > 0
        assert overlap(mask, true) > least, name
        empty, model = segment(model, change(scene.empty()))
        assert np.sum(empty) < 0.002 * SIZE[0] * SIZE[1], name


def test_dark_clothes_are_no_shadow_in_grey_images_and_a_lighter_shadow_is():
    scene = Scene(5)
    model = train_background(grey(scene.empty()) for _ in range(30))
    image, truth = scene.person(shirt=(100, 105, 108), shadow=0.8)  # two thirds of the wall
    mask, _ = segment(model, grey(image))
    assert np.mean(mask[90:135, 145:175]) > 0.95
    assert not mask[200:212, 190:215].any()
    assert not (mask & ~cv2.dilate(truth.view(np.uint8), np.ones((9, 9))).astype(bool)).any()
