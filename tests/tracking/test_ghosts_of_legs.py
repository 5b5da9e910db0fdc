"""Ghost legs where silhouettes of two legs cross: told, and removed where colors betray them."""

import numpy as np
import pytest

from hmc.camera.model import Rig, look_at
from hmc.pose.spectral.ghosts import check_ghosts, remove_ghosts
from hmc.tracking.views import FrameViews
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.grid import VoxelGrid

SIZE = 0.04
GRID = VoxelGrid(np.array([-0.6, -0.6, 0.0]), SIZE, (30, 30, 45))
#: Along both axes from far away: legs at (.2, .2) and (-.2, -.2) have ghosts at (.2, -.2) and (-.2, .2), whichever way one looks.
RIG = Rig(
    tuple(
        look_at(f"cam_{k}", (240, 240), [40 * x, 40 * y, 0.6], [0, 0, 0.6], 2.8)
        for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1)))
    )
)
LEGS, GHOSTS = [(0.2, 0.2), (-0.2, -0.2)], [(0.2, -0.2), (-0.2, 0.2)]


def leg(x, y):
    points = GRID.centres()
    return (np.abs(points[..., 0] - x) < 0.06) & (np.abs(points[..., 1] - y) < 0.06) & (points[..., 2] < 0.8)


def hull(places):
    points = GRID.centres()
    trunk = (np.abs(points[..., :2]) < 0.3).all(-1) & (points[..., 2] > 0.8) & (points[..., 2] < 1.6)
    return np.argwhere(np.any([trunk, *(leg(*place) for place in places)], axis=0))


def views(colors):
    """Images in which the real legs have these colors, before black."""
    images = [np.zeros((240, 240, 3), np.uint8) for _ in RIG]
    for place, color in zip(LEGS, colors, strict=True):
        for camera, image in zip(RIG, images, strict=True):
            column, row, _ = pixel_of_voxel(camera, GRID.centres()[leg(*place)])
            for dy in range(-4, 5):
                for dx in range(-4, 5):
                    image[np.clip(row + dy, 0, 239), np.clip(column + dx, 0, 239)] = color
    return FrameViews(RIG, [image.any(-1) for image in images], images)


def test_ghosts_have_the_colors_of_others():
    voxels = hull(LEGS + GHOSTS)
    report = check_ghosts(voxels, GRID, views([(40, 40, 200), (200, 40, 40)]))
    assert len(report.pieces) == 4 and "4 legs in the hull; 2 removed" in report.text
    for piece, ghost in zip(report.pieces, report.ghosts, strict=True):
        x, y = GRID.centres(piece)[:, :2].mean(0)
        assert ghost == (x * y < 0)
    left = remove_ghosts(voxels, GRID, report)
    points = GRID.centres(left)
    low = points[points[:, 2] < 0.4]
    assert (low[:, 0] * low[:, 1] > 0).all() and len(low)
    # Nothing else is gone but what stood on the ghosts.
    assert len(left) >= len(hull(LEGS))


def test_alike_legs_are_told_and_left():
    voxels = hull(LEGS + GHOSTS)
    report = check_ghosts(voxels, GRID, views([(40, 40, 200), (40, 40, 200)]))
    assert not report.ghosts.any() and "use more cameras" in report.text
    assert len(remove_ghosts(voxels, GRID, report)) == len(voxels)


@pytest.mark.parametrize("places", [LEGS, LEGS[:1], []])
def test_two_legs_or_fewer_are_no_ghosts(places):
    report = check_ghosts(hull(places), GRID, views([(40, 40, 200), (200, 40, 40)]))
    assert report.text == "" and not report.ghosts.any()


def test_nobody_has_no_ghosts():
    report = check_ghosts(np.zeros((0, 3), int), GRID, views([(1, 1, 1), (2, 2, 2)]))
    assert report.pieces == () and report.text == ""
