"""The empty scene out of images with people in them."""

from functools import partial

import numpy as np
import pytest
from drawn import draw_recording, walk

from hmc.camera.background import masked_median
from hmc.camera.empty_scene import cut_samples, replace_people, scenes_behind, shrunk
from hmc.camera.model import Rig
from hmc.io.recording import background_frames, iterate_frames, open_recording
from hmc.voxels.agreement import agreed_views
from hmc.voxels.carving import make_tables
from hmc.voxels.grid import VoxelGrid


def empty_scenes(samples, sizes, views):
    return scenes_behind(samples, cut_samples(shrunk(samples, sizes), views))


def scenes_of(recording, every):
    samples = [list(frame.images) for frame in iterate_frames(recording) if frame.index % every == 0]
    rig = Rig(tuple(camera.scaled(0.5) for camera in recording.rig))
    tables = make_tables(VoxelGrid.from_room(recording.room, 0.08), rig)
    return samples, empty_scenes(samples, [camera.size for camera in rig], partial(agreed_views, tables))


def test_masked_median_against_a_loop():
    rng = np.random.default_rng(0)
    images = list(rng.integers(0, 256, (5, 70, 6, 3)).astype(np.uint8))
    hidden = list(rng.random((5, 70, 6)) < 0.5)
    got = masked_median(images, hidden)
    for y in range(70):
        for x in range(6):
            seen = [image[y, x] for image, mask in zip(images, hidden, strict=True) if not mask[y, x]] or [image[y, x] for image in images]
            assert np.array_equal(got[y, x], np.sort(seen, axis=0)[(len(seen) - 1) // 2])


@pytest.mark.parametrize(("name", "least"), [("r1", 0.6), ("r2", 0.7)])
@pytest.mark.slow
def test_people_leave_less_in_the_scene_than_in_a_plain_median(shared_data, name, least):
    """Walking, and boxing in place, where legs hardly move: what is wrong in the scene without being told so."""
    recording = open_recording(shared_data / "rendered" / name, cameras=["cam_00", "cam_02", "cam_03", "cam_05"])
    samples, scenes = scenes_of(recording, 8)
    for c, one in enumerate(scenes):
        scene, unseen = one.image, one.unseen
        truth = np.median(list(background_frames(recording, c)), axis=0)
        images = [frame[c] for frame in samples]

        def wrong(picture, truth=truth):
            return np.abs(picture.astype(float) - truth).max(axis=2) > 25

        plain = wrong(np.median(images, axis=0)).sum()
        assert plain > 500
        assert (wrong(scene) & ~unseen).sum() < least * plain
        assert unseen.mean() < 0.04
        assert (wrong(replace_people(images[0], scene)) & ~unseen).sum() < wrong(images[0]).sum()


def test_a_walker_is_cut_out_in_every_view_even_where_images_are_missing(tmp_path, ring):
    path = draw_recording(tmp_path / "take", ring, walk(16), background=1)
    (path / "images" / "cam_01" / "000003.png").write_bytes(b"no image")
    recording = open_recording(path)
    frames = list(iterate_frames(recording, on_problem=lambda line: None))
    tables = make_tables(VoxelGrid.from_room(recording.room, 0.08), recording.rig)
    views = partial(agreed_views, tables)
    scenes = empty_scenes([frame.images for frame in frames], [camera.size for camera in recording.rig], views)
    for c, one in enumerate(scenes):
        scene, unseen = one.image, one.unseen
        truth = next(iter(background_frames(recording, c))).astype(float)
        assert (np.abs(scene - truth).max(axis=2) > 25)[~unseen].mean() < 0.01


def test_an_empty_room_and_a_single_image_stay_what_they_are():
    scene = np.random.default_rng(0).integers(0, 256, (60, 80, 3)).astype(np.uint8)

    def nobody(masks):
        return [[np.zeros_like(mask) for mask in masks]] * 3

    for n in (1, 3):
        (found,) = empty_scenes([[scene]] * n, [(80, 60)], nobody)
        assert np.array_equal(found.image, scene) and not found.unseen.any() and found.colors is None
