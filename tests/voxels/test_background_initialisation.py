"""Recordings without frames of the empty scene."""

import cv2
import numpy as np
import pytest

from hmc.camera.segmentation import SegmentationSettings, segment_views
from hmc.io.recording import iterate_frames, open_recording
from hmc.voxels.background_initialisation import learn_from_people, with_unseen_places


@pytest.fixture(scope="module")
def learnt(shared_data):
    """Somebody who boxes in place, so that the legs hardly move; rendered by another program."""
    recording = open_recording(shared_data / "rendered" / "r2", cameras=["cam_00", "cam_02", "cam_03", "cam_05"], frames=61)
    return recording, *learn_from_people(recording, range(4), SegmentationSettings(), 9, 1800)


def test_legs_that_hardly_move_are_whole_where_the_scene_was_never_seen(learnt):
    recording, models, places = learnt
    plain, told, extra = [], [], []
    for frame in iterate_frames(recording):
        if frame.index % 30:
            continue
        masks, _ = segment_views([models[c] for c in range(4)], frame.images)
        whole = with_unseen_places(places, frame.images, masks)
        for camera, before, after in zip(recording.rig, masks, whole, strict=True):
            (path,) = (recording.path / "truth" / "silhouettes" / camera.name).glob(f"*{frame.index:04d}.png")
            truth = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 0
            plain.append((before & truth).sum() / truth.sum())
            told.append((after & truth).sum() / truth.sum())
            extra.append((after & ~truth).sum() / truth.sum())
    assert np.mean(told) > 0.9 and np.mean(told) > np.mean(plain) + 0.02
    assert np.mean(extra) < 0.2


def test_a_camera_without_an_image_stays_out_of_it(learnt):
    recording, models, places = learnt
    frame = next(iter(iterate_frames(recording)))
    images = (None, *frame.images[1:])
    masks, _ = segment_views([models[c] for c in range(4)], images)
    whole = with_unseen_places(places, images, masks)
    assert whole[0] is None and all(mask is not None for mask in whole[1:])
