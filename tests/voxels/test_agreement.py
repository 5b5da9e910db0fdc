"""What cameras agree on, against bodies whose silhouettes are drawn exactly."""

import numpy as np
import pytest
from drawn import post, silhouette

from hmc.voxels.agreement import agreed_views
from hmc.voxels.carving import make_tables
from hmc.voxels.grid import VoxelGrid


@pytest.fixture(scope="module")
def tables(ring):
    return make_tables(VoxelGrid.from_room([[-1.5, -1.5, 0], [1.5, 1.5, 2.2]], 0.05), ring)


def test_a_body_is_found_and_what_one_camera_alone_sees_is_not(tables, ring):
    truth = [silhouette(camera, 0.3, 0.1) for camera in ring]
    masks = [mask.copy() for mask in truth]
    corner = masks[0][:12, :12]
    corner[:] = True
    surely, possibly, below = agreed_views(tables, masks)
    assert not any(view.any() for view in below)  # it stands on the floor
    for mask, sure, possible in zip(truth, surely, possibly, strict=True):
        assert not (sure & ~possible).any() and not (mask & ~possible).any()
        assert (sure & mask).sum() > 0.9 * mask.sum() and (sure & ~mask).sum() < 0.4 * mask.sum()
    assert not surely[0][:6, :6].any()


def test_what_one_camera_missed_is_still_possible(tables, ring):
    truth = [silhouette(camera, 0, 0) for camera in ring]
    masks = [np.zeros_like(truth[0]), *truth[1:-1], None]
    surely, possibly, below = agreed_views(tables, masks)
    assert surely[-1] is None and possibly[-1] is None and below[-1] is None
    assert not any(sure.any() for sure in surely[:-1])
    assert (possibly[0] & truth[0]).sum() > 0.95 * truth[0].sum()


def test_under_a_trunk_whose_legs_were_not_seen_is_where_they_are(tables, ring):
    truth = [post(camera, 0.3, 0.1) for camera in ring]
    trunks = [mask & ~lower for mask, lower in zip(truth, (post(camera, 0.3, 0.1, 0.9) for camera in ring), strict=True)]
    _, possibly, below = agreed_views(tables, trunks)
    for mask, trunk, possible, legs in zip(truth, trunks, possibly, below, strict=True):
        hidden = mask & ~trunk
        assert (legs & hidden).sum() > 0.9 * hidden.sum() and (legs & trunk).sum() < 0.3 * trunk.sum()
        assert (possible & hidden).sum() > 0.95 * hidden.sum()
    # What is far above the floor is no trunk: a lamp.
    lamps = [mask & ~lower for mask, lower in zip(truth, (post(camera, 0.3, 0.1, 1.4) for camera in ring), strict=True)]
    assert not any(view.any() for view in agreed_views(tables, lamps)[2])


def test_nobody_and_specks_are_nobody(tables, ring):
    specks = [silhouette(camera, 0, 0) & False for camera in ring]
    for views in agreed_views(tables, specks):
        assert not any(view.any() for view in views)
