"""Where a tolerant hull is needed: nowhere if silhouettes are whole, and where one camera lost an arm."""

import numpy as np
import pytest
from acted import ROOM, act, ring
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.landmarks import landmark_index
from hmc.pose.views.hull_target import distance_at, make_target
from hmc.pose.views.uncovered import on_uncovered_pixels
from hmc.voxels.carving import carve_levels, make_tables

CAMERAS = 4


def hulls(masks, grid):
    rig = ring(CAMERAS)
    strict, tolerant = carve_levels(make_tables(grid, rig), masks, (0, 1))
    return np.argwhere(strict), np.argwhere(tolerant & ~strict), np.argwhere(tolerant)


@pytest.fixture(scope="module")
def boxer():
    acted = act("box", frames=1, cameras=CAMERAS)
    return acted, acted.masks[0]


def without_forearm(acted, masks, camera_index):
    """The silhouettes, one of which lost the left forearm; and points along it."""
    elbow, wrist = (acted.landmarks[0, landmark_index(f"l_{name}")] for name in ("elbow", "wrist"))
    forearm = elbow + np.linspace(0.2, 1.0, 9)[:, None] * (wrist - elbow)
    camera = ring(CAMERAS)[camera_index]
    from hmc.camera.model import project

    uv, _ = project(camera, forearm)
    rows, columns = np.mgrid[: camera.size[1], : camera.size[0]]
    near = (np.hypot(columns[..., None] - uv[:, 0], rows[..., None] - uv[:, 1]) < 9).any(-1)
    return [mask & ~near if k == camera_index else mask for k, mask in enumerate(masks)], forearm


def test_whole_silhouettes_need_no_tolerant_hull(boxer):
    acted, masks = boxer
    strict, fat, _ = hulls(masks, acted.grid)
    chosen = on_uncovered_pixels(ring(CAMERAS), masks, acted.grid.centres(strict), acted.grid.centres(fat), acted.grid.voxel_size_m)
    assert len(fat) > 0.3 * len(strict)
    assert chosen.mean() < 0.1


@pytest.mark.parametrize("camera_index", range(CAMERAS))
def test_a_forearm_that_one_camera_lost_is_needed(boxer, camera_index):
    acted, masks = boxer
    holed, forearm = without_forearm(acted, masks, camera_index)
    strict, fat, tolerant = hulls(holed, acted.grid)
    rig, size = ring(CAMERAS), acted.grid.voxel_size_m
    known = acted.grid.centres(strict)

    def new(points):
        return on_uncovered_pixels(rig, holed, known, points, size)

    chosen = new(acted.grid.centres(fat))
    assert chosen.mean() < 0.35  # the rest of the person is as it was
    with_all, with_needed = make_target(acted.grid, strict, tolerant), make_target(acted.grid, strict, tolerant, new=new)
    alone = make_target(acted.grid, strict, strict)
    points = forearm.astype(np.float32)
    lost = distance_at(alone, points) > 0.03
    if lost.any():
        assert distance_at(with_needed, points)[lost].mean() < 0.6 * distance_at(alone, points)[lost].mean()
    everywhere = acted.grid.centres(fat).astype(np.float32)
    assert distance_at(with_needed, everywhere).mean() > 1.5 * distance_at(with_all, everywhere).mean()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_what_is_known_is_never_news(seed):
    rng = np.random.default_rng(seed)
    rig = ring(CAMERAS)
    points = rng.uniform(ROOM[0], ROOM[1], (50, 3))
    masks = [rng.random(camera.size[::-1]) < 0.7 for camera in rig]
    masks[0] = None
    assert not on_uncovered_pixels(rig, masks, points, points, 0.03).any()
    everything = on_uncovered_pixels(rig, masks, points[:0], points, 0.03)
    nothing = on_uncovered_pixels(rig, [None if mask is None else mask & False for mask in masks], points[:0], points, 0.03)
    assert everything.mean() > 0.5 and not nothing.any()
    assert on_uncovered_pixels(rig, masks, points, points[:0], 0.03).shape == (0,)
