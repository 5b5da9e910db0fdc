"""The empty scene out of images with people in them."""

import numpy as np

from hmc.camera.empty_scene import _masked_median, empty_scene, replace_people
from hmc.recording import background_frames, iterate_frames, open_recording


def test_masked_median_against_a_loop():
    rng = np.random.default_rng(0)
    images = list(rng.integers(0, 256, (5, 70, 6, 3)).astype(np.uint8))
    hidden = list(rng.random((5, 70, 6)) < 0.5)
    got = _masked_median(images, hidden)
    for y in range(70):
        for x in range(6):
            seen = [image[y, x] for image, mask in zip(images, hidden, strict=True) if not mask[y, x]] or [image[y, x] for image in images]
            assert np.array_equal(got[y, x], np.sort(seen, axis=0)[(len(seen) - 1) // 2])


def test_a_walker_leaves_less_in_the_scene_than_in_a_plain_median(shared_data):
    recording = open_recording(shared_data / "rendered" / "r1", cameras=["cam_03", "cam_04"])
    images = [frame.images[0] for frame in iterate_frames(recording) if frame.index % 8 == 0]
    truth = np.median(list(background_frames(recording, 0)), axis=0)

    def wrong(scene):
        return (np.abs(scene.astype(float) - truth).max(axis=2) > 25).sum()

    plain, ours = np.median(images, axis=0), empty_scene(images)
    assert wrong(plain) > 1000
    assert wrong(ours) < 0.75 * wrong(plain)
    assert wrong(replace_people(images[0], ours)) < 0.75 * wrong(images[0])


def test_an_empty_room_and_a_single_image_stay_what_they_are():
    scene = np.random.default_rng(0).integers(0, 256, (60, 80, 3)).astype(np.uint8)
    assert np.array_equal(empty_scene([scene] * 3), scene)
    assert np.array_equal(empty_scene([scene]), scene)
