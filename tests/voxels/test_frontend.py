"""The chain from a recording to hulls, on drawn recordings whose silhouettes are known exactly."""

import cv2
import numpy as np
import pytest
from drawn import HEIGHT_M, RADIUS_M, draw_recording, silhouette, walk

from hmc.errors import InputError
from hmc.io.recording import open_recording
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, stream_hulls, stream_masks


@pytest.fixture(scope="module")
def folder(tmp_path_factory, ring):
    return draw_recording(tmp_path_factory.mktemp("drawn") / "walk", ring, walk(12))


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()


def test_silhouettes_and_hulls_of_a_walker(folder, ring):
    recording = open_recording(folder)
    grid = VoxelGrid.from_room(recording.room, 0.1)
    problems = []
    steps = list(stream_hulls(recording, grid, on_problem=problems.append))
    assert [step.index for step in steps] == list(range(12)) and problems == []
    for step, ((x, y),) in zip(steps, walk(12), strict=True):
        assert step.usable and len(step.images) == 5
        for camera, mask in zip(ring, step.masks, strict=True):
            assert overlap(mask, silhouette(camera, x, y)) > 0.85
        assert not (step.strict & ~step.tolerant).any()
        body = (((grid.centres() - (x, y, HEIGHT_M / 2)) / (RADIUS_M, RADIUS_M, HEIGHT_M / 2)) ** 2).sum(axis=-1) <= 1
        assert (step.tolerant & body).sum() > 0.97 * body.sum()


def test_ready_made_silhouettes_are_used_as_they_are(tmp_path, ring):
    recording = open_recording(draw_recording(tmp_path / "take", ring, walk(3), silhouettes=True))
    for step, ((x, y),) in zip(stream_masks(recording), walk(3), strict=True):
        for camera, mask in zip(ring, step.masks, strict=True):
            assert np.array_equal(mask, silhouette(camera, x, y))
    learnt = next(stream_masks(recording, FrontendSettings(source="background")))
    assert not any(np.array_equal(mask, given) for mask, given in zip(learnt.masks, next(stream_masks(recording)).masks, strict=True))


def test_without_background_the_median_serves_and_it_is_said(tmp_path, ring):
    recording = open_recording(draw_recording(tmp_path / "take", ring, walk(16), background=0))
    problems = []
    steps = list(stream_masks(recording, on_problem=problems.append))
    assert len(problems) == 1 and "median" in problems[0] and "cam_00, cam_01" in problems[0]
    shares = [
        overlap(mask, silhouette(camera, *place))
        for step, (place,) in zip(steps, walk(16), strict=True)
        for camera, mask in zip(ring, step.masks, strict=True)
    ]
    assert np.median(shares) > 0.85


def test_a_part_of_the_recording_has_the_whole_one_for_its_median(tmp_path, ring):
    path = draw_recording(tmp_path / "take", ring, walk(16), background=0)
    part = next(iter(stream_masks(open_recording(path, frames=1), on_problem=lambda line: None)))
    assert np.median([overlap(mask, silhouette(camera, *walk(16)[0][0])) for camera, mask in zip(ring, part.masks, strict=True)]) > 0.85


def test_a_light_switch_is_reported_once_and_survived(tmp_path, ring):
    path = draw_recording(tmp_path / "take", ring, walk(9))
    for camera in ring:
        for index in (4, 5):
            file = path / "images" / camera.name / f"{index:06d}.png"
            image = cv2.imread(str(file)).astype(float)
            light = np.linspace(0, 160, image.shape[1])[:, None]  # from one side: of exposure or tinge it could be told
            cv2.imwrite(str(file), np.clip(image + light, 0, 255).astype(np.uint8))
    recording = open_recording(path)
    problems = []
    steps = list(stream_hulls(recording, VoxelGrid.from_room(recording.room, 0.1), on_problem=problems.append))
    assert not steps[4].usable and not steps[4].strict.any() and not steps[4].tolerant.any()
    assert steps[3].usable and steps[8].usable
    assert len(problems) == 5 and all("frames 4 to" in line or "frame 4:" in line for line in problems)


def test_a_camera_without_images_does_not_vote(tmp_path, ring):
    path = draw_recording(tmp_path / "take", ring, walk(6))
    for index in (2, 3):
        (path / "images" / "cam_01" / f"{index:06d}.png").write_bytes(b"no image")
    recording = open_recording(path)
    problems = []
    grid = VoxelGrid.from_room(recording.room, 0.1)
    steps = list(stream_hulls(recording, grid, on_problem=problems.append))
    assert steps[2].masks[1] is None and steps[2].usable and steps[2].strict.any()
    assert problems and all("cam_01" in line for line in problems)


def test_with_three_silhouettes_both_hulls_are_the_strict_one(folder):
    recording = open_recording(folder, cameras=["cam_00", "cam_01", "cam_03"], frames=2)
    for step in stream_hulls(recording, VoxelGrid.from_room(recording.room, 0.1)):
        assert step.strict.any() and np.array_equal(step.strict, step.tolerant)


def test_starting_later_with_a_warm_up_gives_the_same_silhouettes(folder):
    recording = open_recording(folder)
    settings = FrontendSettings(threads=1)
    whole = [step for step in stream_masks(recording, settings) if step.index >= 7]
    later = list(stream_masks(recording, FrontendSettings(threads=3), first=7, warm_up=100))
    assert [step.index for step in later] == [7, 8, 9, 10, 11]
    for a, b in zip(whole, later, strict=True):
        assert all(np.array_equal(x, y) for x, y in zip(a.masks, b.masks, strict=True))


def test_a_stream_may_be_left_early(folder):
    stream = stream_masks(open_recording(folder))
    assert next(stream).index == 0
    stream.close()


def test_sources_that_are_not_there_are_refused(folder, tmp_path, ring):
    recording = open_recording(folder)
    with pytest.raises(InputError, match="no folder silhouettes"):
        next(stream_masks(recording, FrontendSettings(source="silhouettes")))
    bare = open_recording(draw_recording(tmp_path / "take", ring, walk(2), background=0))
    with pytest.raises(InputError, match="'cam_00' has no background"):
        next(stream_masks(bare, FrontendSettings(source="background")))
    with pytest.raises(InputError, match="`source` must be one of"):
        FrontendSettings(source="magic")
