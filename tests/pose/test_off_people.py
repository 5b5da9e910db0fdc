"""Detections of keypoints that lie beside everybody are nobody's, where silhouettes and other cameras say so both."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from test_keypoint_cost import detected, places, pose

import hmc
from hmc.camera.model import Rig, project
from hmc.io.keypoints import open_keypoints
from hmc.io.recording import open_recording
from hmc.pose import keypoint_cues, second_pass
from hmc.pose.keypoint_tracks import tracks_of_keypoints
from hmc.pose.views.keypoints import see_keypoints
from hmc.synthetic.keypoints import write_keypoints

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
STATE = pose(np.random.default_rng(21))
#: Far enough that keypoints leave the silhouette, metres.
ASIDE_M = 0.4


def silhouettes(rig):
    """Discs of 9 cm around the keypoints, and nothing of the body's own surface."""
    masks = []
    for camera in rig:
        mask = np.zeros(camera.size[::-1], np.uint8)
        uv, _ = project(camera, places(STATE))
        depth = STATE[:3] @ camera.rotation[2] + camera.translation[2]
        for column, row in np.round(uv).astype(int).tolist():
            cv2.circle(mask, (column, row), round(0.09 * camera.matrix[0, 0] / depth), 1, -1)
        masks.append(mask.astype(bool))
    return masks


def beside(rig, given, camera, metres=ASIDE_M):
    """Detections of which one camera's are so far to the right, and as far up."""
    moved, depth = [one.copy() for one in given], STATE[:3] @ rig[camera].rotation[2] + rig[camera].translation[2]
    moved[camera][..., :2] += metres * rig[camera].matrix[0, 0] / depth * np.array([0.7, -0.7])
    return moved


def cameras_of(rig, given, masks):
    seen = see_keypoints(rig, given, {0: STATE[:3]}, masks=masks)
    return sorted(set(seen[0].camera.tolist())) if 0 in seen else []


def test_people_as_they_are_keep_all_detections(ring):
    given = detected(ring, places(STATE), noise_px=2)
    assert cameras_of(ring, given, silhouettes(ring)) == list(range(len(ring)))


def test_a_detection_beside_everybody_is_nobodys_and_moves_nothing(ring):
    given = beside(ring, detected(ring, places(STATE)), 1)
    assert 1 not in cameras_of(ring, given, silhouettes(ring))
    assert 1 in cameras_of(ring, given, None)  # without silhouettes nothing says so


def test_of_two_cameras_that_differ_silhouettes_say_which_is_right(ring):
    two = Rig(ring.cameras[:2])
    given = detected(two, places(STATE))
    assert cameras_of(two, beside(two, given, 1), silhouettes(two)) == [0]
    assert cameras_of(two, beside(two, beside(two, given, 1), 0, -ASIDE_M), silhouettes(two)) == []
    assert cameras_of(two, given, silhouettes(two)) == [0, 1]


@pytest.mark.parametrize("camera", [0, 2])
def test_where_cameras_agree_a_lost_silhouette_takes_nothing_away(ring, camera):
    masks = silhouettes(ring)
    masks[camera] = np.zeros_like(masks[camera])
    assert camera in cameras_of(ring, detected(ring, places(STATE)), masks)


def test_a_camera_without_silhouette_and_one_alone_are_not_judged(ring):
    given = beside(ring, detected(ring, places(STATE)), 1)
    masks = silhouettes(ring)
    masks[1] = None
    assert 1 in cameras_of(ring, given, masks)
    alone = [one if c == 1 else np.zeros((0, 15, 3)) for c, one in enumerate(given)]
    assert cameras_of(ring, alone, silhouettes(ring)) == [1]


def test_keypoints_outside_of_the_image_are_not_held_against_it(ring):
    given = beside(ring, detected(ring, places(STATE)), 1)
    given[1][..., 0] += 10_000  # nothing is left in the image, and the trunk is too far off for anybody
    assert 1 not in cameras_of(ring, given, silhouettes(ring))
    half = beside(ring, detected(ring, places(STATE)), 1)
    half[1][0, 4:, 2] = 0.2  # four that are sure are too few to judge by
    assert 1 in cameras_of(ring, half, silhouettes(ring))


def test_both_passes_hold_detections_against_silhouettes(tmp_path, monkeypatch):
    folder = Path(shutil.copytree(TINY, tmp_path / "clip"))
    write_keypoints(folder, np.random.default_rng(0))
    recording, judged = open_recording(folder, frames=5), []
    whole = keypoint_cues.see_keypoints

    def see(rig, detections, people, scatter_m, turned, masks):
        judged.append(masks is not None)
        return whole(rig, detections, people, scatter_m, turned, masks)

    monkeypatch.setattr(keypoint_cues, "see_keypoints", see)
    monkeypatch.setattr(second_pass.SecondPass, "recent", lambda *_: None)  # what the first pass saw is not there any more
    tracks = tracks_of_keypoints(recording, open_keypoints(recording))
    people = hmc.pose(recording, tracks, keypoints=open_keypoints(recording), height_m=1.75)
    assert np.isfinite(people.positions).any()
    # How far detections scatter is learnt before anything is segmented for poses; then each pass asks for every frame.
    assert judged.count(True) >= 2 * len(people.frames) and judged.index(True) == judged.count(False)
