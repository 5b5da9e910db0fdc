"""Smaller images: how much smaller they may be, and that cameras, masks and pixels go with them."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from hmc.camera.model import Rig, look_at, project
from hmc.camera.reduction import reduce_image, reduce_mask, reduce_pixels, reduced_camera, reduction_factors

ROOM = np.array([[-1.0, -1, 0], [1, 1, 2]])


def camera(width=1920, height=1080, away=4.0, fov_deg=60.0):
    return look_at("cam", (width, height), [away, 0, 1], [0, 0, 1], fov_deg, (-0.12, 0.03, 0.001, -0.002))


@pytest.mark.parametrize("factor", [1, 2, 3, 4])
def test_points_are_where_opencv_has_them_in_both_sizes(factor):
    full = camera()
    small = reduced_camera(full, factor)
    points = np.random.default_rng(0).uniform(*ROOM, (200, 3))
    vector = Rotation.from_matrix(full.rotation).as_rotvec()
    in_full, in_small = (cv2.projectPoints(points, vector, one.translation, one.matrix, one.distortions)[0][:, 0] for one in (full, small))
    assert_allclose(reduce_pixels(in_full, factor), in_small, atol=1e-9)
    assert_allclose((in_full + 0.5) / factor - 0.5, in_small, atol=1e-9)
    assert_allclose(project(small, points)[0], in_small, atol=1e-6)
    assert (small is full) == (factor == 1)


@pytest.mark.parametrize("size", [(96, 72), (97, 73), (98, 74)])
@pytest.mark.parametrize("factor", [2, 3, 4])
def test_a_spot_is_where_its_pixel_is_taken_to(size, factor):
    width, height = size
    spot = np.array([40.3, 31.6])
    v, u = np.indices((height, width))
    image = np.rint(250 * np.exp(-((u - spot[0]) ** 2 + (v - spot[1]) ** 2) / (2 * 8.0**2))).astype(np.uint8)
    small = reduce_image(image, factor)
    assert small.shape == reduced_camera(camera(width, height), factor).size[::-1]
    assert reduce_image(np.dstack([image] * 3), factor).shape == (*small.shape, 3)
    v, u = np.indices(small.shape)
    assert_allclose([np.average(u, weights=small), np.average(v, weights=small)], reduce_pixels(spot, factor), atol=0.05)


def test_masks_keep_blocks_of_which_half_is_set():
    mask = np.zeros((6, 9), bool)
    mask[0, :2] = mask[2, 2] = True
    mask[4:, 4:] = True
    assert_array_equal(np.argwhere(reduce_mask(mask, 2)), [[0, 0], [2, 2], [2, 3]])  # the last column fills no block
    assert reduce_mask(mask, 1) is mask and reduce_image(mask, 1) is mask


@pytest.mark.parametrize(
    ("width", "height", "voxel_px", "factor"),
    [
        (320, 240, 40.0, 1),  # what silhouettes bear
        (638, 480, 40.0, 1),
        (640, 480, 40.0, 2),
        (1280, 720, 40.0, 4),
        (1920, 1080, 40.0, 6),
        (1080, 1920, 40.0, 6),
        (3840, 2160, 40.0, 12),
        (3840, 2160, 3.7, 1),  # voxels that cover few pixels keep them
        (3840, 2160, 3.9, 2),
        (3840, 2160, 5.6, 2),
        (3840, 2160, 5.8, 3),
    ],
)
def test_images_become_no_smaller_than_voxels_and_silhouettes_bear(width, height, voxel_px, factor):
    focal = width / 2 / np.tan(np.radians(30))
    rig = Rig((camera(width, height, 0.03 * focal / voxel_px),))
    assert reduction_factors(rig, ROOM, 0.03) == (factor,)
    assert reduction_factors(rig, ROOM, 0.06) == (factor,)


def test_a_camera_in_the_middle_of_the_room_has_a_factor_too():
    assert reduction_factors(Rig((camera(away=1e-9),)), ROOM, 0.03) == (6,)
